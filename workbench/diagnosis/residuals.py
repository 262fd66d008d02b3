"""Where and when a simulation is wrong: balances of wheelset and roller, and the slip law.

These residuals are for people: they are formed from smoothed measurements and show an effect where
it acts. The search does not use them, because noise that a residual shares with its explanation
fakes causes; it uses prediction errors.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from workbench.case import Case
from workbench.diagnosis.evidence import Court
from workbench.diagnosis.fit import Fit
from workbench.diagnosis.linearised import Linearised
from workbench.diagnosis.samples import CHANNELS, Samples
from workbench.fmu import Matrix, Vector

# Residuals with units: torque or slip that the measurement has beyond the model.
RESIDUALS = {"wheelset": "N.m", "roller": "N.m", "slip": "m/s"}

# What errors may go with. Angles are those of one turn; a phase belongs to one stop.
INFLUENCES = {
    "time since first contact": "s",
    "speed": "m/s",
    "brake pressure": "Pa",
    "rate of pressure": "Pa/s",
    "friction energy": "J",
    "slip power": "W",
    "direction of rotation": "1",
    "angle of the wheel": "rad",
    "angle of the roller": "rad",
}

_WINDOW = 0.5  # [s] of smoothing, as short as the noise of differentiated speeds allows
_BINS = 12


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals of one stop, and the prediction errors of two models.

    Attributes
    ----------
    name : of the stop.
    time : (n,) [s] of the residuals.
    values : by RESIDUALS, (n,); the wheelset balance and the slip law need Fx.
    block_time : (b,) [s].
    before, after : (b, m) prediction errors of the nominal and of the last model, in CHANNELS.
    sigma : (b, m) their standard deviation by noise.
    """

    name: str
    time: Vector
    values: Mapping[str, Vector]
    block_time: Vector
    before: Matrix
    after: Matrix
    sigma: Matrix


@dataclass(frozen=True)
class Dependence:
    """Share of the variance of a channel's errors that follows an influence, beyond chance."""

    channel: str
    influence: str
    before: float
    after: float


def residuals(court: Court, fit: Fit, before: Linearised, after: Linearised) -> list[Residuals]:
    """Residuals of all stops, with the levels of the nominal model as fitted."""
    values = fit.values(before.point)
    found = []
    for k, (case, stop) in enumerate(zip(court.cases, court.stops, strict=True)):
        inverse = np.linalg.inv(stop.whitening)
        unwhitened: list[Matrix] = [
            np.einsum("bij,bj->bi", inverse, lin.evidence[k].errors) for lin in (before, after)
        ]
        found.append(
            Residuals(
                name=case.name,
                time=case.time,
                values=_balances(case, stop, court.nominal, values[k]["muDC"]),
                block_time=case.time[stop.blocks.mean(axis=1).astype(int)],
                before=unwhitened[0],
                after=unwhitened[1],
                sigma=np.sqrt(np.einsum("bij,bij->bi", inverse, inverse)),
            )
        )
    return found


def _balances(
    case: Case, stop: Samples, nominal: Mapping[str, float], muDC: float
) -> dict[str, Vector]:
    """Balances and slip law from smoothed signals, NaN where the stop does not count."""
    h = float(np.median(np.diff(case.time)))
    width = max(5, round(_WINDOW / h) | 1)
    pB, tauR, (omegaW, omegaR) = stop.u[:, 0], stop.u[:, 1], stop.y.T[:2]

    def smooth(signal: Vector, order: int = 0) -> Vector:
        result: Vector = savgol_filter(signal, width, 2, deriv=order, delta=h)
        return result

    rW, rR = nominal["rW"], nominal["rR"]
    force = nominal["actuation.kappa"] * np.maximum(0.0, smooth(pB) - nominal["actuation.p0"])
    direction = np.sign(smooth(omegaR))
    brake = 3.0 * muDC * force * nominal["rB"] * direction

    def loss(omega: Vector, slot: str) -> Vector:
        c0, c1, c2 = (nominal[name] for name in _losses(nominal, slot))
        return (c0 + c1 * np.abs(omega) + c2 * omega**2) * direction

    counts = np.zeros(case.time.size, bool)
    for first, end in stop.blocks:
        counts[first:end] = True

    def shown(values: Vector) -> Vector:
        return np.where(counts, values, np.nan)

    v = rR * smooth(omegaR)
    found = {"slip": shown(v - rW * smooth(omegaW))}
    if case.Fx is not None:
        Fx = smooth(stop.y[:, 2])
        wheelset = nominal["JW"] * smooth(omegaW, 1) + brake + loss(smooth(omegaW), "wheelsetLoss")
        roller = nominal["JR"] * smooth(omegaR, 1) + rR * Fx + loss(smooth(omegaR), "rollerLoss")
        found |= {"wheelset": shown(rW * Fx - wheelset), "roller": shown(smooth(tauR) - roller)}
        found["slip"] = found["slip"] - shown(Fx * np.abs(v) / _stiffness(case, nominal))
    return found


def _losses(nominal: Mapping[str, float], slot: str) -> list[str]:
    """Names of c0, c1, c2 of a loss, wherever the slot's component keeps them."""
    return [
        next(name for name in nominal if name.startswith(slot) and name.endswith(f".{c}"))
        for c in ("c0", "c1", "c2")
    ]


def _stiffness(case: Case, nominal: Mapping[str, float]) -> float:
    """Creep force of both wheels per creepage at small slip [N]."""
    reduction = {"dry": 0.5 * (1.0 + 0.4), "wet": 0.5 * (0.3 + 0.1)}[case.conditions.wheel_rail]
    # Of one wheel at 80 kN, by Kalker's linear theory; it grows with the contact area (Hertz).
    return 2.0 * 9.68e6 * float((nominal["Fz"] / 80e3) ** (2.0 / 3.0)) * reduction


def dependences(court: Court, found: Sequence[Residuals]) -> list[Dependence]:
    """What prediction errors go with, strongest before first."""
    influences = [_influences(court, k) for k in range(len(found))]
    channels = CHANNELS[: found[0].before.shape[1]]
    # Speeds and force change sign with the direction: what the model lacks goes with their size.
    signs = [case.conditions.direction for case in court.cases]
    pairs = list(zip(signs, found, strict=True))
    table = []
    for c, channel in enumerate(channels):
        before = [sign * one.before[:, c] / one.sigma[:, c] for sign, one in pairs]
        after = [sign * one.after[:, c] / one.sigma[:, c] for sign, one in pairs]
        for name in INFLUENCES:
            shares = (_explained(errors, influences, name) for errors in (before, after))
            table.append(Dependence(channel, name, *shares))
    return sorted(table, key=lambda one: -one.before)


def _influences(court: Court, k: int) -> dict[str, Vector]:
    """Each influence at the blocks of one stop."""
    case, stop, nominal = court.cases[k], court.stops[k], court.nominal
    time, h = case.time, np.gradient(case.time)
    pB, (omegaW, omegaR) = stop.u[:, 0], stop.y.T[:2]
    v = nominal["rR"] * np.abs(omegaR)
    force = nominal["actuation.kappa"] * np.maximum(0.0, pB - nominal["actuation.p0"])
    sliding = v * nominal["rB"] / nominal["rW"]
    touching = force > 0.05 * force.max()
    contact = time[np.argmax(touching)] if touching.any() else time[0]
    slip = np.abs(nominal["rR"] * omegaR - nominal["rW"] * omegaW)
    signals = {
        "time since first contact": np.maximum(0.0, time - contact),
        "speed": v,
        "brake pressure": pB,
        "rate of pressure": np.gradient(_running(pB, h), time),
        "friction energy": np.cumsum(nominal["muDC"] * force * sliding * h),
        "slip power": slip * 3.0 * nominal["muDC"] * force * nominal["rB"] / nominal["rW"],
        "direction of rotation": np.full(time.size, float(case.conditions.direction)),
        "angle of the wheel": np.cumsum(omegaW * h) % (2.0 * np.pi),
        "angle of the roller": np.cumsum(omegaR * h) % (2.0 * np.pi),
    }
    middle = stop.blocks.mean(axis=1).astype(int)
    return {name: values[middle] for name, values in signals.items()}


def _running(values: Vector, h: Vector) -> Vector:
    width = max(1, round(0.25 / float(np.median(h))))
    result: Vector = np.convolve(values, np.ones(width) / width, "same")
    return result


def _explained(
    errors: Sequence[Vector], influences: Sequence[dict[str, Vector]], name: str
) -> float:
    """Correlation ratio of errors on an influence in bins, corrected for chance (Kelley 1935)."""
    apart = name.startswith("angle")
    groups, values = [], []
    everything = np.concatenate([one[name] for one in influences])
    edges = np.unique(np.quantile(everything, np.linspace(0.0, 1.0, _BINS + 1)[1:-1]))
    for k, (error, one) in enumerate(zip(errors, influences, strict=True)):
        groups.append(np.digitize(one[name], edges) + (100 * k if apart else 0))
        values.append(error - error.mean() if apart else error)
    group, value = np.unique(np.concatenate(groups), return_inverse=True)[1], np.concatenate(values)
    counts = np.bincount(group)
    means = np.bincount(group, value) / counts
    total = float(np.sum((value - value.mean()) ** 2))
    within = float(np.sum((value - means[group]) ** 2))
    if total <= 0.0:
        return 0.0
    chance: float = (len(value) - 1) / max(1, len(value) - len(counts))
    return max(0.0, float(1.0 - chance * within / total))
