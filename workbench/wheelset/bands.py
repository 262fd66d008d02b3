"""Whether 95 % bands hold the truth in 95 % of the samples, and how wide they must be for it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import chi2

from workbench.cosim import SURE
from workbench.fmu import Vector
from workbench.lab import BAND
from workbench.objective import judged_window

if TYPE_CHECKING:
    from workbench.wheelset.accuracy import KnownStop, StopAccuracy

INNOVATIONS = "innovations"  # whose band is that of their normalised square, by chi-squared
COVERED = ("Fx", "slip", "omegaW", "omegaR", "muDC", "muWR", INNOVATIONS)  # where there is a band

_RANKS = np.linspace(0.0, 1.0, 1001)  # a share of 95 % to a twentieth of it


@dataclass(frozen=True, eq=False)
class Held:
    """What the band of a quantity holds in a stop.

    Attributes
    ----------
    share : of samples in which it holds the truth.
    errors : (r,) quantiles of the errors over the reach of the band, from least to largest.
    """

    share: float
    errors: Vector


def held(stop: "KnownStop", name: str) -> dict[str, Held]:
    """What bands of an estimator hold, where that is judged and claimed, by quantity."""
    run, found = stop.runs[name], {}
    window = np.zeros(stop.case.time.size, bool)
    window[judged_window(stop.case, stop.system)] = True
    for quantity in COVERED:
        judged = window & run.claimed.get(quantity, True)
        if quantity == INNOVATIONS:
            reach = np.full(judged.sum(), chi2.ppf(SURE, len(stop.system.outputs)))
            errors = run.nis[judged]
        else:
            reach = BAND * run.deviation(quantity)[judged]
            errors = np.abs(run.signal(quantity) - getattr(stop.truth, quantity))[judged]
        if (reach > 0.0).any() and np.isfinite(errors + reach).all():
            shares = errors / reach
            found[quantity] = Held(float(np.mean(shares < 1.0)), np.quantile(shares, _RANKS))
    return found


def covered(
    stops: Sequence["StopAccuracy"], name: str, quantity: str, *, least: bool = False
) -> float | None:
    """Share of samples in which bands of an estimator hold a quantity: mean of the stops, or least.

    In a stop whose share is low the filter is overconfident, which a mean may hide.
    """
    shares = [one.share for one in _of_stops(stops, name, quantity)]
    return float(np.min(shares) if least else np.mean(shares)) if shares else None


def needed(stops: Sequence["StopAccuracy"], name: str, quantity: str) -> float | None:
    """What the band of a quantity must be multiplied by to hold 95 %; None where it has none.

    A band that holds the stated share of samples with known truth holds it of others that are like
    them, whatever the distribution of errors. Source: J. Lei et al. (2018), Distribution-free
    predictive inference for regression, J. Amer. Stat. Assoc. 113, 1094-1111, section 5.2 (errors
    over an estimate of their scatter). Each stop counts alike.
    """
    errors = [one.errors for one in _of_stops(stops, name, quantity)]
    return float(np.quantile(np.concatenate(errors), SURE)) if errors else None


def needed_bands(stops: Sequence["StopAccuracy"]) -> dict[str, dict[str, float]]:
    """What bands must be multiplied by, by estimator and quantity that the stops have."""
    found: dict[str, dict[str, float]] = {}
    for name in stops[0].estimators:
        known = {q: needed(stops, name, q) for q in COVERED if q != INNOVATIONS}
        found[name] = {q: one for q, one in known.items() if one is not None}
    return {name: one for name, one in found.items() if one}


def _of_stops(stops: Sequence["StopAccuracy"], name: str, quantity: str) -> list[Held]:
    bands: list[Mapping[str, Held]] = [stop.estimators[name].bands for stop in stops]
    return [one[quantity] for one in bands if quantity in one]
