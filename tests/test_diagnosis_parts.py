"""The parts that a diagnosis is made of, each against a closed form or an independent way."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import lsq_linear

from workbench.arrays import Matrix, Vector
from workbench.diagnosis import build_everything, choose, given_values, read_effects
from workbench.diagnosis.data.cleaning import outliers, smooth, uneven_steps
from workbench.diagnosis.data.clocks import in_time
from workbench.diagnosis.data.counting import count
from workbench.diagnosis.data.motion import ModelSource, OpenModel, motion, opened
from workbench.diagnosis.data.samples import Samples, compared
from workbench.diagnosis.data.samples import prepare as prepare_samples
from workbench.diagnosis.effects.extension import (
    ExtendedModel,
    build,
    sizes_by_component,
    variables,
)
from workbench.diagnosis.inference.crossvalidation import CrossValidation
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.linearized import LinearizedPoint, Point, slowness
from workbench.diagnosis.inference.quadratic import (
    Joint,
    Quadratic,
    RecordingSystem,
    add,
    covariance,
    minimum,
    minimum_within,
)
from workbench.diagnosis.inference.rivals import Rival
from workbench.diagnosis.inference.score_test import CandidateScore, predictive_deviance
from workbench.diagnosis.inference.search import FittedModel, extended, joined
from workbench.diagnosis.inference.selection import anew
from workbench.diagnosis.inference.thresholds import SOUND
from workbench.diagnosis.simulation.prediction import Predictor, Variation
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.diagnosis.simulation.simulator import (
    SimulatorSetup,
    WhitenedResiduals,
    delay,
    simulating,
)
from workbench.errors import FMUError, InputError
from workbench.models.fmu import FMU, CoSimulation
from workbench.models.modelica import read_library
from workbench.recordings.case import Case, make_case, read_cases
from workbench.system.registry import load_system
from workbench.system.template import write_system

from .edits import edit
from .systems import WHEELSET as SYSTEM

ROOT = Path(__file__).parent.parent
LIBRARY = read_library(ROOT / "modelica" / "WheelsetRig" / "package.mo")
EFFECTS = read_effects(LIBRARY, "MinimalObserver")
MINIMAL = ROOT / "fmus" / "fmi2" / "MinimalObserver.fmu"
DRY = {
    "initial_speed": 27.8,
    "brake_pressure": 2.7e5,
    "wheel_rail": "dry",
    "discs": ("dry", "dry", "dry"),
    "direction": 1,
}
INPUTS, OUTPUTS = ("pB", "tauR"), ("omegaW", "omegaR")


def simulated(fmu: Path, parameters: dict[str, float]) -> Case:
    """A stop without noise, by the FMU's own integrator (RODAS, implicit, with error control)."""
    h, n = 0.005, 3200
    time = h * np.arange(n)
    # A ramp of 1 s and a torque that takes four fifths of the deceleration, as the drive does.
    pB = 2.7e5 * np.clip(time - 3.0, 0.0, 1.0)
    tauR = 7500.0 * np.clip(time - 3.2, 0.0, 1.0)
    readings = ("omegaWReading", "omegaRReading", "FxReading")
    rows = []
    with CoSimulation(fmu) as model:
        inputs, outputs = model.variables(["pB", "tauR"]), model.variables(readings)
        model.start({"omegaW": 39.0 * 0.70 / 0.46, "omegaR": 39.0}, {"muWR": 0.4, **parameters})
        for k in range(n):
            model.set(inputs, np.array([pB[k], tauR[k]]))
            rows.append(model.get(outputs).copy())
            # Inputs are held in a step: ten of them follow the ramp to 0.25 ms.
            for i in range(10):
                share = (i + 0.5) / 10
                after = min(k + 1, n - 1)
                between = [
                    pB[k] + share * (pB[after] - pB[k]),
                    tauR[k] + share * (tauR[after] - tauR[k]),
                ]
                model.set(inputs, np.array(between))
                model.step(h / 10)
    read = dict(zip(("omegaW", "omegaR", "Fx"), np.array(rows).T, strict=True))
    return stop(time, {"pB": pB, "tauR": tauR, **read})


def stop(time: Vector, signals: dict[str, Vector]) -> Case:
    return Case("stop", "a stop", DRY, time, signals, INPUTS, OUTPUTS, Path("none.csv"))


def prepare(case: Case, fmu: FMU) -> Samples:
    signals = compared(SYSTEM, [case])
    return prepare_samples(case, SYSTEM, signals, OpenModel(fmu, motion(fmu, SYSTEM)))


def test_a_signal_that_a_recording_has_not_says_nothing_and_leaves_the_others(everything):
    """Beside one that has it."""
    case = simulated(everything, {})
    rng = np.random.default_rng(5)
    noise = {name: SYSTEM.signals[name].deviation(case[name]) for name in case.signals}
    case = case.with_signals(
        {n: case[n] + noise[n] * rng.standard_normal(case.time.size) for n in case.signals}
    )
    speeds = replace(case.without(["Fx"]), name="speeds")
    values = {"muWR": 0.4}
    with ResidualModel(ModelSource(everything, SYSTEM, {}), [case, speeds]) as both:
        measured, silent = both.at([{**values, delay("Fx"): 0.0}] * 2)
    with ResidualModel(ModelSource(everything, SYSTEM, {}), [speeds]) as alone:
        (without,) = alone.at([values])
    assert silent.blocks.tolist() == [*without.blocks, 0]
    assert np.array_equal(silent.errors[:, :2], without.errors)
    assert np.array_equal(silent.sizes[:, :2], without.sizes)
    assert np.isnan(silent.sizes[:, 2]).all()
    assert np.square(silent.errors[:, 2]).sum() < 1e-9
    # What lasts in one of two recordings is as large as in that one.
    loud = replace(measured, errors=3.0 * measured.errors)
    assert slowness([loud, silent], 20)[2] == pytest.approx(slowness([loud], 20)[2], rel=1e-9)


def errors_of(case: Case, fmu: FMU, values: dict[str, float]) -> tuple[Samples, Matrix]:
    """Prediction errors of all samples."""
    ready = prepare(case, fmu)
    return ready, Predictor(fmu, SYSTEM, ready.signals).errors(ready, values)


@pytest.mark.parametrize(
    "effects",
    [{}, {"padFriction.brakeFade.fade": 5e-4}, {"wheelRadius.outOfRoundWheel.cosine": 2e-4}],
)
def test_prediction_agrees_with_an_error_controlled_integrator(effects, everything):
    case = simulated(everything, effects)
    with FMU(everything) as fmu:
        ready, errors = errors_of(case, fmu, {"muWR": 0.4, **effects})
    moving = slice(200, int(ready.blocks[-1, 1]))
    # Steps of 5 ms, force of 14 kN: 1 N where the force is smooth, and 25 N for the samples at the
    # two kinks of the ramp; a wheel out of round shakes the force by 0.9 kN at 9 Hz, of which
    # 5 % is lost. The noise of one sample is 80 N and 10 mm/s.
    turning = "wheelRadius.outOfRoundWheel.cosine" in effects
    assert np.sqrt(np.mean(errors[moving, 2] ** 2)) < (35.0 if turning else 1.0)
    assert np.abs(errors[moving, 2]).max() < (170.0 if turning else 25.0)
    assert np.abs(0.46 * errors[moving, 0]).max() < 0.015


def test_an_effect_of_size_zero_predicts_what_the_observer_model_does(everything):
    case = simulated(MINIMAL, {})
    both = []
    for path in (MINIMAL, everything):
        with FMU(path) as fmu:
            both.append(errors_of(case, fmu, {"muWR": 0.4})[1])
    moving = slice(200, 2800)
    np.testing.assert_allclose(both[0][moving], both[1][moving], rtol=0, atol=1e-7)


def noisy(seed: int, spikes: tuple[int, ...] = ()) -> Case:
    """A stop at constant deceleration with the noise of the rig's sensors."""
    rng = np.random.default_rng(seed)
    time = 0.005 * np.arange(6000)
    omegaR = 40.0 - 1.2 * np.maximum(0.0, time - 3.0)
    signals = {
        "pB": 2.7e5 * np.clip(time - 3.0, 0.0, 1.0) + 500.0 * rng.standard_normal(6000),
        "tauR": 5000.0 * np.clip(time - 3.0, 0.0, 1.0) + 40.0 * rng.standard_normal(6000),
        "omegaW": omegaR * 0.70 / 0.46 * (1.0 + 3e-4 * rng.standard_normal(6000)),
        "omegaR": omegaR + 0.003 * rng.standard_normal(6000),
        "Fx": 15e3 * np.clip(time - 3.0, 0.0, 1.0) + 80.0 * rng.standard_normal(6000),
    }
    for k in spikes:
        signals["Fx"][k] += 5e3
        signals["omegaR"][k] += 1.0
    return stop(time, signals)


def ready(case: Case) -> Samples:
    with FMU(MINIMAL) as fmu:
        return prepare(case, fmu)


@pytest.mark.parametrize("share", [0.5, -0.5, 2.3])
def test_a_clock_that_is_set_right_leaves_readings_the_noise_they_have(share):
    """A line between two samples would have half of its variance, and half a sample be favoured.

    Of 6000 samples the standard deviation is known to 1 %; the mean of ten that moves adds 0.5 %.
    """
    samples = ready(noisy(2))
    late, j = share * SYSTEM.sample_time, samples.signals.index("omegaR")
    ramp, rng = -3.0 * samples.time, np.random.default_rng(5)
    y = samples.y.copy()
    y[:, j] = ramp + 0.1 * rng.standard_normal(ramp.size)
    errors = in_time(replace(samples, y=y), {"omegaR": late}).y[:, j] - (ramp - 3.0 * late)
    inside = slice(20, -20)  # before the first and after the last sample nothing was recorded
    assert np.std(errors[inside]) == pytest.approx(0.1, rel=0.05)
    assert abs(np.mean(errors[inside])) < 5e-3


def test_errors_of_blocks_are_means_of_the_samples_that_a_channel_has():
    rng = np.random.default_rng(1)
    whole = ready(noisy(1))
    samples = replace(whole, measured=rng.uniform(size=whole.measured.shape) < 0.7)
    errors = rng.standard_normal((*samples.y.shape, 2))
    channels = np.einsum("cj,njp->ncp", samples.slopes, errors)
    means = samples.channels(errors)
    for b, (first, end) in enumerate(samples.blocks):
        for c, has in enumerate(samples.measured[first:end].T):
            assert means[b, c] == pytest.approx(channels[first:end, c][has].mean(axis=0))


def test_rates_at_uneven_samples_are_those_of_numpy():
    rng = np.random.default_rng(1)
    samples = ready(noisy(1))
    samples = replace(samples, time=np.cumsum(rng.uniform(0.5, 1.5, samples.time.size)))
    values = rng.standard_normal((samples.time.size, 3))
    assert samples.rate(values) == pytest.approx(np.gradient(values, samples.time, axis=0))


def test_spikes_are_set_aside_with_their_blocks():
    spikes = (1503, 2407, 3801)
    samples = ready(noisy(1, spikes))
    assert samples.set_aside["spike, dropout or saturation"] == len(spikes)
    for k in spikes:
        assert not any(first <= k < end for first, end in samples.blocks)
        assert samples.gain[k] == 0.0


def test_blocks_span_equal_times_where_steps_do_not(tank):
    """A cycler: 0.5 s while it pulses, one sample in 60 s while it rests; nearly all counts."""
    time = np.concatenate(
        [3060.0 * k + np.append(np.arange(0.0, 60.0, 0.5), 60.0 * np.arange(1, 51)) for k in (0, 1)]
    )
    noise = np.random.default_rng(1)
    signals = {
        "inflow": 4e-3 + 5e-5 * noise.standard_normal(time.size),
        "h": 1.0 + 0.1 * np.sin(time / 500.0) + 2e-3 * noise.standard_normal(time.size),
    }
    case = make_case("cycler", (time, signals), {}, tank)
    counted = count(case, tank, ("inflow", "h"), SOUND, restarting=False)
    first, end = counted.blocks.T
    seconds = np.append(time, time[-1])[end] - time[first]
    assert seconds.sum() > 0.95 * (time[-1] - time[0])
    assert counted.missing == 0
    dense = np.diff(np.append(time, time[-1] + 60.0))[first] < 1.0
    assert (end - first)[dense].tolist() == [5] * dense.sum()
    assert (end - first)[~dense].max() == 1
    held = smooth(time, signals["inflow"], (5.0, 10.0), 0.5, SOUND.held)
    resting = (np.diff(time, prepend=0.0) > 1.0) & (np.diff(time, append=np.inf) > 1.0)
    assert (held[resting] == signals["inflow"][resting]).all()


def test_samples_that_are_lost_at_random_are_no_other_rate():
    kept = np.random.default_rng(1).random(20_000) > 0.3
    assert not uneven_steps(np.flatnonzero(kept) * 0.01, 0.01).any()


def test_a_gap_is_in_no_block_and_leaves_others_as_they_are(tank):
    time = np.delete(np.arange(0.0, 600.0, 0.5), slice(400, 440))
    noise = np.random.default_rng(1)
    signals = {
        "inflow": 4e-3 + 5e-5 * noise.standard_normal(time.size),
        "h": 1.0 + 2e-3 * noise.standard_normal(time.size),
    }
    case = make_case("gap", (time, signals), {}, tank)
    blocks = count(case, tank, ("inflow", "h"), SOUND, restarting=False).blocks
    assert set((blocks[:, 1] - blocks[:, 0]).tolist()) == {5}
    assert np.diff(np.array([time[first:end] for first, end in blocks])).max() < 5.0


@pytest.mark.parametrize("name", ["pB", "tauR", "omegaW", "omegaR", "Fx"])
def test_single_wrong_samples_are_found_wherever_they_strike(name):
    """From a tenth of the range on, in stops with ramps and steps; nothing else is added."""
    rng, struck, missed, more = np.random.default_rng(3), 20, 0, 0
    for case in read_cases([ROOT / "cases"], SYSTEM):
        values, sensor = case[name], SYSTEM.signals[name]
        before = outliers(values, sensor, SOUND)
        at = rng.choice(np.arange(5, values.size - 5), struck, replace=False)
        wrong = values.copy()
        wrong[at] += rng.choice([-1, 1], struck) * rng.uniform(0.1, 1.0, struck) * abs(values).max()
        wrong_samples = outliers(wrong, sensor, SOUND)
        missed += int(np.sum(~wrong_samples[at]))
        more += int(np.sum(np.delete(wrong_samples & ~before, at)))
    # Two that strike within a window of the median, or a ramp's foot, hide each other.
    assert missed <= 0.03 * 14 * struck
    assert more == 0


def test_pressure_loses_its_noise_but_no_time():
    time = 0.005 * np.arange(4000)
    # Up within half a second, held, down: as a valve with its lags does.
    true = 2.7e5 * (1.0 - np.exp(-np.clip(time - 4.0, 0.0, None) / 0.5))
    true *= np.exp(-np.clip(time - 14.0, 0.0, None) / 0.5)
    noise = 500.0 * np.random.default_rng(8).standard_normal(time.size)
    speeds = {"omegaW": 39.0 / 0.46 + noise * 1e-5, "omegaR": 39.0 / 0.70 + noise * 1e-6}
    pB = ready(stop(time, {"pB": true + noise, "tauR": np.zeros(time.size), **speeds})).u[:, 0]
    held = (time > 9.0) & (time < 12.5)
    # 400 samples in a mean, 30 in a parabola of three times its variance.
    assert np.std(pB[held] - true[held]) < 2.0 * 500.0 / np.sqrt(400.0)
    assert np.std(pB - true) < 2.0 * 500.0 * np.sqrt(9.0 / 4.0 / 30.0)
    rises = (time > 4.2) & (time < 6.0)
    late = -np.sum((pB - true)[rises]) / np.sum(np.gradient(true, time)[rises])
    assert abs(late) < 0.001


def test_noise_is_whitened_to_variance_one():
    case = noisy(2)
    samples = ready(case)
    smooth = np.column_stack(
        [np.zeros(case.time.size) + 40.0 - 1.2 * np.maximum(0.0, case.time - 3.0)] * 2
    ) * np.array([0.70 / 0.46, 1.0])
    force = 15e3 * np.clip(case.time - 3.0, 0.0, 1.0)
    errors = np.column_stack([case[name] for name in ("omegaW", "omegaR", "Fx")]) - np.column_stack(
        [smooth, force]
    )
    white = np.einsum("bij,bj->bi", samples.whitening, samples.channels(errors))
    # 500 blocks: a variance is known to 6 %. The roller's channel allows for the prediction's own
    # variance, which pure measurement noise does not have.
    assert white[:, 0].var() == pytest.approx(1.0, abs=0.25)
    assert white[:, 2].var() == pytest.approx(1.0, abs=0.25)
    assert 0.3 < white[:, 1].var() < 1.2


def test_errors_that_last_are_noise_though_samples_are_missing():
    """The right gain leaves innovations white: a mean over a second has the variance of a mean."""
    rng, draws = np.random.default_rng(6), 40
    kept = rng.random(6000) > 0.3
    case = noisy(6)
    case = stop(case.time[kept], {name: values[kept] for name, values in case.signals.items()})
    samples, n = ready(case), case.time.size
    # As `noisy` makes it, and 1.2 for ripple; pressure counts by the lever of three discs.
    lever = 3 * 0.30 * 0.1086 * 0.30 * 0.70 / 0.46
    torque = 1.2 * np.hypot(40.0, lever * 500.0) * rng.standard_normal((n, draws))
    between = 0.5 * np.diff(case.time)[:, None] * (torque[1:] + torque[:-1])
    pushed = between / (1500.0 + 110.0 * (0.70 / 0.46) ** 2)
    errors, away = np.zeros((n, draws)), np.zeros(draws)
    for k in range(n):
        errors[k] = away + 0.003 * rng.standard_normal(draws)
        if k + 1 < n:
            away = away - samples.gain[k] * errors[k] + pushed[k]
    expected = np.linalg.inv(samples.whitening)[:, 1]
    scale = np.sqrt((expected**2).sum(axis=1))
    means = np.array([errors[first:end].mean(axis=0) for first, end in samples.blocks])
    white = means / scale[:, None]
    lasting = white[: len(white) // 20 * 20].reshape(-1, 20, draws).mean(axis=1)
    # 20 seconds of 40 draws: a variance is known to 5 %.
    assert 20.0 * np.square(lasting).mean() == pytest.approx(1.0, abs=0.15)


def test_load_cells_behind_the_mode_follow_its_transfer_function():
    samples = ready(noisy(3))
    for frequency in (2.0, 8.0, 15.0):
        read = samples.behind_structure(2, np.sin(2.0 * np.pi * frequency * samples.time))[2000:]
        s, mode = 1j * frequency, 21.6
        gain = abs(mode**2 / (s**2 + 2 * 0.05 * mode * s + mode**2))
        # Matched poles: 1 % of the amplitude, and 1 % for the samples missing the crest.
        assert np.abs(read).max() == pytest.approx(gain, rel=0.02)


def test_a_step_that_is_held_at_its_bound_lets_the_others_do_their_best():
    rng = np.random.default_rng(5)
    J, r = rng.normal(size=(40, 3)), rng.normal(size=40)
    J[:, 1] += 2.0 * J[:, 0]  # what one of them does the other may do too
    total = Quadratic(J.T @ J, J.T @ r, float(r @ r), 40)
    free = minimum(total)
    bound = 0.5 * abs(free[0])
    wide = np.array([bound, np.inf, np.inf])
    step = minimum_within(total, -wide, wide)
    assert step[0] == pytest.approx(0.5 * free[0], rel=1e-12)
    best = np.linalg.lstsq(J[:, 1:], -(r + step[0] * J[:, 0]), rcond=None)[0]
    # Of normal equations, whose condition is some ten: rounding.
    np.testing.assert_allclose(step[1:], best, rtol=1e-9)
    np.testing.assert_allclose(minimum_within(total, np.full(3, -9.0), np.full(3, 9.0)), free)


def test_eliminating_local_unknowns_is_least_squares_over_all():
    rng = np.random.default_rng(4)
    systems = [
        RecordingSystem(
            *(rng.normal(size=40), rng.normal(size=(40, 3)), rng.normal(size=(40, 5)), d),
            furthest=np.full(5, np.inf),
            channels=3,
        )
        for d in rng.normal(size=(4, 5))
    ]
    total = add([system.eliminated() for system in systems])
    step = minimum(total)
    # The same by brute force: all local unknowns side by side, priors as rows.
    rows, right = [], []
    for k, system in enumerate(systems):
        block = np.zeros((40 + 5, 3 + 5 * 4))
        block[:40, :3], block[:40, 3 + 5 * k : 8 + 5 * k] = system.J, system.P
        block[40:, 3 + 5 * k : 8 + 5 * k] = np.eye(5)
        rows.append(block)
        right.append(np.concatenate([system.r, system.deviations]))
    matrix, vector = np.vstack(rows), np.concatenate(right)
    brute = np.linalg.lstsq(matrix, -vector, rcond=None)[0]
    np.testing.assert_allclose(step, brute[:3], rtol=1e-6)
    assert total.at(step) == pytest.approx(float(np.sum((matrix @ brute + vector) ** 2)), rel=1e-6)
    full = np.linalg.inv(matrix.T @ matrix)
    np.testing.assert_allclose(covariance(total.N), full[:3, :3], rtol=1e-6)
    nothing = Quadratic(np.zeros((3, 3)), np.zeros(3), 0.0, 0)
    keys = tuple(("effect", name) for name in "abc")
    means = np.hstack([np.zeros((5, 3)), np.tile(np.eye(5) / 4, 4)])
    shown = np.vstack([np.eye(3, 23), means])
    joint = Joint(keys, keys, (), tuple(systems), nothing)
    np.testing.assert_allclose(joint.covariance(), shown @ full @ shown.T, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(systems[2].local(step), brute[13:18], rtol=1e-6)


def test_two_local_unknowns_that_act_alike_leave_what_one_of_them_does():
    """Starts of two states may move all that is measured alike, by far more than tolerances do."""
    single = recording(np.random.default_rng(5), 2, 9.0)
    P = np.sign(single.P[:, :1]) * 2.0**40  # whose products are exact
    single = replace(single, P=P, deviations=np.zeros(1), furthest=np.full(1, 9.0))
    both = replace(
        single,
        P=np.hstack([single.P, single.P]),
        deviations=np.zeros(2),
        furthest=np.full(2, 9.0),
    )
    alone, together = single.eliminated(), both.eliminated()
    assert_allclose(together.N, alone.N, rtol=1e-6, atol=1e-6)
    z = np.array([0.3, -0.2])
    assert_allclose(both.local(z).sum(), single.local(z).sum(), rtol=1e-6)


def test_a_tolerance_at_its_bound_stays_there_while_the_rest_does_its_best():
    rng = np.random.default_rng(4)
    begun = rng.uniform(-1.0, 1.0, size=(4, 3))
    far = 0.9 * np.abs(begun).max()  # some are beyond it as begun
    systems = tuple(
        RecordingSystem(
            *(rng.normal(size=40), rng.normal(size=(40, 2)), rng.normal(size=(40, 3)), d),
            furthest=np.full(3, far),
            channels=3,
        )
        for d in begun
    )
    nothing = Quadratic(np.zeros((2, 2)), np.zeros(2), 0.0, 0)
    joint = Joint((("", "a"), ("", "b")), (), (), systems, nothing)
    step, local = joint.solve(np.full(2, -9.0), np.full(2, 9.0))
    # The same by an independent solver, all local unknowns side by side.
    matrix, right = np.zeros((4 * 43, 2 + 4 * 3)), np.zeros(4 * 43)
    for k, system in enumerate(systems):
        at, own = slice(43 * k, 43 * k + 40), slice(2 + 3 * k, 5 + 3 * k)
        matrix[at, :2], matrix[at, own], right[at] = system.J, system.P, system.r
        matrix[43 * k + 40 : 43 * k + 43, own] = np.eye(3)
        right[43 * k + 40 : 43 * k + 43] = system.deviations
    begun = np.concatenate([np.zeros(2), *begun])
    reach = np.append([9.0, 9.0], np.full(12, far))
    best = lsq_linear(matrix, -right, (-reach - begun, reach - begun), tol=1e-13).x
    assert np.sum(np.abs(best + begun) > reach - 1e-9) > 0
    # By normal equations, whose condition is some ten: rounding; the solver's own tolerance.
    np.testing.assert_allclose([*step, *np.concatenate(local)], best, rtol=1e-5, atol=1e-7)


def linearised(errors: Matrix) -> LinearizedPoint:
    residuals = (whitened(errors, np.zeros(1)),)
    return LinearizedPoint(Point({}, {}, np.zeros((1, 5)), {}), (), residuals, 20, np.ones(3), 0.0)


def whitened(errors: Matrix, rest: Vector) -> WhitenedResiduals:
    """Of a recording that has all its signals."""
    (b, c), q = errors.shape, rest.size
    jacobian, blocks = np.zeros((b * c + q, 0)), np.full(c, b)
    return WhitenedResiduals(errors, rest, np.zeros((2, c)), jacobian, blocks)


def test_deviance_is_chi_squared_where_errors_are_noise():
    lin = linearised(np.random.default_rng(4).standard_normal((400, 3)))
    assert lin.deviance == pytest.approx(lin.misfit, rel=1e-12)
    assert lin.spread.tolist() == [1.0, 1.0, 1.0]


def test_chi_squared_over_spread_is_the_slope_of_the_deviance():
    errors = np.random.default_rng(4).standard_normal((400, 3)) * [1.0, 3.0, 200.0]
    lin, step = linearised(errors), 1e-6
    for j, spread in enumerate(lin.spread):
        scale = np.ones(3)
        scale[j] += step
        slope = (linearised(errors * scale).deviance - lin.deviance) / step
        # Second order: a part in a million of the slope, which is of the order of the step.
        assert slope == pytest.approx(2.0 * np.square(errors[:, j]).sum() / spread, rel=1e-5)


def test_to_spoil_a_clean_channel_for_a_wrong_one_is_no_gain():
    errors = np.random.default_rng(4).standard_normal((400, 3)) * [1.0, 1.0, 40.0]
    traded = linearised(errors * [1.0, 10.0, 0.5])
    assert traded.misfit < linearised(errors).misfit
    assert traded.deviance > linearised(errors).deviance


def test_covariance_is_the_same_in_any_unit():
    rng = np.random.default_rng(5)
    matrix = rng.normal(size=(30, 4))
    units: Vector = np.array([1.0, 1e5, 1e-6, 30.0])
    plain = covariance(matrix.T @ matrix)
    other = covariance((matrix / units).T @ (matrix / units))
    np.testing.assert_allclose(other, plain * np.outer(units, units), rtol=1e-8)


def test_sizes_have_bounds_units_and_a_zero_default(everything):
    with FMU(everything) as fmu:
        described = {variable.name: variable for variable in fmu.description.variables}
        for effect in EFFECTS:
            for parameter in effect.sizes:
                for name in variables(effect, parameter):
                    size = described[name]
                    assert fmu.defaults[name] == 0.0
                    assert size.unit
                    assert size.minimum <= 0.0 < effect.matters < size.maximum
            for shape, values in effect.shapes:
                size = described[variables(effect, shape)[0]]
                assert size.minimum <= min(values) <= max(values) <= size.maximum


def test_water_is_where_the_conditions_say_if_those_of_any_stop_do(everything):
    effects = {effect.name: effect for effect in EFFECTS}
    film, single, lag = (effects[n] for n in ("WaterFilm", "SingleDiscWaterFilm", "CylinderLag"))
    named = ("03_dry_120_3.6", "13_onedisc_100_2.7", "11_brakewet_120_2.7_rev")
    cases = read_cases([ROOT / "cases" / name for name in named], SYSTEM)

    def asked(of: list[Case]) -> tuple[list[bool], list[bool], list[float | None], str]:
        with ResidualModel(ModelSource(everything, SYSTEM, {}), of) as simulations:
            fit = Fit(simulations, EFFECTS)
            point = replace(fit.unknowns.start(), sizes={("WaterFilm", "film"): 0.3})
            values = fit.unknowns.values(point)
            both = [
                [fit.unknowns.presence.at(effect, k) for k in range(len(of))]
                for effect in (film, lag)
            ]
            assert [value["padFriction.waterFilm.film"] > 0.0 for value in values] == both[0]
            wet = [value.get("padFriction.waterFilm.wet") for value in values]
            return both[0], both[1], wet, fit.unknowns.presence.unseen(single)

    reason = "the conditions of the stops say which discs are wet"
    assert asked(cases) == ([False, True, True], [True] * 3, [0.0, 1 / 3, 1.0], reason)
    # Nobody said that a disc is wet: then any may be.
    assert asked([cases[0]] * 2) == ([True, True], [True, True], [None, None], "")


def test_what_shows_only_where_an_input_falls_is_not_looked_for_elsewhere():
    rising = ready(noisy(1))
    assert not rising.falls("pB")
    falling = replace(rising, u=rising.u[::-1])
    assert falling.falls("pB")
    with pytest.raises(InputError, match="no recorded input 'pC'"):
        rising.falls("pC")


def test_an_unknown_effect_is_refused_with_the_closest_name():
    with pytest.raises(InputError, match="closest: 'BrakeFade'"):
        choose(["brakefade"], EFFECTS)


def test_source_with_an_error_says_where(tmp_path):
    wrong = {EFFECTS[0].name: {"slop": 0.1}}
    text = ExtendedModel(
        LIBRARY, "MinimalObserver", "Extended", EFFECTS[:1], "a typo", wrong
    ).source()
    with pytest.raises(InputError, match="slop"):
        build(LIBRARY, "Extended", text, tmp_path / "Extended.fmu", every_platform=False)
    assert not (tmp_path / "Extended.fmu").exists()


def test_derivatives_of_the_errors_are_those_of_central_differences():
    samples, point = ready(noisy(6)), {delay("Fx"): 0.002, "muWR": 0.4}
    steps = {"muDC": 0.003, "Fz": 120.0, "JW": 0.5}
    with simulating(SimulatorSetup(MINIMAL, SYSTEM, (samples,))) as simulator:
        with FMU(MINIMAL) as fmu:
            nominal = {name: fmu.defaults[name] for name in steps} | point
        slopes, _ = simulator.derivatives(0, nominal, [Variation((name,)) for name in steps])
        slopes = np.column_stack([simulator.at(0, nominal).jacobian, slopes])
        for j, (name, step) in enumerate({delay("Fx"): 1e-3, **steps}.items()):
            sides = [
                simulator.at(0, {**nominal, name: nominal[name] + s * step}) for s in (0.5, -0.5)
            ]
            central = (sides[0].residual - sides[1].residual) / step
            # Derivatives of the motion, stepped, against those of its steps: they differ by less
            # than a thousandth. The wheel load does a thousandth of what friction does: there, a
            # hundredth.
            share = {"Fz": 0.02}.get(name, 1e-3)
            np.testing.assert_allclose(slopes[:, j], central, atol=share * np.abs(central).max())


def test_derivatives_that_grow_beyond_all_bounds_are_refused_in_words():
    samples, point = ready(noisy(6)), {delay("Fx"): 0.002, "muWR": 0.4}
    with simulating(SimulatorSetup(MINIMAL, SYSTEM, (samples,))) as simulator:
        # An inertia less than none: the wheel runs away from what presses it on, yet stays a
        # number.
        runaway = {**point, "JW": -55.0}
        assert np.isfinite(simulator.at(0, runaway).errors).all()
        with pytest.raises(FMUError, match="derivatives of stop grow beyond all bounds"):
            simulator.derivatives(0, runaway, [Variation(("JW",))])


def test_recordings_that_share_an_open_model_say_what_they_say_alone(everything):
    """One set after the other, whatever the one before left in the model, which stays open."""
    inertia = next(effect for effect in EFFECTS if effect.name == "WheelInertia")
    values = given_values(everything, SYSTEM)

    def residuals(case: Case, model: OpenModel | None) -> WhitenedResiduals:
        with ResidualModel(
            ModelSource(everything, SYSTEM, values), [case], model=model
        ) as simulations:
            fit = Fit(simulations, [inertia])
            (whitened,) = fit.linearise(fit.at(fit.unknowns.start()), [inertia]).residuals
        return whitened

    with opened(ModelSource(everything, SYSTEM, values)) as model:
        for case in (noisy(6), noisy(7)):
            alone, shared = residuals(case, None), residuals(case, model)
            np.testing.assert_array_equal(shared.errors, alone.errors)
            np.testing.assert_array_equal(shared.jacobian, alone.jacobian)


def test_a_fit_that_leads_to_no_derivative_is_no_rival(everything):
    """An effect is given up, and not the diagnosis, where a step leads beyond what a model can."""
    inertia = next(effect for effect in EFFECTS if effect.name == "WheelInertia")
    with ResidualModel(
        ModelSource(everything, SYSTEM, given_values(everything, SYSTEM)), [noisy(6)]
    ) as simulations:
        fit = Fit(simulations, [inertia])
        nominal = anew(fit, fit.unknowns.start(), ())
        # Half the inertia is a machine; less than none is not, though its motion stays finite.
        half, none = (
            CandidateScore(
                inertia, {}, size, 0.1, size, {}, 0.0, 0.0, 0.0, np.zeros(1), np.zeros(0)
            )
            for size in (-0.5, -1.5)
        )
        assert extended(fit, nominal, half, rounds=1) is not None
        assert fit.tried(joined(nominal.point, none)) is not None
        assert extended(fit, nominal, none, rounds=1) is None


def test_states_of_effects_that_are_absent_change_no_derivative(everything):
    """Derivatives with all states, and with those alone that anything depends on."""
    fade = next(effect for effect in EFFECTS if effect.name == "BrakeFade")
    present = {variables(fade, "fade")[0]: 4e-4, "muWR": 0.4}
    columns = [Variation((name,)) for name in ("muDC", "Fz", "JW")]
    samples = ready(simulated(everything, present))
    with simulating(SimulatorSetup(everything, SYSTEM, (samples,))) as simulator:
        values = {delay("Fx"): 0.002, **present}
        every, _ = simulator.derivatives(0, values, columns)
        less, _ = simulator.derivatives(0, values, columns, None, sizes_by_component(EFFECTS))
        # What the others add to the motion is zero, but for rounding; the fade is there.
        apart = np.abs(less - every).max(axis=0)
        assert (apart < 1e-10 * np.abs(every).max(axis=0)).all()


RISING = """
  model RisingLeak "a leak that grows with time"
    extends PartialOutlet;
    parameter Real rate(unit="m3/s2", min=0.0, max=1e-2) = 0.0 "Of its growth";
    Real leak(unit="m3/s", start=0.0, fixed=true) "What leaks";
  equation
    der(leak) = rate;
    actual = nominal + leak;
    annotation (__Workbench(effect(size="rate", matters=1e-6, separation="time")));
  end RisingLeak;

  model Observer"""


def test_what_a_varied_effect_adds_up_counts_though_its_size_is_zero(tmp_path):
    """Reference: central differences, of an effect that acts by its own state alone."""
    write_system(tmp_path)
    modelica = tmp_path / "package.mo"
    edit(modelica, ("\n  model Observer", RISING), count=1)
    system = load_system(tmp_path)
    cases = read_cases([tmp_path / "recordings"], system)[:1]
    library = read_library(system.library)
    effects = read_effects(library, "Observer")
    path = tmp_path / "AllEffects.fmu"
    build_everything(system, library, effects, path)
    name = "outlet.risingLeak.rate"
    with ResidualModel(ModelSource(path, system, given_values(path, system)), cases) as simulations:
        unknowns = Fit(simulations, effects).unknowns
        (values,) = unknowns.values(unknowns.start())
        sizes = sizes_by_component(effects)
        (by,) = simulations.derivatives([values], [Variation((name,))], sizes)
        sides = simulations.at([{**values, name: 1e-9}]) + simulations.at([{**values, name: -1e-9}])
    central = (sides[0].residual - sides[1].residual) / 2e-9
    np.testing.assert_allclose(by[:, 0], central, rtol=0, atol=1e-3 * np.abs(central).max())
    assert np.abs(central).max() > 0.0


# --- what recordings say of a model, kept without them ---


# Normal equations of numbers whose condition is some ten: rounding, and the solver's own tolerance.
NEAR = {"rtol": 1e-6, "atol": 1e-7}
SIZE, ON_DRY, ON_WET = ("effect", "size"), ("friction", "dry"), ("friction", "wet")
SIGMA = 0.5  # of each friction, of which something is known
AWAY = 0.3  # of that of the wet one as fitted, in these


def recording(rng: np.random.Generator, common: int, furthest: float) -> RecordingSystem:
    """Twelve blocks of three channels; two tolerances and a phase."""
    r, J, P = rng.normal(size=37), rng.normal(size=(37, common)), rng.normal(size=(37, 3))
    bounds = np.array([furthest, furthest, 0.5])
    return RecordingSystem(r, J, P, rng.uniform(-0.2, 0.2, 2), bounds, channels=3)


@pytest.mark.parametrize("furthest", [0.1, 0.3, 9.0])
def test_a_recording_in_few_rows_has_the_same_chi_squared(furthest):
    rng = np.random.default_rng(1)
    whole = recording(rng, 2, furthest)
    few = whole.compressed()
    assert few.r.shape == (2 + 3 + 1,)
    for z in rng.normal(size=(20, 2)):
        assert_allclose(few.moved(z).chi_squared, whole.moved(z).chi_squared, rtol=1e-9)
        assert_allclose(few.eliminated().at(z), whole.eliminated().at(z), rtol=1e-9)


def brute(r: Vector, P: Matrix, begun: Vector, prior: Vector, bounds: Vector) -> float:
    """Least of |r + P l|^2 + prior (begun + l)^2 within bounds of begun + l, by SciPy."""
    matrix = np.vstack([P, np.diag(np.sqrt(prior))])
    right = np.concatenate([r, np.sqrt(prior) * begun])
    solution = lsq_linear(matrix, -right, (-bounds - begun, bounds - begun), tol=1e-13)
    return 2.0 * float(solution.cost)


@pytest.mark.parametrize("furthest", [0.25, 0.6, 9.0])
def test_tolerances_follow_a_step_as_far_as_their_bounds(furthest):
    rng = np.random.default_rng(2)
    system = recording(rng, 2, furthest)
    begun, prior = np.append(system.deviations, 0.0), np.array([1.0, 1.0, 0.0])
    for z in rng.normal(size=(20, 2)):
        least = brute(system.r + system.J @ z, system.P, begun, prior, system.furthest)
        moved = system.moved(z)
        assert_allclose(moved.chi_squared, least, **NEAR)
        assert np.abs(moved.deviations).max() <= furthest + 1e-9


def rival(rng: np.random.Generator, furthest: float) -> Rival:
    """Two recordings on a dry rail and two on a wet one."""
    systems = []
    for other in (2, 2, 1, 1):
        system = recording(rng, 3, furthest)
        system.J[:, other] = 0.0
        systems.append(system.compressed())
    N = np.diag([0.0, SIGMA**-2, SIGMA**-2])
    prior = Quadratic(N, np.array([0.0, 0.0, AWAY / SIGMA]), AWAY**2, 0)
    return Rival(("effect",), {SIZE: 1.0}, {ON_DRY: 0.3, ON_WET: 0.1}, tuple(systems), prior, 0.0)


# What has met a bound is not let go again, as a solver does that frees it where others have moved.
@pytest.mark.parametrize(("furthest", "above"), [(0.3, 1e-3), (9.0, 1e-6)])
def test_recordings_so_far_hold_the_unknowns_of_new_ones(furthest, above):
    """Reference: all of them side by side, with what new ones do not have among their own."""
    known = rival(np.random.default_rng(3), furthest)
    so_far = known.so_far((SIZE, ("friction", "greasy"), ON_DRY), 3.0)
    assert_allclose(so_far.chi_squared, known.chi_squared, rtol=1e-12)
    # Side by side: the friction that new ones lack, then the three own unknowns of each recording.
    P = np.zeros((4 * 7, 1 + 4 * 3))
    for k, system in enumerate(known.recordings):
        P[7 * k : 7 * k + 7, 0] = system.J[:, 2] * SIGMA
        P[7 * k : 7 * k + 7, 1 + 3 * k : 4 + 3 * k] = system.P
    begun = np.concatenate([[AWAY], *(np.append(o.deviations, 0.0) for o in known.recordings)])
    prior = np.append(1.0, np.tile([1.0, 1.0, 0.0], 4))
    bounds = np.concatenate([[3.0], *(o.furthest for o in known.recordings)])
    r = np.concatenate([o.r for o in known.recordings])
    J = np.vstack([o.J for o in known.recordings])
    for size, dry, greasy in np.random.default_rng(4).normal(size=(20, 3)):
        least = brute(r + J @ [size, dry, 0.0], P, begun, prior, bounds)
        chi_squared = so_far.moved(np.array([size, greasy, dry])).chi_squared
        assert least * (1.0 - 1e-6) <= chi_squared <= least * (1.0 + above)


def test_information_is_that_of_all_recordings_and_of_what_was_known():
    known = rival(np.random.default_rng(5), 9.0)
    keys = (*known.sizes, *known.levels)
    joint = Joint(keys, keys, tuple(known.levels), known.recordings, known.prior)
    assert_allclose(known.information, joint.total().N, rtol=1e-12)
    # Of all unknowns that new recordings have too, nothing is eliminated.
    held = known.so_far(keys, 3.0).eliminated().N + known.prior.N
    assert_allclose(held, known.information, rtol=1e-9, atol=1e-9)


def test_what_one_recording_alone_tells_is_no_failure_of_the_others():
    """One stop of four tells a size of 8 deviations; of the others each knows it to 100."""
    sharp, blunt = 1.0, 0.01
    stops = [
        Quadratic(np.array([[w * w]]), np.array([-8.0 * w * w]), 64.0 * w * w, 1)
        for w in (sharp, blunt, blunt, blunt)
    ]
    known = predictive_deviance(stops, Quadratic(np.array([[1e-12]]), np.zeros(1), 0.0, 0))
    without = np.array([stop.c for stop in stops])
    # Predicted by the blunt ones the sharp stop has the variance of both, 1 + 1e4/3.
    assert (without - known)[0] == pytest.approx(64.0 - np.log(1.0 + 1e4 / 3.0), rel=1e-6)
    assert (without - known)[1:] == pytest.approx(0.0, abs=0.01)


def test_what_remains_where_an_effect_does_nothing_says_nothing_of_its_form():
    """Of two stops of ten blocks, the effect takes 4 of 5 in the first, and nothing of 9 after."""
    still = Point({}, {}, np.zeros((2, 0)), {})

    def model(*errors: float) -> FittedModel:
        stops = tuple(whitened(np.full((10, 1), error), np.zeros(0)) for error in errors)
        return FittedModel((), still, LinearizedPoint(still, (), stops, 1, np.ones(1), 0.0), 0.0)

    class Recorded(CrossValidation):
        """Fits in which nothing is fitted, so that each stop is held out as it is."""

        unsure = 0.0  # variance of each mean, by the fit to the other stop

        def _errors(self, fitted: FittedModel) -> list[np.ndarray]:
            return [recording.errors for recording in fitted.linearised.residuals]

        def _fitted(self, fitted: FittedModel) -> list[np.ndarray]:
            return [np.ones((10, 1))] * 2

        def left_open(self, fitted: FittedModel, *, fast: bool) -> list[np.ndarray]:
            return [np.full((10, 1), self.unsure)] * 2

    validation = Recorded(SimpleNamespace(unknowns=SimpleNamespace(count=2)))

    def left(remains: float, *, whole: bool = True) -> tuple[float, float]:
        before, after = model(5.0, 9.0), model(remains, 9.0)
        return validation.where_acting(before, after, fast=True, whole=whole)

    assert left(1.0) == (pytest.approx(0.0), pytest.approx(24.0))
    # Of ten means of a law that is wrong by a fifth, noise leaves up to 3.6 in 95 of 100 sets.
    assert left(1.5) == (pytest.approx(0.04 * 24.0), pytest.approx(24.0))
    assert left(3.0) == (pytest.approx(8.0), pytest.approx(24.0))
    validation.unsure = 3.5
    assert left(4.0) == (pytest.approx(16.0 - 1.0 - 3.5), pytest.approx(24.0))
    assert left(4.0, whole=False) == (pytest.approx(15.0), pytest.approx(24.0))
    assert validation.squares(model(1.0, 9.0), fast=True).mean() == pytest.approx(41.0)
