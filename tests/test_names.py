"""A model with names of its own runs like ours, and what does not fit is refused at the door."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from numpy.testing import assert_array_equal

from workbench.cli.inputs import model_names
from workbench.errors import InputError
from workbench.models.description import read_description
from workbench.models.fmu import FMU
from workbench.observers.estimators.disturbance import DisturbanceObserver
from workbench.observers.estimators.kalman import ExtendedKalmanFilter
from workbench.observers.estimators.open_loop import OpenLoop
from workbench.observers.replay import replay
from workbench.observers.run import Ending
from workbench.recordings.case import Case, read_case
from workbench.system.check import check_model
from workbench.system.system import System

from .built import build_here

NAMES = {
    "omegaW": "speedWheelset",
    "omegaR": "speedRoller",
    "pB": "brakePressure",
    "tauR": "rollerTorque",
    "dmuWR": "adhesionChange",
    "dmuDC": "padChange",
    "Fx": "creep",
    "slip": "sliding",
    "muWR": "adhesionLevel",
    "muDC": "padLevel",
    "rW": "rollingRadius",
    "rR": "radiusOfRoller",
    "JR": "inertiaOfRoller",
}


@pytest.fixture(scope="module")
def renamed_path(root, tmp_path_factory) -> Path:
    """MinimalObserver with every variable that estimators use under another name."""
    folder = tmp_path_factory.mktemp("renamed")
    library = folder / "WheelsetRig"
    shutil.copytree(root / "modelica" / "WheelsetRig", library)
    source = library / "MinimalObserver.mo"
    text = source.read_text()
    for ours, theirs in NAMES.items():
        # Not the left side of a modifier such as `actuation(pB=pB)`.
        text = re.sub(rf"\b{ours}\b(?!=)", theirs, text)
    source.write_text(text)
    path = folder / "Renamed.fmu"
    build_here(library / "package.mo", "WheelsetRig.MinimalObserver", path)
    return path


@pytest.fixture(scope="module")
def start_of_stop(dry_case) -> Case:
    """Coasting, first contact and the first second of braking."""
    return dry_case.part(slice(1000))


@pytest.mark.parametrize("cls", [OpenLoop, DisturbanceObserver, ExtendedKalmanFilter])
def test_a_model_with_other_names_gives_the_same_estimate_bit_for_bit(
    root, renamed_path, start_of_stop, system, cls
):
    estimates = []
    with (
        FMU(root / "fmus" / "fmi2" / "MinimalObserver.fmu") as ours,
        FMU(renamed_path, NAMES) as theirs,
    ):
        for fmu in (ours, theirs):
            run = replay(start_of_stop, cls.untuned(fmu, system))
            assert run.ending is Ending.OK
            estimates.append(run.estimate)
    assert_array_equal(*estimates)


def test_a_model_with_other_names_is_refused_without_mapping(renamed_path, system):
    with pytest.raises(InputError, match=r"no variable 'pB'.*--map"):
        check_model(system, read_description(renamed_path))


def test_a_name_that_the_fmu_does_not_have_is_refused_with_the_closest(minimal_path):
    with pytest.raises(InputError, match=r"no variable 'tauRoll' \(closest: 'tauR'\).*'tauR'"):
        FMU(minimal_path, {"tauR": "tauRoll"})


def test_a_variable_whose_name_is_given_to_another_stays_within_reach(minimal_path):
    """FxReading takes the place of Fx; the model's own Fx is fmu.Fx from then on."""
    with FMU(minimal_path) as plain, FMU(minimal_path, {"Fx": "FxReading"}) as mapped:
        for own, new in [("FxReading", "Fx"), ("Fx", "fmu.Fx")]:
            expected = plain.variables([own]).references
            assert_array_equal(mapped.variables([new]).references, expected)
        assert "fmu.Fx" in mapped.outputs


def open_loop(fmu: FMU, system: System) -> OpenLoop:
    return OpenLoop.untuned(fmu, system)


@pytest.mark.parametrize(
    ("names", "match"),
    [
        ({"omegaW": "omegaWReading"}, "'omegaWReading': found a variable that is no state"),
        ({"muWR": "Fx", "Fx": "FxReading"}, "'Fx': found no start value"),
        ({"slip": "Fx", "Fx": "FxReading"}, r"'Fx': found \[N\], a unit of another dimension"),
    ],
)
def test_a_variable_of_the_wrong_kind_is_refused(minimal_path, system, names, match):
    with FMU(minimal_path, names) as fmu, pytest.raises(InputError, match=match):
        open_loop(fmu, system.with_names(names))


def with_units(fmu: FMU, units: dict[str, str | None]) -> FMU:
    """The same model, as if it declared other units."""
    variables = [replace(v, unit=units.get(v.name, v.unit)) for v in fmu.description.variables]
    fmu.description = replace(fmu.description, variables=tuple(variables))
    return fmu


@pytest.mark.parametrize(
    ("ours", "unit"),
    [("pB", "bar"), ("tauR", "kN.m"), ("omegaR", "rpm"), ("Fx", "kN"), ("slip", "km/h")],
)
def test_another_unit_is_refused_and_both_are_named(minimal, system, ours, unit):
    other = with_units(minimal, {ours: unit})
    match = rf"'{ours}': found unit \[{unit}\]; expected \[{system.unit(ours)}\]"
    with pytest.raises(InputError, match=match):
        check_model(system, other.description)
    with pytest.raises(InputError, match=match):
        open_loop(other, system)


def test_a_variable_without_a_unit_is_taken_as_si(minimal, system):
    check_model(system, with_units(minimal, dict.fromkeys(minimal.units)).description)


def copy(case: Path, folder: Path, text: str, system: System) -> Case:
    """A case with more text in its case.toml."""
    shutil.copytree(case, folder)
    toml = folder / "case.toml"
    toml.write_text(f"{toml.read_text()}\n{text}\n")
    return read_case(folder, system)


def test_names_come_from_cases_and_from_the_command_line_which_wins(root, tmp_path, system):
    folder = root / "cases" / "03_dry_120_3.6"
    text = '[model.names]\npB = "pressure"\ntauR = "torque"'
    cases = [copy(folder, tmp_path / name, text, system) for name in ("a", "b")]
    assert cases[0].names == {"pB": "pressure", "tauR": "torque"}
    assert model_names(["pB=brakePressure"], system, cases) == {
        "pB": "brakePressure",
        "tauR": "torque",
    }
    assert model_names([], system) == read_case(folder, system).names == {}


def test_cases_that_contradict_each_other_need_the_command_line(root, tmp_path, system):
    folder = root / "cases" / "03_dry_120_3.6"
    cases = [copy(folder, tmp_path / n, f'[model.names]\npB = "{n}"', system) for n in ("a", "b")]
    match = r"b/case.toml, \[model.names\] pB: found 'b', in a case before it 'a'"
    with pytest.raises(InputError, match=match):
        model_names([], system, cases)
    assert model_names(["pB=c"], system, cases) == {"pB": "c"}


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ('[model]\nname = "x"', r"\[model\]: found unknown key 'name' \(closest: 'names'\)"),
        ('[model.names]\npb = "x"', r"unknown key 'pb' \(closest: 'pB'\)"),
        ("[model.names]\npB = 1", r"\[model.names\] pB: found 1; expected a text"),
        ('[model.names]\npB = "x"\ntauR = "x"', r"tauR: found variable 'x', which is already pB"),
    ],
)
def test_a_wrong_name_in_a_case_is_refused(root, tmp_path, system, text, match):
    with pytest.raises(InputError, match=match):
        copy(root / "cases" / "03_dry_120_3.6", tmp_path / "case", text, system)


@pytest.mark.parametrize(
    ("mapped", "match"),
    [
        (["pB"], "--map pB: found no '='"),
        (["pB=a", "pB=b"], "--map pB=b: found a second name for 'pB'"),
        (["pb=a"], r"unknown key 'pb' \(closest: 'pB'\)"),
        (["pB="], "--map pB: found ''; expected a text"),
        (["pB=a", "tauR=a"], "--map tauR: found variable 'a', which is already pB"),
    ],
)
def test_a_wrong_map_option_is_refused(system, mapped, match):
    with pytest.raises(InputError, match=match):
        model_names(mapped, system)
