"""Tuning finds an optimum that follows from theory, in a case where estimation is linear.

A wheelset rolls without slip on a roller whose drive holds the speed. Its pads are pressed evenly,
and their friction is a stationary Gaussian process. The disturbance observer and the low-pass of
the objective are then one linear system driven by white noise: the mean magnitude of a deviation is
sqrt(2/pi) of its standard deviation, which a Lyapunov equation gives for any gains.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numpy.linalg import inv, solve
from numpy.testing import assert_allclose, assert_array_less
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov
from scipy.optimize import brentq
from scipy.signal import lfilter
from scipy.stats import chi2

from workbench.observers import Gains, SearchSpace
from workbench.observers.estimators.disturbance import DisturbanceObserver
from workbench.observers.score import corner
from workbench.recordings.case import Case
from workbench.tuning import Checkpointing, Job, Plan, Search, evaluate_gains, recording, search

from .built import declare, machine

RW, RR, JR, MU_DC, PADS = 0.46, 0.70, 1500.0, 0.275, 0.09  # as in the model
PRESSURE = 2e5  # [Pa]
VELOCITY = 1.0  # [m/s], so slow that a fifth of the feedback has faded out
FORCE = PADS * PRESSURE / RW  # of friction 1 [N]
EFFECT = -RR * FORCE / JR * np.array([RR / RW, 1.0])  # of friction on both speeds [rad/s2]
FADING = VELOCITY**2 / (VELOCITY**2 + 0.5**2)  # half of it at 0.5 m/s
AUTHORITY = 0.5  # of muDC, whose full authority is at twice the pressure
SHARES = FADING * np.array([1.0, 1.0, AUTHORITY])  # of the rows omegaW, omegaR, muDC of L
CORNER = 2 * np.pi * 5.0 / np.sqrt(np.sqrt(2) - 1)  # of two poles, 3 dB at 5 Hz
ALL = {"omegaW": 1.0, "omegaR": 1.0, "Fx": 1e-3}
FORCE_ALONE = {**ALL, "omegaW": 0.0, "omegaR": 0.0}


@dataclass(frozen=True)
class Process:
    """What is recorded.

    Attributes
    ----------
    step : from sample to sample [s].
    spread : standard deviation of friction [1], eight of which are within the observer's range.
    decay : of its autocorrelation [1/s].
    noise : standard deviation of a sample of omegaW, omegaR [rad/s].
    """

    step: float
    spread: float = 0.02
    decay: float = 0.5
    noise: tuple[float, float] = (0.05, 0.003)

    @property
    def kept(self) -> float:
        """Share of a deviation of friction that is left after a step."""
        return float(np.exp(-self.decay * self.step))

    @property
    def news(self) -> float:
        """Standard deviation of what comes to friction in a step."""
        return self.spread * float(np.sqrt(1.0 - self.kept**2))

    @property
    def rate(self) -> float:
        """T_muDC of the observer that forgets as fast: its steps are implicit [1/s]."""
        return (1.0 - 1.0 / self.kept) / self.step


def record(process: Process, samples: int, rng: np.random.Generator) -> Case:
    """Friction changes at samples; in the step to a sample it is that of the sample."""
    dmuDC = lfilter([process.news], [1.0, -process.kept], rng.standard_normal(samples))
    Fx = FORCE * (MU_DC + dmuDC)
    omega = VELOCITY / np.array([RW, RR]) + rng.standard_normal((samples, 2)) * process.noise
    return Case(
        name="rolling",
        title="rolling",
        conditions={},
        time=process.step * np.arange(samples),
        signals={
            "pB": np.full(samples, PRESSURE),
            "tauR": RR * Fx,  # the drive holds the speed
            "omegaW": omega[:, 0],
            "omegaR": omega[:, 1],
            "Fx": Fx,
        },
        inputs=("pB", "tauR"),
        outputs=("omegaW", "omegaR"),
        source=Path("rolling"),
    )


class Stationary(NamedTuple):
    """What is left in the long run of deviations in omegaW, omegaR [rad/s], Fx [kN].

    Attributes
    ----------
    transition : (10, 10) of the errors, the friction and the low-pass from sample to sample.
    covariance : (10, 10) of them; the low-passed deviations are the last three.
    """

    transition: np.ndarray
    covariance: np.ndarray

    @property
    def means(self) -> np.ndarray:
        """Mean magnitudes, (3,)."""
        return np.sqrt(2 / np.pi * self.covariance.diagonal()[-3:])

    @property
    def correlations(self) -> np.ndarray:
        """Autocorrelations from sample to sample, (lags, 3), until a millionth is left."""
        slowest = np.abs(np.linalg.eigvals(self.transition)).max()
        rows, lagged = [], self.covariance
        for _ in range(int(np.log(1e-6) / np.log(slowest))):
            rows.append(lagged.diagonal()[-3:])
            lagged = self.transition @ lagged
        return np.array(rows) / rows[0]

    def standard_errors(self, samples: int) -> np.ndarray:
        """Of the means over so many samples, (3,).

        The covariance of |a|, |b| for Gaussian a, b of unit variance and correlation r is
        2/pi (sqrt(1 - r^2) + r asin(r) - 1).
        """
        r = np.clip(self.correlations, -1.0, 1.0)
        terms = np.sqrt(1.0 - r**2) + r * np.arcsin(r) - 1.0
        return self.means * np.sqrt((2 * terms.sum(axis=0) - terms[0]) / samples)


def stationary(gains: Gains, process: Process) -> Stationary:
    """The loop of process, disturbance observer (equation 9, implicit Euler) and low-pass."""
    h = process.step
    L = gains.values[:16].reshape(4, 4)
    to_friction = SHARES[:, None] * L[[0, 1, 3], :2]
    implicit = np.eye(3)  # 1 - h A
    implicit[:2, 2] = -h * EFFECT
    implicit[2, 2] -= h * gains["T_muDC"]
    measured = np.eye(2, 3)
    K = solve(implicit + h * to_friction @ measured, h * to_friction)
    # Rows by what was before the step (10) and the white noise in it (3).
    error, friction, first, second, news, noise = np.split(np.eye(13), [3, 4, 7, 10, 11])
    news, noise = process.news * news, np.array(process.noise)[:, None] * noise
    unforeseen = (process.kept - 1.0 / implicit[2, 2]) * friction + news
    predicted = inv(implicit) @ error + np.append(h * EFFECT, 1.0)[:, None] * unforeseen
    error = predicted - K @ (measured @ predicted + noise)
    friction = process.kept * friction + news
    deviations = np.vstack([error[:2] + noise, 1e-3 * FORCE * error[2:]])
    gain = 1.0 - np.exp(-CORNER * h)
    first = first + gain * (deviations - first)
    second = second + gain * (first - second)
    loop = np.vstack([error, friction, first, second])
    transition, driven = loop[:, :10], loop[:, 10:]
    return Stationary(transition, solve_discrete_lyapunov(transition, driven @ driven.T))


def expected_force(gains: Gains, process: Process) -> float:
    """The z that a recording without end has where only the force counts."""
    return float(stationary(gains, process).means[2])


NAMES = (*(f"L{i}{j}" for i in (1, 2, 3, 4) for j in (1, 2, 3, 4)), "T_muWR", "T_muDC")


def gains_of(L11: float, L41: float, T_muDC: float) -> Gains:
    """The wheelset's speed corrects itself and muDC, the roller's speed itself alone."""
    given = {"L11": L11, "L22": 10.0, "L41": L41, "T_muDC": T_muDC}
    values = np.array([given.get(name, 0.0) for name in NAMES])
    design = {"effect": np.array([1.0, EFFECT[0] / AUTHORITY])}
    return Gains(DisturbanceObserver.name, NAMES, values, design, "")


def kalman_gains(process: Process) -> tuple[Gains, float]:
    """The stationary Kalman filter as gains of the observer, and its error of the force [kN].

    An implicit step with L is a prediction and a correction by K = (1 - h A + h L C)^-1 h L.
    """
    h, kept = process.step, process.kept
    transition = np.array([[1.0, h * EFFECT[0] * kept], [0.0, kept]])
    news = process.news * np.array([[h * EFFECT[0]], [1.0]])
    C, R = np.array([[1.0, 0.0]]), np.array([[process.noise[0] ** 2]])
    P = solve_discrete_are(transition.T, C.T, news @ news.T, R)
    K = P @ C.T / (P[0, 0] + R)
    implicit = np.array([[1.0, -h * EFFECT[0]], [0.0, 1.0 - h * process.rate]])
    L = (implicit @ K / (h * (1.0 - K[0, 0]))).ravel() / SHARES[[0, 2]]
    error = np.sqrt((P - K @ C @ P)[1, 1])
    return gains_of(*L, process.rate), 1e-3 * FORCE * float(error)


def around(gains: Gains, free: Sequence[str]) -> SearchSpace:
    """Gains of either sign up to 100, for those that are free; the others stay."""
    values = gains.values
    limits = np.ones(values.size)
    both = SearchSpace(0.01 * limits, 100.0 * limits, -limits, limits, limits)
    start = both.coordinates(values)
    fixed = ~np.isin(gains.names, free)
    s = 2.0 * start - 1.0
    return replace(
        both,
        lower=np.where(fixed, s, -1.0),
        upper=np.where(fixed, s, 1.0),
        start=np.where(fixed, 0.5, start),
    )


def gain(search: Search, name: str) -> float:
    return float(search.best[NAMES.index(name)])


@pytest.fixture(scope="module")
def prepare_rolling(tmp_path_factory) -> Callable[..., Job]:
    """Prepares jobs on the linear model."""
    folder = tmp_path_factory.mktemp("rolling")
    rolling = declare(folder, *machine("rolling_wheelset"), RollingWheelset="Lib.RollingWheelset")
    assert corner(rolling.objective) == pytest.approx(CORNER)

    def prepared(gains: Gains, weights: Mapping[str, float], *cases: Case) -> Job:
        weighted = replace(rolling, objective=replace(rolling.objective, weights=weights))
        recordings = tuple(recording(case, weighted) for case in cases)
        model = (folder / "RollingWheelset.fmu").read_bytes()
        return Job(gains.estimator, weighted, model, gains, recordings, follows=False)

    return prepared


@pytest.mark.parametrize("step", [0.2, 0.02])
def test_z_is_that_of_the_lyapunov_equation(prepare_rolling, inline, step):
    """The low-pass follows a deviation wholly within 0.2 s, and by 39 % within 0.02 s."""
    process, samples = Process(step), 100_000
    best, _ = kalman_gains(process)
    L11, L41, T_muDC = best["L11"], best["L41"], best["T_muDC"]
    several = [
        best,
        gains_of(3 * L11, 3 * L41, T_muDC),
        gains_of(L11 / 3, L41 / 3, T_muDC),
        gains_of(L11, L41 / 3, 5 * T_muDC),
        gains_of(L11, 0.0, T_muDC),
    ]
    job = prepare_rolling(best, ALL, record(process, samples, np.random.default_rng(1)))
    z = evaluate_gains(inline(job), job, [gains.values for gains in several])[:, 0]
    scale = np.array(list(ALL.values())) * [1.0, 1.0, 1e3]
    loops = [stationary(gains, process) for gains in several]
    expected = np.array([scale @ loop.means for loop in loops])
    # At most, if the three terms of z err together.
    standard_errors = np.array([scale @ loop.standard_errors(samples) for loop in loops])
    assert_array_less(standard_errors, 0.03 * expected)
    assert_array_less(np.abs(z - expected), 4 * standard_errors)


def test_search_finds_the_kalman_gain_from_an_observer_without_feedback(
    prepare_rolling, inline, tmp_path
):
    """Samples 0.2 s apart: the low-pass has settled, and least variance is least z.

    At the optimum the error e is independent of its derivative d by the gains, so that the slope of
    the mean of |e| over n independent samples has the covariance E[d d']/n, and z the curvature
    H = sqrt(2/pi) E[d d']/std(e). The gains that are best for these samples then scatter about the
    optimum with the covariance pi/2 z/n inv(H), and their expected z exceeds the least by pi/4 z/n
    times a chi2 with as many degrees of freedom as gains.

    T_muDC is not searched: it may change places with the effective -L11 in the transfer from omegaW
    to muDC, so that there are two optima.
    """
    process, samples, free = Process(step=0.2), 20_000, ["L11", "L41"]
    best, error = kalman_gains(process)
    z = expected_force(best, process)
    # Two poles that have settled to 6e-5 each.
    assert_allclose(z, np.sqrt(2 / np.pi) * error, rtol=3e-4)

    blind = gains_of(0.0, 0.0, process.rate)
    job = prepare_rolling(blind, FORCE_ALONE, record(process, samples, np.random.default_rng(2)))
    tuned = search(
        inline(job),
        job,
        around(blind, free),
        [0],
        Plan(40, 1, seed=2),
        Checkpointing(tmp_path / "c.json"),
    )
    assert tuned.history[0].z > 2 * z

    optimum = np.array([best["L11"], best["L41"]])
    x = np.array([gain(tuned, name) for name in free])

    def expected(x: np.ndarray) -> float:
        return expected_force(gains_of(*x, process.rate), process)

    twin = gains_of(-process.rate / FADING, optimum[1], -FADING * optimum[0])
    assert_allclose(expected_force(twin, process), z)

    steps = np.diag(0.01 * np.abs(optimum))
    curvature = np.array(
        [
            [
                sum(a * b * expected(optimum + a * p + b * q) for a in (-1, 1) for b in (-1, 1))
                / (4 * p.sum() * q.sum())
                for p in steps
            ]
            for q in steps
        ]
    )
    r = np.abs(stationary(best, process).correlations[:, 2])
    independent = samples / (2 * r.sum() - r[0])  # as if d were correlated in time as long as e
    spread = np.sqrt(np.pi / 2 * z / independent * inv(curvature).diagonal())
    assert_array_less(spread, 0.07 * np.abs(optimum))
    assert_array_less(np.abs(x - optimum), 4 * spread)
    # Exceeded once in 10 000 recordings; 0.14 % of z.
    assert expected(x) / z - 1.0 < np.pi / 4 / independent * chi2.ppf(0.9999, len(free))


def test_search_ends_where_the_two_worst_cases_are_equally_bad(prepare_rolling, inline, tmp_path):
    """A lively friction asks for more feedback, a noisy sensor for less; 5 Hz matter to both."""
    lively = Process(step=0.02)
    noisy = Process(step=0.02, spread=0.01, decay=0.2, noise=(0.2, 0.003))
    samples, L11 = 20_000, 10.0

    def expected(process: Process, log_gain: float) -> float:
        return expected_force(gains_of(L11, -np.exp(log_gain), lively.rate), process)

    crossing = brentq(lambda s: expected(lively, s) - expected(noisy, s), np.log(0.1), np.log(20.0))
    rise_lively, rise_noisy = (
        (expected(p, crossing + 0.01) - expected(p, crossing - 0.01)) / 0.02
        for p in (lively, noisy)
    )
    assert rise_lively < 0.0 < rise_noisy

    blind = gains_of(L11, 0.0, lively.rate)
    rng = np.random.default_rng(3)
    cases = [record(process, samples, rng) for process in (lively, noisy)]
    job = prepare_rolling(blind, FORCE_ALONE, *cases)
    tuned = search(
        inline(job),
        job,
        around(blind, ["L41"]),
        [0, 1],
        Plan(40, 1, seed=3),
        Checkpointing(tmp_path / "c.json"),
    )
    assert tuned.history[0].z > 1.5 * expected(lively, crossing)
    # A search ends when z is spread by 1e-3; next to the crossing that is a difference of so much.
    assert_allclose(tuned.z_k[0], tuned.z_k[1], rtol=0.01)
    at_crossing = gains_of(L11, -np.exp(crossing), lively.rate)
    errors = [stationary(at_crossing, p).standard_errors(samples)[2] for p in (lively, noisy)]
    # Two curves that are wrong by so much cross elsewhere by their difference over that of slopes.
    margin = 4 * float(np.hypot(*errors)) / (rise_noisy - rise_lively)
    assert margin < 0.2
    assert abs(np.log(-gain(tuned, "L41")) - crossing) < margin
