"""How well a run fits its recording, stage 5: errors of the creep force, and z of the paper."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt

from workbench.case import Case
from workbench.cosim import Outcome, Run
from workbench.fmu import Vector

BANDWIDTH = 5.0  # [Hz] below the 15..35 Hz modes of a rig's structure, above what friction does
FIRST_PRESSURE = 0.1e5  # [Pa] twenty times the noise of a pressure sensor (5 mbar)
LOWEST_SPEED = 1.0  # [m/s] below, slip and creepage lose their meaning


@dataclass(frozen=True)
class Weights:
    """Weights of equation (12) of Schwarz et al. (2018).

    They bring the terms to one scale: an error of 1 rad/s in a speed counts as one of 1 kN in the
    force, so the force decides once the speeds follow their measurement.
    """

    cW: float = 1.0  # [s/rad]
    cR: float = 1.0  # [s/rad]
    cF: float = 1.0e-3  # [1/N]


@dataclass(frozen=True)
class Score:
    """Errors of one run; None where they cannot be judged, and why.

    Attributes
    ----------
    Fx_rms : rms error of the creep force between first pressure and 1 m/s, below 5 Hz [N].
    Fx_nrmse : the same over the mean of |Fx| [1].
    z : objective z_k of equation (12), over the whole recording [1].
    reason : why a value is missing; empty if none is.
    """

    Fx_rms: float | None
    Fx_nrmse: float | None
    z: float | None
    reason: str


def braking_window(case: Case, roller_radius: float) -> slice:
    """Samples from first pressure to the last one above 1 m/s; empty without braking."""
    applied = np.flatnonzero(case.pB > FIRST_PRESSURE)
    moving = np.flatnonzero(np.abs(case.omegaR) * roller_radius > LOWEST_SPEED)
    if not applied.size or not moving.size:
        return slice(0, 0)
    return slice(int(applied[0]), max(int(moving[-1]) + 1, int(applied[0])))


def low_pass(time: Vector, signal: Vector, bandwidth: float = BANDWIDTH) -> Vector:
    """Low-pass a sampled signal without phase shift (Butterworth, order 2, forward and backward).

    Uneven samples are brought to an even grid of their mean step and back. A signal sampled too
    slowly to hold more than the bandwidth is returned as it is.

    >>> t = np.arange(0, 2, 0.005)
    >>> ringing = low_pass(t, np.sin(2 * np.pi * 21.6 * t))
    >>> float(np.abs(ringing[100:-100]).max().round(3))
    0.002
    """
    step = (time[-1] - time[0]) / (time.size - 1)
    if 2 * bandwidth * step >= 1.0:
        return signal
    even = time[0] + step * np.arange(time.size)
    sections = butter(2, 2 * bandwidth * step, output="sos")
    smooth: Vector = sosfiltfilt(sections, np.interp(even, time, signal))
    return np.interp(time, even, smooth)


def score(case: Case, run: Run, roller_radius: float, weights: Weights) -> Score:
    """Judge a run against its recording.

    Parameters
    ----------
    roller_radius : [m], turns omegaR into the speed that ends the window.
    """
    if run.outcome is not Outcome.OK:
        return Score(None, None, None, f"{run.outcome.value} {run.message}".strip())
    if case.Fx is None:
        return Score(None, None, None, "the recording has no Fx to judge by")
    error = run.signal("Fx") - case.Fx
    # A method that takes the speeds as measured makes no error in them.
    speed_errors = [
        np.nan_to_num(np.abs(run.signal(name) - measured))
        for name, measured in (("omegaW", case.omegaW), ("omegaR", case.omegaR))
    ]
    rate = weights.cW * speed_errors[0] + weights.cR * speed_errors[1] + weights.cF * np.abs(error)
    duration = case.time[-1] - case.time[0]
    z = float(np.trapezoid(rate, case.time) / duration)
    window = braking_window(case, roller_radius)
    if window.stop - window.start < 2:
        return Score(None, None, z, "the recording has no braking above 1 m/s")
    rms = float(np.sqrt(np.mean(low_pass(case.time, error)[window] ** 2)))
    mean = float(np.mean(np.abs(low_pass(case.time, case.Fx)[window])))
    return Score(rms, rms / mean, z, "")
