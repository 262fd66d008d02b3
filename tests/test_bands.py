"""Bands are checked by innovations, and what contradicts them is said at the top."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from workbench import case_from_frame
from workbench.diagnosis.data.motion import OpenModel, motion
from workbench.diagnosis.data.samples import prepare as prepare_samples
from workbench.diagnosis.simulation.prediction import Predictor, Variation
from workbench.errors import InputError
from workbench.models.compiler import native
from workbench.models.fmu import FMU
from workbench.models.simulation import Drive, Simulation
from workbench.observers import choose, estimators_of
from workbench.observers.export import build_observer
from workbench.observers.replay import replay
from workbench.observers.report import format_table, summarise_runs
from workbench.observers.simulation import CaseResult, followed, prepare
from workbench.observers.trust import likely_reason, residual_tests
from workbench.recordings.case import Case
from workbench.system.registry import open_model
from workbench.system.system import System
from workbench.tuning.cost import Candidate, Evaluator
from workbench.tuning.recipe import pose

from .built import declare, machine

NAMES = ["open_loop", "ekf", "mhe"]


@pytest.fixture(scope="module")
def vessel(tmp_path_factory) -> System:
    return declare(tmp_path_factory.mktemp("vessel"), *machine("vessel"))


def result_of(system: System, noise: float, seed: int, leak: float = 0.0) -> CaseResult:
    """A vessel that is filled, whose sensors have so many times the noise that is declared."""
    time = np.arange(200.0)
    flow = np.where(time % 20.0 < 10.0, 1e-3, 0.0)
    volume = np.append(0.0, np.cumsum(flow[:-1] - leak))
    rng = np.random.default_rng(seed)
    volume += noise * 1e-5 * rng.standard_normal(time.size)
    through = flow + 1e-6 * rng.standard_normal(time.size)
    columns = {"q [m3/s]": flow, "V [m3]": volume, "through [m3/s]": through}
    case = case_from_frame(system, pd.DataFrame({"time [s]": time, **columns}), name="filled")
    return prepare(system, choose(system, NAMES)).run(case)


def test_innovations_do_not_contradict_bands_of_a_model_and_noise_that_are_right(vessel):
    results = [result_of(vessel, 1.0, seed) for seed in range(20)]
    assert all(not result.contradicted for result in results)
    # The test has something to go by, though the first sample has no innovation.
    # Walks are declared, of which the vessel has none: somewhat less than 1.
    assert all(0.7 < result.surprise("ekf") < 1.17 for result in results)
    assert format_table(vessel, results[:1]).splitlines()[2].startswith("case")


def test_a_score_by_what_corrects_an_estimator_says_so(vessel):
    """V follows its sensor as closely as gains let it."""
    result = result_of(vessel, 1.0, 0)
    doubt = "V corrects the estimators that it scores"
    assert format_table(vessel, [result]).splitlines()[1].startswith(doubt)
    assert doubt in result.summary()
    assert doubt in summarise_runs(vessel, [result], {"run": {}})["answer"]["sentence"]
    # A gauge of the outflow is fed to none.
    (meter,) = [output for output in vessel.outputs if output.name == "through"]
    objective = replace(vessel.objective, signal="gauge", weights={"gauge": 1.0})
    gauge = (replace(meter, name="gauge"),)
    assert not followed(replace(vessel, reference_signals=gauge, objective=objective))


def test_gains_that_repeat_the_noise_of_what_scores_them_score_worse(vessel):
    """Each estimate is scored by samples after it: by its own, following it would be best."""
    case = result_of(vessel, 100.0, 0).case  # with noise of 1e-3 m3
    of_volume = replace(vessel, objective=replace(vessel.objective, weights={"V": 100.0}))
    problem = pose(of_volume, "ekf", [case])
    gains = problem.job.gains
    with Evaluator(problem.job) as evaluator:
        sound, repeating = (
            evaluator.evaluate(Candidate(np.where(at, noise, gains.values), np.inf, (0,))).z
            for at in [np.array(gains.names) == "V"]
            for noise in (1e-3, 1e-6)
        )
    # A sample's noise beside that of the line through four others, 1.5 times its variance: 29 %,
    # and less as lines cut the corners of the volume.
    assert repeating > 1.1 * sound


def test_bands_that_innovations_contradict_are_told_at_the_top_of_all_that_is_read(vessel):
    result = result_of(vessel, 3.0, 0)
    assert list(result.contradicted) == ["ekf", "mhe"]
    doubt = "Bands of ekf are too narrow in filled: innovations have "
    assert format_table(vessel, [result]).splitlines()[2].startswith(doubt)
    assert doubt in result.summary()
    summary = summarise_runs(vessel, [result], {"run": {}})
    assert doubt in summary["answer"]["sentence"]
    assert summary["cases"]["filled"]["contradicted"]["ekf"] == pytest.approx(
        result.surprise("ekf"), abs=5e-4
    )


def test_innovations_that_turn_say_that_walks_are_smaller_and_not_that_the_start_is_off():
    turning = (-1.0) ** np.arange(400) + np.random.default_rng(2).standard_normal(400)
    (test,) = residual_tests({"V": turning}, {"V": np.ones(400)})
    assert not test.narrow
    assert "turn from sample to sample: what they share is -1." in str(test)
    assert likely_reason(test, "", False, True) == "walks are smaller than the system file says"


def test_bands_that_are_too_wide_are_told_as_well(vessel):
    result = result_of(vessel, 0.2, 0)
    (test,) = [t for t in result.contradictions["ekf"] if t.test == "variance"]
    assert not test.narrow
    assert not result.contradicted
    assert "Bands of ekf are too wide in filled: innovations have 0." in result.summary()


def test_a_start_that_is_farther_off_than_it_is_said_to_be_is_named(vessel):
    """A leak of 20 standard deviations of what is known of it, to which the filter settles."""
    result = result_of(vessel, 1.0, 0, leak=2e-4)
    narrow = [test for test in result.contradictions["ekf"] if test.narrow]
    assert narrow
    assert all(test.reason.startswith("the start is farther off") for test in narrow)


def innovations(
    rng: np.random.Generator, walk: float, stated: float, count: int = 400
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Residuals and deviations of a filter on a walk, of which it says another, in unit noise."""
    truth = np.cumsum(walk * rng.standard_normal(count))
    samples = truth + rng.standard_normal(count)
    x, P, values, deviations = 0.0, 1.0, [], []
    for sample in samples:
        P += stated**2
        gain = P / (P + 1.0)
        x, P = x + gain * (sample - x), (1.0 - gain) * P
        values.append(sample - x)
        deviations.append(np.sqrt(P))
    return {"y": np.array(values)[20:]}, {"y": np.array(deviations)[20:]}


def test_residuals_of_a_right_filter_pass_both_tests():
    rng = np.random.default_rng(1)
    flagged = sum(bool(residual_tests(*innovations(rng, 0.3, 0.3))) for _ in range(1000))
    # Chance makes one in a thousand; seven or more of a Poisson number of one, one in 12 000.
    assert flagged < 7


@pytest.mark.parametrize(("walk", "narrow"), [(1.5, True), (0.05, False)])
def test_a_walk_that_is_wrong_shows_in_what_follows_from_sample_to_sample(walk, narrow):
    rng = np.random.default_rng(2)
    runs = [residual_tests(*innovations(rng, walk, 0.3, count=4000)) for _ in range(20)]
    assert all(any(t.test == "whiteness" and t.narrow is narrow for t in tests) for tests in runs)


def test_a_mean_shows_though_it_is_far_below_the_noise():
    rng = np.random.default_rng(3)
    residuals, deviations = innovations(rng, 0.05, 0.05, count=4000)
    residuals["y"] += 0.2  # of the noise, whose estimate is sure to 0.22 of it
    (test,) = residual_tests(residuals, deviations)
    assert (test.test, test.signal, test.narrow) == ("mean", "y", True)
    assert test.value == pytest.approx(0.2 / deviations["y"][-1], rel=0.2)


@pytest.mark.parametrize("step", [1e-4, 1e-3, 5e-3])
@pytest.mark.parametrize("name", ["ekf", "ukf", "mhe"])
def test_bands_hold_or_what_is_said_is_that_samples_are_too_far_apart(tmp_path, name, step):
    """A sound coil, from a thirtieth to twice its time constant of 3 ms; nothing is lost in it."""
    system = declare(tmp_path / "coil", *machine("coil", step=step))
    rng, count = np.random.default_rng(4), 2000
    u = np.repeat(rng.uniform(-12.0, 12.0, count // 40), 40)
    current = [0.0]
    for voltage in u[:-1]:  # exact, for a voltage that is held
        current.append(voltage / 2.0 + (current[-1] - voltage / 2.0) * np.exp(-step / 0.003))
    measured = np.array(current) + 0.02 * rng.standard_normal(count)
    columns = {"time [s]": step * np.arange(count), "u [V]": u, "i [A]": measured}
    case = case_from_frame(system, pd.DataFrame(columns), name="switched")
    result = prepare(system, choose(system, [name])).run(case)
    run = result.runs[name]
    truth = {"i": np.array(current), "r": np.zeros(count)}
    half = count // 2
    shares = [
        np.mean(np.abs(run.signal(key) - values)[half:] < 1.96 * run.deviation(key)[half:])
        for key, values in truth.items()
    ]
    if min(shares) < 0.93:
        tests = result.contradictions[name]
        assert any("samples are too far apart" in test.reason for test in tests if test.narrow)
        assert any("do not resolve the model" in text for text in result.warnings())


@pytest.mark.parametrize(("held", "shift"), [("true", 0), ('"before"', 1)])
def test_bands_that_fail_as_an_input_is_held_otherwise_name_the_input_and_how(
    tmp_path, held, shift
):
    """A coil whose voltage jumps, or is told as the mean since the sample before.

    Of a straight line between samples, more steps make the error less as well: the coil was said
    to be sampled too coarsely, at a third of its time constant.
    """
    library, text = machine("coil", step=1e-3)
    assert "held = true" in text
    system = declare(tmp_path / "coil", library, text.replace("held = true", "held = false"))
    rng, count = np.random.default_rng(5), 2000
    u = np.repeat(rng.uniform(-12.0, 12.0, count // 5), 5)
    current = [0.0]
    for voltage in u[shift:][: count - 1]:  # exact, for a voltage that is constant in between
        current.append(voltage / 2.0 + (current[-1] - voltage / 2.0) * np.exp(-1.0 / 3.0))
    measured = np.array(current) + 0.02 * rng.standard_normal(count)
    columns = {"time [s]": 1e-3 * np.arange(count), "u [V]": u, "i [A]": measured}
    case = case_from_frame(system, pd.DataFrame(columns), name="switched")
    result = prepare(system, choose(system, ["ekf"])).run(case)
    assert any(f"with held = {held} in [inputs.u]" in text for text in result.warnings())
    assert not any("do not resolve" in text for text in result.warnings())
    reasons = {test.reason for test in result.contradictions["ekf"] if test.narrow}
    assert reasons == {"u is held otherwise between samples than the system file says"}


def swing(folder: Path, samples: int, mistuned: float = 1.0) -> CaseResult:
    """Ten undamped periods by their closed form, with so many samples a period."""
    step = 1.0 / samples
    system = declare(folder, *machine("swing", step=step))
    time = step * np.arange(10 * samples + 1)
    noise = 1e-3 * np.random.default_rng(5).standard_normal(time.size)
    place = 0.5 * np.cos(2.0 * np.pi * mistuned * time) + noise
    columns = {"time [s]": time, "f [m/s2]": 0.0 * time, "s [m]": place}
    case = case_from_frame(system, pd.DataFrame(columns), name="swing")
    return prepare(system, choose(system, ["open_loop", "disturbance_observer"])).run(case)


def test_coarse_steps_are_told_of_estimators_that_have_no_others(tmp_path):
    result = swing(tmp_path / "coarse", samples=200)
    # Euler's implicit step of a swing: a period of n samples leaves exp(-2 pi^2 / n) of it, an
    # error of 0.26 m at the end of ten. The open loop has no more than what a sensor of 1 mm tells.
    exact = 0.5 * np.cos(2.0 * np.pi * result.case.time)
    start = result.case["s"][0] - 0.5  # where the swing begins as measured, it stays off by that
    assert result.runs["open_loop"].signal("s") - exact == pytest.approx(0.0, abs=abs(start) + 1e-4)
    assert result.step_share > 0.9
    (doubt,) = [text for text in result.warnings() if "damps what swings" in text]
    assert doubt.startswith("disturbance_observer: one step")
    assert doubt in format_table(result.system, [result])


def test_an_error_that_the_model_makes_is_not_put_down_to_steps(tmp_path):
    """A spring that is softer by a fifth: steps leave 0.91 of the swing, and its phase is lost."""
    result = swing(tmp_path / "fine", samples=2000, mistuned=0.9)
    assert result.step_share == 0.0
    assert not any("steps" in text for text in result.warnings())


# --- inputs that are held between samples ---


ESTIMATORS = [
    "open_loop",
    "disturbance_observer",
    "parameter_estimator",
    "ekf",
    "arrow",
    "ukf",
    "mhe",
    "imm",
    "smoother",
]


@pytest.fixture(scope="module")
def fmu(vessel) -> Iterator[FMU]:
    with open_model(vessel) as model:
        yield model


@pytest.fixture(scope="module")
def filled(vessel) -> Case:
    """A litre in a second for ten seconds, switched at samples: ten litres, without any noise."""
    time = np.arange(31.0)
    flow = np.where(time < 10.0, 1e-3, 0.0)
    volume = np.minimum(time, 10.0) * 1e-3
    columns = {"q [m3/s]": flow, "V [m3]": volume, "through [m3/s]": flow}
    return case_from_frame(vessel, pd.DataFrame({"time [s]": time, **columns}))


@pytest.mark.parametrize("name", ESTIMATORS)
def test_a_switched_pump_is_integrated_exactly_and_nothing_is_made_of_the_switch(
    vessel, fmu, filled, name
):
    run = replay(filled, estimators_of(vessel)[name].untuned(fmu, vessel))
    assert_allclose(run.signal("V"), filled["V"], rtol=0.0, atol=1e-12)
    assert_allclose(run.signal("leak"), 0.0, atol=1e-12)
    # What a sensor sees at a sample is the input from there on.
    assert_allclose(run.signal("through"), filled["through"], rtol=0.0, atol=1e-12)


# --- inputs whose samples are means of the time before ---


def metered(vessel: System, held: bool | str) -> System:
    return replace(vessel, inputs=tuple(replace(flow, held=held) for flow in vessel.inputs))


@pytest.fixture(scope="module")
def counted(vessel) -> Case:
    """A pump that runs from the first sample on; a meter gives the mean since the last second."""
    time = np.arange(21.0)
    flow = np.where(time > 0.0, 0.5e-3, 0.0)
    columns = {"q [m3/s]": flow, "V [m3]": 0.5e-3 * time, "through [m3/s]": flow}
    return case_from_frame(vessel, pd.DataFrame({"time [s]": time, **columns}))


@pytest.mark.parametrize("name", ESTIMATORS)
def test_means_of_a_meter_are_integrated_exactly(vessel, fmu, counted, name):
    system, cls = metered(vessel, "before"), estimators_of(vessel)[name]
    run = replay(counted, cls.untuned(fmu, system))
    assert_allclose(run.signal("V"), counted["V"], rtol=0.0, atol=1e-12)
    assert_allclose(run.signal("leak"), 0.0, atol=1e-12)


@pytest.mark.parametrize(("held", "litres"), [("before", 10.0), (False, 9.75), (True, 9.5)])
def test_ten_litres_are_ten_where_means_are_declared_as_what_they_are(
    vessel, fmu, counted, held, litres
):
    """By an open loop, a whole simulation, and the prediction of a diagnosis with derivatives."""
    system, cls = metered(vessel, held), estimators_of(vessel)["open_loop"]
    run = replay(counted, cls.untuned(fmu, system))
    assert run.signal("V")[-1] == pytest.approx(1e-3 * litres)
    drive = Drive(counted.time, counted.u)
    simulated = Simulation(fmu, ["q"], ["V"], system.holds).run(drive, {})
    assert simulated[-1, 0] == pytest.approx(1e-3 * litres)
    system = replace(system, comparison=replace(system.comparison, least=10.0))
    ready = prepare_samples(counted, system, ("V", "through"), OpenModel(fmu, motion(fmu, system)))
    columns = [Variation(("leak",))]
    errors, by = Predictor(fmu, system, ready.signals).derivatives(ready, {}, columns)
    assert errors[-1, 0] == pytest.approx(1e-3 * (10.0 - litres), abs=1e-9)
    assert by.errors[-1, 0, 0] == pytest.approx(20.0)


def test_a_sensor_that_is_a_mean_is_refused(tmp_path):
    package, text = machine("vessel")
    noisy = 'noise = "1e-5 m3"'
    with pytest.raises(InputError, match=r"V.* held.*only inputs may be means"):
        declare(tmp_path / "meter", package, text.replace(noisy, f'{noisy}, held = "before"'))
    with pytest.raises(InputError, match="true, false or before"):
        declare(tmp_path / "typo", package, text.replace("held = true", 'held = "after"'))


@pytest.mark.parametrize(
    ("name", "held", "recording"),
    [("disturbance_observer", True, "filled"), ("ekf", "before", "counted")],
)
def test_an_exported_observer_takes_inputs_as_declared(
    vessel, fmu, tmp_path, name, held, recording, request
):
    filled, system = request.getfixturevalue(recording), metered(vessel, held)
    estimator = estimators_of(vessel)[name].untuned(fmu, system)
    path = tmp_path / "observer.fmu"
    build_observer(estimator, path, 2, platforms=[native()])
    names = [signal.name for signal in (*vessel.inputs, *vessel.outputs)]
    recorded = np.array(
        list(zip(filled.time, *(filled[name] for name in names), strict=True)),
        [(name, float) for name in ("time", *names)],
    )
    shown = fmpy.simulate_fmu(str(path), input=recorded, output=["VEstimate"], output_interval=1.0)
    # A tool shows each estimate one step later.
    assert_allclose(shown["VEstimate"][1:], filled["V"][: len(shown) - 1], rtol=0.0, atol=1e-12)
