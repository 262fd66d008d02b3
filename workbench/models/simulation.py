"""Whole simulations of any FMU along a recording, and derivatives by differences of them.

For models that no compiled loop steps: those with events, and Co-Simulation alone. Between samples
a model is integrated at a tolerance of 1e-8 and goes through its events; see `hybrid`.

    with open_file(path, system) as fmu:
        simulation = Simulation(fmu, inputs=["Ta"], outputs=["T"], held=[False])
        drive = Drive(time, u)
        y = simulation.run(drive, {"G": 55.0, "T": 291.0})                   # (n, l)
        by = simulation.derivatives(drive, {"G": 55.0}, [("G",), ("T",)])  # .values (n, l, 2)
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError, InputError
from workbench.models.description import MODEL_EXCHANGE
from workbench.models.fmu import FMU, CoSimulation
from workbench.models.hybrid import TOLERANCE, CoSimulationRun, HybridSimulation

# Of a difference, over the size of what is varied: errors of truncation and of integration are
# alike at the cube root of the tolerance. Others are for models that bend more, or have more noise.
_SHARE = TOLERANCE ** (1 / 3)
_FACTORS = (1.0, 1.0 / 16.0, 1.0 / 256.0, 16.0)
# Of a derivative, by which it may be wrong: Gauss-Newton steps and intervals are, by as much.
_AGREES = 0.01
# Of an output's size, below which no sensor shows what a step does.
_SHOWN = 1e-6


class Drive(NamedTuple):
    """What drives a simulation.

    Attributes
    ----------
    time : (n,) of the samples [s], from any begin.
    u : (n, m) inputs at the samples.
    model_time : of the model at the first sample [s]; None: where its default experiment begins.
    """

    time: Vector
    u: Matrix
    model_time: float | None = None


@dataclass(frozen=True, eq=False)
class Derivatives:
    """Of outputs along a drive, by differences of whole simulations.

    Attributes
    ----------
    values : (n, l, p).
    unsure : (p,) share of each column by which differences with other steps disagree; 0 where
        they agree to 1 %, or where no output moves by a millionth.
    """

    values: NDArray[np.float64]
    unsure: Vector


class Simulation:
    """A model along recordings, one whole simulation after the other with the same instance.

    Where an FMU does not give the same results after a reset, each run has an instance of its own.

    Parameters
    ----------
    fmu : Model Exchange, with events or without, or Co-Simulation; it must outlive this.
    inputs, outputs : variables of the FMU of any types that hold numbers, m and l.
    held : (m,) whether an input stays until the next sample; else it goes there in a straight line.
    """

    def __init__(
        self, fmu: FMU, inputs: Sequence[str], outputs: Sequence[str], held: ArrayLike
    ) -> None:
        self._fmu = fmu
        self._inputs, self._outputs = fmu.typed(inputs), fmu.typed(outputs)
        self._held = np.array(held, np.bool_)
        self._variables = {v.name: v for v in fmu.description.variables}
        self._resets: bool | None = None  # not known before the first run

    def run(self, drive: Drive, values: Mapping[str, float]) -> Matrix:
        """Outputs at the samples, (n, l).

        Parameters
        ----------
        values : of parameters, and of states at the start; others keep their defaults.

        Raises
        ------
        InputError
            If a value cannot be set, or a type does not hold it.
        FMUError
            If the FMU refuses a call, asks to end, or cannot be integrated; if it gives other
            results for the same run.
        """
        outputs = self._run(drive, values)
        if self._resets is None:
            self._resets = np.array_equal(self._run(drive, values), outputs, equal_nan=True)
            if not self._resets and not np.array_equal(self._run(drive, values), outputs):
                raise FMUError(
                    f"{self._fmu.path.name}: the same run gives other results when it is repeated, "
                    "even with a new instance"
                )
        return outputs

    def _run(self, drive: Drive, values: Mapping[str, float]) -> Matrix:
        fmu = self._fmu
        self._start(drive, values)
        make = CoSimulationRun if isinstance(fmu, CoSimulation) else HybridSimulation
        along = make(fmu, self._inputs, self._held)  # type: ignore[arg-type]
        along.begin(drive.u[0])
        outputs = np.empty((drive.time.size, len(self._outputs.names)))
        outputs[0] = fmu.get_typed(self._outputs)
        for k in range(1, drive.time.size):
            along.advance(fmu.start_time + (drive.time[k] - drive.time[0]), drive.u[k])
            outputs[k] = fmu.get_typed(self._outputs)
        return outputs

    def _start(self, drive: Drive, values: Mapping[str, float]) -> None:
        fmu = self._fmu
        own = fmu.states if fmu.interface == MODEL_EXCHANGE else ()  # set after the start
        for name in values:
            variable = self._variables.get(name)
            if variable is not None and variable.initial == "calculated" and name not in own:
                raise InputError(
                    where=f"{fmu.place}, variable '{name}'",
                    found="a variable that the FMU calculates",
                    expected="a parameter, or a start value that may be set",
                    remedy="set the parameter that it follows from",
                )
        if self._resets is False:
            fmu.renew(reload=False)
        fmu.begin_at(drive.model_time)
        # What a model calculates at its start may depend on inputs.
        fmu.start({**dict(zip(self._inputs.names, drive.u[0], strict=True)), **values})

    def derivatives(
        self,
        drive: Drive,
        values: Mapping[str, float],
        columns: Sequence[Sequence[str]],
        sizes: Mapping[str, float] | None = None,
    ) -> Derivatives:
        """Derivatives of the outputs by parameters and states at the start.

        Parameters
        ----------
        columns : names of what is varied, p times; of several the same is added to each.
        sizes : typical change of what is varied, by the first name of its column; else its value,
            or where that is zero its nominal value.

        Raises
        ------
        InputError, FMUError
            As of `run`; if what is varied can neither grow nor fall.
        """
        base = self.run(drive, values)
        self._start(drive, values)
        varied = [name for names in columns for name in names]
        at = {**dict(zip(varied, self._fmu.get_typed(self._fmu.typed(varied)), strict=True))}
        at |= {name: value for name, value in values.items() if name in at}
        scale = np.abs(base).max(axis=0, initial=0.0)
        scale[scale == 0.0] = 1.0
        derivatives, unsure = np.empty((*base.shape, len(columns))), np.zeros(len(columns))
        for q, names in enumerate(columns):
            size = (sizes or {}).get(names[0]) or abs(at[names[0]])
            size = size or abs(self._variables[names[0]].nominal or 1.0)

            def moved(step: float, names: Sequence[str] = names) -> Matrix | FMUError:
                """Outputs after a step of this column, less the base; or why there are none."""
                after = {name: at[name] + step for name in names}
                for name, value in after.items():
                    variable = self._variables[name]
                    if (variable.minimum is not None and value < variable.minimum) or (
                        variable.maximum is not None and value > variable.maximum
                    ):
                        return FMUError(f"{self._fmu.place}: '{name}' is at its limit, {value:g}")
                try:
                    return self.run(drive, {**values, **after}) - base
                except FMUError as error:
                    return error

            trials = []
            for factor in _FACTORS:
                trials.append(_difference(moved, factor * _SHARE * size, scale))
                if trials[-1].unsure <= _AGREES:
                    break
            best = min(trials, key=lambda trial: trial.unsure)
            derivatives[:, :, q] = best.slope
            shown = max(trial.moved for trial in trials) > _SHOWN
            unsure[q] = best.unsure if shown and best.unsure > _AGREES else 0.0
        return Derivatives(derivatives, unsure)


class _Difference(NamedTuple):
    """A slope (n, l), the share by which it may be wrong, and the largest move of an output."""

    slope: Matrix
    unsure: float
    moved: float


def _difference(
    moved: Callable[[float], Matrix | FMUError], h: float, scale: Vector
) -> _Difference:
    """Slope of what moves by d(h), at zero.

    (d(h) - d(-h)) / 2h; on one side, where the other is beyond a limit or refused, by the step and
    its half, (4 d(h/2) - d(h)) / h. Slopes of both sides, or of step and half, are compared.

    Parameters
    ----------
    scale : (l,) sizes of the outputs.
    """
    up, down = moved(h), moved(-h)
    if isinstance(up, FMUError):
        up, down, h = down, up, -h
    if isinstance(up, FMUError):
        raise up
    if isinstance(down, FMUError):
        half = moved(0.5 * h)
        if isinstance(half, FMUError):
            raise half
        slope, apart = (4.0 * half - up) / h, 2.0 * half - up
    else:
        slope, apart = (up - down) / (2.0 * h), 0.5 * (up + down)
    whole = float(np.linalg.norm(h * slope / scale))
    share = float(np.linalg.norm(apart / scale)) / whole if whole else 0.0
    return _Difference(slope, share, float(np.abs(up / scale).max(initial=0.0)))
