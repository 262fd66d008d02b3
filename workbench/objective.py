"""How well a run fits its recording, stage 5: errors of the creep force, and z of the paper."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt

from workbench.case import Case
from workbench.cosim import Outcome, Run
from workbench.fmu import Vector
from workbench.kernel import compiled

BANDWIDTH = 5.0  # [Hz] below the 15..35 Hz modes of a rig's structure, above what friction does
FIRST_PRESSURE = 0.1e5  # [Pa] twenty times the noise of a pressure sensor (5 mbar)
# [rad/s] two equal poles there are down by 3 dB at the bandwidth
_CORNER = 2 * np.pi * BANDWIDTH / np.sqrt(np.sqrt(2) - 1)
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

    @property
    def vector(self) -> Vector:
        """cW, cR, cF, (3,)."""
        return np.array([self.cW, self.cR, self.cF])


@dataclass(frozen=True)
class Score:
    """Errors of one run; None where they cannot be judged, and why.

    Attributes
    ----------
    Fx_rms : rms error of the creep force between first pressure and 1 m/s, below 5 Hz [N].
    Fx_nrmse : the same over the mean of |Fx| [1].
    z : objective z_k of equation (12), over the whole recording, of deviations below 5 Hz [1].
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


def samples(time: Vector) -> tuple[Vector, Vector]:
    """Step [s] from the sample before, and share [1] in the time average, of each sample, (n,)."""
    steps = np.diff(time, prepend=time[0])
    return steps, 0.5 * (steps + np.append(steps[1:], 0.0)) / (time[-1] - time[0])


@compiled
def integrate(z, memory, deviations, weights, steps, shares):  # type: ignore[no-untyped-def]
    """Add a piece of recording to z_k, equation (12) of Schwarz et al. (2018).

    Deviations count below 5 Hz, where an estimate can follow friction; above, a recording holds the
    noise of its sensors and the modes of its rig, which would reward slow gains. The low-pass has
    two equal real poles. z only grows, sample by sample, so that pieces do not change the sum.

    Parameters
    ----------
    memory : (2, 3) of the low-pass, written; zeros at the beginning.
    deviations : (n, 3) of omegaW, omegaR [rad/s] and Fx [N] from their measurement.
    weights : (3,) cW, cR, cF.
    steps, shares : (n,) as of `samples`.
    """
    for i in range(steps.size):
        # The first sample has no step before it and stands for all the past.
        gain = 1.0 - np.exp(-_CORNER * steps[i]) if steps[i] > 0.0 else 1.0
        for j in range(3):
            memory[0, j] += gain * (deviations[i, j] - memory[0, j])
            memory[1, j] += gain * (memory[0, j] - memory[1, j])
            z += shares[i] * weights[j] * abs(memory[1, j])
    return z


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
    omegaW = np.nan_to_num(run.signal("omegaW") - case.omegaW)
    omegaR = np.nan_to_num(run.signal("omegaR") - case.omegaR)
    deviations = np.column_stack([omegaW, omegaR, error])
    steps, shares = samples(case.time)
    z = float(integrate(0.0, np.zeros((2, 3)), deviations, weights.vector, steps, shares))
    window = braking_window(case, roller_radius)
    if window.stop - window.start < 2:
        return Score(None, None, z, "the recording has no braking above 1 m/s")
    rms = float(np.sqrt(np.mean(low_pass(case.time, error)[window] ** 2)))
    mean = float(np.mean(np.abs(low_pass(case.time, case.Fx)[window])))
    return Score(rms, rms / mean, z, "")
