"""Errors of estimates against the truth of the virtual rig: by stop, and the worst.

The truth is what no sensor reads and no estimator sees; the rig writes it beside each recording.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv

from workbench.arrays import Vector
from workbench.machines.wheelset.truth import BUILT_UP, Truth, lowest_speed, rolling_speed
from workbench.observers import Estimator
from workbench.observers.replay import SURE, replay
from workbench.observers.run import Ending, Run
from workbench.observers.score import judged_window, low_pass
from workbench.recordings.case import Case, sign
from workbench.system.system import System
from workbench.system.units import BAND

INNOVATIONS = "innovations"  # whose band is that of their normalised square, by chi-squared
COVERED = ("Fx", "slip", "omegaW", "omegaR", "muDC", "muWR", INNOVATIONS)  # where there is a band
# Share of the force: twice what noise of the sensors makes of an estimate below 5 Hz.
NOISE = 0.03

_BUILDING_UP = 2.0  # [s] after the first contact
_SLIDING = 0.02  # creepage [1]; a wheel that keeps its grip stays below half of it
_SLIDE = 4.0  # [s] by then wheel-slide protection has ended it, or the wheel is locked
_BEFORE_FALL = 0.1  # [s] the force is not falling yet
_FALL = 2.0  # [s]
_AVERAGED = 0.05  # [s] longer than a period of the rig's structure, 15..35 Hz
_RANKS = np.linspace(0.0, 1.0, 1001)  # a share of 95 % to a twentieth of it


@dataclass(frozen=True, eq=False)
class BandCoverage:
    """Coverage of the band of a quantity in a stop."""

    share: float  # of samples in which it holds the truth
    errors: Vector  # (r,) quantiles of the errors over the reach of the band, from least to largest


def held_by_bands(stop: "KnownStop", name: str) -> dict[str, BandCoverage]:
    """Coverage by an estimator's bands of samples that are scored and valid, by quantity."""
    run, bands = stop.runs[name], {}
    window = np.zeros(stop.case.time.size, bool)
    window[judged_window(stop.case, stop.system)] = True
    for quantity in COVERED:
        valid = window & run.claimed.get(quantity, True)
        if quantity == INNOVATIONS:
            reach = np.full(valid.sum(), 2.0 * gammaincinv(0.5 * len(stop.system.outputs), SURE))
            errors = run.nis[valid]
        else:
            reach = BAND * run.deviation(quantity)[valid]
            errors = np.abs(run.signal(quantity) - getattr(stop.truth, quantity))[valid]
        if (reach > 0.0).any() and np.isfinite(errors + reach).all():
            shares = errors / reach
            bands[quantity] = BandCoverage(
                float(np.mean(shares < 1.0)), np.quantile(shares, _RANKS)
            )
    return bands


def covered(
    stops: Sequence["StopAccuracy"], name: str, quantity: str, *, least: bool = False
) -> float | None:
    """Share of samples in which bands of an estimator hold a quantity: mean of the stops, or least.

    In a stop whose share is low the filter is overconfident, which a mean may hide.
    """
    shares = [stop.share for stop in _of_stops(stops, name, quantity)]
    return float(np.min(shares) if least else np.mean(shares)) if shares else None


def needed(stops: Sequence["StopAccuracy"], name: str, quantity: str) -> float | None:
    """What the band of a quantity must be multiplied by to hold 95 %; None where it has none.

    A band that holds the stated share of samples with known truth holds it of others that are like
    them, whatever the distribution of errors. Source: J. Lei et al. (2018), Distribution-free
    predictive inference for regression, J. Amer. Stat. Assoc. 113, 1094-1111, section 5.2 (errors
    over an estimate of their scatter). Each stop counts alike.
    """
    errors = [stop.errors for stop in _of_stops(stops, name, quantity)]
    return float(np.quantile(np.concatenate(errors), SURE)) if errors else None


def needed_bands(stops: Sequence["StopAccuracy"]) -> dict[str, dict[str, float]]:
    """What bands must be multiplied by, by estimator and quantity that the stops have."""
    factors: dict[str, dict[str, float]] = {}
    for name in stops[0].estimators:
        known = {q: needed(stops, name, q) for q in COVERED if q != INNOVATIONS}
        factors[name] = {q: factor for q, factor in known.items() if factor is not None}
    return {name: factor for name, factor in factors.items() if factor}


def _of_stops(stops: Sequence["StopAccuracy"], name: str, quantity: str) -> list[BandCoverage]:
    bands: list[Mapping[str, BandCoverage]] = [stop.estimators[name].bands for stop in stops]
    return [band[quantity] for band in bands if quantity in band]


@dataclass(frozen=True, eq=False)
class KnownStop:
    """A stop whose truth is known, and the runs of estimators on it."""

    case: Case
    truth: Truth
    runs: Mapping[str, Run]  # by the name of the estimator
    system: System  # whose estimators they are

    def between(self, begin: float, end: float) -> NDArray[np.bool_]:
        """Samples between two times [s] after the first contact, (n,)."""
        since = self.case.time - self.truth.contact
        return (since >= begin) & (since < end)

    def force(self, name: str) -> Vector:
        """Estimated force [N], (n,), positive if it brakes."""
        return sign(self.case, self.system) * self.runs[name].signal("Fx")

    @property
    def true_force(self) -> Vector:
        """True force [N], (n,), positive if it brakes."""
        return sign(self.case, self.system) * self.truth.Fx

    def force_error(self, name: str) -> Vector:
        """Estimated minus true force below 5 Hz [N], (n,), positive if it is too large."""
        return self.smooth(self.force(name) - self.true_force)

    def smooth(self, signal: Vector) -> Vector:
        """The part of a signal that counts, below 5 Hz, (n,)."""
        return low_pass(self.case.time, signal, self.system.objective.bandwidth)

    @property
    def slide(self) -> NDArray[np.bool_]:
        """Samples in which the wheel slides for the first time, (n,); none if it never does."""
        speed = rolling_speed(self.system, self.truth.omegaR)
        slip = sign(self.case, self.system) * self.truth.slip
        sliding = (slip > _SLIDING * speed) & (speed > lowest_speed(self.system))
        begin = float(self.case.time[np.argmax(sliding)])
        return np.logical_and(sliding, self.case.time < begin + _SLIDE)

    def around_slide(self, before: float, after: float) -> NDArray[np.bool_]:
        """Samples from a time before the slide begins to one after that [s], (n,)."""
        since = self.case.time - float(self.case.time[np.argmax(self.slide)])
        return (since >= -before) & (since < after)


def _quantity(unit: str, text: str) -> Any:
    return field(default=None, metadata={"unit": unit, "text": text})


@dataclass(frozen=True)
class Accuracy:
    """Errors of one estimator in one stop; None where there is nothing to judge.

    Attributes
    ----------
    failure : why the estimator did not run to the end; empty if it did.
    force .. muWR : see their metadata; infinite if a delay never ends.
    bands : what 95 % bands hold from first pressure to 1 m/s, by quantity that has one.
    """

    failure: str = ""
    force: float | None = _quantity(
        "1", "error of the force, rms over mean, from first pressure to 1 m/s, below 5 Hz"
    )
    force_in_slide: float | None = _quantity(
        "1", "error of the force, rms over mean, inside the slide, below 5 Hz"
    )
    force_in_slide_all_frequencies: float | None = _quantity(
        "1", "error of the force, rms over mean, inside the slide, ringing included"
    )
    minimum_in_slide: float | None = _quantity(
        "1", "lowest estimated over lowest true force of the slide, minus 1, below 5 Hz"
    )
    rise_delay: float | None = _quantity(
        "s", "delay at nine tenths of the force that is reached 2 s after the first pad contact"
    )
    fall_delay: float | None = _quantity(
        "s", "delay at nine tenths of the fall of the force in the slide"
    )
    contact_too_high: float | None = _quantity(
        "1",
        "how far the force is too high within 2 s of the first pad contact, over the force "
        "that is building up, below 5 Hz",
    )
    contact_too_low: float | None = _quantity(
        "1",
        "how far the force is too low within 2 s of the first pad contact, over the force "
        "that is building up, below 5 Hz",
    )
    oscillation: float | None = _quantity(
        "1", "the smaller of contact_too_high and contact_too_low, 0 for an error to one side"
    )
    muDC: float | None = _quantity(
        "1",
        "largest error of the pads' friction, from 1 s after the first pad contact to 1 m/s, "
        "below 5 Hz",
    )
    muWR: float | None = _quantity(
        "1", "error of muWR over the truth, below which 95 % of the samples stay that claim it"
    )
    bands: Mapping[str, BandCoverage] = field(default_factory=dict)


@dataclass(frozen=True)
class StopAccuracy:
    """Errors of all estimators in one stop."""

    # name, title: of the case
    name: str
    title: str
    wet: bool  # whether a disc was wet
    slides: bool  # whether the truth has a slide
    estimators: Mapping[str, Accuracy]  # by name


@dataclass(frozen=True)
class Row:
    """A quantity, and the stops of which the worst counts."""

    text: str
    quantity: str  # field of Accuracy
    # wet, slides: what must be so of a stop; None if either will do
    wet: bool | None = None
    slides: bool | None = None
    # of two values the one for which it is larger is worse
    badness: Callable[[float], float] = float

    def concerns(self, stop: StopAccuracy) -> bool:
        """Whether a stop counts."""
        return self.wet in (None, stop.wet) and self.slides in (None, stop.slides)


ROWS = (
    Row("force, dry discs", "force", wet=False, slides=False),
    Row("force, wet discs", "force", wet=True, slides=False),
    Row("force, stop with a slide", "force", slides=True),
    Row("force, inside the slide", "force_in_slide"),
    Row("its minimum in the slide", "minimum_in_slide", badness=abs),
    Row("delay at 90 % of the force", "rise_delay"),
    Row("oscillation at first pad contact", "oscillation"),
    Row("muDC, dry discs", "muDC", wet=False),
    Row("muDC, wet discs", "muDC", wet=True),
    Row("muWR, 95 % of valid samples", "muWR"),
)


@dataclass(frozen=True)
class Worst:
    """The worst value of a row; NaN if an estimator failed in this stop."""

    stop: str
    value: float


def observe_stop(
    case: Case, truth: Truth, estimators: Sequence[Estimator], system: System
) -> KnownStop:
    """Run estimators on a recording whose truth is known."""
    runs = {estimator.name: replay(case, estimator) for estimator in estimators}
    return KnownStop(case, truth, runs, system)


def stop_accuracy(stop: KnownStop) -> StopAccuracy:
    """All quantities of all estimators in one stop."""
    return StopAccuracy(
        name=stop.case.name,
        title=stop.case.title,
        wet="wet" in np.atleast_1d(stop.case.conditions["discs"]),
        slides=bool(stop.slide.any()),
        estimators={name: accuracy(stop, name) for name in stop.runs},
    )


def accuracy(stop: KnownStop, name: str) -> Accuracy:
    """All quantities of one estimator in one stop."""
    run = stop.runs[name]
    if run.ending is not Ending.OK:
        return Accuracy(failure=f"{run.ending.value} {run.message}".strip())
    slides = bool(stop.slide.any())
    too_high, too_low = contact_errors(stop, name)
    # A friction that never moves, as that of the nominal model, is no estimate.
    estimated = bool(np.ptp(run.signal("muDC")) > 0.0)
    in_slide: dict[str, Any] = {}
    if slides:
        in_slide = {
            "force_in_slide": slide_error(stop, name),
            "force_in_slide_all_frequencies": slide_error(stop, name, all_frequencies=True),
            "minimum_in_slide": minimum_error(stop, name),
            "fall_delay": fall_delay(stop, name),
        }
    return Accuracy(
        force=force_error(stop, name),
        rise_delay=rise_delay(stop, name),
        contact_too_high=too_high,
        contact_too_low=too_low,
        oscillation=max(0.0, min(too_high, too_low)),
        muDC=friction_error(stop, name) if estimated else None,
        muWR=rail_error(stop, name),
        bands=held_by_bands(stop, name),
        **in_slide,
    )


def force_error(stop: KnownStop, name: str) -> float:
    """Error of the force below 5 Hz, rms over mean, from first pressure to 1 m/s [1]."""
    window = judged_window(stop.case, stop.system)
    return _rms(stop.force_error(name)[window]) / float(np.abs(stop.truth.Fx[window]).mean())


def slide_error(stop: KnownStop, name: str, *, all_frequencies: bool = False) -> float:
    """Error of the force, rms over mean, inside the slide [1]; below 5 Hz, or with ringing."""
    error = stop.force(name) - stop.true_force if all_frequencies else stop.force_error(name)
    return _rms(error[stop.slide]) / float(stop.smooth(stop.true_force)[stop.slide].mean())


def _rms(values: Vector) -> float:
    return float(np.sqrt(np.mean(values**2)))


def minimum_error(stop: KnownStop, name: str) -> float:
    """Lowest estimated over lowest true force of the slide below 5 Hz, minus 1 [1]."""
    around = stop.around_slide(0.5, _SLIDE)
    true = stop.smooth(stop.true_force)
    estimated = true + stop.force_error(name)
    return float(estimated[around].min() / true[around].min()) - 1.0


def rise_delay(stop: KnownStop, name: str) -> float:
    """Delay at nine tenths of the force that is reached 2 s after the first contact [s]."""
    level = 0.9 * float(stop.true_force[stop.between(1.9, 2.1)].mean())
    return _delay(stop, name, level, stop.truth.contact)


def fall_delay(stop: KnownStop, name: str) -> float:
    """Delay at nine tenths of the fall of the force in the slide [s]."""
    falling = stop.around_slide(_BEFORE_FALL, _FALL - _BEFORE_FALL)
    high, low = float(stop.true_force[falling][0]), float(stop.true_force[falling].min())
    return _delay(stop, name, high - 0.9 * (high - low), float(stop.case.time[falling][0]))


def _delay(stop: KnownStop, name: str, level: float, begin: float) -> float:
    """Time [s] by which an estimate reaches a force [N] later than the truth; inf if never."""
    late = arrival(stop.case.time, stop.force(name), level, begin)
    return late - arrival(stop.case.time, stop.true_force, level, begin)


def arrival(time: Vector, force: Vector, level: float, begin: float) -> float:
    """Time [s] from `begin` at which the mean of 50 ms up to now crosses a level; inf if never.

    Parameters
    ----------
    time, force : (n,) [s], [N].

    Examples
    --------
    >>> time = np.arange(0.0, 1.0, 0.005)
    >>> round(arrival(time, np.where(time < 0.3, 0.0, 100.0), 45.0, 0.1), 3)
    0.22
    >>> arrival(time, np.zeros(time.size), 45.0, 0.1)
    inf
    """
    count = max(1, round(_AVERAGED / float(np.median(np.diff(time)))))
    recent = np.convolve(force, np.full(count, 1.0 / count))[: force.size]
    after = time >= begin
    crossed = after & ((recent > level) != (recent[after][0] > level))
    return float(time[crossed][0] - begin) if crossed.any() else math.inf


def contact_errors(stop: KnownStop, name: str) -> tuple[float, float]:
    """How far the force is too high and too low within 2 s of the first contact [1].

    As shares of the force that is being built up, below 5 Hz. An error to both sides is an
    oscillation; to one side it is none: of wet discs an observer learns only as they are pressed.
    """
    error = stop.force_error(name)[stop.between(0.0, _BUILDING_UP)]
    force = np.abs(stop.truth.Fx[stop.between(*BUILT_UP)]).mean()
    return float(error.max() / force), float(-error.min() / force)


def friction_error(stop: KnownStop, name: str) -> float:
    """Largest error of the pads' friction below 5 Hz, from 1 s after the first contact to 1 m/s."""
    error = stop.smooth(stop.runs[name].signal("muDC") - stop.truth.muDC)
    moving = rolling_speed(stop.system, stop.case["omegaR"]) > lowest_speed(stop.system)
    return float(np.abs(error[stop.between(1.0, np.inf) & moving]).max())


def rail_error(stop: KnownStop, name: str) -> float | None:
    """Error of muWR over the truth, which 95 % of the valid samples stay below; None without."""
    valid = stop.runs[name].claimed.get("muWR")
    if valid is None or not valid.any():
        return None
    error = stop.runs[name].signal("muWR") / stop.truth.muWR - 1.0
    return float(np.quantile(np.abs(error[valid]), SURE))


def worst(row: Row, stops: Sequence[StopAccuracy], estimator: str) -> Worst | None:
    """The worst value of an estimator over the stops that a row concerns; None if it has none."""
    worst_stop: Worst | None = None
    for stop in stops:
        result = stop.estimators[estimator]
        if not row.concerns(stop):
            continue
        if result.failure:
            return Worst(stop.name, math.nan)
        value = getattr(result, row.quantity)
        if value is not None and (
            worst_stop is None or row.badness(value) > row.badness(worst_stop.value)
        ):
            worst_stop = Worst(stop.name, value)
    return worst_stop
