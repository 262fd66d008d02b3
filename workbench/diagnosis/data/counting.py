"""Which samples of a recording count, and the blocks that they make."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.cleaning import (
    Mask,
    bridge,
    noise_between,
    noise_in,
    outliers,
    runs,
    saturated,
    uneven_steps,
)
from workbench.diagnosis.inference.thresholds import Soundness
from workbench.errors import InputError
from workbench.recordings.case import Case
from workbench.system.comparison import Exclusion
from workbench.system.system import System

# Reasons of every system.
FAULTY, MISSING, BEYOND = "spike, dropout or saturation", "missing", "at the limit of a sensor"
LEADING = "before what counts"
_EARLY = 50  # samples at usual rates, before anything is applied


@dataclass(frozen=True, eq=False)
class CountedSamples:
    """The signals of a recording made clean, and which samples count."""

    clean: Mapping[str, Vector]  # (n,) by signal, bridged where it is wrong
    wrong: Mapping[str, Mask]  # (n,) where
    gaps: Mapping[str, Mask]  # (n,) the same of what is measured at times, or where it is missing
    deviation: Mapping[str, float]  # standard deviation of the noise of a sample, by signal
    excluded: Mapping[str, Mask]  # (n,) samples that do not count, by reason
    spans: Mask  # (n,) samples where states are restarted; if they count, they do for that
    applied: int  # sample at which the recording begins
    blocks: NDArray[np.int64]  # (b, 2) first sample and end of each block that counts
    missing: int  # number of samples

    @property
    def usable(self) -> Mask:
        """(n,) samples that count."""
        usable: Mask = ~np.logical_or.reduce(list(self.excluded.values()))
        return usable

    def measured(self, signals: Sequence[str], slopes: Matrix) -> Mask:
        """(n, c) samples that channels have, which are formed of signals by slopes (c, s)."""
        gaps = [self.gaps.get(name, np.zeros_like(self.spans)) for name in signals]
        measured: Mask = (np.column_stack(gaps) @ np.abs(slopes).T) == 0.0
        return measured

    @property
    def reported(self) -> Mask:
        """(n,) samples whose errors are reported: those at the limit of a sensor, too."""
        others = [mask for why, mask in self.excluded.items() if why not in (FAULTY, BEYOND)]
        reported: Mask = self.usable | (self.excluded[BEYOND] & ~np.logical_or.reduce(others))
        return reported

    @property
    def set_aside(self) -> dict[str, int]:
        """Number of samples by reason."""
        counts = {reason: int(mask.sum()) for reason, mask in self.excluded.items()}
        return {MISSING: self.missing, **counts}


def count(
    case: Case, system: System, names: Sequence[str], sound: Soundness, *, restarting: bool
) -> CountedSamples:
    """Tell which samples of a recording count, by these signals.

    Parameters
    ----------
    restarting : whether samples count where states can be restarted.
    """
    system = system.under(case.conditions)
    compare, time, h = system.comparison, case.time, float(np.median(np.diff(case.time)))
    beyond = {name: saturated(case[name], system.signals[name]) for name in names}
    flat = not system.library.is_file()
    faulty = {name: outliers(case[name], system.signals[name], sound, flat=flat) for name in names}
    wrong = {name: beyond[name] | faulty[name] | np.isnan(case[name]) for name in names}
    clean = {name: bridge(time, case[name], wrong[name]) for name in names}
    # What is measured at times lacks what is wrong with it; all other signals count there.
    gaps = {name: wrong[name] for name in names if name in case.aids}
    others = [name for name in names if name not in gaps]
    applied = applied_at(clean, system, time)
    own = {
        exclusion.reason: excluded_by(exclusion, clean, system, time, h, applied)
        for exclusion in compare.exclusions
    }
    restarted = [own[exclusion.reason] for exclusion in compare.exclusions if exclusion.restarted]
    spans = np.logical_or.reduce(restarted) if restarted else np.zeros(time.size, np.bool_)
    for exclusion in compare.exclusions if restarting else ():
        if exclusion.restarted:
            own[exclusion.reason] = np.zeros(time.size, np.bool_)
    excluded = {
        FAULTY: np.logical_or.reduce([faulty[name] for name in others]),
        BEYOND: np.logical_or.reduce([beyond[name] for name in others]),
        **own,
        LEADING: time < case.counts_from,
        "settling": time < time[0] + compare.settling,
    }
    usable = ~np.logical_or.reduce(list(excluded.values()))
    blocks, seconds = blocks_of(usable, time, compare.block, h)
    refuse_too_short(case, system, seconds, excluded)
    deviation = {}
    for name in others:
        within = ~beyond[name]
        driving = [clean[own][within] for own in case.inputs if name not in case.inputs]
        deviation[name] = noise_in(clean[name][within], system.signals[name], driving)
    deviation |= {n: noise_between(case[n], gap, system.signals[n]) for n, gap in gaps.items()}
    lost = np.maximum(0.0, np.round(np.diff(time) / h) - 1.0)
    missing = int(lost[~uneven_steps(time, h)].sum())
    return CountedSamples(clean, wrong, gaps, deviation, excluded, spans, applied, blocks, missing)


def refuse_too_few(cases: Sequence[Case], system: System, held_out: int = 0) -> None:
    """Refuse recordings of which none can be predicted by a fit to others.

    Parameters
    ----------
    held_out : number of recordings beside, to which nothing is fitted.
    """
    compare = system.comparison
    if not cases or (len(cases) == 1 and (compare.tolerances or compare.begins is not None)):
        why = (
            f"differences within [diagnosis.tolerances] ({', '.join(compare.tolerances)}) look the "
            "same as an effect in one"
            if compare.tolerances
            else "an effect is scored on those it was not fitted to"
        )
        raise InputError(
            where="recordings",
            found=f"{len(cases)} to fit" + f", beside {held_out} held out" * bool(held_out),
            expected=f"two or more to fit, because {why}",
            remedy="hold out one fewer"
            if held_out > 1
            else "give the folder that holds all recordings of one machine",
        )


def refuse_too_short(
    case: Case, system: System, seconds: float, excluded: Mapping[str, Mask]
) -> None:
    """Refuse a recording with too little that counts.

    Raises
    ------
    InputError
        With what was set aside, by reason.
    """
    compare = system.comparison
    if seconds < compare.least * (1.0 - 1e-9):
        lost = ", ".join(f"{reason}: {mask.sum()}" for reason, mask in excluded.items())
        raise InputError(
            where=str(case.source),
            found=f"{seconds:.3g} s are compared; excluded samples: {lost}",
            expected=f"{compare.least:g} s or more, because less does not tell noise from cause",
            remedy="leave this recording out, or repair it; a short one that is whole needs "
            "shorter blocks, [diagnosis] block in the system file",
        )


def applied_at(clean: Mapping[str, Vector], system: System, time: Vector) -> int:
    """Sample at which the recording begins; before it the machine is as it was left."""
    early = max(2, int(np.searchsorted(time, time[0] + _EARLY * system.sample_time)))
    if (begins := system.comparison.begins) is None:
        return early
    values = system.signal(begins.signal, clean)
    rising = values > np.median(values[:early]) + begins.level
    return max(early, int(np.argmax(rising)) - early if rising.any() else values.size)


def excluded_by(
    exclusion: Exclusion,
    clean: Mapping[str, Vector],
    system: System,
    time: Vector,
    h: float,
    rest: int,
) -> Mask:
    """Where samples do not count for one reason."""
    width = max(1, round(exclusion.smoothed / h))
    values = np.convolve(system.evaluate(exclusion.formula, clean), np.ones(width) / width, "same")
    if exclusion.from_rest:
        values = values - np.median(values[:rest])
    mask: Mask = (np.abs(values) > exclusion.above) | (np.abs(values) < exclusion.below)
    if exclusion.only_while is not None:
        signal = np.abs(system.signal(exclusion.only_while.signal, clean))
        mask &= signal > exclusion.only_while.level
    # A mean at an end is one of zeros too.
    mask[: width + 1] = False
    if exclusion.to_the_end:
        mask = np.cumsum(mask) > 0
    else:
        mask[time.size - width :] = False
    if exclusion.within:
        around = np.ones(max(1, round(2.0 * exclusion.within / h)))
        mask = np.convolve(mask, around, "same") > 0.5
    return mask


def blocks_of(
    usable: Mask, time: Vector, block: float, h: float
) -> tuple[NDArray[np.int64], float]:
    """First sample and end of each block of samples that count, (b, 2); and seconds in all of them.

    Where samples are h apart, a block holds as many of them as make its time, and one with a gap is
    none. Where a recorder samples at another rate (`uneven_steps`), a block holds the samples of
    its time, be it one, which stands for the time to the next.
    """
    size = max(1, round(block / h))
    uneven = np.append(uneven_steps(time, h), False)
    blocks: list[tuple[int, int]] = []
    seconds = 0.0
    for first, end in runs(usable):
        k = first
        while k < end:
            if not uneven[k : k + max(1, size - 1)].any():
                whole = k + size <= end and time[k + size - 1] - time[k] < 2.0 * max(block, h)
                if whole:
                    blocks.append((k, k + size))
                    seconds += block
                k += size
                continue
            # The first sample at the end of this block's time, within rounding of times.
            after = max(k + 1, int(np.searchsorted(time, time[k] + block * (1.0 - 1e-9))))
            if after <= min(end, time.size - 1):
                blocks.append((k, after))
                seconds += float(time[after] - time[k])
            k = after
    return np.array(blocks, dtype=np.int64).reshape(-1, 2), seconds


def counts_in(blocks: NDArray[np.int64], mask: Mask) -> NDArray[np.int64]:
    """Samples of each block (b, 2) where a mask (n, c) holds, (b, c)."""
    total = np.zeros((len(mask) + 1, mask.shape[1]), np.int64)
    np.cumsum(mask, axis=0, out=total[1:])
    counts: NDArray[np.int64] = total[blocks[:, 1]] - total[blocks[:, 0]]
    return counts
