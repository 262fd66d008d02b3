"""What each recording says about every parameter: whitened prediction errors, their derivatives.

The derivatives are made beside the simulation. Everything that follows, fits, tests on held-out
recordings and confusability, is linear algebra on them.
"""

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self, TypeVar

import numpy as np

from workbench.case import Case
from workbench.diagnosis.motion import motion
from workbench.diagnosis.pace import Pace
from workbench.diagnosis.prediction import Predictor, Variation
from workbench.diagnosis.samples import Samples, compared, prepare
from workbench.diagnosis.thresholds import SOUND, Soundness, Thresholds
from workbench.fmu import FMU, Matrix, Vector
from workbench.pool import Pool
from workbench.system import System

Item = TypeVar("Item")
Result = TypeVar("Result")

_DELAY_STEP = 1e-3  # of the difference, over the delay's spread; errors are linear in the delay
_FINEST = 32  # steps of a sample time


def delay(signal: str) -> str:
    """Name of the delay of a sensor behind a structure [s], which is no variable of the FMU."""
    return f"{signal}Delay"


@dataclass(frozen=True, eq=False)
class Evidence:
    """One recording, linearised about a point.

    Attributes
    ----------
    errors : (b, c) whitened prediction errors of the blocks, by channel.
    rest : whitened error of the input at rest.
    sizes : (2, c) root mean square and mean absolute error of single samples, in SI units.
    jacobian : (b*c + 1, p) derivatives of [errors, rest] in SI units, by delays and columns.
    """

    errors: Matrix
    rest: float
    sizes: Matrix
    jacobian: Matrix

    @property
    def residual(self) -> Vector:
        """(b*c + 1,) errors and rest in one vector."""
        return np.append(self.errors.ravel(), self.rest)


class Simulated(NamedTuple):
    """What a simulator is made from: an FMU and the recordings."""

    path: Path
    system: System
    recordings: tuple[Samples, ...]
    parts: int = 1  # steps of a sample time


class Simulator:
    """An FMU along recordings, in one process."""

    def __init__(self, given: Simulated) -> None:
        self._fmu = FMU(given.path)
        self._recordings = given.recordings
        signals = given.recordings[0].signals
        self._predictor = Predictor(self._fmu, given.system, signals, given.parts)
        self._delays = {
            j: (delay(signals[j]), mode.late) for j, mode in given.recordings[0].modes.items()
        }
        rest = given.system.comparison.rest
        self._rest = self._fmu.variables([rest.output]) if rest else None

    @property
    def parameters(self) -> set[str]:
        """Names of the FMU's variables that have a default."""
        return set(self._fmu.defaults)

    def errors(self, number: int, values: Mapping[str, float]) -> Matrix:
        """Prediction errors of the samples of one recording that count, (m, c)."""
        one = self._recordings[number]
        found: Matrix = self._simulated(number, values)[0][one.told]
        return found

    def begin(self, number: int) -> dict[str, float]:
        """Start values of states that a recording's outputs show."""
        return self._predictor.begin(self._recordings[number])

    def close(self) -> None:
        """Free the FMU."""
        self._fmu.close()

    def at(self, number: int, values: Mapping[str, float]) -> Evidence:
        """Errors of one recording at a point, and their derivatives by delays, which cost nothing.

        Parameters
        ----------
        values : of the FMU's variables and of delays, SI.
        """
        simulated, rest = self._simulated(number, values)
        read_ = self._read(number, simulated, values)
        errors = self._whitened(number, read_)
        columns = []
        for name, spread in self._delays.values():
            step = _DELAY_STEP * spread
            delayed = {**values, name: values[name] + step}
            late = self._whitened(number, self._read(number, simulated, delayed))
            columns.append(np.append((late - errors).ravel() / step, 0.0))
        jacobian = np.column_stack(columns) if columns else np.zeros((errors.size + 1, 0))
        return Evidence(errors, rest, self._recordings[number].sizes(read_), jacobian)

    def derivatives(
        self,
        number: int,
        values: Mapping[str, float],
        columns: Sequence[Variation],
    ) -> Matrix:
        """Derivatives of one recording's [errors, rest] by the columns, (b*c + 1, p)."""
        one, fmu = self._recordings[number], self._fmu
        jacobian = np.zeros((len(one.blocks) * len(one.slopes) + 1, len(columns)))
        for part in _compatible(columns):
            varied = [columns[j] for j in part]
            _, found = self._predictor.derivatives(one, self._known(values), varied)
            by = self._whitened(number, self._late(number, found.errors, values))
            jacobian[:-1, part] = by.reshape(-1, len(part))
            if self._rest is not None:
                place = self._rest.references
                slopes = (fmu.jacobian(place, fmu.variables(fmu.states)) @ found.states)[0]
                for q, column in enumerate(varied):
                    acting = [name for name in column.variables if name not in fmu.states]
                    slopes[q] += fmu.jacobian(place, fmu.variables(acting)).sum()
                jacobian[-1, part] = -slopes / one.rest_noise
        return jacobian

    def _simulated(self, number: int, values: Mapping[str, float]) -> tuple[Matrix, float]:
        """Prediction errors of all samples, and the whitened error of the input at rest."""
        one = self._recordings[number]
        errors = self._predictor.errors(one, self._known(values))
        if self._rest is None:
            return errors, 0.0
        return errors, (one.rest - float(self._fmu.get(self._rest)[0])) / one.rest_noise

    def _known(self, values: Mapping[str, float]) -> dict[str, float]:
        """Values of the FMU's variables."""
        delays = {name for name, _ in self._delays.values()}
        return {name: value for name, value in values.items() if name not in delays}

    def _read(self, number: int, errors: Matrix, values: Mapping[str, float]) -> Matrix:
        """Errors of samples (n, c) with sensors behind structures, as late as `values` say."""
        measured = self._recordings[number].y
        return measured - self._late(number, measured - errors, values)

    def _late(self, number: int, signals: Matrix, values: Mapping[str, float]) -> Matrix:
        """What sensors read of signals (n, c, ...), behind structures and late."""
        one = self._recordings[number]
        if self._delays:
            signals = signals.copy()
        for j, (name, _) in self._delays.items():
            behind = one.behind_structure(j, signals[:, j])
            signals[:, j] = behind - values[name] * np.gradient(behind, one.time, axis=0)
        return signals

    def _whitened(self, number: int, errors: Matrix) -> Matrix:
        """Whitened errors of the blocks, (b, c, ...)."""
        one = self._recordings[number]
        whitened: Matrix = np.einsum("bij,bj...->bi...", one.whitening, one.channels(errors))
        return whitened


def _compatible(columns: Sequence[Variation]) -> list[list[int]]:
    """Numbers of columns that may be varied in one run: none sets what another sets otherwise."""
    parts: list[tuple[list[int], dict[str, float]]] = []
    for j, column in enumerate(columns):
        wanted = column.setting.items()
        able = (
            one for one in parts if all(one[1].get(name, value) == value for name, value in wanted)
        )
        if (part := next(able, None)) is None:
            parts.append(part := ([], {}))
        part[0].append(j)
        part[1].update(wanted)
    return [part for part, _ in parts]


@contextmanager
def simulating(given: Simulated) -> Iterator[Simulator]:
    """Open a simulator."""
    simulator = Simulator(given)
    try:
        yield simulator
    finally:
        simulator.close()


def settled_parts(given: Simulated, values: Mapping[str, float]) -> int:
    """Steps of a sample time from which on finer ones hardly move prediction errors.

    A step that is long for what oscillates damps it and turns its phase, and a wrong law would be
    named for that. Of the squares of errors, half a step may move what forms of laws differ by.

    Parameters
    ----------
    values : of the FMU's variables, SI.
    """

    def errors(parts: int) -> list[Matrix]:
        with simulating(given._replace(parts=parts)) as simulator:
            return [simulator.errors(k, values) for k in range(len(given.recordings))]

    parts, coarse = 1, errors(1)
    while parts < _FINEST:
        fine = errors(2 * parts)
        moved = [np.square(a - b).sum(axis=0) for a, b in zip(fine, coarse, strict=True)]
        wrong = [np.square(a).sum(axis=0) for a in fine]
        if np.all(np.sum(moved, axis=0) <= Thresholds.form_share * np.sum(wrong, axis=0)):
            break
        parts, coarse = 2 * parts, fine
    return parts


class Simulations:
    """A model along all recordings, in worker processes if there are more than one.

    Parameters
    ----------
    path : FMU with all effects that may be asked for.
    given : values of its variables that the diagnosed model has instead of the defaults.
    sound : which samples count.
    report : takes a line now and then on how many simulations were made.

    Attributes
    ----------
    nominal, units, bounds : value, unit, (least, greatest) value by variable of the FMU.
    begin : start values of states by recording, as measured.
    simulated : what its simulators are made from.
    cases, recordings : as recorded, and made ready.
    """

    def __init__(
        self,
        path: Path,
        system: System,
        given: Mapping[str, float],
        cases: Sequence[Case],
        workers: int,
        sound: Soundness = SOUND,
        report: Callable[[str], None] = lambda line: None,
    ) -> None:
        self._pace = Pace(report, "simulations")
        with FMU(path, None, given) as fmu:
            self.nominal = dict(fmu.defaults)
            self.units = dict(fmu.units)
            self.bounds = {
                v.name: (
                    -np.inf if v.minimum is None else v.minimum,
                    np.inf if v.maximum is None else v.maximum,
                )
                for v in fmu.description.variables
            }
            moving = motion(fmu, system)
        self.system, self.given, self.cases = system, dict(given), list(cases)
        signals = compared(system, cases)
        self.recordings = [
            prepare(one, system, signals, self.nominal, moving, sound) for one in cases
        ]
        workers = min(workers, len(cases))
        coarse = Simulated(path, system, tuple(self.recordings))
        self.simulated = coarse._replace(parts=settled_parts(coarse, self.nominal))
        with simulating(self.simulated) as own:
            self.begin = [own.begin(k) for k in range(len(cases))]
        self._alone = workers == 1
        self._pool = Pool(workers, simulating, self.simulated)
        # Long ones first: the last one to finish leaves the other processors idle.
        self._order = sorted(range(len(cases)), key=lambda k: -self.recordings[k].time.size)
        self._interrupted = threading.Event()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._pool.close()

    def at(self, points: Sequence[Mapping[str, float]]) -> list[Evidence]:
        """Errors of every recording at its own point.

        Parameters
        ----------
        points : values of the FMU's variables and of delays, one mapping for each recording.
        """
        found = self._gathered({k: (Simulator.at, k, points[k]) for k in self._order})
        return [found[k] for k in range(len(self.recordings))]

    def derivatives(
        self,
        points: Sequence[Mapping[str, float]],
        columns: Sequence[Variation],
    ) -> list[Matrix]:
        """Derivatives of every recording's [errors, rest] by the columns, each (b*c + 1, p)."""
        found = self._gathered(
            {k: (Simulator.derivatives, k, points[k], columns) for k in self._order}
        )
        return [found[k] for k in range(len(self.recordings))]

    def together(self, job: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
        """Results of a job that asks for evidence, by item; no processor waits for one of them."""
        if self._alone or len(items) < 2:
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
        if self._interrupted.is_set():
            raise CancelledError
        counted = self._pace.part(len(tasks))
        under_way = {}
        try:
            for name, task in tasks.items():
                under_way[name] = self._pool.submit(*task)
                under_way[name].add_done_callback(counted)
            return {name: one.result() for name, one in under_way.items()}
        finally:
            # After Ctrl-C nobody waits for the others.
            for one in under_way.values():
                one.cancel()
