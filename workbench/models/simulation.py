"""Whole simulations of any FMU along a recording, and derivatives by differences of them.

For models that no compiled loop steps: those with events, and Co-Simulation alone. Between samples
a model is integrated at a tolerance of 1e-8 and goes through its events; see `hybrid`.

    with open_file(path, system) as fmu:
        simulation = Simulation(fmu, inputs=["Ta"], outputs=["T"], holds=[0.0])
        drive = Drive(time, u)
        y = simulation.run(drive, {"G": 55.0, "T": 291.0})                   # (n, l)
        by = simulation.derivatives(drive, {"G": 55.0}, [("G",), ("T",)])  # .values (n, l, 2)
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError, InputError
from workbench.models.description import MODEL_EXCHANGE
from workbench.models.fmu import FMU, CoSimulation
from workbench.models.hybrid import CoSimulationRun, HybridSimulation
from workbench.models.instance import TOLERANCE

# Of a difference, over the size of what is varied: errors of truncation and of integration are
# alike at the cube root of the tolerance. Others are for models that bend more, or have more noise.
_SHARE = TOLERANCE ** (1 / 3)
_FACTORS = (1.0, 1.0 / 16.0, 1.0 / 256.0, 16.0)
# Of a derivative, by which it may be wrong: Gauss-Newton steps and intervals are, by as much.
_AGREES = 0.01
_AS_GOOD = 2.0  # times the disagreement of before, at another point
# Of a derivative, by which slopes of both sides differ where errors of integration alone move the
# outputs: they are independent, and differ by their size.
_APART = 0.5
# Of an output's size, below which no sensor shows what a step does; and what rounding adds up to.
_SHOWN, _ROUNDED = 1e-6, 1e-12


class Drive(NamedTuple):
    """What drives a simulation."""

    time: Vector  # (n,) of the samples [s], from any begin
    u: Matrix  # (n, m) inputs at the samples
    # of the model at the first sample [s]; None: where its default experiment begins
    model_time: float | None = None


@dataclass(frozen=True, eq=False)
class Derivatives:
    """Of outputs along a drive, by differences of whole simulations."""

    values: NDArray[np.float64]  # (n, l, p)
    # (p,) share of each column by which differences with other steps disagree; 0 where they agree
    # to 1 %, or where no output moves by a millionth
    unsure: Vector


def needs_simulation(fmu: FMU, inputs: Sequence[str], outputs: Sequence[str]) -> bool:
    """Whether no compiled loop steps an FMU: Co-Simulation alone, not Real, or remembers steps."""
    if isinstance(fmu, CoSimulation) or fmu.remembers_steps:
        return True
    real = all(map(fmu.is_real, (*fmu.states, *outputs)))
    return not real or not all(map(fmu.is_continuous, inputs))


class Simulation:
    """A model along recordings, one whole simulation after the other with the same instance.

    Where an FMU does not give the same results after a reset, each run has an instance of its own.

    Parameters
    ----------
    fmu : Model Exchange, with events or without, or Co-Simulation; it must outlive this.
    inputs, outputs : variables of the FMU of any types that hold numbers, m and l.
    holds : (m,) see `HybridSimulation`; 0: a straight line from sample to sample.
    """

    def __init__(
        self, fmu: FMU, inputs: Sequence[str], outputs: Sequence[str], holds: ArrayLike
    ) -> None:
        self.fmu = fmu
        self._inputs, self._outputs = fmu.typed(inputs), fmu.typed(outputs)
        self._holds = np.array(holds, float)
        self._variables = fmu.description.by_name
        self._resets: bool | None = None  # not known before the first run
        self._set: set[str] = set()
        # By column: over the usual step, that which was best, and its disagreement.
        self._best: dict[tuple[str, ...], tuple[float, float]] = {}

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
            # Where the first run began is not known either: a command may have run the FMU before.
            outputs = outputs if self._resets else self._run(drive, values)
            if not self._resets and not np.array_equal(
                self._run(drive, values), outputs, equal_nan=True
            ):
                raise FMUError(
                    f"{self.fmu.called}: the same run gives other results when it is repeated, "
                    "even with a new instance"
                )
        return outputs

    def _run(self, drive: Drive, values: Mapping[str, float]) -> Matrix:
        fmu = self.fmu
        self._start(drive, values)
        make = CoSimulationRun if isinstance(fmu, CoSimulation) else HybridSimulation
        along = make(fmu, self._inputs, self._holds)  # type: ignore[arg-type]
        return along.run(fmu.start_time + (drive.time - drive.time[0]), drive.u, self._outputs)

    def _start(self, drive: Drive, values: Mapping[str, float]) -> None:
        fmu = self.fmu
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
            # Some Co-Simulations keep values in their library, which outlast an instance.
            fmu.renew(reload=isinstance(fmu, CoSimulation))
        fmu.begin_at(drive.model_time)
        # What a run has set stays set in an FMU whose reset forgets to take it back.
        before = {name: fmu.defaults[name] for name in self._set if name in fmu.defaults}
        self._set |= values.keys()
        # What a model calculates at its start may depend on inputs.
        inputs = dict(zip(self._inputs.names, drive.u[0], strict=True))
        fmu.start({**inputs, **before, **values})

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
        names = [name for column in columns for name in column]
        at = {**self.values(drive, values, names), **values}
        base = self.run(drive, values)
        scale = np.abs(base).max(axis=0, initial=0.0)
        scale[scale == 0.0] = 1.0
        derivatives, unsure = np.empty((*base.shape, len(columns))), np.zeros(len(columns))
        for q, column in enumerate(columns):
            size = (sizes or {}).get(column[0]) or self.size(column[0], at[column[0]])

            def moved(step: float, column: Sequence[str] = column) -> Matrix | FMUError:
                """Outputs after a step of this column, less the base; or why there are none."""
                after = {name: at[name] + step for name in column}
                for name, value in after.items():
                    low, high = self.limits[name]
                    if not low <= value <= high:
                        return FMUError(f"'{name}' can neither grow nor fall within its limits")
                try:
                    return self.run(drive, {**values, **after}) - base
                except FMUError as error:
                    return error

            best, most = self._best_difference(tuple(column), moved, size, scale)
            noise = most < _ROUNDED or (most < _SHOWN and best.unsure > _APART)
            derivatives[:, :, q] = 0.0 if noise else best.slope
            unsure[q] = best.unsure if most > _SHOWN and best.unsure > _AGREES else 0.0
        return Derivatives(derivatives, unsure)

    def _best_difference(
        self,
        column: tuple[str, ...],
        moved: Callable[[float], Matrix | FMUError],
        size: float,
        scale: Vector,
    ) -> tuple["_Difference", float]:
        """The slope whose halves agree best, and the largest move of an output by any step.

        The step that was best before is tried first, and is good enough if it is as good again.
        """
        first, least = self._best.get(column, (1.0, 0.0))
        enough = max(_AGREES, _AS_GOOD * least)
        trials: dict[float, _Difference] = {}
        refused = FMUError("")
        for factor in dict.fromkeys((first, *_FACTORS)):
            try:
                trials[factor] = _difference(moved, factor * _SHARE * size, scale)
            except FMUError as error:
                refused = error
                continue
            if trials[factor].unsure <= enough:
                break
        if not trials:
            raise refused
        factor, best = min(trials.items(), key=lambda trial: trial[1].unsure)
        self._best[column] = factor, best.unsure
        return best, max(trial.moved for trial in trials.values())

    def values(
        self, drive: Drive, values: Mapping[str, float], names: Sequence[str]
    ) -> dict[str, float]:
        """Values of variables at the start of a run."""
        self._start(drive, values)
        read = self.fmu.get_typed(self.fmu.typed(names))
        return dict(zip(names, map(float, read), strict=True))

    def size(self, name: str, value: float) -> float:
        """Of what size a variable is: as its value, or where that is zero as is usual."""
        return abs(value) or float(self.fmu.sizes([name])[0])

    @cached_property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Least and greatest value of each variable, infinite where it has none."""
        return {name: variable.limits for name, variable in self._variables.items()}


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
        slope, gap = (4.0 * half - up) / h, 2.0 * half - up
    else:
        slope, gap = (up - down) / (2.0 * h), 0.5 * (up + down)
    whole = float(np.linalg.norm(h * slope / scale))
    # What does not move at all says nothing: a larger step may.
    share = float(np.linalg.norm(gap / scale)) / whole if whole else 1.0
    return _Difference(slope, share, float(np.abs(up / scale).max(initial=0.0)))
