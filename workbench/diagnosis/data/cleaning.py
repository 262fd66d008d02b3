"""One channel of a recording made clean: faulty samples, noise, and where a signal starts."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter, uniform_filter1d

from workbench.arrays import Vector
from workbench.diagnosis.inference.thresholds import Soundness
from workbench.system.comparison import RATE
from workbench.system.parts import Signal

ALONG = 2.0  # standard deviations, of a line through few samples: noise alone scatters by one
_ABREAST = 11  # samples of the running median
_FEW = 6  # samples; three fourth differences have no median to speak of
# Order of differences: of a swing of 12 samples a period they leave a fiftieth, of a sample beside
# others 20 times what it is off, and 30 standard deviations of noise.
_ORDER = 6
# Share of equal samples, beyond what rounding makes, from which a channel does repeat itself.
_OFTEN = 0.2
# Share of its way out by which a wrong sample comes back at least. What jumps and then decays, as a
# controller's output does, comes back in its first sample by the square of one over the samples of
# its time constant; from three on that is less.
_BACK = 0.1
# Share of the range that no sample reads between two levels, and standard deviations over which
# noise scatters about one: 8.8 in 1e5 samples.
_APART, _WIDE = 0.25, 12.0
# Visits to a level, and steps to others, by sample, from which on that is how a signal goes:
# recorders lose fewer.
_SWITCHED = 0.02
_FOLLOWS = 4  # samples of an input of which second differences of an output follow a jump
_MOVED = 0.5  # of what second differences say: noise comes below in a thousandth of 20 samples
# Steps in a row of another length that are another rate. Of samples lost at random, three in ten,
# steps of three or more have a share of 0.09, so many in a row 5e-7: once in 20 recordings of 1e5.
_RATE = 6

Mask = NDArray[np.bool_]


def saturated(values: Vector, signal: Signal) -> Mask:
    """Where a sensor reads no further."""
    low, high = signal.limits
    mask: Mask = (values <= low) | (values >= high)
    return mask


def outliers(values: Vector, signal: Signal, sound: Soundness, *, flat: bool = False) -> Mask:
    """Isolated wrong samples (Hampel's identifier), repeated ones and a saturated extreme.

    A command is what it is, and what is read in steps repeats itself, unless noise is as large as a
    step. Samples at the limit of a sensor say nothing of the noise of others.

    Parameters
    ----------
    flat : whether an extreme that repeats itself may be right, since saturation is a candidate.
    """
    within = ~(saturated(values, signal) | np.isnan(values))
    wrong = np.zeros(values.size, np.bool_)
    if not signal.exact and within.any():
        wrong[within] = _outliers(values[within], signal, sound, flat=flat)
    return wrong


def _outliers(values: Vector, signal: Signal, sound: Soundness, *, flat: bool) -> Mask:
    # Odd at the ends: there too, the median of what rises or falls is the middle sample.
    beside = _ABREAST // 2
    extended = np.pad(values, beside, mode="reflect", reflect_type="odd")
    away = np.abs(values - median_filter(extended, _ABREAST)[beside:-beside])
    # The wide window knows the noise, the narrow one that a structure rings.
    noise = np.maximum(median_filter(away, 20 * _ABREAST + 1), median_filter(away, 2 * _ABREAST))
    scale = np.maximum(1.4826 * noise, deviation_of(values))
    wrong = _out_and_back(values, away > sound.spike * scale, scale, sound)
    for level in levels_of(values):
        if len(runs(level)) > _SWITCHED * values.size:
            wrong[level] = False
    if _steps(values, sound) > _SWITCHED * values.size:
        for first, end in runs(wrong):
            wrong[first:end] = end - first == 1
    same = np.diff(values) == 0.0
    alike = _alike(signal)
    if same.mean() < min(_OFTEN + alike, 1.0 - alike):
        extremes, stuck = (values.min(), values.max()), sound.stuck
        if alike > 0.0:  # as seldom as a false alarm, by noise that is declared or smaller
            often = max(alike, float(same.mean()))
            stuck = max(stuck, 1 + math.ceil(math.log(RATE / values.size) / math.log(often)))
        for first, end in runs(same):
            if end - first >= stuck - 1 and not (flat and values[first] in extremes):
                wrong[first : end + 1] = True
        for extreme in () if flat else extremes:
            at = values == extreme
            if at.sum() > 2 * stuck and same[at[1:]].mean() > 0.5:
                wrong |= at
    return wrong


def _steps(values: Vector, sound: Soundness) -> int:
    """How often a signal goes to another level in one sample, and stays for two or more.

    As what is set step by step does; a wrong sample goes and comes in two.
    """
    moves = np.abs(np.diff(values))
    large = moves > sound.spike * max(1.4826 * float(np.median(moves)), _rounding(moves))
    return sum(end - first == 1 for first, end in runs(large))


def _alike(signal: Signal) -> float:
    """How often two samples of white noise are rounded to one step; 1 of steps beyond the noise.

    The integral of the squared density, 1/(2 sqrt(pi)) over the standard deviation, times a step.
    """
    if signal.resolution > signal.noise:
        return 1.0
    return signal.resolution / (2.0 * math.sqrt(math.pi) * signal.noise) if signal.noise else 0.0


def _out_and_back(values: Vector, mask: Mask, scale: Vector, sound: Soundness) -> Mask:
    """Of samples off a running median, those that leave the lines on both sides of them.

    A signal that turns fast is off the median too, but comes or goes along a line; or, at the end
    of a swing, along a curve, which differences of high order leave nothing of.
    """
    jump = sound.spike * scale
    padded = np.pad(values, 2, constant_values=np.nan)  # at an end, one side has to do
    before = (values - (2.0 * padded[1:-3] - padded[:-4])) / jump
    after = (values - (2.0 * padded[3:-1] - padded[4:])) / jump
    kept = np.zeros_like(mask)
    for first, end in runs(mask):
        sides = [side for side in (before[first], after[end - 1]) if np.isfinite(side)]
        leaves = min(sides, default=0.0) > 1.0 or max(sides, default=0.0) < -1.0
        leaves = leaves and min(map(abs, sides)) > _BACK * max(map(abs, sides))
        kept[first:end] = (
            leaves and _rough(values, first, end) > sound.held * scale[first:end].min()
        )
    return kept


def _rough(values: Vector, first: int, end: int) -> float:
    """Largest difference of high order about samples, as noise of which size makes it.

    Infinite at an end, of which it hardly depends.
    """
    if first == 0 or end == values.size:
        return np.inf
    near = values[max(first - _ORDER, 0) : end + _ORDER]
    return float(
        np.abs(np.diff(near, _ORDER)).max(initial=0.0) / math.sqrt(math.comb(2 * _ORDER, _ORDER))
    )


def bridge(time: Vector, values: Vector, wrong: Mask) -> Vector:
    """Put a line across what is wrong."""
    return np.interp(time, time[~wrong], values[~wrong]) if wrong.any() else values


def smooth(time: Vector, values: Vector, windows: Sequence[float], h: float, held: float) -> Vector:
    """An input without most of its sensor's noise, and without lag.

    The machine does not feel that noise; fed to a model, any effect that lags or sticks would gain
    by keeping it from the rest. Where the input holds, the mean is taken over longer. Parts that
    are sampled at other rates than each h (`uneven_steps`) are left as they are.
    """
    edges = np.flatnonzero(uneven_steps(time, h)) + 1
    parts = np.split(values, edges)
    return np.concatenate(
        [_smooth_evenly(part, windows, h, held) if part.size > _FEW else part for part in parts]
    )


def uneven_steps(time: Vector, h: float) -> Mask:
    """Which steps are of a part that is sampled at another rate than each h, (n - 1,).

    There, so many steps in a row are more than 2 h, or less than h/2; fewer are gaps.
    """
    steps = np.diff(time)
    uneven: Mask = np.zeros(steps.size, np.bool_)
    for first, end in runs((steps > 2.0 * h) | (steps < 0.5 * h)):
        uneven[first:end] = end - first >= _RATE
    return uneven


def _smooth_evenly(values: Vector, windows: Sequence[float], h: float, held: float) -> Vector:
    from scipy.signal import savgol_filter  # takes its time to load

    best, noise = values, deviation_beside_switching(values)
    for seconds, order in zip(windows, (2, 1), strict=False):
        window = 2 * (round(seconds / h) // 2) + 1
        if order < window <= values.size:
            smooth = savgol_filter(values, window, order)
            moves = maximum_filter1d(np.abs(best - smooth) > held * noise, window)
            weight = uniform_filter1d(moves.astype(np.float64), window)
            best = weight * best + (1.0 - weight) * smooth
            # Of a parabola over n samples, the variance is 9/4 of that of a mean.
            noise *= 1.5 / np.sqrt(window)
    return best


def noise_in(values: Vector, signal: Signal, moving: Sequence[Vector] = ()) -> float:
    """Standard deviation of the noise of a signal's samples; see `deviation_beside_switching`."""
    if signal.exact:
        return 0.0
    shown = deviation_beside_switching(values, moving)
    return max(shown, float(signal.resolution / np.sqrt(12.0)))


def noise_between(values: Vector, gaps: Mask, signal: Signal) -> float:
    """Noise of what is measured at times: what is declared, or more if samples in a row say so.

    Samples apart show motion, and lines between samples, as recorders draw them, less than noise.
    """
    rows = [values[first:end] for first, end in runs(~gaps) if end - first > _FEW]
    shown = noise_in(np.concatenate(rows), signal) if rows else 0.0
    return max(shown, signal.noise_at_scale)


def deviation_of(values: Vector) -> float:
    """Standard deviation of white noise on a slow signal, from its second differences.

    Where the signal is sampled slowly they show its motion too, and fourth differences far less: of
    noise alone, both tell the same. It is no less than that of rounding to the least step that the
    signal makes. Source: T. Gasser, L. Sroka, C. Jennen-Steinmetz (1986), Biometrika 73, 625-633:
    variance by differences.
    """
    return max(_by_differences(np.diff(values, 2)), _rounding(np.abs(np.diff(values))))


def deviation_beside_switching(values: Vector, moving: Sequence[Vector] = ()) -> float:
    """As `deviation_of`, without what a relay switches, where that is most of what it tells.

    Parameters
    ----------
    moving : inputs at the same samples. What follows those that switch is no noise; of others,
        which a controller may set by what it reads, noise itself would go with them.
    """
    differences, left = deviation_of(values), np.diff(values, 2)
    about = max((_about(values[own]) for own in levels_of(values)), default=0.0)
    if 0.0 < about < _MOVED * differences:  # it jumps at most samples
        return about
    switched = [u for u in moving if levels_of(u)]
    if switched and left.size > _FEW * _FOLLOWS * len(switched):
        before = [np.roll(u, late)[2:] for u in switched for late in range(_FOLLOWS)]
        design = np.column_stack([np.ones(left.size), *before])
        rest = left - design @ np.linalg.lstsq(design, left)[0]
        still = max(_by_differences(rest), _rounding(np.diff(np.unique(values))))
        if still < _MOVED * differences:
            return still
    return differences


def levels_of(values: Vector) -> list[Mask]:
    """Samples at each level between which a signal jumps, as of a relay; none if it reads others.

    Each has as many samples as a running median has one of, on average, and scatters like noise;
    a pump that is set to many values leaves such spans free, too, but not so.
    """
    order = np.sort(values)
    edges = np.flatnonzero(np.diff(order) > _APART * np.ptp(order)) + 1
    at = np.searchsorted(order[edges], values, side="right")
    levels = [at == number for number in range(edges.size + 1)]
    jumps = len(levels) > 1 and all(
        own.sum() * _ABREAST >= values.size
        and np.ptp(values[own]) <= _WIDE * _about(values[own])
        and _MOVED * _about(values[own]) <= deviation_of(values[own])
        for own in levels
    )
    return levels if jumps else []


def _by_differences(second: Vector) -> float:
    """Standard deviation of white noise by second differences, or by fourth if that is far less."""
    spread = _scatter(second) / math.sqrt(6.0)
    finer = _scatter(np.diff(second, 2)) / math.sqrt(70.0) if second.size > _FEW - 2 else spread
    return finer if finer < _MOVED * spread else spread


def _rounding(steps: Vector) -> float:
    """Standard deviation of rounding to the least of some steps."""
    quantum = steps[steps > 0.0].min(initial=np.inf)
    return float(quantum / np.sqrt(12.0)) if np.isfinite(quantum) else float(np.finfo(float).tiny)


def _about(level: Vector) -> float:
    """Standard deviation about the median."""
    return _scatter(level - np.median(level))


def _scatter(values: Vector) -> float:
    """Standard deviation of what scatters around zero, whatever a few of them are."""
    return float(1.4826 * np.median(np.abs(values)))


def first_value(time: Vector, values: Vector, noise: float, before: float = 0.0) -> float:
    """Value at the start of a signal: by a line through as many samples as lie along one.

    Parameters
    ----------
    before : time by which the start was before the first sample [s].
    """
    count = time.size
    while count > 2:
        line = np.polynomial.Polynomial.fit(time[:count], values[:count], 1)
        if np.std(values[:count] - line(time[:count])) < ALONG * noise:
            return float(line(time[0] - before))
        count //= 2
    return float(values[0])


def runs(mask: Mask) -> list[tuple[int, int]]:
    """First and end of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
