"""What each stop says about every parameter: whitened prediction errors and their derivatives.

The derivatives are differences of two simulations. Everything that follows, fits, tests on held-out
stops and confusability, is linear algebra on them.
"""

import signal
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import (
    CancelledError,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

import numpy as np

from workbench.case import Case
from workbench.diagnosis.prediction import Predictor
from workbench.diagnosis.samples import Samples, prepare
from workbench.fmu import FMU, Matrix, Vector

Item = TypeVar("Item")
Result = TypeVar("Result")

REST = "pBRest"

# Not of the FMU: by how much the load cell is late beyond the mode that it sits behind [s].
FORCE_DELAY = "FxDelay"
_DELAY_STEP = 1e-3  # [s] of the difference; errors are linear in the delay

_CHUNK = 6  # columns of one task: few, so that no processor waits long for the last one


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
    jacobian : (b*m + 1, p) derivatives of [errors, rest] in SI units, by FORCE_DELAY and columns.
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

    def at(self, number: int, values: Mapping[str, float]) -> Evidence:
        """Errors of one stop at a point, and their derivative by FORCE_DELAY, which costs nothing.

        Parameters
        ----------
        values : of the FMU's variables and of FORCE_DELAY, SI.
        """
        simulated, rest = self._simulated(number, values)
        delay = values[FORCE_DELAY]
        errors = self._whitened(number, simulated, delay)
        late = self._whitened(number, simulated, delay + _DELAY_STEP)
        by_delay = np.append((late - errors).ravel() / _DELAY_STEP, 0.0)
        return Evidence(errors, rest, by_delay[:, None])

    def derivatives(
        self, number: int, values: Mapping[str, float], columns: Sequence[Column], about: Evidence
    ) -> Matrix:
        """Derivatives of one stop's [errors, rest] by the columns, (b*m + 1, p).

        Parameters
        ----------
        about : errors at the point.
        """
        jacobian = np.zeros((about.errors.size + 1, len(columns)))
        for j, column in enumerate(columns):
            name = column.variables[0]
            start = values[name] if name in values else self._fmu.defaults[name]
            moved = {**values, **column.setting}
            moved |= dict.fromkeys(column.variables, start + column.step)
            simulated, rest = self._simulated(number, moved)
            errors = self._whitened(number, simulated, values[FORCE_DELAY])
            jacobian[:-1, j] = (errors - about.errors).ravel() / column.step
            jacobian[-1, j] = (rest - about.rest) / column.step
        return jacobian

    def _simulated(self, number: int, values: Mapping[str, float]) -> tuple[Matrix, float]:
        """Prediction errors of all samples, and the whitened error of the pressure at rest."""
        stop = self._stops[number]
        known = {name: value for name, value in values.items() if name != FORCE_DELAY}
        errors = self._predictor.errors(stop, known)
        return errors, (stop.rest - float(self._fmu.get(self._rest)[0])) / stop.rest_noise

    def _whitened(self, number: int, errors: Matrix, delay: float) -> Matrix:
        """Whitened errors of the blocks, (b, m), with the load cell late by `delay` [s]."""
        stop, nominal = self._stops[number], self._fmu.defaults
        if errors.shape[1] == 3:
            errors, force = errors.copy(), stop.y[:, 2]
            read = stop.behind_structure(force - errors[:, 2])
            errors[:, 2] = force - (read - delay * np.gradient(read, stop.time))
        means = stop.channels(errors, nominal["rW"], nominal["rR"])
        whitened: Matrix = np.einsum("bij,bj->bi", stop.whitening, means)
        return whitened


_bench: Bench | None = None


def _begin(path: Path, stops: Sequence[Samples]) -> None:
    """Start a worker; it leaves Ctrl-C to the process that waits for it."""
    global _bench
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _bench = Bench(path, stops)


def _work(task: Callable[..., Any], *arguments: Any) -> Any:
    assert _bench is not None
    return task(_bench, *arguments)


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
        # Long stops first: the last one to finish leaves the other processors idle.
        self._order = sorted(range(len(cases)), key=lambda k: -self.stops[k].time.size)
        self._interrupted = threading.Event()

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

    def at(self, points: Sequence[Mapping[str, float]]) -> list[Evidence]:
        """Errors of every stop at its own point.

        Parameters
        ----------
        points : values of the FMU's variables and of FORCE_DELAY, one mapping for each stop.
        """
        found = self._gathered({k: (Bench.at, k, points[k]) for k in self._order})
        return [found[k] for k in range(len(self.stops))]

    def derivatives(
        self,
        points: Sequence[Mapping[str, float]],
        columns: Sequence[Column],
        about: Sequence[Evidence],
    ) -> list[Matrix]:
        """Derivatives of every stop's [errors, rest] by the columns, each (b*m + 1, p).

        Parameters
        ----------
        about : errors of each stop at its point.
        """
        chunks = [columns[i : i + _CHUNK] for i in range(0, len(columns), _CHUNK)]
        found = self._gathered(
            {
                (k, i): (Bench.derivatives, k, points[k], chunk, about[k])
                for k in self._order
                for i, chunk in enumerate(chunks)
            }
        )
        return [
            np.column_stack([found[k, i] for i in range(len(chunks))])
            for k in range(len(self.stops))
        ]

    def together(self, job: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
        """Results of a job that asks for evidence, by item; no processor waits for one of them."""
        if self._own is not None or len(items) < 2:
            return [job(item) for item in items]
        with ThreadPoolExecutor(len(items)) as threads:
            jobs = [threads.submit(job, item) for item in items]
            try:
                return [one.result() for one in jobs]
            except BaseException:
                # Others end with what they wait for.
                self._interrupted.set()
                wait(jobs)
                self._interrupted.clear()
                raise

    def _gathered(self, tasks: Mapping[Any, tuple[Any, ...]]) -> dict[Any, Any]:
        """Results of tasks, by their names."""
        if self._own is not None:
            return {name: task(self._own, *rest) for name, (task, *rest) in tasks.items()}
        if self._interrupted.is_set():
            raise CancelledError
        under_way = {name: self._pool.submit(_work, *task) for name, task in tasks.items()}
        try:
            return {name: one.result() for name, one in under_way.items()}
        finally:
            # After Ctrl-C nobody waits for the others.
            for one in under_way.values():
                one.cancel()
