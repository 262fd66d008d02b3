"""A recording made ready for statistics: what counts, what is set aside, how large noise is.

Blocks are the unit of all statistics: short against everything that the machine does, long enough
to average most of the ringing of its structure.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.cleaning import Mask, first_value, smooth
from workbench.diagnosis.data.counting import CountedSamples, count, counts_in
from workbench.diagnosis.data.motion import (
    Lead,
    Motion,
    OpenModel,
    effects_on_led,
    led_by,
    noise_of,
    random_walk,
)
from workbench.diagnosis.data.restarts import Restarts, restarts_of
from workbench.diagnosis.data.whitening import WEIGHTLESS, whitening
from workbench.diagnosis.effects.candidates import without_guesses
from workbench.diagnosis.inference.thresholds import SOUND, Soundness
from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.observers.operating import shown_states
from workbench.recordings.case import Case
from workbench.system.comparison import Channel, Comparison
from workbench.system.parts import Mode
from workbench.system.system import System

_STARTING = 40  # samples at usual rates, of a first value
_RELEASED = 0.1  # share of the greatest value
_REACH = 3.0  # standard deviations of a quantity, beyond which a law goes no further with it


@dataclass(frozen=True, eq=False)
class Samples:
    """One recording, sampled."""

    name: str  # of the case
    time: Vector  # (n,) [s]
    inputs: tuple[str, ...]  # names of the columns of u
    u: Matrix  # (n, m) measured inputs, without noise that the model would not feel
    # names of the columns of y: outputs, and what is judged if some recording has it
    signals: tuple[str, ...]
    # y, read: (n, c) measured, without and with what is wrong; zero of what this one has not
    y: Matrix
    read: Matrix
    silent: Mask  # (c,) channels of signals that this one has not: their errors have no weight
    measured: Mask  # (n, c) samples that a channel has: all, but of what is measured at times
    # (n,) samples whose errors are reported: those that are not wrong and that no reason excludes
    reported: Mask
    limits: Matrix  # (2, c) of what the sensors read
    gain: Vector  # (n,) [1] of the correction of the led output, 0 where that was not measured
    lead: Lead | None  # how all outputs correct the states, or None where one leads alone
    restarts: Restarts | None  # where states are set as measured, or None if nowhere
    holds: Vector  # (m,) when samples of inputs act, see `Signal.hold`
    # outputs, what rolls along, and states that outputs show under other names, at the start
    begin: Mapping[str, float]
    rest: Vector  # (q,) means of inputs at rest, before they are applied, or held
    rest_noise: Vector  # (q,) standard deviations, infinite of one that is never so
    blocks: NDArray[np.int64]  # (b, 2) first sample and end of each block that counts
    slopes: Matrix  # (c, c) of the channels by the signals
    # (b, c, c) makes the errors of a block, by channel, white with variance one
    whitening: NDArray[np.float64]
    modes: Mapping[int, Mode]  # by column of y, of the structure before its sensor
    set_aside: dict[str, int]  # number of samples by reason
    model_time: float | None = None  # see `Case`

    def falls(self, signal: str) -> bool:
        """Whether an input falls, by more than its sensor's noise and a valve's overshoot."""
        if signal not in self.inputs:
            raise InputError(
                where=f"recording {self.name}",
                found=f"no recorded input '{signal}', which an effect of the library asks for",
                expected=f"one of {', '.join(self.inputs)}",
                remedy="correct the annotation of the effect",
            )
        column = self.inputs.index(signal)
        u = np.concatenate([self.u[first:end, column] for first, end in self.blocks])
        return bool(np.max(np.maximum.accumulate(u) - u) > _RELEASED * u.max())

    @cached_property
    def _filters(self) -> dict[int, tuple[Vector, Vector, Vector]]:
        """Numerator, denominator and state at rest of digital filters, of modes that show."""
        from scipy.signal import lfiltic  # takes its time, and little else needs it

        h = float(np.median(np.diff(self.time)))
        quantised = {}
        for column, mode in self.modes.items():
            omega = 2.0 * np.pi * mode.frequency
            if omega * h > 2.0:
                continue  # sampled too slowly to show the mode
            damped = -mode.damping + 1j * np.sqrt(1.0 - mode.damping**2)
            z = np.exp(h * omega * np.array([damped, np.conj(damped)]))
            denominator = np.real(np.poly(z))
            # Matched poles; symmetric weights keep the delay, these the amplitude to 0.2 % below
            # three quarters of the mode's frequency.
            numerator = np.sum(denominator) * np.array([1.0, 10.0, 1.0]) / 12.0
            steady = lfiltic(numerator, denominator, np.ones(2), np.ones(2))
            quantised[column] = numerator, denominator, steady
        return quantised

    def behind_structure(self, column: int, values: Vector) -> Vector:
        """What a sensor reads of quantities, (n, ...): a mode of second order in between."""
        if column not in self._filters:
            return values
        from scipy.signal import lfilter

        numerator, denominator, steady = self._filters[column]
        begin = np.multiply.outer(steady, values[0])
        read: Vector = lfilter(numerator, denominator, values, axis=0, zi=begin)[0]
        return read

    @cached_property
    def _rate(self) -> csr_array:
        """Derivative by time of what is sampled, (n, n), as of `numpy.gradient`."""
        h = np.diff(self.time)
        before, after = h[:-1], h[1:]
        middle = (after - before) / (before * after)
        return diags_array(
            [
                np.append(-after / (before * (before + after)), -1.0 / h[-1]),
                np.concatenate([[-1.0 / h[0]], middle, [1.0 / h[-1]]]),
                np.append(1.0 / h[0], before / (after * (before + after))),
            ],
            offsets=[-1, 0, 1],
            format="csr",
        )

    def rate(self, values: Matrix) -> Matrix:
        """Rates of values (n, ...) at each sample, of second order, at the ends of first."""
        rates: Matrix = (self._rate @ values.reshape(len(values), -1)).reshape(values.shape)
        return rates

    def sizes(self, errors: Matrix) -> Matrix:
        """Root mean square and mean absolute error of samples that are told, by channel, (2, c).

        Where a sensor saturates, so does what the model says that it reads; NaN of what is silent.
        """
        readings = np.clip(self.y - errors, *self.limits)
        measured = self.measured[self.reported]
        by_channel = np.where(measured, (self.read - readings)[self.reported] @ self.slopes.T, 0.0)
        counts = np.where(self.silent, np.nan, measured.sum(axis=0))
        sums = np.array([np.square(by_channel).sum(axis=0), np.abs(by_channel).sum(axis=0)])
        return np.array([np.sqrt(sums[0] / counts), sums[1] / counts])

    @cached_property
    def counts(self) -> NDArray[np.int64]:
        """(b, c) samples of each block that a channel has."""
        return counts_in(self.blocks, self.measured)

    @property
    def compared(self) -> Mask:
        """(b, c) blocks in which a channel has samples."""
        return (self.counts > 0) & ~self.silent

    @property
    def restarted(self) -> Mask:
        """(b,) blocks that begin with states as measured."""
        if self.restarts is None:
            return np.zeros(len(self.blocks), np.bool_)
        return self.restarts.at[self.blocks[:, 0]]

    @property
    def corrected(self) -> str:
        """What corrects a simulation along the recording; empty for a free run."""
        leads = self.gain.any() or (self.lead is not None and self.lead.noisy)
        sets = self.restarts is not None and self.restarts.at.any()
        return " and ".join(["measured outputs"] * bool(leads) + ["restarts"] * bool(sets))

    @property
    def free(self) -> "Samples":
        """The same, of which nothing corrects a simulation."""
        return replace(self, gain=np.zeros_like(self.gain), lead=None, restarts=None)

    def loosened(self, moved: Sequence[Matrix], apart: Sequence[Matrix]) -> "Samples":
        """The same with errors that are uncertain by more, apart from each other.

        Parameters
        ----------
        moved : by how much one standard deviation of each cause moves block means, (b, c).
        apart : the same of causes that each channel has by itself.
        """
        inverse = np.linalg.inv(self.whitening)
        covariance = np.einsum("bij,bkj->bik", inverse, inverse)
        for slopes in moved:
            covariance += slopes[:, :, None] * slopes[:, None, :]
        for slopes in apart:
            covariance += slopes[:, :, None] ** 2 * np.eye(slopes.shape[1])
        return replace(self, whitening=np.linalg.inv(np.linalg.cholesky(covariance)))

    @cached_property
    def _means(self) -> list[csr_array]:
        """Means over each block of samples that a channel has, (b, n), by channel."""
        size = self.blocks[:, 1] - self.blocks[:, 0]
        edges = np.append(0, np.cumsum(size))
        columns = np.concatenate([np.arange(first, end) for first, end in self.blocks])
        shape = len(self.blocks), self.time.size
        shares = np.repeat(1.0 / np.maximum(1, self.counts.T), size, axis=1)
        return [
            csr_array((own * has[columns], columns, edges), shape)
            for own, has in zip(shares, self.measured.T, strict=True)
        ]

    def channels(self, errors: Matrix) -> Matrix:
        """Means of prediction errors (n, c, ...) over each block, by channel, (b, c, ...)."""
        flat = errors.reshape(len(errors), -1)
        means = np.array([(mean @ flat).reshape(-1, *errors.shape[1:]) for mean in self._means])
        by_channel: Matrix = np.einsum("cj,cbj...->bc...", self.slopes, means)
        return by_channel

    def whitened(self, errors: Matrix) -> Matrix:
        """Means of errors (n, c, ...) over each block in units of their noise, (b, c, ...)."""
        means: Matrix = np.einsum("bij,bj...->bi...", self.whitening, self.channels(errors))
        return means


def compared(system: System, cases: Sequence[Case]) -> tuple[str, ...]:
    """Signals that are compared: outputs, and what only judges or aids, if a case has it."""
    others = [
        signal.name
        for signal in (*system.reference_signals, *system.intermittent)
        if any(_has(case, signal.name) for case in cases)
    ]
    return (*(output.name for output in system.outputs), *others)


def _has(case: Case, name: str) -> bool:
    """Whether a recording has some samples of a signal."""
    return name in case and not np.isnan(case[name]).all()


def channels(system: System, signals: Sequence[str]) -> tuple[Channel, ...]:
    """Channels that can be formed from some signals."""
    missing = set(system.signals) - set(signals)
    return tuple(
        channel for channel in system.comparison.channels if not channel.formula.names & missing
    )


def prepare(
    case: Case,
    system: System,
    signals: tuple[str, ...],
    model: OpenModel,
    sound: Soundness = SOUND,
    *,
    restarting: bool = True,
) -> Samples:
    """Make a recording ready.

    Parameters
    ----------
    signals : that are compared, see `compared`.
    sound : which samples count.
    restarting : whether samples count where states can be restarted.
    """
    time, h = case.time, float(np.median(np.diff(case.time)))
    own = tuple(name for name in signals if _has(case, name))
    counted = count(case, system, (*case.inputs, *own), sound, restarting=restarting)
    clean, deviation, blocks = counted.clean, counted.deviation, counted.blocks
    formed, own_channels = channels(system, signals), channels(system, own)
    slopes = np.array([signal.formula.slopes(signals, model.fmu.defaults) for signal in formed])
    own_slopes = np.array(
        [signal.formula.slopes(own, model.fmu.defaults) for signal in own_channels]
    )
    gain, lead, ahead = _led(case, system, own, counted, model.motion)
    silent = np.array([signal not in own_channels for signal in formed])
    measured = counted.measured(signals, slopes)
    scales = np.abs(slopes) @ [system.signals[name].scale for name in signals]
    white = whitening(system, counted, own, own_slopes, ahead)
    nothing = np.zeros(time.size)
    # In place of a sample that is missing stands what is bridged, which does not count.
    read = {name: np.where(np.isnan(case[name]), clean[name], case[name]) for name in own}
    driving = [
        smooth(time, clean[signal.name], signal.smoothed, h, sound.held) for signal in system.inputs
    ]
    rest, rest_noise = _at_rest(system.comparison, case, clean, counted.applied)
    start = slice(0, starting(system, h))
    first = {n: first_value(time[start], clean[n][start], deviation[n]) for n in case.outputs}
    begin = _begin(system, first, model.motion)
    modes = {j: m for j, n in enumerate(signals) if (m := system.signals[n].mode) is not None}
    return Samples(
        name=case.name,
        time=time,
        model_time=case.model_time,
        inputs=case.inputs,
        u=np.ascontiguousarray(np.reshape(driving, (len(driving), time.size)).T),
        signals=signals,
        y=np.ascontiguousarray(np.column_stack([clean.get(name, nothing) for name in signals])),
        read=np.column_stack([read.get(name, nothing) for name in signals]),
        silent=silent,
        measured=measured,
        reported=counted.reported,
        limits=np.array([system.signals[name].limits for name in signals]).T,
        gain=gain,
        lead=lead,
        restarts=restarts_of(system, counted),
        holds=system.holds,
        begin={**_shown(case, system, model.fmu, begin), **begin},
        rest=rest,
        rest_noise=rest_noise,
        blocks=blocks,
        slopes=slopes,
        whitening=_beside_silent(white, silent, scales),
        modes=modes,
        set_aside=counted.set_aside,
    )


def _beside_silent(white: NDArray[np.float64], silent: Mask, scales: Vector) -> NDArray[np.float64]:
    """Whitening (b, c, c) of channels that are told, and of silent ones, which have no weight."""
    if not silent.any():
        return white
    beside = np.tile(np.diag(1.0 / (WEIGHTLESS * scales)), (len(white), 1, 1))
    channels_told = np.flatnonzero(~silent)
    beside[:, channels_told[:, None], channels_told] = white
    return beside


def _led(
    case: Case,
    system: System,
    signals: tuple[str, ...],
    counted: CountedSamples,
    motion: Motion | None,
) -> tuple[Vector, Lead | None, NDArray[np.float64]]:
    """Gain of the led output (n,), or how all lead; covariance of what they led, (n, c, c)."""
    time, clean, deviation = case.time, counted.clean, counted.deviation
    h, steps = float(np.median(np.diff(time))), np.diff(time)
    leading = system.comparison.leading
    ahead = np.zeros((time.size, len(signals), len(signals)))
    if motion is None:
        return np.zeros(time.size), None, ahead
    if leading is None:
        inputs, outputs = (noise_of(part, deviation) for part in (case.inputs, case.outputs))
        lead = led_by(motion, inputs, outputs, h)
        predicted = (*case.outputs, *case.aids)
        of, at = np.array(
            [(predicted.index(name), j) for j, name in enumerate(signals) if name in predicted]
        ).T
        ahead[:, at[:, None], at] = lead.ahead[of[:, None], of]
        return np.zeros(time.size), lead, ahead
    effects = effects_on_led(motion, leading.output)
    moved = leading.ripple * np.hypot.reduce(effects * noise_of(case.inputs, deviation))
    # Noise of an input's sample acts until half way to its neighbours.
    acting = 0.5 * (np.append(steps, h) + np.append(h, steps))
    led = clean[leading.output]
    walked, gain = random_walk(
        moved * acting, deviation[leading.output], counted.wrong[leading.output]
    )
    # What moves together is wrong together: its ratio is as sure as before.
    moves = [n in leading.together for n in signals]
    along = np.array([clean[n] @ led for n in signals]) / (led @ led) * moves
    return gain, None, walked[:, None, None] * np.outer(along, along)


def _at_rest(
    compare: Comparison, case: Case, clean: Mapping[str, Vector], applied: int
) -> tuple[Vector, Vector]:
    """Means of inputs while they are steady, (q,), and their standard deviations, (q,).

    A recording that begins while an input acts does not tell what its sensor reads at rest; one in
    which it is released early, or of which nobody says what was asked for, not what it reads held.
    """
    means, deviations = np.zeros(len(compare.rests)), np.full(len(compare.rests), np.inf)
    for q, rest in enumerate(compare.rests):
        values = clean[rest.signal]
        steady = values[:applied]
        if rest.held_from:
            steady = _held(case.time[applied:], values[applied:], rest.held_from)
        known = not rest.by or isinstance(case.conditions.get(rest.by), float)
        if not (known and steady.size > 1 and applied < values.size):
            continue
        means[q] = np.mean(steady)
        spread = float(np.std(steady)) / np.sqrt(steady.size)
        halves = np.array_split(steady, 2) if rest.held_from else [steady]
        drift = np.mean(halves[-1]) - np.mean(halves[0])  # a pressure that is moved is not held
        deviations[q] = np.hypot(np.hypot(spread, rest.zero), drift)
    return means, deviations


def _held(time: Vector, values: Vector, after: float) -> Vector:
    """Values from some time after they rise to half of their greatest one on, until they fall."""
    if not time.size:
        return values
    greatest = values.max()
    fallen = np.maximum.accumulate(values) - values > _RELEASED * greatest
    end = int(np.argmax(fallen)) if fallen.any() else values.size
    applied = time[np.argmax(values > 0.5 * greatest)]
    held: Vector = values[:end][time[:end] >= applied + after]
    return held


def _begin(system: System, measured: dict[str, float], motion: Motion | None) -> dict[str, float]:
    """What is known of states at the start: as measured, but a follower rolls along."""
    if motion is None or system.rolling is None or system.rolling.leader not in measured:
        return measured
    return {**measured, system.rolling.follower: motion.ratio * measured[system.rolling.leader]}


def _shown(case: Case, system: System, fmu: FMU, begin: Mapping[str, float]) -> dict[str, float]:
    """Starts of states of an FMU alone that outputs show under other names.

    How far from there one may begin stays as `with_starts` says: the sensor may err. A library says
    itself how its states begin.
    """
    if system.library.is_file():
        return {}
    given = {**system.given, **system.set_by(case.conditions)}
    own = {name: value for name, value in begin.items() if name in fmu.states}
    u = np.array([case[name][0] for name in case.inputs])
    fmu.begin_at(case.model_time)
    fmu.start(own, {**given, **dict(zip(case.inputs, u, strict=True))})
    shown = shown_states(fmu, without_guesses(system, fmu), u, begin, own)
    return {name: start.value for name, start in shown.items()}


def starting(system: System, h: float) -> int:
    """Samples, h [s] apart, of a first value."""
    return max(1, round(_STARTING * system.sample_time / h))


def standardised(recordings: Sequence[Samples]) -> list[Matrix]:
    """What a law may depend on and should not, in each recording, (n, q).

    Time, inputs and outputs as they were measured, each with the mean zero and the root mean square
    one over all recordings, so that a size is that in the middle.
    """
    columns = [
        np.column_stack([r.time - r.time[0], r.u, np.where(r.silent, np.nan, r.y)])
        for r in recordings
    ]
    every = np.vstack([c[r.reported] for c, r in zip(columns, recordings, strict=True)])
    able = np.nanmax(every, axis=0) > np.nanmin(every, axis=0)
    mean, scale = np.nanmean(every, axis=0)[able], np.nanstd(every, axis=0)[able]
    courses = [np.clip((c[:, able] - mean) / scale, -_REACH, _REACH) for c in columns]
    return [np.nan_to_num(course) for course in courses]
