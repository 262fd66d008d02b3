"""The map of unknowns from sample to sample of a model with events, which filters differentiate."""

from collections.abc import Sequence

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.models.fmu import FMU
from workbench.models.hybrid import HybridSimulation
from workbench.observers.layout import Layout
from workbench.system.system import System


class EventMap:
    """A model that goes to the next sample from any point, through all events on the way.

    Its discrete states, as the mode of a thermostat, are those of one trajectory, that of the mean:
    each point begins with them, in the FMU's saved state, and passes at once the events that it is
    beyond.

    Parameters
    ----------
    fmu : at the last sample; it must save its state.
    outputs : of the model, whose place `layout.seen` says.
    u : (m,) inputs of the last sample.

    Attributes
    ----------
    passed : events that the mean passed.
    unsure : samples at which some points had passed an event that others had not, as at the sample
        before. Where that is no passing moment, no Gaussian holds what is known.
    """

    def __init__(
        self, fmu: FMU, system: System, layout: Layout, outputs: Sequence[str], u: Vector
    ) -> None:
        names = [signal.name for signal in system.inputs]
        inputs = fmu.typed([*names, *system.corrections])
        holds = np.concatenate([system.holds, np.ones(len(system.corrections))])
        self._fmu, self._read, self._seen = fmu, fmu.typed(outputs), layout.seen
        self._simulation = HybridSimulation(fmu, inputs, holds)
        self._simulation.begin(np.concatenate([u, fmu.get_typed(inputs)[u.size :]]))
        self._simulation.keep()
        self.passed = self.unsure = self._parted = 0

    def ends(self, points: Matrix, t: float, u: Vector) -> tuple[Matrix, Matrix]:
        """Go from the last sample to the one at t [s] with inputs u, (m,); keep where the mean is.

        Parameters
        ----------
        points : (p, n + q) states and corrections; the first is the mean.

        Returns
        -------
        ends : (p, n + q) states and corrections at the sample.
        seen : (p, l) outputs there.

        Raises
        ------
        FMUError
            If the FMU refuses a call, asks to end, or cannot be integrated.
        """
        n, ends = len(self._fmu.states), points.copy()
        seen = np.empty((len(points), len(self._seen)))
        passed = []
        for k in range(len(points) - 1, -1, -1):
            corrections = points[k, n:]
            self._simulation.start_from(points[k, :n], corrections)
            ends[k, :n] = self._simulation.advance(t, np.concatenate([u, corrections]))
            passed.append(self._simulation.passed)
            read = self._fmu.get_typed(self._read)
            seen[k] = [ends[k, at] if at >= 0 else read[-1 - at] for at in self._seen]
        self._simulation.keep()
        self.passed += passed[-1]
        self._parted = self._parted + 1 if len(set(passed)) > 1 else 0
        self.unsure += self._parted > 1
        return ends, seen

    def release(self) -> None:
        """Free what the FMU keeps."""
        self._simulation.release()
