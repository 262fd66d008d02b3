"""A machine of another kind, by its files alone, is diagnosed without a change of the engine.

A fan on an electric motor: the current follows the voltage at once, the winding warms. The
recordings come from equations of their own and an integrator with error control.
"""

import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path

import lxml.etree
import lxml.html
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from workbench.diagnosis import Outcome, catalogue, diagnose
from workbench.diagnosis.problem import Problem
from workbench.diagnosis.report import write_diagnosis
from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.models.modelica import read_library
from workbench.pages.provenance import run_of
from workbench.recordings.case import Case, read_cases
from workbench.runtime.engine import Engine
from workbench.system.reader import with_model
from workbench.system.system import System

from .built import declare, machine, write_case

LIBRARY, SYSTEM = machine("fan")
J, K, DRAG, R, ALPHA, C, G = 0.02, 0.5, 5.3e-4, 1.0, 3.9e-3, 40.0, 0.4  # nominal drag is 5e-4
STEP, SECONDS, HOLD = 0.02, 60.0, 5.0  # [s]
GREASE = 1e-3  # [N.m.s/rad]
FRICTION = 0.05  # [N.m] planted: a tenth of what the fan takes at 30 rad/s

Torque = Callable[[float, float], float]


def rubbing(t: float, w: float) -> float:
    return FRICTION * np.tanh(w / 0.5)


def nothing(t: float, w: float) -> float:
    return 0.0


def gusts(t: float, w: float) -> float:
    """Wind on the fan, which no class of the library knows."""
    return 0.05 * np.sin(2.0 * np.pi * 0.4 * t)


def recorded(folder: Path, system: System, load: Torque) -> list[Case]:
    """Four recordings of voltages that are set anew every five seconds."""
    time = np.arange(0.0, SECONDS, STEP)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        voltage = np.repeat(rng.uniform(4.0, 16.0, round(SECONDS / HOLD)), round(HOLD / STEP))
        speed = simulated(time, voltage, DRAG * (1.0 + 0.02 * rng.standard_normal()), load)
        columns = {
            "time [s]": time,
            "u [V]": voltage + 2e-3 * rng.standard_normal(time.size),
            "w [rad/s]": speed + 0.02 * rng.standard_normal(time.size),
        }
        write_case(folder / f"{seed:02}_steps", columns, "Steps of the voltage")
    return read_cases([folder], system)


def simulated(
    time: NDArray[np.float64], voltage: NDArray[np.float64], drag: float, load: Torque
) -> NDArray[np.float64]:
    """Speed, from rest, by an integrator with error control from step to step of the voltage."""

    def rates(t: float, x: NDArray[np.float64], u: float) -> list[float]:
        w, T = x
        winding = R * (1.0 + ALPHA * T)
        i = (u - K * w) / winding
        torque = K * i - drag * w * abs(w) - load(t, w)
        return [torque / J, (winding * i * i - G * T) / C]

    x, speeds = np.zeros(2), []
    count = round(HOLD / STEP)
    for first in range(0, time.size, count):
        at = np.append(time[first : first + count], time[first] + HOLD)
        solved = solve_ivp(
            rates, at[[0, -1]], x, t_eval=at, args=(voltage[first],), rtol=1e-8, atol=1e-9
        )
        speeds.append(solved.y[0, :-1])
        x = solved.y[:, -1]
    return np.concatenate(speeds)


@pytest.fixture(scope="module")
def fan(tmp_path_factory) -> System:
    return declare(tmp_path_factory.mktemp("fan"), LIBRARY, SYSTEM)


@pytest.fixture(scope="module")
def diagnosed(fan, once) -> Callable[[Torque], tuple[Outcome, Path]]:
    """Diagnoses recordings under a load, once, and writes what was found."""

    def run(load: Torque) -> tuple[Outcome, Path]:
        def diagnose_load(folder: Path) -> tuple[Outcome, Path]:
            cases = recorded(folder / "recordings", fan, load)
            return diagnosis(fan, cases, folder / "results"), folder / "results"

        return once(f"fan, {load.__name__}", diagnose_load)

    return run


def diagnosis(system: System, cases: list[Case], out: Path) -> Outcome:
    library = read_library(system.library)
    return diagnose(Problem(system, cases, library, catalogue(system, library)), Engine(out=out))


def test_a_bearing_that_rubs_is_named_with_its_friction(diagnosed):
    outcome, _ = diagnosed(rubbing)
    assert outcome.diagnosis.verdict == "found"
    (cause,) = outcome.diagnosis.causes
    assert cause.effect.name == "BearingFriction"
    # Brushes that take a voltage brake as much, with a current that nobody measured.
    assert cause.confusable_with == ("BrushDrop",)
    friction = cause.parameters["tau_c"]
    assert friction.low <= FRICTION <= friction.high
    assert friction.unit == "N.m"
    assert friction.high - friction.low < 0.3 * FRICTION


def test_nothing_is_found_in_a_motor_like_its_model(diagnosed):
    outcome, _ = diagnosed(nothing)
    assert outcome.diagnosis.verdict == "nothing"
    assert outcome.extension is None


def test_wind_that_the_library_lacks_is_unexplained(diagnosed):
    outcome, _ = diagnosed(gusts)
    assert outcome.diagnosis.verdict == "unexplained"
    assert outcome.diagnosis.causes == ()


def test_a_logger_of_the_system_file_that_is_late_is_named(fan, tmp_path):
    """Without a line of Python or Modelica, and neither recording nor model has that clock."""
    system = declare(tmp_path, LIBRARY, f'{SYSTEM}\n[loggers]\nsupply = ["u"]\n')
    late = 3  # samples
    cases = [
        case.with_signals({"u": np.concatenate([np.full(late, case["u"][0]), case["u"][:-late]])})
        for case in recorded(tmp_path / "recordings", fan, nothing)
    ]
    outcome = diagnosis(system, cases, tmp_path / "results")
    (cause,) = outcome.diagnosis.causes
    assert (cause.effect.name, cause.effect.text) == (
        "LoggerTimeSkew[supply]",
        "a logger of u with a time offset",
    )
    skew = cause.parameters["skew"]
    assert skew.low <= late * STEP <= skew.high
    assert skew.high - skew.low < STEP
    assert outcome.extension.difference < 1e-3
    # Nobody declared it: it is said, and no other cause is made of it.
    undeclared = diagnosis(fan, cases, tmp_path / "undeclared")
    assert undeclared.diagnosis.verdict == "unexplained"
    assert "late by" in undeclared.sentence


# --- what is beyond a bound, and what is a part ---


@pytest.fixture(scope="module")
def bounded(once) -> Callable[[Torque], tuple[Outcome, Path]]:
    """A bearing that rubs by more than its class allows, and brushes that cannot stand for it."""
    library = LIBRARY.replace("min=0.0, max=1.0", f"min=0.0, max={0.6 * FRICTION}")

    def run(load: Torque) -> tuple[Outcome, Path]:
        def diagnose_load(folder: Path) -> tuple[Outcome, Path]:
            system = declare(folder, library.replace("max=3.0", "max=0.06"), SYSTEM)
            cases = recorded(folder / "recordings", system, load)
            return diagnosis(system, cases, folder / "results"), folder / "results"

        return once(f"fan beyond bounds, {load.__name__}", diagnose_load)

    return run


def test_a_cause_beyond_its_bound_is_told_with_it(bounded):
    """And not two causes, of which one stands for what the other may not be."""
    outcome, out = bounded(rubbing)
    assert outcome.diagnosis.verdict == "partly explained"
    (cause,) = outcome.diagnosis.causes
    friction = cause.parameters["tau_c"]
    assert (cause.effect.name, friction.limit) == ("BearingFriction", "greatest")
    assert friction.high == np.inf
    # As sure as a size within its bounds is, in the test of a bearing that rubs.
    assert friction.beyond == pytest.approx(FRICTION, rel=0.15)
    page = write_diagnosis(outcome, {"run": run_of("diagnose", outcome.system, {})}, out)
    doubt, *others = json.loads((out / "summary.json").read_text())["warnings"]
    warnings = lxml.html.fromstring(page.read_bytes()).find_class("warning")
    assert doubt in [" ".join(warning.text_content().split()) for warning in warnings]
    assert f"doubt: {doubt}" in outcome.summary()
    assert "at its limit of 0.03 N.m" in doubt
    assert any("widens the intervals" in other for other in others)


def greasy(t: float, w: float) -> float:
    """A bearing that rubs, and is stiff with grease."""
    return rubbing(t, w) + GREASE * w


def test_beside_a_cause_beyond_its_bound_no_other_stands_for_it(bounded):
    """Else the grease has the rest of the friction in it, and an interval far from its size."""
    outcome, _ = bounded(greasy)
    assert outcome.diagnosis.verdict == "unexplained"
    (nearest,) = outcome.diagnosis.nearest
    assert set(nearest.effects) == {"BearingFriction", "Grease"}
    match = re.search(
        r"tau_c of BearingFriction is at its bound; ([0-9.]+) N.m, beyond", nearest.text
    )
    assert float(match[1]) == pytest.approx(FRICTION, rel=0.05)
    assert "widen the bounds" in outcome.summary()


def windy(t: float, w: float) -> float:
    """A bearing that rubs, in wind that no class of the library knows."""
    return rubbing(t, w) + 0.6 * gusts(t, w)


def test_a_part_is_told_with_its_size_and_what_remains(diagnosed):
    outcome, out = diagnosed(windy)
    assert outcome.diagnosis.verdict == "partly explained"
    (cause,) = outcome.diagnosis.causes
    friction = cause.parameters["tau_c"]
    assert {cause.effect.name, *cause.confusable_with} >= {"BearingFriction"}
    assert friction.low <= FRICTION <= friction.high
    # What remains widens it.
    sure = diagnosed(rubbing)[0].diagnosis.causes[0].parameters["tau_c"]
    assert friction.high - friction.low > sure.high - sure.low
    gain = outcome.diagnosis.gain
    assert gain.after < gain.before
    assert "This is a part" in outcome.sentence
    assert outcome.rivals is not None
    assert "a part of what is missing" in outcome.extension.modelica.read_text()
    write_diagnosis(outcome, {"run": run_of("diagnose", outcome.system, {})}, out)
    summary = json.loads((out / "summary.json").read_text())
    assert summary["partial"] == [cause.effect.name]
    assert summary["model"]["partial"] is True


def bent(t: float, w: float) -> float:
    """A bearing whose friction is off by a tenth, up and down between 5 and 30 rad/s."""
    return rubbing(t, w) * (1.0 + 0.1 * np.cos(2.0 * np.pi * (w - 5.0) / 12.5))


def test_an_interval_is_widened_where_a_law_is_wrong_in_form(diagnosed):
    """Alone in the catalogue, so that no other effect stands for what its form leaves."""
    outcome, out = diagnosed(bent)
    system, cases = outcome.system, list(outcome.cases)
    library = read_library(system.library)
    effects = [e for e in catalogue(system, library) if e.name == "BearingFriction"]
    alone = diagnose(Problem(system, cases, library, effects), Engine(out=out))
    assert not alone.diagnosis.noise_alone
    (cause,) = alone.diagnosis.causes
    friction = cause.parameters["tau_c"]
    # The mean over the range, which the fit misses by more than noise would let it.
    assert friction.low <= FRICTION <= friction.high
    assert any("wrong in form" in warning for warning in alone.warnings)
    (out / "gain.png").touch()  # of an earlier diagnosis
    page = write_diagnosis(alone, {"run": run_of("diagnose", system, {})}, out).read_text()
    assert not [*out.glob("*.png"), *out.glob("*.svg")]  # nobody asked for pictures
    assert '.svg">' not in page
    assert "95 of 100" not in page
    assert "widened because what remains is no noise" in page


def test_where_nothing_is_accepted_the_nearest_candidates_say_why(diagnosed):
    outcome, _ = diagnosed(gusts)
    assert "nearest candidates" in outcome.summary()
    assert "--propose" in outcome.summary()
    for candidate in outcome.diagnosis.nearest:
        assert 0.0 < candidate.removed < 0.9
        assert candidate.reasons


def test_drag_that_differs_by_nature_is_a_level_and_no_cause(diagnosed):
    outcome, _ = diagnosed(nothing)
    value, unit = outcome.levels["c", "all"]
    # Four recordings whose drag scatters by 2 %: their mean is known to 1 %.
    assert value == pytest.approx(DRAG, rel=0.03)
    assert unit == "N.m.s2/rad2"


def test_the_extended_model_rubs_and_lacks_nothing(fan, diagnosed, tmp_path):
    outcome, out = diagnosed(rubbing)
    assert outcome.extension.difference < 1e-3
    with FMU(outcome.extension.fmu) as fmu:
        size = outcome.diagnosis.causes[0].parameters["tau_c"].value
        assert fmu.defaults["friction.bearingFriction.tau_c"] == pytest.approx(size)
    better = with_model(fan, "observer", outcome.extension.fmu)
    cases = read_cases([out.parent / "recordings"], better)
    assert diagnosis(better, cases, tmp_path).diagnosis.verdict == "nothing"


def test_a_diagnosis_is_text_table_numbers_and_figure(diagnosed):
    outcome, _ = diagnosed(rubbing)
    sentence = "The model lacks a bearing that rubs: BearingFriction (or BrushDrop), tau_c 0.0"
    assert outcome.summary().startswith(sentence)
    table = outcome.to_frame()
    assert list(table["effect"]) == ["BearingFriction"]
    assert (table["low"] < table["value"]).all()
    assert json.loads(json.dumps(outcome.to_dict()))["channels"] == {"w": "rad/s"}
    figure = outcome.plot()
    assert isinstance(figure, Figure)
    assert [axes.get_title(loc="left") for axes in figure.axes] == [
        "Voltage u, as measured [V]",
        "Speed w: measured - predicted [rad/s]",
    ]
    assert "02_steps" in outcome.plot("02_steps").get_suptitle()
    assert "<table" in outcome._repr_html_()
    assert "<table" not in diagnosed(nothing)[0]._repr_html_()
    with pytest.raises(InputError, match="no recording of this name"):
        outcome.plot("02_stepps")


@pytest.mark.parametrize("load", [rubbing, nothing, gusts])
def test_page_and_files_speak_of_the_fan(load, diagnosed):
    outcome, out = diagnosed(load)
    page = write_diagnosis(outcome, {"run": run_of("diagnose", outcome.system, {})}, out)
    tree = lxml.html.fromstring(page.read_bytes())
    lxml.etree.strip_elements(tree, "script", "style", with_tail=False)
    text = tree.text_content()
    assert "The model is simulated from the measured voltage." in text
    for word in ("stop", "wheel", "roller", "brak", "slip", "creep", "rig's"):
        assert word not in text.replace("turn the wheel with Ctrl", ""), word
    columns = list(pd.read_csv(out / "00_steps.csv"))
    assert columns[:3] == ["time [s]", "before.w [rad/s]", "after.w [rad/s]"]
    summary: Mapping[str, object] = json.loads((out / "summary.json").read_text())
    assert summary["verdict"] == outcome.diagnosis.verdict
