"""Whether signals are late by themselves, where causes were found or none was.

What the system file says of loggers may be wrong, or not known. So clocks of all signals are fitted
alone: where they leave clearly less than what was found, a name would be one of chance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.quadratic import covariance, minimum
from workbench.diagnosis.inference.search import FittedModel, beyond, fitted


@dataclass(frozen=True)
class LateSignals:
    """Signals that are late together against all others, by themselves.

    Attributes
    ----------
    signals : none, where several are late by different times.
    skew, sigma : by how much, and its standard deviation [s].
    """

    signals: tuple[str, ...]
    skew: float
    sigma: float


def by_themselves(
    fit: Fit, base: FittedModel, best: FittedModel, *, clean: bool
) -> LateSignals | None:
    """Signals whose clocks explain clearly more than what was found; None: no clocks do.

    Several causes that explain no more than clocks are less likely than these.

    Parameters
    ----------
    base, best : the nominal model and the last one, with all derivatives.
    clean : whether the last one leaves nothing that lasts.
    """
    clocks = fit.own_clocks
    other = fit.beside(clocks)
    needed = fit.decides.needed if len(best.active) < 2 else 0.0
    if clean and len(best.active) < 2 and _fall(other, clocks, best) < needed:
        return None
    sizes = {(clock.name, clock.size): 0.0 for clock in clocks}
    one = fitted(other, other.at(replace(base.point, sizes=sizes)), tuple(clocks))
    explains = float(one.linearised.variance_factors.max()) < fit.decides.wrong
    if not explains or beyond(best, one) < needed:
        return None
    return _together(other, clocks, one)


def _fall(fit: Fit, clocks: Sequence[Effect], best: FittedModel) -> float:
    """By how much chi-squared falls with clocks beside what was found, linearised."""
    lin = fit.linearise(best.linearised, best.active, [(clock, {}) for clock in clocks])
    joint = fit.quadratics(lin, [(clock.name, clock.size) for clock in clocks])
    total = joint.total()
    known = total.columns(np.eye(len(joint.shared), len(joint.known)))
    return known.at(minimum(known)) - total.at(minimum(total))


def _together(fit: Fit, clocks: Sequence[Effect], fitted: FittedModel) -> LateSignals:
    """The fewest signals that, late together, explain as well as each by its own clock.

    The clock of the one signal that has none is what the others are late against.
    """
    joint = fit.quadratics(fit.linearise(fitted.linearised, fitted.active))
    at = [joint.shared.index((clock.name, clock.size)) for clock in clocks]
    N = np.linalg.inv(covariance(joint.total().N)[np.ix_(at, at)])
    skews = np.array([fitted.point.sizes[clock.name, clock.size] for clock in clocks])
    names = [fit.reference, *(signal for clock in clocks for signal in clock.late)]
    for count in range(1, len(names) // 2 + 1):
        tried = []
        for chosen in combinations(range(len(names)), count):
            own = np.isin(range(len(names)), chosen).astype(float)
            along = own[1:] - own[0]
            information = float(along @ N @ along)
            skew = float(along @ N @ skews) / information
            left = skews - skew * along
            tried.append((float(left @ N @ left), skew, information, chosen))
        behind, skew, information, chosen = min(tried)
        if behind < fit.decides.form:
            return LateSignals(
                tuple(names[j] for j in chosen), skew, float(1.0 / np.sqrt(information))
            )
    return LateSignals((), 0.0, 0.0)
