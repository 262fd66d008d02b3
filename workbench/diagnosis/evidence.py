"""What each stop says about every parameter: whitened prediction errors and their derivatives.

The derivatives are differences of two simulations. Everything that follows, fits, tests on held-out
stops and confusability, is linear algebra on them.
"""

import signal
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from workbench.case import Case
from workbench.diagnosis.prediction import Predictor
from workbench.diagnosis.samples import Samples, prepare
from workbench.fmu import FMU, Matrix, Vector

REST = "pBRest"

# Not of the FMU: by how much the load cell is late beyond the mode that it sits behind [s].
FORCE_DELAY = "FxDelay"


@dataclass(frozen=True)
class Column:
    """A parameter that is varied.

    Attributes
    ----------
    variables : of the FMU that take its value.
    step : of the difference, in SI units.
    setting : other variables that are set while it is varied, such as the shape of an effect that
        is absent otherwise.
    """

    variables: tuple[str, ...]
    step: float
    setting: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Evidence:
    """One stop, linearised about a point.

    Attributes
    ----------
    errors : (b, m) whitened prediction errors of the blocks, in CHANNELS.
    rest : whitened error of the pressure at rest.
    jacobian : (b*m + 1, p) derivatives of [errors, rest] by the columns, in SI units.
    """

    errors: Matrix
    rest: float
    jacobian: Matrix

    @property
    def residual(self) -> Vector:
        """(b*m + 1,) errors and rest in one vector."""
        return np.append(self.errors.ravel(), self.rest)


class Bench:
    """An FMU and the stops, in one process."""

    def __init__(self, path: Path, stops: Sequence[Samples]) -> None:
        self._fmu = FMU(path)
        self._predictor = Predictor(self._fmu)
        self._rest = self._fmu.variables([REST])
        self._stops = stops

    @property
    def parameters(self) -> set[str]:
        """Names of the FMU's variables that have a default."""
        return set(self._fmu.defaults)

    def close(self) -> None:
        """Free the FMU."""
        self._fmu.close()

    def errors(self, number: int, values: Mapping[str, float]) -> tuple[Matrix, float]:
        """Whitened prediction errors of one stop, (b, m), and that of the pressure at rest.

        Parameters
        ----------
        values : of the FMU's variables and of FORCE_DELAY, SI.
        """
        stop, nominal = self._stops[number], self._fmu.defaults
        known = {name: value for name, value in values.items() if name != FORCE_DELAY}
        errors = self._predictor.errors(stop, known)
        if errors.shape[1] == 3:
            read = stop.behind_structure(stop.y[:, 2] - errors[:, 2])
            late = read - values[FORCE_DELAY] * np.gradient(read, stop.time)
            errors[:, 2] = stop.y[:, 2] - late
        means = stop.channels(errors, nominal["rW"], nominal["rR"])
        rest = (stop.rest - float(self._fmu.get(self._rest)[0])) / stop.rest_noise
        return np.einsum("bij,bj->bi", stop.whitening, means), rest

    def evidence(
        self, number: int, values: Mapping[str, float], columns: Sequence[Column]
    ) -> Evidence:
        """Errors and their derivatives by the columns."""
        errors, rest = self.errors(number, values)
        jacobian = np.zeros((errors.size + 1, len(columns)))
        for j, column in enumerate(columns):
            name = column.variables[0]
            start = values[name] if name in values else self._fmu.defaults[name]
            moved = {**values, **column.setting}
            moved |= dict.fromkeys(column.variables, start + column.step)
            other, other_rest = self.errors(number, moved)
            jacobian[:-1, j] = (other - errors).ravel() / column.step
            jacobian[-1, j] = (other_rest - rest) / column.step
        return Evidence(errors, rest, jacobian)


_bench: Bench | None = None


def _begin(path: Path, stops: Sequence[Samples]) -> None:
    """Start a worker; it leaves Ctrl-C to the process that waits for it."""
    global _bench
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _bench = Bench(path, stops)


def _work(number: int, values: Mapping[str, float], columns: Sequence[Column]) -> Evidence:
    assert _bench is not None
    return _bench.evidence(number, values, columns)


class Court:
    """Gathers evidence, in worker processes if there are more than one.

    Parameters
    ----------
    path : FMU with all effects that may be asked for.
    given : values of its variables that the diagnosed model has instead of the defaults.

    Attributes
    ----------
    nominal, units, bounds : value, unit, (least, greatest) value by variable of the FMU.
    cases, stops : as recorded, and made ready.
    """

    def __init__(
        self, path: Path, given: Mapping[str, float], cases: Sequence[Case], workers: int
    ) -> None:
        with FMU(path) as fmu:
            self.nominal = {**fmu.defaults, **given}
            self.units = dict(fmu.units)
            self.bounds = {
                v.name: (
                    -np.inf if v.minimum is None else v.minimum,
                    np.inf if v.maximum is None else v.maximum,
                )
                for v in fmu.description.variables
            }
        self.given = dict(given)
        self.stops = [prepare(case, self.nominal) for case in cases]
        self.cases = list(cases)
        workers = min(workers, len(cases))
        self._own = Bench(path, self.stops) if workers == 1 else None
        self._pool = ProcessPoolExecutor(workers, initializer=_begin, initargs=(path, self.stops))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._pool.shutdown(cancel_futures=True)
        if self._own is not None:
            self._own.close()

    def hear(
        self, points: Sequence[Mapping[str, float]], columns: Sequence[Sequence[Column]]
    ) -> list[Evidence]:
        """Evidence of every stop at its own point.

        Parameters
        ----------
        points : values of the FMU's variables, one mapping for each stop.
        columns : what is varied, one list for each stop.
        """
        if self._own is not None:
            return [self._own.evidence(k, points[k], columns[k]) for k in range(len(self.stops))]
        # Long stops first: the last one to finish leaves the other processors idle.
        order = np.argsort([-stop.time.size for stop in self.stops])
        tasks = {int(k): self._pool.submit(_work, int(k), points[k], columns[k]) for k in order}
        try:
            return [tasks[k].result() for k in range(len(self.stops))]
        finally:
            # After Ctrl-C nobody waits for the others.
            for task in tasks.values():
                task.cancel()
