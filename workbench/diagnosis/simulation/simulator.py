"""A model along recordings, in one process: whitened prediction errors and their derivatives."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.clocks import (
    in_time,
    late_signals,
    late_start,
    lateness,
    mirrored,
    moved,
)
from workbench.diagnosis.data.samples import Samples
from workbench.diagnosis.data.sensors import (
    SensorReading,
    corrected,
    readings,
    sensed,
    sensed_changes,
    sensor_errors,
    starts,
    step_of,
    straightened,
)
from workbench.diagnosis.effects.candidates import LAG, LOSS, RECTIFIED, STEP
from workbench.diagnosis.inference.thresholds import Thresholds
from workbench.diagnosis.simulation.free import FreeDerivatives, FreePredictor
from workbench.diagnosis.simulation.prediction import Predictor, Variation
from workbench.diagnosis.simulation.tangent import Tangent
from workbench.errors import FMUError
from workbench.models.fmu import FMU
from workbench.models.instance import EventError
from workbench.system.parts import AT_REST
from workbench.system.registry import open_file
from workbench.system.system import System

More = TypeVar("More")

_DELAY_STEP = 1e-3  # of the difference, over the delay's spread; errors are linear in the delay
_DIFFERENCE = 1e-4  # step over a typical size: far above rounding, far below what bends
_SMALLER = 8  # times that it is made ten times smaller: then it is near rounding
_FURTHEST = 1e100  # of an error and its derivatives: beyond, squares and products are no numbers
FINEST = 32  # steps of a sample time
_CUT = 1e-12  # share, by which no reading differs
_STRAIGHTENED = 2  # runs, of which each leads the next
_DRAWS = 12  # of the noise of inputs: their variance is known to two fifths


def delay(signal: str) -> str:
    """Name of the delay of a sensor behind a structure [s], which is no variable of the FMU."""
    return f"{signal}Delay"


@dataclass(frozen=True, eq=False)
class WhitenedResiduals:
    """One recording, linearised about a point."""

    errors: Matrix  # (b, c) whitened prediction errors of the blocks, by channel
    rest: Vector  # (q,) whitened errors of inputs at rest
    # (2, c) root mean square and mean absolute error of single samples, in SI units; NaN of a
    # silent channel
    sizes: Matrix
    # (b*c + q, p) derivatives of [errors, rest] in SI units, by delays and columns
    jacobian: Matrix
    blocks: NDArray[np.int64]  # (c,) number of blocks in which a channel has samples

    @property
    def residual(self) -> Vector:
        """(b*c + q,) errors and rest in one vector."""
        return np.append(self.errors.ravel(), self.rest)

    def moved(self, change: Vector, spread: Vector) -> "WhitenedResiduals":
        """The same with other errors.

        Parameters
        ----------
        change : (b*c + q,) of [errors, rest], errors in units of the roots of `spread`, (c,).
        """
        errors = change[: self.errors.size].reshape(self.errors.shape) * np.sqrt(spread)
        rest = change[self.errors.size :]
        return replace(self, errors=self.errors + errors, rest=self.rest + rest)


class SimulatorSetup(NamedTuple):
    """What a simulator is made from: an FMU and the recordings."""

    path: Path
    system: System
    recordings: tuple[Samples, ...]
    parts: int = 1  # steps of a sample time
    free: bool = False  # whether by whole simulations, see `FreePredictor`


class Simulator:
    """An FMU along recordings, in one process; the FMU must outlive it."""

    def __init__(self, given: SimulatorSetup, fmu: FMU) -> None:
        self._fmu = fmu
        self._recordings = given.recordings
        self._system, self._parts, self._free = given.system, given.parts, given.free
        signals = given.recordings[0].signals
        self._predictor = self._predictor_of(signals)
        self._delays = {
            j: (delay(signals[j]), mode.late) for j, mode in given.recordings[0].modes.items()
        }
        self._rest = fmu.variables([rest.output for rest in given.system.comparison.rests])
        self._clocks = late_signals(given.system)
        self._sensors = sensor_errors(given.system)
        self._typical = {name: error.typical for name, error in self._sensors.items()}
        if not given.system.library.is_file() and not given.free:
            # An FMU of another tool need not take a parameter while it runs: each is set before.
            self._typical |= {
                v.name: abs(fmu.defaults.get(v.name, 0.0)) or v.nominal or 1.0
                for v in fmu.description.variables
                if v.causality == "parameter"
            }

    def stepped(self, parts: int) -> "Simulator":
        """The same FMU in other steps, so many to a sample time."""
        other = copy(self)
        other._parts = parts
        other._predictor = other._predictor_of(self._recordings[0].signals)
        return other

    def _predictor_of(
        self, signals: Sequence[str], watched: Sequence[str] = ()
    ) -> Predictor | FreePredictor:
        if self._free:
            return FreePredictor(self._fmu, self._system, signals, watched)
        return Predictor(self._fmu, self._system, signals, self._parts, watched)

    @property
    def parameters(self) -> set[str]:
        """Names of the FMU's variables that have a default."""
        return set(self._fmu.defaults)

    def errors(self, points: Sequence[Mapping[str, float]]) -> list[Matrix]:
        """Prediction errors of the samples that count, of each recording at its point, (m, c)."""
        pairs = enumerate(zip(self._recordings, points, strict=True))
        return [self._simulated(k, values)[0][own.reported] for k, (own, values) in pairs]

    def along(self, number: int, values: Mapping[str, float], watched: Sequence[str]) -> Matrix:
        """Variables of the FMU at each sample of one recording, (n, w)."""
        recording = self._in_time(number, values)
        predictor = self._predictor_of(recording.signals, watched)
        return predictor.along(recording, self._known(number, values))

    def free_run(self, number: int, values: Mapping[str, float]) -> Matrix:
        """Errors of samples of one recording that nothing corrects, see `Samples.sizes`, (2, c).

        NaN where the model cannot be simulated so far by itself.
        """
        recording = self._recordings[number]
        late = lateness(self._clocks, values)
        freed = corrected(in_time(recording.free, late), self._wrong(values))
        try:
            errors = self._predictor.errors(freed, self._known(number, values)) + (
                recording.y - freed.y
            )
        except FMUError:
            return np.full((2, len(recording.slopes)), np.nan)
        with np.errstate(over="ignore", invalid="ignore"):  # what runs away is as large as it gets
            return recording.sizes(self._read(number, errors, values))

    def predicted(self, number: int, values: Mapping[str, float]) -> Matrix:
        """Signals of one recording as the model has them, (n, c)."""
        return self._recordings[number].y - self._simulated(number, values)[0]

    def begin(self, number: int) -> dict[str, float]:
        """Start values of states that a recording's outputs show."""
        return self._predictor.begin(self._recordings[number])

    def started(self, number: int, values: Mapping[str, float]) -> dict[str, float]:
        """All that a simulation of one recording starts with, states as they were."""
        known, begin = self._known(number, values), self.begin(number)
        read_ = self._predictor.started(self._recordings[number], known)
        return {**begin, **values, **{n: known[n] for n in begin if n in known}, **read_}

    def at(self, number: int, values: Mapping[str, float]) -> WhitenedResiduals:
        """Errors of one recording at a point, and their derivatives by delays, which cost nothing.

        Parameters
        ----------
        values : of the FMU's variables and of delays, SI.
        """
        simulated, rest = self._simulated(number, values)
        seen = sensed(
            self._recordings[number], self._recordings[number].y - simulated, self._wrong(values)
        )
        behind = self._behind(number, seen)
        read_ = self._compared(number, self._late(number, seen, values, behind), values)
        errors = self._recordings[number].whitened(read_)
        columns = []
        for name, spread in self._delays.values():
            step = _DELAY_STEP * spread
            delayed = {**values, name: values[name] + step}
            later = self._late(number, seen, delayed, behind)
            late = self._recordings[number].whitened(self._compared(number, later, delayed))
            columns.append(np.append((late - errors).ravel() / step, np.zeros(rest.size)))
        rows = errors.size + rest.size
        jacobian = np.column_stack(columns) if columns else np.zeros((rows, 0))
        own = self._recordings[number]
        return WhitenedResiduals(errors, rest, own.sizes(read_), jacobian, own.compared.sum(axis=0))

    def derivatives(
        self,
        number: int,
        values: Mapping[str, float],
        columns: Sequence[Variation],
        courses: Matrix | None = None,
        sizes: Mapping[str, Sequence[str]] | None = None,
    ) -> tuple[Matrix, Mapping[str, float]]:
        """Derivatives of one recording's [errors, rest] by the columns, (b*c + q, p).

        Beside them shares by which they may be wrong, by variable, of those that are unsure.

        Parameters
        ----------
        courses : (n, p) factors by which the columns act at each sample, if they change in time;
            what is read at rest does not change then.
        sizes : variables by the component of the FMU that is nominal while they are zero: then
            nothing depends on its states.
        """
        recording, fmu = self._in_time(number, values), self._fmu
        blocks = len(recording.blocks) * len(recording.slopes)
        jacobian = np.zeros((blocks + recording.rest.size, len(columns)))
        unsure: dict[str, float] = {}
        differing = {*self._clocks, *self._typical}
        beside = [j for j, column in enumerate(columns) if column.variables[0] in differing]
        simulated: Matrix | None = None  # errors at the values, which a run without settings has
        for part in _compatible(columns, beside):
            varied = [columns[j] for j in part]
            shares = None if courses is None else courses[:, part]
            absent = self._absent(values, varied, sizes or {})
            run: Callable[[Samples], tuple[Matrix, Tangent | FreeDerivatives]] = partial(
                self._predictor.derivatives,
                values=self._known(number, values),
                columns=varied,
                courses=shares,
                absent=absent,
            )
            errors, along = self._led(recording, run)
            if not any(column.setting for column in varied):
                simulated = errors + (self._recordings[number].y - recording.y)
            by_sensor = sensed_changes(
                recording, along.errors, recording.y - errors, self._wrong(values)
            )
            by = self._recordings[number].whitened(self._late(number, by_sensor, values))
            if not np.abs(by).max(initial=0.0) < _FURTHEST:
                raise FMUError(
                    f"{fmu.called}: derivatives of {recording.name} grow beyond all bounds"
                )
            jacobian[:blocks, part] = by.reshape(-1, len(part))
            if isinstance(along, FreeDerivatives):
                unsure |= along.unsure
            elif recording.rest.size and courses is None:
                place = self._rest.references
                slopes = fmu.jacobian(place, fmu.variables(fmu.states)) @ along.states  # (q, part)
                for j, column in enumerate(varied):
                    acting = [name for name in column.variables if name not in fmu.states]
                    slopes[:, j] += fmu.jacobian(place, fmu.variables(acting)).sum(axis=1)
                jacobian[blocks:, part] = -slopes / recording.rest_noise[:, None]
        if beside:
            varied = [columns[j] for j in beside]
            jacobian[:blocks, beside] = self._by_differences(number, values, varied, simulated)
        return jacobian, unsure

    def _absent(
        self,
        values: Mapping[str, float],
        varied: Sequence[Variation],
        sizes: Mapping[str, Sequence[str]],
    ) -> list[str]:
        """Components of which no size is varied, or other than zero."""
        acting = {name for column in varied for name in column.variables}
        return [
            name
            for name, own in sizes.items()
            if not any(name in acting or values.get(name, self._fmu.defaults[name]) for name in own)
        ]

    def _by_differences(
        self,
        number: int,
        values: Mapping[str, float],
        varied: Sequence[Variation],
        simulated: Matrix | None,
    ) -> Matrix:
        """Derivatives of the errors by clocks, sensors, and parameters of an FMU alone, (b*c, p).

        Of a time over a sample: within one, a signal that is moved is a straight line. Both ends of
        a difference are mirrored alike: noise of other samples would look like what the clock does.
        What is read in steps follows no step; by its size it goes from what is not.

        Parameters
        ----------
        simulated : errors of samples at the values, (n, c), where they are known.
        """
        recording = self._recordings[number]
        sample = float(np.median(np.diff(recording.time)))

        def read(
            simulated: Matrix, values: Mapping[str, float], *clocks: Mapping[str, float]
        ) -> Matrix:
            return (
                self._recordings[number]
                .whitened(self._read(number, simulated, values, *clocks))
                .ravel()
            )

        def errors(values: Mapping[str, float], *clocks: Mapping[str, float]) -> Matrix:
            return read(self._simulated(number, values)[0], values, *clocks)

        if simulated is None:
            simulated = self._simulated(number, values)[0]
        now = read(simulated, values)
        columns = []
        for column in varied:
            name, known = column.variables[0], {**values, **column.setting}
            at = values.get(name, self._fmu.defaults.get(name, 0.0))
            sensor = self._sensors.get(name)
            if sensor is not None and sensor.parameter == STEP:
                of = recording.read[:, recording.signals.index(sensor.signal)]
                size = at or step_of(of) or sensor.typical
                whole = now if at else errors({**known, name: size})
                columns.append((whole - errors({**known, name: 0.0})) / size)
                continue
            timed = name not in self._typical or (sensor is not None and sensor.parameter == LAG)
            cut = sensor is not None and sensor.parameter in (LOSS, RECTIFIED)
            step = sample if timed else _DIFFERENCE * self._typical[name]
            if not (timed or cut):
                step, moved = self._stepped(number, known, name, at, step, simulated)
                columns.append((read(moved, {**known, name: at + step}) - now) / step)
                continue
            later = {**known, name: at + step}
            before = read(simulated, values, values, later) if name in self._clocks else now
            if cut and not at:
                before = errors({**known, name: _CUT})  # nothing leads either run
            columns.append((errors(later, values, later) - before) / step)
        return np.column_stack(columns)

    def _stepped(
        self,
        number: int,
        values: Mapping[str, float],
        name: str,
        at: float,
        step: float,
        simulated: Matrix,
    ) -> tuple[float, Matrix]:
        """A step of a variable that is small, and errors of samples there, (n, c).

        It is made smaller until it moves no signal by more than its scale, either way: a leak that
        is none to a lake empties a bottle, and what the model then says is no derivative.

        Parameters
        ----------
        at, step : where the variable is, and the step to begin with, SI.
        simulated : errors of samples there, (n, c).

        Raises
        ------
        EventError
            If an FMU alone passes an event.
        FMUError
            If the model cannot be evaluated beside this value, or its signals jump.
        """
        scales = [self._system.signals[n].scale for n in self._recordings[number].signals]
        for smaller in 10.0 ** -np.arange(_SMALLER):
            for small in (smaller * step, -smaller * step):
                try:
                    moved = self._simulated(number, {**values, name: at + small})[0]
                except EventError:  # then whole simulations are compared
                    raise
                except FMUError:
                    continue
                if np.all(np.abs(moved - simulated).max(axis=0) <= scales):
                    return small, moved
        unstable = (
            ". If it is unstable, say in [points.design] of the system file where it works: "
            "outputs correct the run by what holds there"
        )
        raise FMUError(
            f"{self._fmu.called}: no derivative by {name} along {self._recordings[number].name}: "
            f"however little it changes, the model cannot be evaluated, or its signals jump"
            + unstable
            * (not self._free and self._system.design == AT_REST)
        )

    def weighed(self, number: int, values: Mapping[str, float]) -> Samples:
        """A recording whose errors are weighed by how sharply they depend on what is not known.

        Where a motion runs away, the noise of what a restart reads grows until the next one, and a
        law that is simplified shows by more. Both are linear within a block. What a parameter
        wanders by along the recording counts as noise of blocks that moves means by as much: a
        variance over a correlation time, twice, is one over so many blocks.

        Parameters
        ----------
        values : of the FMU's variables, SI, at which this is judged.
        """
        recording = self._recordings[number]
        compare = self._system.comparison
        shaken = self._free and not all(signal.exact for signal in self._system.inputs)
        if recording.restarts is None and not compare.wander and not shaken:
            return recording
        values = {**dict.fromkeys((name for name, _ in self._delays.values()), 0.0), **values}
        nominal, moved = self._means(number, recording, values), []

        def shifted(name: str, share: float) -> Matrix:
            value = (1.0 + share) * values.get(name, self._fmu.defaults[name])
            return self._means(number, recording, {**values, name: value}) - nominal

        if recording.restarts is not None:
            for name, noise in recording.restarts.noise.items():
                y, read = recording.y.copy(), np.flatnonzero(recording.restarts.at) - 1
                y[read, recording.signals.index(name)] += noise[read]
                moved.append(self._means(number, replace(recording, y=y), values) - nominal)
            moved.extend(
                shifted(name, share) for name, share in recording.restarts.uncertain.items()
            )
        alone = [
            shifted(name, by.share) * max(1.0, 2.0 * by.over / compare.block) ** 0.5
            for name, by in compare.wander.items()
        ]
        if shaken:
            moved.extend(self._shaken(number, values, nominal))
        return recording.loosened(moved, alone)

    def _shaken(
        self, number: int, values: Mapping[str, float], nominal: Matrix
    ) -> NDArray[np.float64]:
        """What noise of the inputs adds up to in a run that nothing corrects, (draws, b, c).

        The covariance of block means S is that of draws d, S = sum(d d') / draws. Errors that last
        are one error and not b: with the greatest eigenvalue of S beyond what draws of white errors
        have, s (1 + sqrt(b / draws))^2, each block counts as the less.
        Source: V. A. Marchenko, L. A. Pastur (1967), Math. USSR Sbornik 1, 457-483.
        """
        recording, rng = self._recordings[number], np.random.default_rng(number)
        deviations = np.column_stack(
            [signal.deviation(recording.u[:, j]) for j, signal in enumerate(self._system.inputs)]
        )
        draws = np.empty((_DRAWS, *nominal.shape))
        for k in range(_DRAWS):
            u = recording.u + deviations * rng.standard_normal(recording.u.shape)
            draws[k] = self._means(number, replace(recording, u=u), values) - nominal
        blocks = len(nominal)
        for c in range(nominal.shape[1]):
            total = float(np.square(draws[:, :, c]).sum())
            greatest = float(np.linalg.norm(draws[:, :, c], 2) ** 2)
            white = total / blocks * (1.0 + np.sqrt(blocks / _DRAWS)) ** 2
            draws[:, :, c] *= np.sqrt(max(1.0, blocks * (greatest - white) / max(total, 1e-300)))
        by_draw: NDArray[np.float64] = draws / np.sqrt(_DRAWS)
        return by_draw

    def _means(self, number: int, recorded: Samples, values: Mapping[str, float]) -> Matrix:
        """Errors of the blocks, by channel (b, c), of a recording that was read otherwise."""
        recording = self._recordings[number]
        errors = self._predictor.errors(recorded, self._known(number, values)) - (
            recorded.y - recording.y
        )
        return recording.channels(self._read(number, errors, values))

    def _simulated(self, number: int, values: Mapping[str, float]) -> tuple[Matrix, Vector]:
        """Prediction errors of all samples, and whitened errors of inputs at rest, (q,)."""
        recording, in_time = self._recordings[number], self._in_time(number, values)
        known = self._known(number, values)
        errors, _ = self._led(in_time, lambda own: (self._predictor.errors(own, known), None))
        errors += recording.y - in_time.y
        if not np.abs(errors).max(initial=0.0) < _FURTHEST:
            raise FMUError(f"{self._fmu.called}: signals of {recording.name} leave all bounds")
        return errors, (recording.rest - self._fmu.get(self._rest)) / recording.rest_noise

    def _led(
        self, samples: Samples, run: Callable[[Samples], tuple[Matrix, More]]
    ) -> tuple[Matrix, More]:
        """Prediction errors of a run that outputs lead, and what else it returns.

        Outputs lead by a gain for the model as it is given. With half of its damping, that gain may
        drive it away: where errors are larger than signals are, nothing leads, if that is nearer.
        """
        led = run(samples)
        if samples.lead is None or not samples.lead.noisy or self._away(led[0]) < 1.0:
            return led
        free = run(samples.free)
        return led if self._away(led[0]) <= self._away(free[0]) else free

    def _away(self, errors: Matrix) -> float:
        """Root mean square of errors (n, c) over the scale of their signal, the largest."""
        scales = [self._system.signals[n].scale for n in self._recordings[0].signals]
        with np.errstate(over="ignore"):
            return float((np.sqrt(np.square(errors).mean(axis=0)) / scales).max())

    def _in_time(self, number: int, values: Mapping[str, float]) -> Samples:
        """A recording as by one clock, and by right sensors."""
        by_one_clock = in_time(self._recordings[number], lateness(self._clocks, values))
        wrong = self._wrong(values)
        read_ = corrected(by_one_clock, wrong)
        own = [wrong[name] for name in read_.signals if name in wrong]
        if not read_.corrected or not any(reading.bends for reading in own):
            return read_
        if any(reading.loss or reading.rectified for reading in own):
            return read_.free  # what is cut off leads nothing
        # What leads a run are outputs as they were, which what is bent says by the run alone: first
        # by one that nothing leads.
        straight, known = read_.free, self._known(number, values)
        for _ in range(_STRAIGHTENED):
            errors, _ = self._led(straight, lambda own: (self._predictor.errors(own, known), None))
            straight = straightened(read_, straight.y - errors, wrong)
        return straight

    def _wrong(self, values: Mapping[str, float]) -> dict[str, SensorReading]:
        return readings(self._sensors, values)

    def _known(self, number: int, values: Mapping[str, float]) -> dict[str, float]:
        """Values of the FMU's variables; states begin as they were, by one clock, rightly read."""
        others = {
            *(name for name, _ in self._delays.values()),
            *self._clocks,
            *self._sensors,
        }
        known = {name: value for name, value in values.items() if name not in others}
        if self._system.comparison.leading is None:  # what leads a run lets it forget its start
            recording = self._recordings[number]
            for name, late in lateness(self._clocks, values).items():
                if name in known and name in recording.signals:
                    known[name] += late_start(recording, name, self._system, late)
        return starts(known, self._wrong(values))

    def _read(
        self,
        number: int,
        errors: Matrix,
        values: Mapping[str, float],
        *clocks: Mapping[str, float],
    ) -> Matrix:
        """Errors of samples (n, c) with sensors behind structures, as late as `values` say.

        Parameters
        ----------
        clocks : values by whose clocks errors are mirrored, one after the other; unless any are
            given, `values`.
        """
        recording = self._recordings[number]
        seen = sensed(recording, recording.y - errors, self._wrong(values))
        return self._compared(number, self._late(number, seen, values), *(clocks or (values,)))

    def _compared(self, number: int, read_: Matrix, *clocks: Mapping[str, float]) -> Matrix:
        """Errors of samples (n, c) of what sensors read."""
        recording = self._recordings[number]
        errors = recording.y - read_
        for values in clocks:
            if late := lateness(self._clocks, values):
                errors = mirrored(recording, errors, late)
        return errors

    def _behind(self, number: int, signals: Matrix) -> dict[int, tuple[Matrix, Matrix]]:
        """What sensors behind structures read of signals (n, c, ...), and its rates, by column."""
        recording = self._recordings[number]
        behind = {j: recording.behind_structure(j, signals[:, j]) for j in self._delays}
        return {j: (own, recording.rate(own)) for j, own in behind.items()}

    def _late(
        self,
        number: int,
        signals: Matrix,
        values: Mapping[str, float],
        behind: Mapping[int, tuple[Matrix, Matrix]] | None = None,
    ) -> Matrix:
        """What sensors read of signals (n, c, ...), behind structures, late.

        Parameters
        ----------
        behind : see `_behind`, where that is known.
        """
        recording, late = self._recordings[number], lateness(self._clocks, values)
        if self._delays or late:
            signals = signals.copy()
        for j, (own, rate) in (self._behind(number, signals) if behind is None else behind).items():
            signals[:, j] = own - values[self._delays[j][0]] * rate
        for j, name in enumerate(recording.signals):
            if name in late:
                signals[:, j] = moved(recording.time, signals[:, j], late[name])
        return signals


def _compatible(columns: Sequence[Variation], left: Collection[int]) -> list[list[int]]:
    """Numbers of columns that may be varied in one run: none sets what another sets otherwise.

    Parameters
    ----------
    left : numbers of columns that are left out.
    """
    parts: list[tuple[list[int], dict[str, float]]] = []
    for j, column in ((j, column) for j, column in enumerate(columns) if j not in left):
        wanted = column.setting.items()
        able = (
            part
            for part in parts
            if all(part[1].get(name, value) == value for name, value in wanted)
        )
        if (part := next(able, None)) is None:
            parts.append(part := ([], {}))
        part[0].append(j)
        part[1].update(wanted)
    return [part for part, _ in parts]


@contextmanager
def simulating(given: SimulatorSetup) -> Iterator[Simulator]:
    """Open an FMU and simulate with it."""
    with open_file(given.path, given.system, {}) as fmu:
        yield Simulator(given, fmu)


def settled_parts(
    simulator: Simulator, points: Sequence[Mapping[str, float]], parts: int = 1
) -> int:
    """Steps of a sample time from which on finer ones hardly move prediction errors.

    A step that is long for what oscillates damps it and turns its phase, and a wrong law would be
    named for that. Of the squares of errors, half a step may move what forms of laws differ by.

    Parameters
    ----------
    points : values of the FMU's variables, SI, in each recording.
    parts : that are tried first.
    """

    def errors(parts: int) -> list[Matrix]:
        return simulator.stepped(parts).errors(points)

    coarse = errors(parts)
    while parts < FINEST:
        fine = errors(2 * parts)
        moved = [np.square(a - b).sum(axis=0) for a, b in zip(fine, coarse, strict=True)]
        wrong = [np.square(a).sum(axis=0) for a in fine]
        if np.all(np.sum(moved, axis=0) <= Thresholds.form_share * np.sum(wrong, axis=0)):
            break
        parts, coarse = 2 * parts, fine
    return parts
