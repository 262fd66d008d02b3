"""The map of unknowns from sample to sample of a model with events, which filters differentiate."""

from collections.abc import Sequence

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError
from workbench.models.fmu import FMU, SAME_RATE
from workbench.models.hybrid import HybridSimulation
from workbench.models.instance import TOLERANCE, EventError
from workbench.observers.layout import Layout
from workbench.system.system import System

_BORNE = 0.1  # of what is known of a state, by which steps of a filter may err


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
        self.passed = self.unsure = self._parted = self._turn = 0
        # At the end of one of the points, with the discrete states that its own events left.
        self._other: HybridSimulation | None = None

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
            If the FMU refuses a call, asks to end, or cannot be integrated; if a point that is
            repeated ends elsewhere, or if discrete states follow from the point.
        """
        n, count, ends = len(self._fmu.states), len(points), points.copy()
        seen, passed = np.empty((count, len(self._seen))), np.zeros(count, np.int64)

        def go(k: int, simulation: HybridSimulation) -> Vector:
            simulation.start_from(points[k, :n], points[k, n:])
            return simulation.advance(t, np.concatenate([u, points[k, n:]]))

        by_other = go(0, self._other) if self._other is not None else None
        self._release_other()
        for k in range(count - 1, -1, -1):
            ends[k, :n] = go(k, self._simulation)
            passed[k] = self._simulation.passed
            read = self._fmu.get_typed(self._read)
            seen[k] = [ends[k, at] if at >= 0 else read[-1 - at] for at in self._seen]
            if passed[k] and k == 1 + self._turn % (count - 1):
                self._turn += 1
                self._other = self._simulation.fork()
        least = TOLERANCE * (self._fmu.nominals() + np.abs(ends[0, :n]))
        if by_other is not None:
            borne = _BORNE * np.abs(ends[:, :n] - ends[0, :n]).max(axis=0)
            if name := self._off(by_other - ends[0, :n], borne + least):
                raise EventError(
                    f"{self._fmu.called}: what an event sets follows from states or estimated "
                    f"quantities, as in a sampled controller, and moves states, {self._by(t, name)}"
                    ". Filters know one value of it, so that their bands would be wrong. Only the "
                    "open loop, fit and diagnose go through such events"
                )
        if passed.any() or self._fmu.remembers_steps:
            again = go(count - 1, self._simulation)
            moved = SAME_RATE * np.abs(ends[-1, :n] - points[-1, :n])
            if name := self._off(again - ends[-1, :n], moved + 100.0 * least):
                raise FMUError(
                    f"{self._fmu.called}: the same step from a restored state ends elsewhere, "
                    f"{self._by(t, name)}: the FMU keeps more than its saved state holds, such as "
                    "static variables of its code. Filters would go on in a wrong mode. Export it "
                    "with all of its memory in its state, or without canGetAndSetFMUState"
                )
            go(0, self._simulation)
        self._simulation.keep()
        parted = bool(np.ptp(passed))
        if parted:  # other discrete states, of which `unsure` tells
            self._release_other()
        self.passed += int(passed[0])
        self._parted = self._parted + 1 if parted else 0
        self.unsure += self._parted > 1
        return ends, seen

    def _off(self, off: Vector, borne: Vector) -> str:
        """The state that is off by more than is borne, (n,) each; empty: none."""
        beyond = np.abs(off) - borne
        return self._fmu.states[int(np.argmax(beyond))] if (beyond > 0.0).any() else ""

    @staticmethod
    def _by(t: float, name: str) -> str:
        return f"seen in '{name}' by {t:.6g} s of its time"

    def _release_other(self) -> None:
        if self._other is not None:
            self._other.release()
            self._other = None

    def release(self) -> None:
        """Free what the FMU keeps."""
        self._release_other()
        self._simulation.release()
