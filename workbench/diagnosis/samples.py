"""A recorded stop made ready for statistics: what counts, what is set aside, how large noise is.

Blocks of 50 ms are the unit of all statistics: short against everything that brakes do, long
enough to average most of the 20 Hz ringing of a load cell.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter, uniform_filter1d
from scipy.optimize import nnls
from scipy.signal import lfilter, lfiltic, savgol_filter

from workbench.case import Case, Matrix, Vector
from workbench.errors import InputError

BLOCK = 0.05  # [s]

_FEWEST = 100  # blocks, 5 s: less does not tell noise from cause
_SETTLING = 1.0  # [s] at the start, in which the simulation finds its slip
_SLOWEST = 1.0  # [m/s] below, slip is a small difference of uncertain speeds
_SLIDE = 0.03  # [1] creepage from which on a wheel slides: friction then depends on the rail only
_ABREAST = 11  # samples of the running median
# [s] and order: parabolas over less than the lags of a valve, lines where pressure holds.
_SMOOTHED = (0.15, 2), (2.0, 1)
_HELD = 4.0  # standard deviations that a polynomial may take away
_RELEASED = 0.1  # share of the pressure
_SPIKE = 8.0  # standard deviations that no noise reaches
_UNMODELLED = 1.2  # ripple and the like, over the noise of torque and pressure
_STUCK = 6  # equal samples in a row: a channel that is noisy does not repeat itself

# The load cell sits behind the wheelset's longitudinal mode on its cylinders.
_MODE, _DAMPING = 21.6, 0.05  # [Hz], [1]

CHANNELS = ("slip", "omegaR", "Fx")  # in m/s, rad/s, N
_RECORDED = ("pB", "tauR")  # columns of u

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Samples:
    """One stop, sampled.

    Attributes
    ----------
    name : of the case.
    time : (n,) [s].
    u : (n, 4) pB [Pa], tauR [N.m] and two corrections that stay zero.
    y : (n, m) omegaW, omegaR [rad/s], and Fx [N] if it was measured.
    gain : (n,) [1] of the correction of the roller's speed, 0 where that was not measured.
    omegaR : [rad/s] at the start.
    rest : [Pa] mean brake pressure before the brake is applied.
    rest_noise : [Pa] its standard deviation.
    blocks : (b, 2) first sample and end of each block that counts.
    whitening : (b, m, m) makes the errors of a block, in CHANNELS, white with variance one.
    speed : (b,) [m/s] mean circumferential speed of the roller in each block.
    set_aside : number of samples by reason.
    """

    name: str
    time: Vector
    u: Matrix
    y: Matrix
    gain: Vector
    omegaR: float
    rest: float
    rest_noise: float
    blocks: NDArray[np.int64]
    whitening: NDArray[np.float64]
    speed: Vector
    set_aside: dict[str, int]

    def falls(self, signal: str) -> bool:
        """Whether an input falls, by more than its sensor's noise and a valve's overshoot.

        Raises
        ------
        InputError
            If it is none of the recorded inputs.
        """
        if signal not in _RECORDED:
            raise InputError(
                where=f"stop {self.name}",
                found=f"no recorded input '{signal}', which an effect of the library asks for",
                expected=f"one of {', '.join(_RECORDED)}",
                remedy="correct the annotation of the effect",
            )
        column = _RECORDED.index(signal)
        u = np.concatenate([self.u[first:end, column] for first, end in self.blocks])
        return bool(np.max(np.maximum.accumulate(u) - u) > _RELEASED * u.max())

    @cached_property
    def _structure(self) -> tuple[Vector, Vector] | None:
        """Numerator and denominator of the mode before the load cell, as a digital filter."""
        h = float(np.median(np.diff(self.time)))
        omega = 2.0 * np.pi * _MODE
        if omega * h > 2.0:
            return None  # sampled too slowly to show the mode
        poles = omega * (-_DAMPING + 1j * np.sqrt(1.0 - _DAMPING**2)) * np.array([1.0, 1.0])
        poles[1] = np.conj(poles[0])
        z = np.exp(h * poles)
        denominator = np.real(np.poly(z))
        # Matched poles; symmetric weights keep the delay, these the amplitude to 0.2 % below 15 Hz.
        return np.sum(denominator) * np.array([1.0, 10.0, 1.0]) / 12.0, denominator

    def behind_structure(self, force: Vector) -> Vector:
        """What load cells read of a creep force [N], (n,): a mode of second order in between."""
        if self._structure is None:
            return force
        numerator, denominator = self._structure
        begin = lfiltic(numerator, denominator, force[:1].repeat(2), force[:1].repeat(2))
        read: Vector = lfilter(numerator, denominator, force, zi=begin)[0]
        return read

    def channels(self, errors: Matrix, rW: float, rR: float) -> Matrix:
        """Means of prediction errors over each block, (b, m), in CHANNELS.

        The error of the slip is free of what both speeds have in common.
        """
        slip = rR * errors[:, 1] - rW * errors[:, 0]
        total = np.zeros((len(errors) + 1, errors.shape[1]))
        np.cumsum(slip, out=total[1:, 0])
        np.cumsum(errors[:, 1:], axis=0, out=total[1:, 1:])
        first, end = self.blocks.T
        means: Matrix = (total[end] - total[first]) / (end - first)[:, None]
        return means


def prepare(case: Case, nominal: Mapping[str, float]) -> Samples:
    """Make a stop ready.

    Parameters
    ----------
    nominal : defaults of the model's parameters.

    Raises
    ------
    InputError
        If the stop has too little that counts.
    """
    rW, rR = nominal["rW"], nominal["rR"]
    time, h = case.time, float(np.median(np.diff(case.time)))
    signals = {"pB": case.pB, "tauR": case.tauR, "omegaW": case.omegaW, "omegaR": case.omegaR}
    if case.Fx is not None:
        signals["Fx"] = case.Fx
    wrong = {name: _outliers(values) for name, values in signals.items()}
    clean = {name: _bridge(time, values, wrong[name]) for name, values in signals.items()}

    speed = np.abs(clean["omegaR"]) * rR
    slip = rR * clean["omegaR"] - rW * clean["omegaW"]
    applied = _first_contact(clean["pB"], time)
    sliding = _sliding(slip, speed, h, applied)
    excluded = {
        "spike, dropout or saturation": np.logical_or.reduce(list(wrong.values())),
        "slide": sliding,
        "settling": time < time[0] + _SETTLING,
        "standstill": _stopped(speed, h),
    }
    usable = ~np.logical_or.reduce(list(excluded.values()))
    blocks = _blocks(usable, time, round(BLOCK / h))
    if len(blocks) < _FEWEST:
        lost = ", ".join(f"{reason}: {mask.sum()}" for reason, mask in excluded.items())
        raise InputError(
            where=str(case.source),
            found=f"{BLOCK * len(blocks):.1f} s that count; samples set aside: {lost}",
            expected=f"{BLOCK * _FEWEST:.0f} s or more of rolling above {_SLOWEST:g} m/s",
            remedy="leave this stop out, or repair its recording",
        )
    steps = np.diff(time)

    deviation = {name: _deviation(clean[name]) for name in ("pB", "tauR", "omegaR")}
    lever = 3.0 * nominal["muDC"] * nominal["actuation.kappa"] * nominal["rB"] * rR / rW
    torque = _UNMODELLED * np.hypot(deviation["tauR"], lever * deviation["pB"])
    inertia = nominal["JR"] + nominal["JW"] * (rR / rW) ** 2
    # Noise of a torque sample acts until half way to its neighbours.
    acting = 0.5 * (np.append(steps, h) + np.append(h, steps))
    p, gains = _kalman(torque * acting / inertia, deviation["omegaR"], wrong["omegaR"])
    u = np.column_stack([_smooth(clean["pB"], h), clean["tauR"], np.zeros((time.size, 2))])
    y = np.column_stack([clean[name] for name in signals if name not in ("pB", "tauR")])
    v = np.array([speed[first:end].mean() for first, end in blocks])
    rest = clean["pB"][:applied]
    return Samples(
        name=case.name,
        time=time,
        u=np.ascontiguousarray(u),
        y=np.ascontiguousarray(y),
        gain=gains,
        omegaR=float(np.mean(clean["omegaR"][: max(1, round(0.2 / h))])),
        rest=float(np.mean(rest)),
        rest_noise=float(np.hypot(np.std(rest) / np.sqrt(rest.size), _REST_ZERO)),
        blocks=blocks,
        whitening=_whitening(clean, slip, speed, blocks, v, p + deviation["omegaR"] ** 2, rR),
        speed=v,
        set_aside={
            "missing": int(np.sum(np.maximum(0, np.round(steps / h) - 1))),
            **{reason: int(mask.sum()) for reason, mask in excluded.items()},
        },
    )


_REST_ZERO = 200.0  # [Pa] by which the zero of a good pressure sensor moves


def _outliers(values: Vector) -> Mask:
    """Isolated wrong samples (Hampel's identifier), repeated ones and a saturated extreme."""
    away = np.abs(values - median_filter(values, _ABREAST))
    # The wide window knows the noise, the narrow one that a structure rings.
    noise = np.maximum(median_filter(away, 20 * _ABREAST + 1), median_filter(away, 2 * _ABREAST))
    scale = np.maximum(1.4826 * noise, _deviation(values))
    wrong = away > _SPIKE * scale
    same = np.diff(values) == 0.0
    if same.mean() < 0.2:
        for first, end in _runs(same):
            if end - first >= _STUCK - 1:
                wrong[first : end + 1] = True
        for extreme in (values.min(), values.max()):
            at = values == extreme
            if at.sum() > 2 * _STUCK and same[at[1:]].mean() > 0.5:
                wrong |= at
    return wrong


def _bridge(time: Vector, values: Vector, wrong: Mask) -> Vector:
    return np.interp(time, time[~wrong], values[~wrong]) if wrong.any() else values


def _smooth(pB: Vector, h: float) -> Vector:
    """Pressure without most of its sensor's noise, and without lag.

    The pads do not feel that noise; fed to a model, any effect that lags or sticks would gain by
    keeping it from them. Where pressure holds, the mean is taken over longer.
    """
    best, noise = pB, _deviation(pB)
    for seconds, order in _SMOOTHED:
        window = 2 * (round(seconds / h) // 2) + 1
        if order < window <= pB.size:
            smooth = savgol_filter(pB, window, order)
            moves = maximum_filter1d(np.abs(best - smooth) > _HELD * noise, window)
            weight = uniform_filter1d(moves.astype(np.float64), window)
            best = weight * best + (1.0 - weight) * smooth
            # Of a parabola over n samples, the variance is 9/4 of that of a mean.
            noise *= 1.5 / np.sqrt(window)
    return best


def _deviation(values: Vector) -> float:
    """Standard deviation of white noise on a slow signal, from its second differences."""
    return float(1.4826 * np.median(np.abs(np.diff(values, 2))) / np.sqrt(6.0))


def _kalman(process: Vector, measurement: float, missing: Mask) -> tuple[Vector, Vector]:
    """Variance of the predicted roller speed, and gain, of a random walk, (n,).

    Parameters
    ----------
    process : (n,) [rad/s] standard deviation of what is added up to the next sample.
    measurement : [rad/s] standard deviation of a sample.
    missing : (n,) where there is none.
    """
    r = max(measurement, 1e-9) ** 2
    q = float(np.median(process)) ** 2
    predicted, gains = np.empty_like(process), np.zeros_like(process)
    p = 0.5 * (q + np.sqrt(q * q + 4.0 * q * r))
    for k in range(process.size):
        predicted[k] = p
        if not missing[k]:
            gains[k] = p / (p + r)
        p = (1.0 - gains[k]) * p + process[k] ** 2
    return predicted, gains


def _first_contact(pB: Vector, time: Vector) -> int:
    """Sample at which the brake is applied; at least a quarter of a second is coasting."""
    early = max(2, int(np.searchsorted(time, time[0] + 0.25)))
    rising = pB > np.median(pB[:early]) + 0.1e5
    return max(early, int(np.argmax(rising)) - early if rising.any() else pB.size)


def _sliding(slip: Vector, speed: Vector, h: float, applied: int) -> Mask:
    """Where the wheel slides, with half a second around it; a wrong radius is no slide."""
    width = max(1, round(0.1 / h))
    smooth = np.convolve(slip, np.ones(width) / width, "same")
    creepage = smooth / np.maximum(speed, _SLOWEST)
    coasting = np.median(creepage[:applied])
    slides = (np.abs(creepage - coasting) > _SLIDE) & (speed > 3.0 * _SLOWEST)
    slides[:width] = slides[-width:] = False
    around = np.ones(max(1, round(1.0 / h)))
    mask: Mask = np.convolve(slides, around, "same") > 0.5
    return mask


def _stopped(speed: Vector, h: float) -> Mask:
    """From the first second below the slowest speed on."""
    width = max(1, round(0.1 / h))
    slow = np.convolve(speed, np.ones(width) / width, "same") < _SLOWEST
    slow[: width + 1] = False
    stopped: Mask = np.cumsum(slow) > 0
    return stopped


def _runs(mask: Mask) -> list[tuple[int, int]]:
    """First and end of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _blocks(usable: Mask, time: Vector, size: int) -> NDArray[np.int64]:
    size = max(1, size)
    found = [
        (k, k + size)
        for first, end in _runs(usable)
        for k in range(first, end - size + 1, size)
        if time[k + size - 1] - time[k] < 2.0 * BLOCK
    ]
    return np.array(found, dtype=np.int64).reshape(-1, 2)


def _whitening(
    clean: dict[str, Vector],
    slip: Vector,
    speed: Vector,
    blocks: NDArray[np.int64],
    v: Vector,
    roller: Vector,
    rR: float,
) -> NDArray[np.float64]:
    """Inverse Cholesky factors of the covariance of block means, (b, m, m).

    A pole wheel's noise grows with speed; the slip shares the noise of the roller's speed; the
    noise of a load cell is mostly ringing, whose block means are taken as they are.
    """
    size = int(blocks[0, 1] - blocks[0, 0]) if len(blocks) else 1
    squares = np.diff(slip, 2) ** 2 / 6.0
    squares = np.minimum(squares, 9.0 * median_filter(squares, 201) / 0.455)
    moving = speed[1:-1] > _SLOWEST
    design = np.column_stack([np.ones(moving.sum()), speed[1:-1][moving] ** 2])
    coefficients, _ = nnls(design, squares[moving])
    noise = _deviation(clean["omegaR"]) ** 2
    variance = np.maximum(coefficients[0] + coefficients[1] * v**2, 1.01 * rR**2 * noise)
    m = 3 if "Fx" in clean else 2
    covariance = np.zeros((len(v), m, m))
    covariance[:, 0, 0] = variance / size
    covariance[:, 0, 1] = covariance[:, 1, 0] = rR * noise / size
    covariance[:, 1, 1] = [roller[first:end].mean() / size for first, end in blocks]
    if m == 3:
        means = np.array([clean["Fx"][first:end].mean() for first, end in blocks])
        covariance[:, 2, 2] = _deviation(means) ** 2
    return np.linalg.inv(np.linalg.cholesky(covariance))
