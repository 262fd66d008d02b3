"""Causes that were found: how large each is, how sure that is, and what looks like it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from workbench.arrays import Vector
from workbench.diagnosis.effects.candidates import LAG, SHARES
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.inference.discrepancy import (
    correlated_deviations,
    hidden_by_noise,
    share_by_form,
)
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.search import (
    BEGUN,
    FittedModel,
    beyond,
    differentiable,
    extended,
    fitted,
    misfits,
    reduced_to,
)
from workbench.diagnosis.inference.selection import Selection
from workbench.system.units import BAND, with_interval, with_unit

_FORM, _COMPANY = 0.005, 0.1  # shares of a value, and of the size that matters


@dataclass(frozen=True)
class Interval:
    """An estimate with its 95 % interval, in `unit`."""

    value: float
    # low, high: ends; infinite to the side of a bound at which the fit stopped, but for a bound
    # that nature sets
    low: float
    high: float
    unit: str
    limit: str = ""  # that bound, "least" or "greatest": then the value is no estimate
    # where a fit ends that may pass the bound and leaves clearly less; NaN if none does
    beyond: float = np.nan
    alone: bool = False  # whether that fit needs no other cause
    plain: bool = False  # whether it is a number in a unit that nobody states, and no share

    @property
    def text(self) -> str:
        """For people."""
        if not self.limit:
            return with_interval(self.value, self.low, self.high, self._spoken)
        value = with_unit(self.value, self._spoken)
        return f"at its limit of {value}, which is no estimate: {self.better}"

    @property
    def better(self) -> str:
        """What is known of values beyond the limit."""
        if np.isfinite(self.beyond):
            alone = ", alone" * self.alone
            return f"{with_unit(self.beyond, self._spoken)}, beyond it, fits better{alone}"
        more = "smaller" if self.limit == "least" else "larger"
        return f"{more} may fit better" if self.open else f"nothing is {more}"

    @property
    def _spoken(self) -> str:
        return "" if self.plain else self.unit

    @property
    def holds_zero(self) -> bool:
        """Whether it may be nothing at all.

        >>> Interval(2.03, 0.0, 9.83, "1/s").holds_zero, Interval(0.4, 0.2, 0.6, "N").holds_zero
        (True, False)
        """
        return self.low <= 0.0 <= self.high

    @property
    def open(self) -> bool:
        """Whether there may be values beyond the limit."""
        return not (np.isfinite(self.low) and np.isfinite(self.high))

    def to_dict(self) -> dict[str, float | str | None]:
        """As plain numbers and texts; None of an end that is open."""
        ends = {"value": self.value, "low": self.low, "high": self.high, "beyond": self.beyond}
        numbers = {name: end if np.isfinite(end) else None for name, end in ends.items()}
        return {**numbers, "unit": self.unit, "limit": self.limit, "text": self.text}


@dataclass(frozen=True, eq=False)
class Cause:
    """One effect that was found."""

    effect: Effect
    parameters: Mapping[str, Interval]  # by name
    confusable_with: tuple[str, ...]  # names of effects that explain these data as well
    explained: float  # share of the explainable that this effect explains on held-out stops
    phases: Vector | None  # (K,) [rad] in each stop, of an order-locked effect, else None

    @property
    def may_be_zero(self) -> bool:
        """Whether its size may be none, by the interval."""
        return self.parameters[self.effect.label].holds_zero


def strongest_first(fit: Fit, chosen: Selection, catalogue: Sequence[Effect]) -> Sequence[Effect]:
    """Causes by what each leaves when it alone is fitted, roughly; of equals the usual one."""
    causes = chosen.best.active
    if len(causes) < 2:
        return causes
    first = chosen.steps[0]
    alone = {rival.active[-1]: rival for rival in first.rivals if first.before is chosen.base}
    scores = [score for step in chosen.steps for score in step.scores]
    best = {score.effect: score for score in reversed(scores)}  # of its shapes
    begun = [best[effect] for effect in causes if effect in best and effect not in alone]
    fits = fit.together(partial(extended, fit, chosen.base, rounds=BEGUN), begun)
    alone |= {fit.active[-1]: fit for fit in fits if fit is not None}
    left = dict(zip(alone, misfits(list(alone.values())), strict=True))
    ordered = list[Effect]()
    while waiting := [effect for effect in causes if effect not in ordered]:
        least = min(left.get(effect, np.inf) for effect in waiting)
        equals = [other for other in waiting if left.get(other, np.inf) <= least + fit.decides.tied]
        ordered.append(min(equals, key=catalogue.index))
    return ordered


def cause_of(
    fit: Fit, chosen: Selection, effect: Effect, *, noise_alone: bool, whole: bool
) -> Cause:
    """A cause with intervals, which what is left widens, or the form that noise may hide."""
    best, trial, less = chosen.best, chosen.trial, chosen.less[effect]
    moved = trial.moved(chosen.twins[effect])
    sigma = np.hypot(np.sqrt(np.diag(trial.covariance())), moved)
    fast, form_share = chosen.validation.fast(less, best), _FORM
    if noise_alone:
        more = hidden_by_noise(fit, best, effect)
    else:
        left, explained = chosen.validation.where_acting(less, best, fast=fast, whole=whole)
        form_share = max(_FORM, share_by_form(left, explained))
        more = correlated_deviations(fit, best)
    parameters = {}
    for key, value in best.point.sizes.items():
        if key[0] != effect.name:
            continue
        # Beside the noise: forms of laws that differ in detail, and immaterial companions.
        of_size = key[1] == effect.label
        share = form_share if of_size else _FORM
        form = np.hypot(share * value, _COMPANY * effect.matters * of_size)
        noise = np.hypot(sigma[trial.joint.known.index(key)], more.get(key, 0.0))
        reach = float(BAND * np.hypot(noise, form))
        parameters[key[1]] = _interval(fit, best, effect, key[1], reach)
    alike = [*chosen.twins[effect], *_apart_by_starts(fit, effect)]
    return Cause(
        effect=effect,
        parameters=parameters,
        confusable_with=tuple(dict.fromkeys(alike)),
        explained=chosen.validation.explained(less, best, fast=fast)[0],
        phases=best.point.phases.get(effect.name),
    )


def _interval(fit: Fit, best: FittedModel, effect: Effect, label: str, reach: float) -> Interval:
    """A value with as much to either side, where a bound does not end it."""
    value = best.point.sizes[effect.name, label]
    parameter = effect.size if label == effect.label else label
    low, high = fit.unknowns.bounds(effect, parameter)
    limit = binding_bound(fit, best, effect, label)
    unit = fit.unknowns.unit(effect, parameter)
    # A parameter or a zero without a unit may be of any size: 2 is not 200 % of anything.
    own = bool(effect.parameter or effect.sensor) and label not in SHARES
    plain = own and unit in ("", "1")
    least, greatest = max(value - reach, low), min(value + reach, high)
    further = (np.nan, False)
    # A value at a bound says nothing of the side beyond.
    if limit and not set_by_nature(value, "" if plain else unit):
        least = -np.inf if limit == "least" else least
        greatest = np.inf if limit == "greatest" else greatest
        further = _passed(fit, best, effect, label, limit)
    return Interval(value, float(least), float(greatest), unit, limit, *further, plain=plain)


def _passed(
    fit: Fit, best: FittedModel, effect: Effect, label: str, limit: str
) -> tuple[float, bool]:
    """Where a fit ends that may pass a bound, and whether it needs no other cause; NaN: no better.

    Beside a cause that is held at its bound, others stand for the rest of it.
    """
    key = (effect.name, label)
    other = fit.opened(effect, effect.size if label == effect.label else label, limit)
    start = replace(best.linearised, settled=False)
    wide = differentiable(partial(fitted, other, start, best.active))
    if wide is None or beyond(best, wide) < fit.decides.fall:
        return np.nan, False
    if len(best.active) > 1 and (begun := other.tried(reduced_to(best, effect))) is not None:
        alone = differentiable(partial(fitted, other, begun, (effect,)))
        if alone is not None and beyond(alone, wide) < fit.decides.form:
            return float(alone.point.sizes[key]), True
    return float(wide.point.sizes[key]), False


def binding_bound(fit: Fit, best: FittedModel, effect: Effect, label: str) -> str:
    """The bound at which a fit stopped, "least" or "greatest"; empty within them."""
    value = best.point.sizes[effect.name, label]
    low, high = fit.unknowns.bounds(effect, effect.size if label == effect.label else label)
    return "least" if value <= low else "greatest" if value >= high else ""


def set_by_nature(value: float, unit: str) -> bool:
    """Whether a bound is a sign, or the whole of a share, beyond which there is nothing."""
    return value == 0.0 or (unit == "1" and abs(value) == 1.0)


def _apart_by_starts(fit: Fit, effect: Effect) -> list[str]:
    """Lags that differ in how a recording begins alone: of the one input, and the one output.

    A linear model behind a lag is a lag behind that model. A recording that begins in motion does
    not say where either lag begins.
    """
    if not effect.sensor or effect.size != LAG or len(fit.recorded) != 2:
        return []
    others = fit.unknowns.effects.values()
    return [e.name for e in others if e.sensor and e.size == LAG and e.model != effect.model]


def at_bounds(causes: Sequence[Cause]) -> list[str]:
    """Parameters of causes beyond whose bounds there may be values, in words."""
    return [
        f"{name} of {cause.effect.name} is at its bound"
        for cause in causes
        for name, interval in cause.parameters.items()
        if interval.limit and interval.open
    ]


def size_text(fit: Fit, model: FittedModel, effect: Effect) -> str:
    """The size that an effect has in a fit, in words."""
    size = model.point.sizes[effect.name, effect.label]
    return with_unit(size, fit.unknowns.unit(effect, effect.size))
