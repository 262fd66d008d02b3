"""A diagnosis of an FMU without a library: a parameter or a sensor that is wrong is named.

Recordings are made by SciPy from equations of their own; the FMU is used as one of another tool.
"""

import json
import re
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.signal import butter, cont2discrete, dlsim, sosfilt

from workbench.__main__ import main
from workbench.api import read_cases
from workbench.diagnosis import Outcome, Problem, catalogue, choose, problem_of
from workbench.diagnosis.data.clocks import held_otherwise
from workbench.diagnosis.effects.candidates import rate_terms
from workbench.diagnosis.laws import propose
from workbench.diagnosis.report import write_diagnosis
from workbench.diagnosis.run import with_effects
from workbench.diagnosis.simulation.prediction import Predictor
from workbench.diagnosis.simulation.residual_model import ModelSource, ResidualModel
from workbench.errors import InputError
from workbench.models.added import write_extended
from workbench.models.fmu import FMU
from workbench.models.native import instance
from workbench.pages.provenance import run_of
from workbench.runtime.engine import Engine, silent
from workbench.studies.power.own_model import own_model
from workbench.system.registry import load_system, model_path
from workbench.system.system import OBSERVER, System

from . import built
from .built import build_text, lagged, machine_file, write_case
from .hostile_fmus import rewritten
from .schemas import check

# The level has another name than the output, so that no output's name tells where it begins.
SYSTEM = machine_file("tank_alone/system.toml")


def behind(signal: np.ndarray, h: float, tau: float) -> np.ndarray:
    """A signal on a fine grid behind a lag of first order, by Euler's method."""
    y = signal.copy()
    for k in range(1, y.size):
        y[k] = y[k - 1] + h / tau * (signal[k - 1] - y[k - 1])
    return y


def record(
    folder: Path,
    seed: int,
    area=0.5,
    outlet=1e-3,
    apart=0.0,
    gain=0.0,
    zero=0.0,
    late=0.0,
    lag=0.0,
    top=9.0,
    means=False,
) -> Path:
    """Four recordings of 200 s; each starts at another level, outlets are `apart` from the next.

    A flow is that until the next sample, or the mean since the last one.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 200.25, 0.5)
    for number in range(4):
        steps = rng.uniform(2e-3, 7e-3, 5)
        level, own = [rng.uniform(0.5, 1.5)], outlet * (1.0 + (number - 1.5) * apart)
        for flow in steps:  # of 80 samples

            def rate(_t, x, flow=flow, own=own):
                return [(flow - own * np.sqrt(2.0 * 9.81 * x[0])) / area]

            at = time[1:81]
            solution = solve_ivp(rate, (0.0, 40.0), level[-1:], t_eval=at, rtol=1e-8, atol=1e-10)
            level.extend(solution.y[0])
        inflow = np.repeat(steps, 80)
        flows = np.append(inflow[0], inflow) if means else np.append(inflow, inflow[-1])
        if lag:
            fine = np.arange(0.0, 200.005, 0.01)
            level = np.interp(time, fine, behind(np.interp(fine, time, level), 0.01, lag))
        columns = {
            "time [s]": time,
            "inflow [m3/s]": (1.0 + gain) * flows + 5e-5 * rng.standard_normal(time.size),
        }
        read = np.interp(time - late, time, level) + zero + 2e-3 * rng.standard_normal(time.size)
        columns["level [m]"] = np.minimum(read, top)
        write_case(folder / f"{number}", columns, "Steps of the pump")
    return folder


@pytest.fixture(scope="module")
def tank(tmp_path_factory) -> System:
    folder = tmp_path_factory.mktemp("tank")
    build_text(folder, machine_file("tank_alone/Tank.mo"))
    (folder / "system.toml").write_text(SYSTEM)
    return load_system(folder)


def quietly(system: System, recordings: Path, *effects: str) -> Outcome:
    """A diagnosis of recordings, which writes beside them."""
    return built.diagnosed(system, recordings, recordings.parent / "out", *effects)


def diagnosed(system: System, folder: Path, **truth: float) -> Outcome:
    return quietly(system, record(folder / "recordings", **truth))


def test_nothing_is_missing_where_only_unknown_starts_differ(tank, tmp_path):
    assert diagnosed(tank, tmp_path, seed=1).diagnosis.verdict == "nothing"


@pytest.mark.parametrize(
    ("truth", "effect", "size", "value"),
    [
        ({"seed": 2, "area": 0.55}, "A", "change", 0.05),
        ({"seed": 3, "gain": 0.05}, "SensorGain[inflow]", "gain", 0.05),
        ({"seed": 4, "zero": 0.15}, "SensorOffset[level]", "offset", 0.15),
        ({"seed": 2, "top": 1.28}, "SensorSaturation[level]", "limit", 1.28),
    ],
)
def test_what_is_wrong_is_named_with_its_size(tank, tmp_path, truth, effect, size, value):
    outcome = diagnosed(tank, tmp_path, **truth)
    (cause,) = outcome.diagnosis.causes
    assert cause.effect.name == effect
    assert cause.parameters[size].low < value < cause.parameters[size].high
    assert (outcome.extension is None) == (effect != "A")  # a sensor is no matter of the model


def test_an_extended_model_says_which_wrong_sensors_it_does_not_hold(tank, tmp_path):
    """With the recordings as they are, another tool would not reach the errors of the fit."""
    outcome = diagnosed(tank, tmp_path, seed=2, area=0.55, zero=0.15)
    effects = {cause.effect.name for cause in outcome.diagnosis.causes}
    assert effects == {"A", "SensorOffset[level]"}
    assert outcome.without == ["SensorOffset[level]"]
    said = "without SensorOffset[level]: sensors and clocks are no part of a model"
    assert f"Extended.fmu\n  {said}" in outcome.summary()
    page = write_diagnosis(outcome, {"run": run_of("diagnose", tank, {})}, tmp_path / "out")
    assert f"W{said[1:]}" in page.read_text()


@pytest.mark.parametrize(
    ("truth", "form", "size"),
    [({"seed": 2, "late": 3.0}, "Delay", "delay"), ({"seed": 3, "lag": 6.0}, "Lag", "lag")],
)
def test_a_late_or_lagging_sensor_and_such_an_input_are_one_cause(
    tank, tmp_path, truth, form, size
):
    """Of one input and one output, in motion from the first sample, nothing says which is late."""
    outcome = diagnosed(tank, tmp_path, **truth)
    (cause,) = outcome.diagnosis.causes
    names = {cause.effect.name, *cause.confusable_with}
    assert names == {f"Input{form}[inflow]", f"Sensor{form}[level]"}
    interval, (_, late) = cause.parameters[size], truth.values()
    assert interval.low < late < interval.high
    assert outcome.extension is None


def test_parameters_that_act_alike_are_named_together(tank, tmp_path):
    """The outlet's area and the root of gravity are one factor: nothing can tell them apart."""
    outcome = diagnosed(tank, tmp_path, seed=5, outlet=1.1e-3)
    (cause,) = outcome.diagnosis.causes
    assert {cause.effect.name, *cause.confusable_with} == {"c", "g"}
    assert "another value of" in outcome.summary()


def test_a_parameter_that_differs_between_recordings_is_told_and_then_allowed_for(tank, tmp_path):
    outcome = diagnosed(tank, tmp_path, seed=1, apart=0.02)
    differing = outcome.diagnosis.differing
    assert differing is not None
    # c acts as the root of 2 g h, so that g differs by twice as much and explains the same.
    assert (differing.name, differing.deviation) in (
        ("c", pytest.approx(0.02 * np.std(range(4), ddof=1), rel=0.1)),
        ("g", pytest.approx(0.04 * np.std(range(4), ddof=1), rel=0.1)),
    )
    assert differing.text in outcome.warnings
    tolerances = {**tank.comparison.tolerances, differing.name: round(differing.deviation, 2)}
    allowing = replace(tank, comparison=replace(tank.comparison, tolerances=tolerances))
    assert quietly(allowing, tmp_path / "recordings").diagnosis.verdict == "nothing"


@pytest.mark.parametrize(
    ("held", "means", "right"), [(False, False, "true"), (True, True, '"before"')]
)
def test_an_input_that_is_held_otherwise_than_said_is_named_beside_the_delay(
    tank, tmp_path, held, means, right
):
    """It acts half a sample later than on straight lines, or a sample earlier than it says."""
    (inflow,) = tank.inputs
    wrong = replace(tank, inputs=(replace(inflow, held=held),))
    recordings = record(tmp_path / "recordings", seed=1, means=means)
    outcome = quietly(wrong, recordings, "InputDelay[inflow]")
    (cause,) = outcome.diagnosis.causes
    delay = cause.parameters["delay"]
    later = -0.5 if held else 0.25
    assert later - 0.2 < delay.low < later < delay.high
    asked = f"write held = {right} in [inputs.inflow]"
    assert any(asked in warning for warning in outcome.warnings)


@pytest.mark.long
def test_on_forty_sets_the_wrong_value_is_named_and_nothing_else(tank, tmp_path):
    """Of 30 wrong sets 95 % are right; 10 clean ones raise no alarm in 98 of 100 runs of this."""
    rng, right = np.random.default_rng(5), 0
    for number in range(40):
        sign = rng.choice((-1.0, 1.0))
        truth, name = (
            ({}, ""),
            ({"area": 0.5 * (1.0 + sign * rng.uniform(0.05, 0.15))}, "A"),
            ({"gain": sign * rng.uniform(0.03, 0.08)}, "SensorGain[inflow]"),
            ({"outlet": 1e-3 * (1.0 + sign * rng.uniform(0.04, 0.1))}, "c"),
        )[number % 4]
        causes = diagnosed(tank, tmp_path / str(number), seed=number, **truth).diagnosis.causes
        groups = [{cause.effect.name, *cause.confusable_with} for cause in causes]
        assert all(name in group for group in groups), (truth, groups)
        right += bool(groups) if name else 0
    assert right >= 0.95 * 30


def test_a_start_far_from_the_models_is_no_missing_effect(tmp_path):
    """The level in mm, without limits: an FMU that states no nominal value leaves it at 1 mm."""
    text = machine_file("tank_alone/Tank.mo").replace(
        'x(unit="m", start=1.0, fixed=true, min=0.0, max=3.0)', "x(start=1000.0)"
    )
    text = text.replace("= x;", "= 1e-3*x;").replace("der(x)", "1e-3*der(x)")
    text = text.replace('A(unit="m2", ', "A(").replace("sqrt(x^2", "sqrt(1e-6*x^2")
    build_text(tmp_path, text)
    (tmp_path / "system.toml").write_text(SYSTEM + '[candidates]\nonly = ["A", "c"]\n')
    (cause,) = diagnosed(load_system(tmp_path), tmp_path, seed=2, area=0.55).diagnosis.causes
    change = cause.parameters["change"]
    assert (cause.effect.name, cause.confusable_with) == ("A", ())
    assert change.low < 0.05 < change.high
    assert re.fullmatch(r"0\.0\d+ \(95 %: .*", change.text)  # no share, which would be 5 %


def test_an_input_that_nothing_feeds_is_asked_about(tmp_path):
    """It keeps its start, and what it does to the machine would be taken for a fault."""
    text = machine_file("tank_alone/Tank.mo").replace(
        "  Real x(", '  input Real rain(unit="m3/s", start=2e-4);\n  Real x('
    )
    build_text(tmp_path, text.replace("inflow - c", "inflow + rain - c"))
    (tmp_path / "system.toml").write_text(SYSTEM)
    message = "input 'rain' of the FMU: found no signal that feeds it, so that it keeps 0.0002"
    with pytest.warns(UserWarning, match=message):
        cases = read_cases(record(tmp_path / "recordings", seed=2), load_system(tmp_path))
    assert [len(case.doubts) for case in cases] == [1] * len(cases)


def test_candidates_are_parameters_and_sensors_of_a_stated_size(tank):
    names = [effect.name for effect in catalogue(tank, None)]
    # A leak of zero without bounds or nominal value has no size that a change can be small to.
    assert names[:3] == ["A", "c", "g"]
    assert names[3:7] == [
        f"Sensor{size}[{signal}]" for signal in ("inflow", "level") for size in ("Gain", "Offset")
    ]
    assert names[7:12] == [
        f"{form}Term[x]" for form in ("Coulomb", "Stribeck", "Viscous", "Quadratic", "Constant")
    ]
    forms = ("Lag", "Saturation", "Rectification", "DeadZone", "Quantisation")
    late = ("InputDelay[inflow]", "SensorDelay[level]")
    bent = (f"Sensor{form}[level]" for form in forms)
    assert names[12:] == ["Start[x]", "InputLag[inflow]", *bent, *late]


def test_what_nothing_shows_and_what_is_exact_are_no_candidates(tmp_path):
    """A sensor that no recording has, and a start that is said to have no spread."""
    build_text(tmp_path, machine_file("tank_alone/Tank.mo"))
    more = '[judged.second]\nvariable = "x"\nunit = "m"\nnoise = "1 mm"\nscale = "1 m"\n'
    (tmp_path / "system.toml").write_text(
        f'{SYSTEM}\n{more}[states]\nsecond = {{ spread = "0 m" }}\n'
    )
    system = load_system(tmp_path)
    names = [effect.name for effect in catalogue(system, None)]
    assert "Start[x]" not in names
    assert "SensorQuantisation[second]" in names
    outcome = diagnosed(system, tmp_path, seed=2)
    tried = [score.effect.name for score in outcome.diagnosis.scores]
    assert not [name for name in tried if name.startswith("Sensor") and name.endswith("[second]")]


def test_candidates_are_chosen_in_the_system_file(tank, tmp_path, capsys):
    text = SYSTEM.replace("Tank.fmu", str(tank.source.parent / "Tank.fmu"))
    chosen = '[candidates]\nonly = ["c", "Sensor*"]\nwithout = ["*[level]"]\nmatters = 0.05\n'
    (tmp_path / "system.toml").write_text(text + chosen)
    effects = catalogue(load_system(tmp_path), None)
    names = [effect.name for effect in effects]
    assert names == ["c", "SensorGain[inflow]", "SensorOffset[inflow]"]
    assert effects[0].matters == pytest.approx(5e-5)
    (tmp_path / "system.toml").write_text(text + '[candidates]\nonly = ["cc"]\n')
    assert main(["diagnose", "--system", str(tmp_path), "--list"]) == 2
    message = "found 'cc' (closest: 'c'); expected a parameter of the FMU that may differ"
    assert message in capsys.readouterr().err


def test_a_stated_range_bounds_the_change(tank, tmp_path):
    """Of 10 % only 4 are allowed: the size is told to be at its bound."""
    text = SYSTEM.replace("Tank.fmu", str(tank.source.parent / "Tank.fmu"))
    (tmp_path / "system.toml").write_text(f'{text}[fit.A]\nrange = ["0.4 m2", "0.52 m2"]\n')
    system = load_system(tmp_path)
    outcome = quietly(system, record(tmp_path / "recordings", seed=2, area=0.55), "A")
    nearest = [candidate.text for candidate in outcome.diagnosis.nearest]
    assert [text for text in [*outcome.warnings, *nearest] if "0.02 m2" in text], outcome.summary()


def test_what_needs_the_equations_says_so(tank, tmp_path):
    effects = choose(["SensorOffset[level]"], catalogue(tank, None))
    recordings = record(tmp_path / "recordings", seed=6, area=0.55)
    outcome = quietly(tank, recordings, "SensorOffset[level]")
    problem = Problem(tank, outcome.cases, None, effects)
    assert outcome.diagnosis.verdict != "found"
    assert "workbench fit ... --parameter NAME" in outcome.next_steps[-3]
    assert "the model's own tool, export the FMU" in outcome.next_steps[-2]
    assert "put the Modelica library" in outcome.next_steps[-1]
    with pytest.raises(InputError, match=re.escape("no Modelica library package.mo")):
        propose(outcome, problem, Engine(out=tmp_path))


@pytest.fixture(scope="module")
def recorded(tank) -> Path:
    """The tank with a pump's sensor whose error it is, and recordings that come with it."""
    record(tank.source.parent / "recordings", seed=8)
    return tank.source.parent


def powered(folder: Path, out: Path, *options: str) -> int:
    """Status of `power`, one set of each effect."""
    sets = ["--repeats", "1", "--pairs", "0", "--workers", "1"]
    case = ["--case", str(folder / "recordings")]
    return main(["power", "--system", str(folder), "--out", str(out), *case, *sets, *options])


def test_power_of_an_fmu_alone_plants_what_its_diagnosis_may_find(recorded, tmp_path, capsys):
    """A clean set, a value, a term, and sensors that read otherwise: each by its name, or group."""
    names = ("A", "ViscousTerm[x]", "SensorGain[level]", "SensorSaturation[level]")
    names += ("SensorQuantisation[level]", "SensorDelay[level]", "InputLag[inflow]")
    chosen = ["--effects", *names, "--clean", "1", "--sizes", "20"]
    assert powered(recorded, tmp_path, *chosen) == 0
    power = json.loads((tmp_path / "power.json").read_text())
    check("power", power)
    sentence = "The figures hold only as far as its form is right"
    assert sentence in power["provenance"]["machine"]
    assert sentence in capsys.readouterr().out
    assert sentence in (tmp_path / "index.html").read_text()
    assert (power["false_alarms"]["hits"], power["failed"]) == (0, [])
    right = {name: effect["right_first"]["20"]["hits"] for name, effect in power["effects"].items()}
    assert right == dict.fromkeys(names, 1)
    # A 95 % interval of ten or fewer misses none in most runs; these sets are the same in each.
    assert power["coverage"]["hits"] == power["coverage"]["of"] >= len(names) - 2


def test_power_of_an_fmu_alone_says_what_recordings_can_show_at_best(recorded, tmp_path):
    chosen = ["--effects", "A", "SensorGain[level]", "--oracle"]
    assert powered(recorded, tmp_path, *chosen) == 0
    rows = json.loads((tmp_path / "oracle" / "oracle.json").read_text())["effects"]
    assert [row["effect"] for row in rows] == ["A", "SensorGain[level]"]
    # All that is wrong in A shows as a change of the rate, by h/A over 200 s: far below 1 %.
    assert all(0.0 < row["sigma"] < 0.01 * unit for row, unit in zip(rows, (0.5, 1.0), strict=True))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--form-error", "0.1", "--effects", "A"], "no effect that the simulated rig can inject"),
        (["--leave-out-effect"], "no Modelica library package.mo"),
    ],
)
def test_what_an_fmu_alone_cannot_be_asked_is_refused(recorded, tmp_path, capsys, options, message):
    assert powered(recorded, tmp_path, *options) == 2
    assert message in capsys.readouterr().err


def test_a_term_that_is_wrong_in_form_changes_along_a_recording(recorded, tmp_path):
    """By the readings, dh/dt = (q - c sqrt(2 g h))/A - k h: so is k, in steps of ten seconds."""
    system = load_system(recorded)
    exact = replace(system, comparison=replace(system.comparison, tolerances={}))
    problem = problem_of(exact, read_cases(recorded / "recordings", system), ["ViscousTerm[x]"])
    made = with_effects(problem, tmp_path, silent)
    assert made[1].name == model_path(system, OBSERVER).name  # which a refusal names
    _, sets = own_model(*made, 0.5).simulate(1, {problem.effects[0].name: 0.01})
    sizes = []
    for read in sets:
        h, q = read["level"], read["inflow"]
        flow = np.cumsum(0.5 * (q - 1e-3 * np.sqrt(2.0 * 9.81 * h)) / 0.5)
        part = slice(0, None, 20)
        middle = np.add.reduceat(0.5 * h, range(0, h.size - 1, 20))[: h[part].size - 1]
        sizes.append((np.diff(flow[part]) - np.diff(h[part])) / middle)
    every = np.concatenate(sizes)
    assert every.mean() == pytest.approx(0.01, rel=0.2)
    assert every.std() == pytest.approx(0.005, rel=0.3)


def test_inputs_that_are_named_alone_may_be_held_otherwise(tank):
    """Half a sample later; of a sensor that is late, all inputs may be."""
    (inflow,) = tank.inputs
    two = replace(tank, inputs=(replace(inflow, held=False), replace(inflow, name="rain")))
    assert held_otherwise(two, {"InputLag[inflow]"}, 0.25, 0.2, 0.3) == {"inflow": "held = true"}
    assert held_otherwise(two, {"SensorDelay[level]"}, -0.25, -0.3, -0.2) == {
        "inflow": 'held = "before"',
        "rain": "held = false",
    }
    assert held_otherwise(two, {"InputDelay[rain]"}, -0.25, -0.3, -0.2) == {"rain": "held = false"}


def test_of_two_ways_to_hold_an_input_the_nearer_one_is_named(tank):
    """Of a held one, straight lines act half a sample earlier, means of before a whole one."""
    assert held_otherwise(tank, set(), -0.22, -0.7, 0.1) == {"inflow": "held = false"}


# --- terms beside rates ---

SWING = machine_file("swing_alone/Swing.mo")
LAWS = {
    "Coulomb": lambda v: 0.4 * np.tanh(v / 1e-3),
    "Viscous": lambda v: 0.3 * v,
    "Quadratic": lambda v: 0.5 * v * abs(v),
}


@pytest.fixture(scope="module")
def swing(tmp_path_factory: pytest.TempPathFactory) -> System:
    folder = tmp_path_factory.mktemp("swing")
    build_text(folder, SWING)
    (folder / "system.toml").write_text(machine_file("swing_alone/system.toml"))
    return load_system(folder)


def swung(law, start: float, time) -> np.ndarray:
    """Position of the swing with a law of friction, by a solver of its own, (n,)."""
    return motion(law, start, time)[0]


def motion(law, start: float, time) -> np.ndarray:
    """Position and speed of the swing, (2, n)."""
    return solve_ivp(
        lambda _t, x: [x[1], -10.0 * x[0] - law(x[1])],
        (0.0, time[-1]),
        [start, 0.0],
        method="Radau",
        t_eval=time,
        rtol=1e-8,
        atol=1e-10,
    ).y


@pytest.mark.parametrize(("form", "size"), [("Coulomb", 0.4), ("Viscous", 0.3), ("Quadratic", 0.5)])
def test_a_missing_friction_is_named_with_its_size(swing, tmp_path, form, size):
    """And the FMU around the one that lacks it is right in another tool."""
    rng, time = np.random.default_rng(7), np.arange(0.0, 4.005, 0.01)
    for number, start in enumerate((0.5, 0.35, -0.4)):
        position = swung(LAWS[form], start, time) + 1e-3 * rng.standard_normal(time.size)
        write_case(
            tmp_path / f"recordings/{number}", {"time [s]": time, "s [m]": position}, "Released"
        )
    outcome = quietly(swing, tmp_path / "recordings")
    (cause,) = outcome.diagnosis.causes
    assert cause.effect.name == f"{form}Term[v]"
    assert cause.parameters["coefficient"].low < size < cause.parameters["coefficient"].high
    assert outcome.extension is not None
    assert outcome.extension.difference < 1e-6  # the same equations, stepped alike
    # Noise of three recordings leaves some thousandths of the size open: 4 mm are 1 % of the swing.
    run = fmpy.simulate_fmu(
        str(outcome.extension.fmu),
        fmi_type="ModelExchange",
        stop_time=4.0,
        output_interval=0.01,
        relative_tolerance=1e-8,
        output=["s"],
    )
    expected = np.interp(run["time"], time, swung(LAWS[form], 0.5, time))
    assert_allclose(run["s"], expected, atol=4e-3)
    assert validate_fmu(str(outcome.extension.fmu)) == []


def test_observability_needs_neither_inputs_nor_quantities(swing, tmp_path):
    time = np.arange(0.0, 4.005, 0.01)
    columns = {"time [s]": time, "s [m]": 0.5 * np.cos(np.sqrt(10.0) * time)}
    case = write_case(tmp_path / "recordings/0", columns, "Released")
    given = ["--system", str(swing.source), "--out", str(tmp_path / "out")]
    assert main(["observability", str(case), *given]) == 0


def test_dry_friction_stops_a_body_within_a_sample(swing, tmp_path):
    """At samples 100 ms apart, a tenth of a noise of 1 mm from the closed form.

    Each half swing is a cosine about -+ mu/c; below mu/c from the middle the body sticks.
    """
    mu, c, time = 0.9, 10.0, np.arange(0.0, 8.05, 0.1)
    position, start, begin = np.empty(time.size), 0.5, 0.0
    while abs(start) > mu / c:
        middle = np.copysign(mu / c, start)
        now = time >= begin
        position[now] = middle + (start - middle) * np.cos(np.sqrt(c) * (time[now] - begin))
        start, begin = 2.0 * middle - start, begin + np.pi / np.sqrt(c)
    position[time >= begin] = start
    write_case(tmp_path / "recordings/0", {"time [s]": time, "s [m]": position}, "Released")
    (case,) = read_cases(tmp_path / "recordings", swing)
    with FMU(swing.source.parent / "Swing.fmu") as model:
        terms = rate_terms(model, swing)
    write_extended(model.path, tmp_path / "Extended.fmu", terms, {"added.coulomb.v": mu}, {})
    source = ModelSource(tmp_path / "Extended.fmu", swing, {})
    with ResidualModel(source, [case]) as simulations, FMU(source.path) as model:
        (samples,) = simulations.recordings
        simulated = samples.y - Predictor(model, swing, ["s"]).errors(samples, {})
    assert_allclose(simulated[:, 0], position, atol=1e-4)


def test_a_single_recording_that_forgets_its_start_names_the_parameter(tmp_path):
    """40 s of c der(x) = u - k x from x = u/k: what is left out first says how it began."""
    build_text(tmp_path, machine_file("lag_alone/Lag.mo", outputs="y"))
    (tmp_path / "system.toml").write_text(
        'title = "Lag"\nsample_time = "0.2 s"\nmodels.observer = { fmu = "Lag.fmu" }\n'
        'inputs.u = { unit = "1", noise = 0.0, scale = 2.0, held = true }\n'
        'outputs.y = { unit = "1", noise = 0.01, scale = 2.0 }\n'
    )
    system, time = load_system(tmp_path), np.arange(0.0, 40.1, 0.2)
    u = 1.0 + np.floor(time / 8.0 + 1e-9) % 2
    y = lagged(u, 0.2, 0.6, 1.0 / 0.6) + 0.01 * np.random.default_rng(1).standard_normal(time.size)
    columns = {"time [s]": time, "u [1]": u, "y [1]": y}
    write_case(tmp_path / "recordings/0", columns, "Steps")
    (cause,) = quietly(system, tmp_path / "recordings").diagnosis.causes
    assert "k" in {cause.effect.name, *cause.confusable_with}
    change = cause.parameters[cause.effect.size]
    assert change.low < 0.1 < change.high < change.low + 0.03


SENSORS = {
    "SensorLag[s]": ("lag", 0.03, lambda x: behind(x, 1e-3, 0.03)),
    "SensorDeadZone[s]": ("width", 0.03, lambda x: np.sign(x) * np.maximum(np.abs(x) - 0.03, 0.0)),
    "SensorRectification[s]": ("rectified", 2.0, np.abs),
    "SensorSaturation[s]": ("limit", 0.3, lambda x: x),  # cut with its noise, below
}


@pytest.mark.parametrize("name", SENSORS)
def test_a_sensor_that_bends_its_signal_is_named_with_its_size(swing, tmp_path, name):
    parameter, size, sensor = SENSORS[name]
    rng, fine = np.random.default_rng(2), np.arange(0.0, 4.0055, 1e-3)
    for number, start in enumerate((0.5, 0.35, -0.4)):
        seen = sensor(swung(lambda v: 0.0, start, fine))[::10]
        read = seen + 1e-3 * rng.standard_normal(seen.size)
        if name.startswith("SensorSaturation"):
            read = np.clip(read, -size, size)
        columns = {"time [s]": fine[::10], "s [m]": read}
        write_case(tmp_path / f"recordings/{number}", columns, "Released")
    outcome = quietly(swing, tmp_path / "recordings")
    (cause,) = outcome.diagnosis.causes
    assert (cause.effect.name, cause.confusable_with) == (name, ())
    assert cause.parameters[parameter].low < size < cause.parameters[parameter].high
    assert outcome.extension is None  # a sensor is no matter of the model


def test_errors_far_above_noise_are_never_nothing(swing, tmp_path):
    """A position that rests where it begins: no mean over half a swing lasts."""
    rng, time = np.random.default_rng(2), np.arange(0.0, 4.005, 0.01)
    for number, start in enumerate((0.5, 0.35, -0.4)):
        position = np.clip(swung(lambda v: 0.0, start, time), -0.2, 0.3)
        position += 1e-3 * rng.standard_normal(time.size)
        columns = {"time [s]": time, "s [m]": position}
        write_case(tmp_path / f"recordings/{number}", columns, "Released")
    assert quietly(swing, tmp_path / "recordings", "m").diagnosis.verdict == "unexplained"


def with_speed(swing: System, folder: Path) -> System:
    """The swing whose speed is read, too."""
    speed = 'unit = "m/s"\nnoise = "3 mm/s"\nscale = "2 m/s"\n'
    text = (swing.source).read_text().replace("Swing.fmu", str(swing.source.parent / "Swing.fmu"))
    (folder / "system.toml").write_text(f"{text}\n[outputs.v]\n{speed}")
    return load_system(folder)


def test_a_late_sensor_in_motion_is_late_where_it_begins(swing, tmp_path):
    """A speed that changes by 5 m/s2 is 50 deviations off what was read 30 ms late."""
    system, late, fine = with_speed(swing, tmp_path), 30, np.arange(0.0, 6.005, 1e-3)
    rng = np.random.default_rng(4)
    for number, start in enumerate((0.5, 0.35, -0.4)):
        s, v = motion(lambda v: 0.0, start, fine)
        part = slice(200 + 100 * number, -1, 10)
        time = fine[part] - fine[part][0]
        columns = {
            "time [s]": time,
            "s [m]": s[part] + 1e-3 * rng.standard_normal(time.size),
            "v [m/s]": np.roll(v, late)[part] + 3e-3 * rng.standard_normal(time.size),
        }
        write_case(tmp_path / f"recordings/{number}", columns, "Released")
    (cause,) = quietly(system, tmp_path / "recordings").diagnosis.causes
    assert cause.effect.name == "SensorDelay[v]"
    assert cause.parameters["delay"].low < 1e-3 * late < cause.parameters["delay"].high


@pytest.mark.long
def test_friction_of_three_parts_is_named_with_each(swing, tmp_path):
    """What fades with speed gains nothing beside dry friction, without what rises with speed."""

    def law(v):
        rubs = np.tanh(v / 1e-3)
        return 0.25 * rubs + 0.5 * rubs * np.exp(-abs(v) / 0.5) + 0.05 * v

    system = with_speed(swing, tmp_path)
    rng, time = np.random.default_rng(3), np.arange(0.0, 6.005, 0.01)
    for number, start in enumerate((1.5, 1.0, -1.2)):
        s, v = motion(law, start, time)
        columns = {
            "time [s]": time,
            "s [m]": s + 1e-3 * rng.standard_normal(time.size),
            "v [m/s]": v + 3e-3 * rng.standard_normal(time.size),
        }
        write_case(tmp_path / f"recordings/{number}", columns, "Released")
    outcome = quietly(system, tmp_path / "recordings")
    causes = {cause.effect.name: cause.parameters for cause in outcome.diagnosis.causes}
    sizes = {"CoulombTerm[v]": 0.25, "StribeckTerm[v]": 0.5, "ViscousTerm[v]": 0.05}
    assert causes.keys() == sizes.keys()
    for name, size in sizes.items():
        interval = causes[name]["coefficient"]
        assert interval.low < size < interval.high
    # A rest within a sample is simulated as one at its end: sizes are those to a fifth.
    assert causes["StribeckTerm[v]"]["speed"].value == pytest.approx(0.5, rel=0.2)


def test_an_fmu_around_another_has_its_rates_and_derivatives_with_terms(swing, tmp_path):
    inner = swing.source.parent / "Swing.fmu"
    with FMU(inner) as model:
        terms = rate_terms(model, swing)
    # The rate of the position is the speed itself: what moves it acts on the speed.
    assert [term.name for term in terms] == [
        f"added.{form}.v" for form in ("coulomb", "stribeck", "viscous", "quadratic", "constant")
    ]
    path = tmp_path / "Extended.fmu"
    write_extended(inner, path, terms, {"added.viscous.v": 0.3}, {"c": 20.0})
    with FMU(path) as model:
        model.start({"added.quadratic.v": 0.5, "added.constant.v": 2.0})
        at = np.array([model.states.index(name) for name in ("s", "v")])
        x = np.empty(2)
        x[at] = 0.2, -0.7
        model.set_states(x)
        acceleration = -20.0 * 0.2 + 0.3 * 0.7 + 0.5 * 0.7**2 + 2.0
        assert_allclose(model.derivatives()[at], [-0.7, acceleration], rtol=1e-14)
        jacobian = model.state_jacobian()[np.ix_(at, at)]
        assert_allclose(jacobian, [[0.0, 1.0], [-20.0, -0.3 - 2.0 * 0.5 * 0.7]], rtol=1e-12)
        # (c, v_S) -> -c tanh(v/w) exp(-|v|/v_S), which rubs in full at 0.7 m/s
        rubbing, speed = "added.stribeck.v", "added.stribeck.v.speed"
        model.start({rubbing: 0.5, speed: 0.4, "added.viscous.v": 0.0})
        model.set_states(x)
        left = np.exp(-0.7 / 0.4)
        assert_allclose(model.derivatives()[at[1]], -4.0 + 0.5 * left, rtol=1e-14)
        by = model.jacobian(model.rate_references, model.variables([*model.states, rubbing, speed]))
        slopes = [-20.0, 0.5 * left / 0.4, left, 0.5 * left * 0.7 / 0.4**2]
        assert_allclose(by[at[1]], np.array(slopes)[[*at, 2, 3]], rtol=1e-12)
        model.start({})  # reset: what was set is gone, what was written stays
        model.set_states(x)
        assert_allclose(model.derivatives()[at], [-0.7, -4.0 + 0.3 * 0.7], rtol=1e-14)


def test_another_tools_fmu_is_asked_for_derivatives_of_outputs_and_rates_alone(swing, tmp_path):
    """FMI grants no others, and some tools end with an error; v is no output of the swing."""

    def change(folder: Path) -> None:
        file = folder / "modelDescription.xml"
        other = re.sub('generationTool="[^"]*"', 'generationTool="Other"', file.read_text())
        file.write_text(other)

    original = swing.source.parent / "Swing.fmu"
    with FMU(rewritten(original, tmp_path / "Other.fmu", change)) as model:
        assert model.description.tool == "Other"
        model.start({})
        assert model.states_derivatives(np.append(model.rate_references, model.references(["s"])))
        assert not model.states_derivatives(model.references(["v"]))
        assert instance(model, [], [], ["s"]).directional_fmi == 2
        assert instance(model, [], [], ["s", "v"]).directional_fmi == 0
        by = model.jacobian(model.references(["v"]), model.variables(["s", "v"]))
        assert_allclose(by, [[0.0, 1.0]], atol=1e-9)


def test_no_fmu_is_built_around_one_of_fmi_3(tank, tmp_path):
    path = build_text(tmp_path, SWING, fmi=3)
    with FMU(path) as model:
        assert rate_terms(model, tank) == ()
    with pytest.raises(InputError, match=re.escape("expected Model Exchange of FMI 2.0")):
        write_extended(path, tmp_path / "Extended.fmu", [], {}, {})


def test_an_extended_fmu_without_units_is_valid(tmp_path):
    inner = build_text(
        tmp_path,
        "model Plain output Real x(start=1, fixed=true); parameter Real k=1; "
        "equation der(x) = -k*x; end Plain;",
    )
    write_extended(inner, tmp_path / "extended.fmu", (), {}, {"k": 2.0})
    assert validate_fmu(str(tmp_path / "extended.fmu")) == []
    run = fmpy.simulate_fmu(str(tmp_path / "extended.fmu"), stop_time=1.0)
    assert run["x"][-1] == pytest.approx(np.exp(-2.0), rel=1e-3)  # of FMPy's integrator, 1e-4


KETTLE = """model Kettle
  parameter Real C(unit="J/K") = 3e5;
  parameter Real Cj(unit="J/K") = 5e4;
  parameter Real UA(unit="W/K") = 800.0;
  parameter Real loss(unit="W/K") = 40.0;
  input Real heater(unit="W", nominal=3e3);
  input Real warmth(unit="W", nominal=3e3);
  output Real T(unit="K", start=300.0, fixed=true, nominal=300.0);
  output Real Tj(unit="K", start=300.0, fixed=true, nominal=300.0);
equation
  C*der(T) = heater - UA*(T - Tj);
  Cj*der(Tj) = warmth + UA*(T - Tj) - loss*(Tj - 293.15);
end Kettle;
"""
KETTLE_SYSTEM = """
title = "Kettle"
sample_time = "10 s"
models.observer = { fmu = "Kettle.fmu" }
inputs.heater = { unit = "W", noise = "0 W", scale = "3 kW", held = true }
inputs.warmth = { unit = "W", noise = "0 W", scale = "3 kW", held = true }
outputs.T = { unit = "K", noise = "0.03 K", scale = "300 K" }
outputs.Tj = { unit = "K", noise = "0.03 K", scale = "300 K" }
"""


def mixed(folder: Path, more: str, gain: float) -> Outcome:
    """Three recordings of 6 h of a dye, of whose flow a share `gain` too much is read."""
    build_text(folder, machine_file("mixer/Mixer.mo"))
    (folder / "system.toml").write_text(machine_file("mixer/system.toml") + more)
    rng = np.random.default_rng(3)
    for number in range(3):
        time = np.arange(0.0, 21600.0, 60.0)
        flow = np.repeat(rng.uniform(0.0, 1e-4, 12), 30)
        volume = 2.0 + np.append(0.0, np.cumsum(flow[:-1] * 60.0))
        share = 1.0 - 2.0 / volume  # all that is no dye is the water of the start
        columns = {
            "time [s]": time,
            "F [m3/s]": (1.0 + gain) * flow,
            "c [1]": share + 0.002 * rng.standard_normal(time.size),
        }
        write_case(folder / "recordings" / f"{number}", columns, "Dye")
    return quietly(load_system(folder), folder / "recordings")


def test_a_start_that_nothing_shows_says_what_it_hides(tmp_path):
    """What mixes goes with flow over volume alone, so that half the water is twice the flow.

    By terms beside its rate the water runs out within the recordings, which must end no diagnosis.
    """
    outcome = mixed(tmp_path, "", 0.2)
    assert outcome.diagnosis.verdict == "nothing"
    assert "SensorGain[F]" in outcome.diagnosis.hidden_by_starts["V"]
    assert "[states.V] spread" in outcome.not_visible["SensorGain[F]"]
    assert "Start[V]" not in outcome.not_visible


def test_a_start_that_is_known_hides_nothing(tmp_path):
    outcome = mixed(tmp_path, '[states.V]\nspread = "0.02 m3"\n', 0.2)
    (cause,) = outcome.diagnosis.causes
    names = {cause.effect.name, *cause.confusable_with}
    assert names == {"SensorGain[F]", "Start[V]"}
    assert outcome.not_visible.keys().isdisjoint(names)


def test_a_gain_for_another_model_leads_no_run_astray(tmp_path):
    """Outputs lead a run where the input has noise, here by a gain for twice the damping.

    With half of it, that gain makes the run unstable: errors of 1e20 hid the right value. Shaken by
    straight lines between samples, the car is stepped exactly (SciPy, first-order hold).
    """
    build_text(tmp_path, machine_file("quarter_car/Quarter.mo"))
    (tmp_path / "system.toml").write_text(machine_file("quarter_car/system.toml"))
    ms, mu, ks, cs, kt, h = 300.0, 40.0, 2e4, 750.0, 1.8e5, 0.005
    between = np.array([-ks, ks, -cs, cs])  # force on the body, by zs, zu, vs, vu
    A = np.array([[0, 0, 1, 0], [0, 0, 0, 1], between / ms, (-between - [0, kt, 0, 0]) / mu])
    B, C = np.array([[0.0], [0.0], [0.0], [kt / mu]]), np.array([between / ms, [1, -1, 0, 0]])
    car = cont2discrete((A, B, C, np.zeros((2, 1))), h, "foh")[:-1]
    # Rough enough for its noise, which samples cannot tell from its motion, to count.
    road = butter(2, [0.3, 12.0], "band", fs=1.0 / h, output="sos")
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 8.0, h)
    for number in range(2):
        shaker = 0.04 * sosfilt(road, rng.standard_normal(time.size))
        _, read, _ = dlsim((*car, h), shaker, time)
        columns = {
            "time [s]": time,
            "zr [m]": shaker,
            "a [m/s2]": read[:, 0] + 0.05 * rng.standard_normal(time.size),
            "travel [m]": read[:, 1] + 2e-4 * rng.standard_normal(time.size),
        }
        write_case(tmp_path / "recordings" / f"{number}", columns, "Shaken", "%.8g")
    outcome = quietly(load_system(tmp_path), tmp_path / "recordings", "cs", "ms", "mu")
    (cause,) = outcome.diagnosis.causes
    assert cause.effect.name == "cs"
    assert cause.parameters["change"].low < cs - 1500.0 < cause.parameters["change"].high


def test_what_a_sensor_lacks_is_taken_from_no_run_that_was_led_astray(tmp_path, monkeypatch):
    """A reading that lags was made straight by a led run of 1e159 K, which ended the diagnosis."""
    build_text(tmp_path, machine_file("quarter_car/Quarter.mo"))
    (tmp_path / "system.toml").write_text(machine_file("quarter_car/system.toml"))
    time, rng = np.arange(0.0, 4.0, 0.005), np.random.default_rng(5)
    shaker = 0.01 * np.sin(9.0 * time) + 7e-4 * rng.standard_normal(time.size)
    a, travel = 0.05 * rng.standard_normal(time.size), 2e-4 * rng.standard_normal(time.size)
    columns = {"time [s]": time, "zr [m]": shaker, "a [m/s2]": a, "travel [m]": travel}
    write_case(tmp_path / "recordings/0", columns, "Shaken")
    system = load_system(tmp_path)
    cases, lagging = read_cases(tmp_path / "recordings", system), {"SensorLag[travel].lag": 0.005}
    right = Predictor.errors
    with ResidualModel(ModelSource(tmp_path / "Quarter.fmu", system, {}), cases) as simulations:
        assert simulations.recordings[0].lead.noisy
        away = 1e30 * time[:, None]
        monkeypatch.setattr(
            Predictor,
            "errors",
            lambda self, own, values: right(self, own, values) + away * (own.lead is not None),
        )
        (free,), (straight,) = simulations.predicted([{}]), simulations.predicted([lagging])
    assert_allclose(straight, free, atol=1e-9)


def test_a_run_at_the_edge_of_what_the_model_can_do_ends_no_diagnosis(tmp_path):
    """A valve lets nothing through below a tenth of its lift, where a sensor's gain takes it."""
    build_text(
        tmp_path,
        """model Valve
  parameter Real A(unit="m2") = 0.5 "Area of the tank";
  parameter Real most(unit="m3/s") = 4e-3 "Flow through the open valve";
  input Real lift(unit="1", start=0.5, min=0.1, max=1.0) "Lift of the valve";
  input Real drawn(unit="m3/s") "Flow that is drawn";
  output Real h(unit="m", start=1.0, fixed=true, nominal=1.0) "Level";
equation
  A*der(h) = most*sqrt(lift - 0.099999) - drawn;
end Valve;
""",
    )
    (tmp_path / "system.toml").write_text("""title = "A valve"
sample_time = "1 s"
models.observer = { fmu = "Valve.fmu" }
inputs.lift = { unit = "1", noise = "1e-4 1", scale = "1 1", held = true }
inputs.drawn = { unit = "m3/s", noise = "0 m3/s", scale = "4e-3 m3/s", held = true }
outputs.h = { unit = "m", noise = "2 mm", scale = "1 m" }
""")
    rng = np.random.default_rng(2)
    for number in range(3):
        time = np.arange(0.0, 300.0)
        opened = np.repeat(rng.choice([0.1, 0.3, 0.6, 1.0], 10), 30)
        through = 3.6e-3 * np.sqrt(opened - 0.099999)
        drawn = np.repeat(rng.uniform(0.5, 1.5, 5), 60) * through.mean()
        level = 1.0 + np.append(0.0, np.cumsum(through - drawn)[:-1]) / 0.5
        columns = {
            "time [s]": time,
            "lift [1]": opened,
            "drawn [m3/s]": drawn,
            "h [m]": level + 0.002 * rng.standard_normal(time.size),
        }
        write_case(tmp_path / "recordings" / f"{number}", columns, "Valve", "%.9g")
    outcome = quietly(load_system(tmp_path), tmp_path / "recordings")
    (cause,) = outcome.diagnosis.causes
    assert cause.effect.name == "most"
    assert cause.parameters["change"].low < -4e-4 < cause.parameters["change"].high


@pytest.fixture(scope="module")
def kettle(tmp_path_factory) -> Path:
    """Folder of an FMU whose states are temperatures, with its system file."""
    folder = tmp_path_factory.mktemp("kettle")
    build_text(folder, KETTLE)
    (folder / "system.toml").write_text(KETTLE_SYSTEM)
    return folder


def heated(folder: Path, zero: float, gain: float, more: float) -> Path:
    """Four recordings of an hour; a thermometer is wrong about 0 degC, or the heater does more."""
    rng = np.random.default_rng(5)
    time = 10.0 * np.arange(361.0)
    for number in range(4):
        heater, warmth = np.repeat(rng.uniform(0.0, 3e3, (2, 6)), 60, axis=1)
        x = [np.array([300.0 + 5.0 * number, 300.0 + 4.0 * number])]
        for P, Q in zip(heater, warmth, strict=True):

            def rate(_, x, P=P, Q=Q):
                through = 800.0 * (x[0] - x[1])
                return [(P + more - through) / 3e5, (Q + through - 40.0 * (x[1] - 293.15)) / 5e4]

            x.append(solve_ivp(rate, (0.0, 10.0), x[-1], rtol=1e-9, atol=1e-9).y[:, -1])
        T, Tj = np.transpose(x)
        T = T + zero + gain * (T - 273.15)
        columns = {
            "time [s]": time,
            "heater [W]": np.append(heater, heater[-1]),
            "warmth [W]": np.append(warmth, warmth[-1]),
            "T [K]": T + 0.03 * rng.standard_normal(time.size),
            "Tj [K]": Tj + 0.03 * rng.standard_normal(time.size),
        }
        write_case(folder / f"{number}", columns, "Kettle")
    return folder


@pytest.mark.parametrize(
    ("zero", "gain", "more", "name", "size"),
    [
        (1.0, 0.0, 0.0, "SensorOffset[T]", 1.0),
        (0.0, 0.05, 0.0, "SensorGain[T]", 0.05),
        (0.0, 0.0, 200.0, "SensorOffset[heater]", -200.0),
    ],
)
def test_what_is_small_beside_absolute_temperatures_is_named(
    kettle, tmp_path, zero, gain, more, name, size
):
    """One in a hundred of 300 K is 3 K, a hundred times the noise: not what a thermometer may err.

    None errs in proportion to what is above absolute zero.
    """
    outcome = quietly(load_system(kettle), heated(tmp_path, zero, gain, more))
    cause = outcome.diagnosis.causes[0]
    assert len(outcome.diagnosis.causes) == 1
    assert name in (cause.effect.name, *cause.confusable_with)
    if name == cause.effect.name:
        (interval,) = cause.parameters.values()
        assert interval.low < size < interval.high
