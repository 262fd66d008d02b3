"""Estimators: what they recover, what they leave alone, and what they must not do."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import solve_continuous_lyapunov

from workbench.case import Case, read_cases
from workbench.cosim import Outcome, observe
from workbench.fmu import FMU
from workbench.objective import Weights, braking_window, low_pass, score
from workbench.observers import (
    ESTIMATE,
    DirectInversion,
    DisturbanceGains,
    DisturbanceObserver,
    Estimator,
    NoiseLevels,
    OpenLoop,
    OperatingPoint,
    stationary_gains,
)

RR, JR, TRAIN_INERTIA = 0.70, 1500.0, 7840.0
SECONDS, STEP = 24.0, 0.005


@pytest.fixture(scope="module")
def fmu(minimal_path: Path) -> Iterator[FMU]:
    with FMU(minimal_path) as opened:
        yield opened


@pytest.fixture(scope="module")
def gains(fmu: FMU) -> DisturbanceGains:
    return stationary_gains(fmu)


def recorded_stop(
    fmu: FMU,
    *,
    muDC: Callable[[float], float],
    muWR: float = 0.30,
    direction: float = 1.0,
    seed: int | None = 7,
) -> tuple[Case, np.ndarray]:
    """A stop from 80 km/h at 2.7 bar, simulated at 1 kHz with other friction than nominal.

    Returns the recording at 200 Hz, with the data sheet's sensor noise, and the true slip [m/s].
    """
    rng = np.random.default_rng(seed)
    omegaR = direction * 80 / 3.6 / RR
    fmu.start({"omegaR": omegaR, "omegaW": omegaR * RR / 0.46}, {"muWR": muWR})
    inputs = fmu.variables(["pB", "tauR", "dmuDC"])
    outputs = fmu.variables(["omegaW", "omegaR", "Fx", "slip"])
    rows = []
    for k in range(round(SECONDS / 0.001)):
        t = k * 0.001
        pB = 2.7e5 * (1 - np.exp(-max(0.0, t - 3.0) / 0.5))
        values = fmu.get(outputs)
        # The drive imitates a train: it supplies what the roller lacks in inertia.
        tauR = (TRAIN_INERTIA - JR) / TRAIN_INERTIA * RR * values[2]
        fmu.set(inputs, np.array([pB, tauR, muDC(t) - 0.30]))
        fmu.step(0.001)
        if k % 5 == 0:
            rows.append([t, pB, tauR, *fmu.get(outputs)])
    t, pB, tauR, omegaW, omegaR_, Fx, slip = np.array(rows).T
    noise = rng.standard_normal((4, t.size)) if seed is not None else np.zeros((4, t.size))
    case = Case(
        name="synthetic",
        title="synthetic",
        conditions=None,  # type: ignore[arg-type]
        time=t,
        pB=pB + 500.0 * noise[0],
        tauR=tauR + 40.0 * noise[1],
        omegaW=omegaW + (3e-4 * np.abs(omegaW) + 0.002) * noise[2],
        omegaR=omegaR_ + 0.003 * noise[3],
        Fx=Fx,
        source=Path("synthetic"),
    )
    return case, slip


def drying(t: float) -> float:
    """Friction of pads that dry: 0.18 to 0.36 within a stop."""
    return 0.36 - 0.18 * float(np.exp(-max(0.0, t - 3.0) / 4.0))


def all_estimators(fmu: FMU, gains: DisturbanceGains) -> list[Estimator]:
    return [OpenLoop(fmu), DirectInversion(fmu), DisturbanceObserver(fmu, gains)]


@pytest.mark.parametrize("which", range(3))
def test_every_estimator_keeps_the_contract(
    fmu: FMU, gains: DisturbanceGains, dry_case: Case, which: int
) -> None:
    """Shape, finite force, and the same bits when it starts again."""
    estimator = all_estimators(fmu, gains)[which]
    runs = []
    for _ in range(2):
        rows = [estimator.init(dry_case.time[0], dry_case.u[0], dry_case.y[0])]
        rows += [
            estimator.step(dry_case.time[k], dry_case.u[k], dry_case.y[k]) for k in range(1, 300)
        ]
        runs.append(np.array(rows))
    assert runs[0].shape == (300, len(ESTIMATE))
    assert np.isfinite(runs[0][:, list(ESTIMATE).index("Fx")]).all()
    assert_array_equal(runs[0], runs[1])


def test_disturbance_observer_recovers_friction_and_force(
    fmu: FMU, gains: DisturbanceGains
) -> None:
    """Recovery: muDC within 0.01 and Fx within 2 % on a stop whose pads dry."""
    case, _ = recorded_stop(fmu, muDC=drying)
    run = observe(case, DisturbanceObserver(fmu, gains))
    window = braking_window(case, RR)
    settled = slice(window.start + 200, window.stop)
    truth = np.array([drying(t) for t in case.time])
    # 0.01 is the accuracy asked of dry friction; noise is averaged over what 5 Hz pass.
    error = low_pass(case.time, run.signal("muDC") - truth)[settled]
    assert np.abs(error).max() < 0.01
    judged = score(case, run, RR, Weights())
    assert judged.Fx_nrmse is not None
    assert judged.Fx_nrmse < 0.02


def test_forward_and_reverse_are_mirror_images(fmu: FMU, gains: DisturbanceGains) -> None:
    """Property: speeds, torque and force change sign, friction does not."""
    case, _ = recorded_stop(fmu, muDC=drying)
    mirrored = replace(case, tauR=-case.tauR, omegaW=-case.omegaW, omegaR=-case.omegaR, Fx=-case.Fx)
    forward = observe(case, DisturbanceObserver(fmu, gains))
    reverse = observe(mirrored, DisturbanceObserver(fmu, gains))
    signs = np.array([-1.0, -1.0, 1.0, 1.0, -1.0, -1.0])
    # Rounding only, amplified by the stiff slip.
    assert_allclose(reverse.estimate, signs * forward.estimate, rtol=1e-6, atol=1e-3)


def test_without_gains_the_observer_is_the_open_loop_model(
    fmu: FMU, gains: DisturbanceGains
) -> None:
    case, _ = recorded_stop(fmu, muDC=drying)
    zero = DisturbanceGains(np.zeros((4, 4)), -1.0, -1.0, gains.effect)
    free = observe(case, DisturbanceObserver(fmu, zero))
    open_loop = observe(case, OpenLoop(fmu))
    # The two write the same implicit step differently: rounding only.
    assert_allclose(free.estimate, open_loop.estimate, rtol=1e-6, atol=1e-3)


def test_friction_deviations_decay_without_measurement(fmu: FMU, gains: DisturbanceGains) -> None:
    """Reference: dmu(t) = dmu(0) exp(T t), equation (10), by implicit Euler."""
    observer = DisturbanceObserver(fmu, replace(gains, T_WR=-0.5, T_DC=-2.0))
    standstill, nothing = np.zeros(2), np.zeros(2)
    observer.init(0.0, nothing, standstill)
    observer._z[2:4] = [0.1, 0.05]
    for k in range(1, 201):
        estimate = observer.step(0.01 * k, nothing, standstill)
    # Implicit Euler with h*T = 0.02 over t*T = 4: relative error h*T*t*T/2 = 4 %.
    assert_allclose(
        estimate[2:4] - [0.15, 0.30], [0.1 * np.exp(-1.0), 0.05 * np.exp(-4.0)], rtol=0.05
    )


def test_nothing_is_learned_about_pads_that_do_not_touch(fmu: FMU, gains: DisturbanceGains) -> None:
    """Without pressure muDC has no effect (Schwarz et al. 2018): it stays where it is."""
    case, _ = recorded_stop(fmu, muDC=drying)
    coasting = case.time < 2.9
    run = observe(case, DisturbanceObserver(fmu, gains))
    assert_array_equal(np.abs(run.signal("muDC")[coasting] - 0.30).max(), 0.0)


def test_a_standing_wheelset_has_no_chattering_force(
    fmu: FMU, gains: DisturbanceGains, root: Path
) -> None:
    """At rest the noise of two speed sensors must not appear as creep force."""
    for case in read_cases([root / "cases"]):
        resting = case.time > case.time[-1] - 0.5
        run = observe(case, DisturbanceObserver(fmu, gains))
        # 100 N is the noise of the load cell itself (80 N) with a margin for the drive's torque.
        assert np.abs(run.signal("Fx")[resting]).max() < 100.0, case.name


def test_stationary_gains_stabilise_the_linearised_model(fmu: FMU, gains: DisturbanceGains) -> None:
    """Reference: eigenvalues of the extended error dynamics, all of the observer's poles."""
    point, noise = OperatingPoint(), NoiseLevels()
    stationary_gains(fmu, point, noise)
    extended = np.zeros((4, 4))
    extended[:2, :2] = fmu.state_jacobian()
    extended[:2, 2:] = fmu.input_jacobian(fmu.variables(["dmuWR", "dmuDC"]))
    extended[[2, 3], [2, 3]] = noise.decay
    error = extended - gains.L[:, :2] @ np.eye(2, 4)
    assert np.linalg.eigvals(error).real.max() < -0.1
    # The Kalman gain satisfies its own Riccati equation: P from the Lyapunov equation of the error.
    R = np.diag([noise.omegaW, noise.omegaR]) ** 2 * noise.sample_time
    Q = np.diag([noise.model, noise.model, noise.muWR, noise.muDC]) ** 2
    K = gains.L[:, :2]
    P = solve_continuous_lyapunov(error, -(Q + K @ R @ K.T))
    # Two solvers of condition number 1e6 agree to ten digits less.
    assert_allclose(P[:, :2] @ np.linalg.inv(R), K, rtol=1e-5, atol=1e-6 * np.abs(K).max())


def test_direct_inversion_is_exact_where_nothing_changes(fmu: FMU) -> None:
    """Reference: Fx = (tauR - JR*a - loss)/rR at constant deceleration a, after the filter."""
    t = np.arange(0.0, 4.0, 0.005)
    omegaR = 40.0 - 1.5 * t
    tauR = np.full_like(t, 9000.0)
    estimator = DirectInversion(fmu)
    y = np.column_stack([omegaR * RR / 0.46, omegaR])
    u = np.column_stack([np.zeros_like(t), tauR])
    estimator.init(t[0], u[0], y[0])
    for k in range(1, t.size):
        estimate = estimator.step(t[k], u[k], y[k])
    # The loss is that of 0.2 s ago, for the filter's delay; the filter has settled to exp(-20).
    delayed = omegaR[-1] + 1.5 * 0.2
    loss = 40 + 1.0 * delayed + 0.02 * delayed**2
    assert_allclose(estimate[4], (9000.0 + 1500.0 * 1.5 - loss) / RR, rtol=1e-5)


def test_direct_inversion_lags_by_its_time_constant(fmu: FMU) -> None:
    """Reference: a first-order filter reaches 1 - 1/e of a step after its time constant."""
    estimator = DirectInversion(fmu, time_constant=0.2)
    y = np.array([40.0 * RR / 0.46, 40.0])
    start = estimator.init(0.0, np.array([0.0, 0.0]), y)[4]
    h = 0.001
    for k in range(1, 201):
        estimate = estimator.step(k * h, np.array([0.0, 7000.0]), y)
    # Backward Euler with h = T/200: 0.1 % of the step.
    assert_allclose((estimate[4] - start) / 1e4, 1 - np.exp(-1.0), rtol=3e-3)


def test_unstable_gains_end_as_an_outcome_not_as_an_exception(
    fmu: FMU, gains: DisturbanceGains, dry_case: Case
) -> None:
    wild = replace(gains, L=-1e6 * np.ones((4, 4)))
    run = observe(dry_case, DisturbanceObserver(fmu, wild))
    judged = score(dry_case, run, RR, Weights())
    assert run.outcome is not Outcome.OK or (judged.Fx_nrmse or 0.0) > 0.5
    if run.outcome is not Outcome.OK:
        assert run.outcome.value in judged.reason
