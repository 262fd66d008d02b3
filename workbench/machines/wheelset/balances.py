"""Balances of wheelset and roller, and the slip law: what a stop has beyond the model."""

from collections.abc import Mapping

import numpy as np

from workbench.arrays import Vector
from workbench.diagnosis.data.samples import Samples
from workbench.diagnosis.inference.residuals import Balance
from workbench.recordings.case import Case
from workbench.system.system import System

_WINDOW = 0.5  # [s] of smoothing, as short as the noise of differentiated speeds allows


def balances(
    system: System, case: Case, recorded: Samples, values: Mapping[str, float]
) -> list[Balance]:
    """Balances and slip law from smoothed signals.

    Balances and the slip law need Fx: without it, what the contact explains is not known.
    """
    from scipy.signal import savgol_filter  # takes its time, and little else needs it

    h = float(np.median(np.diff(case.time)))
    width = max(5, round(_WINDOW / h) | 1)
    pB, tauR, (omegaW, omegaR) = recorded.u[:, 0], recorded.u[:, 1], recorded.y.T[:2]

    def smooth(signal: Vector, order: int = 0) -> Vector:
        result: Vector = savgol_filter(signal, width, 2, deriv=order, delta=h)
        return result

    rW, rR = values["rW"], values["rR"]
    kappa, p0 = (values[name] for name in _within(values, "actuation", "kappa", "p0"))
    force = kappa * np.maximum(0.0, smooth(pB) - p0)
    direction = np.sign(smooth(omegaR))
    brake = 3.0 * values["muDC"] * force * values["rB"] * direction

    def loss(omega: Vector, slot: str) -> Vector:
        c0, c1, c2 = (values[name] for name in _within(values, slot, "c0", "c1", "c2"))
        return (c0 + c1 * np.abs(omega) + c2 * omega**2) * direction

    counts = np.zeros(case.time.size, bool)
    for first, end in recorded.blocks:
        counts[first:end] = True

    def shown(signal: Vector) -> Vector:
        return np.where(counts, signal, np.nan)

    v = rR * smooth(omegaR)
    slip = shown(v - rW * smooth(omegaW))
    if "Fx" not in case:
        return [Balance("slip", "Slip, as measured", "m/s", "mm/s", slip)]
    Fx = smooth(recorded.y[:, 2])
    wheelset = values["JW"] * smooth(omegaW, 1) + brake + loss(smooth(omegaW), "wheelsetLoss")
    roller = values["JR"] * smooth(omegaR, 1) + rR * Fx + loss(smooth(omegaR), "rollerLoss")
    torque = "balance: torque that the model lacks"
    law = slip - shown(Fx * np.abs(v) / _stiffness(values))
    return [
        Balance("wheelset", f"Wheelset {torque}", "N.m", "N.m", shown(rW * Fx - wheelset)),
        Balance("roller", f"Roller {torque}", "N.m", "N.m", shown(smooth(tauR) - roller)),
        Balance("slip", "Slip law: slip that the model lacks", "m/s", "mm/s", law),
    ]


def _within(values: Mapping[str, float], slot: str, *parameters: str) -> list[str]:
    """Names of parameters of a slot, wherever its component keeps them: a law has it within."""
    return [
        next(
            name
            for name in values
            if name.startswith(f"{slot}.") and name.endswith(f".{parameter}")
        )
        for parameter in parameters
    ]


def _stiffness(values: Mapping[str, float]) -> float:
    """Creep force of both wheels per creepage at small slip [N]."""
    reduction = 0.5 * (values["polach.kA"] + values["polach.kS"])
    # Of one wheel at 80 kN, by Kalker's linear theory; it grows with the contact area (Hertz).
    return 2.0 * 9.68e6 * float((values["Fz"] / 80e3) ** (2.0 / 3.0)) * reduction
