"""Which samples of a recording count, and the blocks that they make."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Vector
from workbench.diagnosis.data.cleaning import Mask, bridge, noise_in, outliers, runs, saturated
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
    """The signals of a recording made clean, and which samples count.

    Attributes
    ----------
    clean : (n,) by signal, bridged where it is wrong; wrong : (n,) where.
    deviation : standard deviation of the noise of a sample, by signal.
    excluded : (n,) samples that do not count, by reason.
    spans : (n,) samples where states are restarted; if they count, they do for that.
    applied : sample at which the recording begins.
    blocks : (b, 2) first sample and end of each block that counts.
    missing : number of samples.
    """

    clean: Mapping[str, Vector]
    wrong: Mapping[str, Mask]
    deviation: Mapping[str, float]
    excluded: Mapping[str, Mask]
    spans: Mask
    applied: int
    blocks: NDArray[np.int64]
    missing: int

    @property
    def usable(self) -> Mask:
        """(n,) samples that count."""
        usable: Mask = ~np.logical_or.reduce(list(self.excluded.values()))
        return usable

    @property
    def told(self) -> Mask:
        """(n,) samples whose errors are told: those at the limit of a sensor, too."""
        others = [mask for why, mask in self.excluded.items() if why not in (FAULTY, BEYOND)]
        told: Mask = self.usable | (self.excluded[BEYOND] & ~np.logical_or.reduce(others))
        return told

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

    Raises
    ------
    InputError
        If too few do.
    """
    system = system.under(case.conditions)
    compare, time, h = system.comparison, case.time, float(np.median(np.diff(case.time)))
    beyond = {name: saturated(case[name], system.signals[name]) for name in names}
    faulty = {name: outliers(case[name], system.signals[name], sound) for name in names}
    wrong = {name: beyond[name] | faulty[name] for name in names}
    clean = {name: bridge(time, case[name], wrong[name]) for name in names}
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
        FAULTY: np.logical_or.reduce(list(faulty.values())),
        BEYOND: np.logical_or.reduce(list(beyond.values())),
        **own,
        LEADING: time < case.counts_from,
        "settling": time < time[0] + compare.settling,
    }
    blocks = blocks_of(~np.logical_or.reduce(list(excluded.values())), time, compare.block, h)
    refuse_too_short(case, system, blocks, excluded)
    deviation = {n: noise_in(clean[n][~beyond[n]], system.signals[n]) for n in names}
    missing = int(np.sum(np.maximum(0, np.round(np.diff(time) / h) - 1)))
    return CountedSamples(clean, wrong, deviation, excluded, spans, applied, blocks, missing)


def refuse_too_few(cases: Sequence[Case], system: System) -> None:
    """Refuse recordings of which none can be held out.

    Raises
    ------
    InputError
        If there is only one, and parameters differ from recording to recording.
    """
    compare = system.comparison
    if not cases or (len(cases) == 1 and (compare.tolerances or compare.begins is not None)):
        raise InputError(
            where="recordings",
            found=str(len(cases)),
            expected="two or more, because a cause is judged on those it was not fitted to",
            remedy="give the folder that holds all recordings of one machine",
        )


def refuse_too_short(
    case: Case, system: System, blocks: NDArray[np.int64], excluded: Mapping[str, Mask]
) -> None:
    """Refuse a recording with too little that counts.

    Raises
    ------
    InputError
        With what was set aside, by reason.
    """
    compare = system.comparison
    if len(blocks) * compare.block < compare.least * (1.0 - 1e-9):
        lost = ", ".join(f"{reason}: {mask.sum()}" for reason, mask in excluded.items())
        raise InputError(
            where=str(case.source),
            found=f"{compare.block * len(blocks):.3g} s that count; samples set aside: {lost}",
            expected=f"{compare.least:g} s or more, because less does not tell noise from cause",
            remedy="leave this recording out, or repair it",
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


def blocks_of(usable: Mask, time: Vector, block: float, h: float) -> NDArray[np.int64]:
    """First sample and end of each block of samples that count, without a gap, (b, 2)."""
    size = max(1, round(block / h))
    found = [
        (k, k + size)
        for first, end in runs(usable)
        for k in range(first, end - size + 1, size)
        if time[k + size - 1] - time[k] < 2.0 * max(block, h)
    ]
    return np.array(found, dtype=np.int64).reshape(-1, 2)
