"""Whether signals are late by themselves, where causes were found or none was.

What the system file says of loggers may be wrong, or not known. So clocks of all signals are fitted
alone: where they leave clearly less than what was found, a name would be one of chance.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from workbench.diagnosis.data.clocks import DELAY
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.quadratic import Key, covariance, minimum
from workbench.diagnosis.inference.search import FittedModel, beyond, fitted
from workbench.system.units import BAND

_ROUNDED = 1e-6  # of chi-squared


@dataclass(frozen=True)
class LateSignals:
    """Signals that are late against all others, by themselves."""

    # those that are late together; or all that are late, by different times
    signals: tuple[str, ...]
    # skew, sigma: by how much, and its standard deviation [s]; 0 where times differ
    skew: float
    sigma: float
    skews: Mapping[str, float]  # by how much each of them is late [s]

    def skew_of(self, signals: Sequence[str], recorded: Sequence[str]) -> float:
        """How late a clock of some of the recorded signals is [s]; 0 where others are late."""
        of, late = {*signals} & {*recorded}, {*self.signals}
        if of == late:
            return self.skew
        return -self.skew if of == {*recorded} - late else 0.0


def by_themselves(
    fit: Fit, base: FittedModel, best: FittedModel, *, clean: bool
) -> LateSignals | None:
    """Signals whose clocks explain clearly more than what was found; None: no clocks do.

    Several causes that explain no more than clocks are less likely than these. Clocks that are late
    by less than matters are none: as inputs go from sample to sample, as much is a matter of form.

    Parameters
    ----------
    base, best : the nominal model and the last one, with all derivatives.
    clean : whether the last one leaves nothing that lasts.
    """
    active = best.active
    if clean and active and all(effect.late and effect.size == DELAY for effect in active):
        return None  # of signals by themselves
    clocks = list(fit.own_clocks)
    other, least = fit.beside(clocks), fit.least_skew
    needed = fit.decides.needed if len(best.active) < 2 else 0.0
    if clean and len(best.active) < 2 and _fall(other, clocks, best) < needed:
        return None
    starts: dict[Key, float] = {}
    # Beside causes that leave nothing, clocks have to explain as much.
    sought = best.linearised.deviance + fit.decides.form if clean else np.inf
    while True:
        if not clocks:
            return None
        model = _fitted(other, base, clocks, starts, sought)
        lin = model.linearised
        # What swings about zero may have no mean that lasts.
        wrong = max(float(lin.variance_factors.max()), float(lin.squares.max()))
        explains = wrong < fit.decides.wrong
        if not explains and not starts and not clean:
            # By more than a machine's shortest time, derivatives point elsewhere.
            starts = fit.apparent_skews(base.point)
            continue
        if not explains or beyond(best, model) < needed:
            return None
        late = [clock for clock in clocks if abs(model.point.sizes[clock.name, clock.size]) > least]
        if late == clocks:
            return _together(other, clocks, model, least)
        clocks = late


def _fitted(
    fit: Fit,
    base: FittedModel,
    clocks: Sequence[Effect],
    starts: Mapping[Key, float],
    sought: float,
) -> FittedModel:
    """The nominal model with clocks, begun at where they start, or else in time."""
    keys = [(clock.name, clock.size) for clock in clocks]
    point = replace(base.point, sizes={key: starts.get(key, 0.0) for key in keys})
    return fitted(fit, fit.at(point), tuple(clocks), sought=sought)


def _fall(fit: Fit, clocks: Sequence[Effect], best: FittedModel) -> float:
    """By how much chi-squared falls with clocks beside what was found, linearised."""
    lin = fit.linearise(best.linearised, best.active, [(clock, {}) for clock in clocks])
    joint = fit.quadratics(lin, [(clock.name, clock.size) for clock in clocks])
    total = joint.total()
    known = total.columns(np.eye(len(joint.shared), len(joint.known)))
    return known.at(minimum(known)) - total.at(minimum(total))


def _together(fit: Fit, clocks: Sequence[Effect], fitted: FittedModel, least: float) -> LateSignals:
    """The fewest signals that, late together, explain as well as each by its own clock.

    They do, too, where each is as late as all within the `least` time that matters [s]. The clock
    of the one signal that has none is what the others are late against.
    """
    joint = fit.quadratics(fit.linearise(fitted.linearised, fitted.active))
    at = [joint.shared.index((clock.name, clock.size)) for clock in clocks]
    N = np.linalg.inv(covariance(joint.total().N)[np.ix_(at, at)])
    skews = np.array([fitted.point.sizes[clock.name, clock.size] for clock in clocks])
    names = [fit.reference, *(signal for clock in clocks for signal in clock.late)]
    # The reference is late itself where all others are early.
    able = range(0 if len(clocks) == len(fit.own_clocks) else 1, len(names))
    for count in range(1, len(names) // 2 + 1):
        tried = []
        for chosen in combinations(able, count):
            own = np.isin(range(len(names)), chosen).astype(float)
            along = own[1:] - own[0]
            information = float(along @ N @ along)
            skew = float(along @ N @ skews) / information
            left = skews - skew * along
            away = float(np.abs(left).max())
            tried.append((float(left @ N @ left), away, skew, information, chosen))
        # That one of two is early is that the other is late, but for rounding; sensors are late.
        best = min(tried)[0] * (1.0 + _ROUNDED) + _ROUNDED
        behind, away, skew, information, chosen = min(
            tried, key=lambda clocks: (clocks[0] > best, clocks[2] < 0.0, clocks)
        )
        if behind < fit.decides.form or away < least:
            signals = tuple(names[j] for j in chosen)
            # Between samples, time is a matter of form: within the least that matters.
            sigma = float(np.hypot(1.0 / np.sqrt(information), least / BAND))
            return LateSignals(signals, skew, sigma, dict.fromkeys(signals, skew))
    by_signal = dict(zip(names[1:], map(float, skews), strict=True))
    return LateSignals(tuple(by_signal), 0.0, 0.0, by_signal)
