"""A wheel load that is set: a condition that is a parameter of the model, and need not be said."""

from dataclasses import replace

import numpy as np
import pytest

from workbench.cli.schemas import case_schema
from workbench.diagnosis.data.counting import count
from workbench.diagnosis.inference.thresholds import SOUND
from workbench.errors import InputError
from workbench.machines.wheelset.rig import CONSTANT_PADS, SCENARIOS, simulate
from workbench.models.fmu import FMU
from workbench.observers import estimators_of
from workbench.observers.replay import replay
from workbench.observers.run import Run
from workbench.recordings.case import Case, read_case
from workbench.system.expression import Expression
from workbench.system.registry import load_system, model_path

from .recordings import REFERENCE, record

SYSTEM = load_system("wheelset")
STOP = SCENARIOS["01_dry_80_1.5"]
LIGHT = replace(STOP, conditions=replace(STOP.conditions, wheel_load=60e3))
# The contact is as stiff as its area is large, with the power 2/3 of the load (Hertz).
SOFTER = (80.0 / 60.0) ** (2.0 / 3.0)


@pytest.fixture(scope="module")
def light(tmp_path_factory) -> Case:
    folder = tmp_path_factory.mktemp("light") / "01_light"
    record(LIGHT, 3, CONSTANT_PADS, folder)
    return read_case(folder, SYSTEM)


@pytest.fixture(scope="module")
def unsaid(light) -> Case:
    """As if nobody had said how heavy the axle was."""
    kept = {name: said for name, said in light.conditions.items() if name != "wheel_load"}
    return replace(light, conditions=kept)


def open_loop(case: Case, role: str) -> Run:
    """A model of the rig by itself."""
    cls = estimators_of(SYSTEM)["open_loop"]
    with FMU(model_path(SYSTEM, role)) as fmu:
        return replay(case, cls(fmu, SYSTEM, cls.default_gains(fmu, SYSTEM)))


def test_what_sets_a_parameter_is_said_or_is_as_in_the_model(light, unsaid):
    assert SYSTEM.set_by(light.conditions)["Fz"] == 60e3
    assert "Fz" not in SYSTEM.set_by(unsaid.conditions)
    assert "Fz" not in SYSTEM.set_by({**light.conditions, "wheel_load": "unknown"})
    required = case_schema(SYSTEM)["properties"]["conditions"]["required"]
    assert "wheel_rail" in required
    assert "wheel_load" not in required


@pytest.mark.parametrize(
    ("written", "found"),
    [("-1 kN", "found '-1 kN'; expected above 0 N"), ("60 kg", r"found \[kg\]")],
)
def test_a_load_that_is_none_is_refused(written, found, tmp_path):
    record(LIGHT, 3, CONSTANT_PADS, tmp_path / "stop")
    toml = tmp_path / "stop" / "case.toml"
    toml.write_text(toml.read_text().replace("60 kN", written))
    with pytest.raises(InputError, match=found):
        read_case(tmp_path / "stop", SYSTEM)


def test_slip_of_a_light_axle_goes_with_its_contact():
    usual, less = (simulate(scenario, 3, CONSTANT_PADS, REFERENCE) for scenario in (STOP, LIGHT))
    held = slice(*np.searchsorted(usual.time, usual.drawn.coasting + np.array([5.0, 10.0])))
    more = less.truth["slip"][held] / usual.truth["slip"][held]
    # Polach's force bends by 1 % more where less of it is left.
    assert more == pytest.approx(SOFTER, rel=0.015)


def test_estimators_run_with_the_load_that_was_said(light, unsaid):
    runs = [open_loop(case, "observer") for case in (light, unsaid)]
    # Where the contact carries little: the model's friction is that of a slippery rail.
    begins = np.argmax(runs[0].signal("Fx") > 500.0)
    said, usual = (run.signal("slip")[begins] for run in runs)
    assert said / usual == pytest.approx(SOFTER, rel=0.02)
    # Of both wheels, 60 kN each.
    assert runs[0].signal("adhesion") == pytest.approx(np.abs(runs[0].signal("Fx")) / 120e3)


def test_samples_are_excluded_by_the_load_that_was_said(light, unsaid):
    (slide, *_) = SYSTEM.comparison.exclusions
    usage = Expression("Fx/(2*Fz)", "a test")
    much = replace(slide, reason="much adhesion", formula=usage, above=0.04, from_rest=False)
    much = replace(much, smoothed=0.0, within=0.0, only_while=None, restarted=())
    system = replace(SYSTEM, comparison=replace(SYSTEM.comparison, exclusions=(much,)))
    for case, load in ((light, 60e3), (unsaid, 80e3)):
        counted = count(case, system, tuple(case.signals), SOUND, restarting=False)
        beyond = np.abs(counted.clean["Fx"]) > 0.04 * 2.0 * load
        assert 0.01 < beyond.mean() < 0.99
        # But for the first samples and the last one, of which no mean is formed.
        assert np.array_equal(counted.excluded["much adhesion"][5:-5], beyond[5:-5])


def test_a_model_without_that_parameter_runs_as_it_is(light, unsaid):
    """The full model has the wheel load as an output."""
    runs = [open_loop(case, "full") for case in (light, unsaid)]
    assert np.array_equal(runs[0].signal("slip"), runs[1].signal("slip"))
