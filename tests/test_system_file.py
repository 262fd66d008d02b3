"""Mistakes in a system file are refused at the door: where, found, expected, what to do.

A key is declared once: reader, refusals, schema and reference follow. Formulas are arithmetic.
"""

import pickle
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.observers import choose
from workbench.system.declaration import Either, Scope, Unit, declared, key, table_name
from workbench.system.expression import Expression
from workbench.system.reader import read, read_system
from workbench.system.reference import reference, schema, tables
from workbench.system.registry import load_system, model_path, open_model
from workbench.system.tables import Table

from .edits import replaced
from .schemas import validator

ROOT = Path(__file__).parent.parent
OWN = ROOT / "modelica" / "WheelsetRig" / "system.toml"


def changed(folder: Path, *changes: tuple[str, str]) -> Path:
    """The wheelset's file with other lines, in a folder without a library."""
    text = OWN.read_text().replace("../../fmus", f"{ROOT}/fmus")
    path = folder / "system.toml"
    path.write_text(replaced(text, *changes))
    return path


# Lines of the wheelset's file, others in their place, and what is said of these.
MISTAKES = tomllib.loads((ROOT / "tests" / "wrong" / "system_files.toml").read_text())


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_refused_where_it_stands(tmp_path, mistake):
    wrong = MISTAKES[mistake]
    with pytest.raises(InputError, match=wrong["message"]) as refusal:
        read_system(changed(tmp_path, (wrong["old"], wrong["new"])))
    assert "To do: " in str(refusal.value)


def test_the_file_without_a_mistake_is_read(tmp_path, system):
    read = read_system(changed(tmp_path))
    assert read.signals == system.signals
    assert read.values == system.values


def test_an_fmu_that_is_missing_is_refused(tmp_path):
    path = changed(tmp_path, (f"{ROOT}/fmus/fmi2/MinimalObserver.fmu", "Other.fmu"))
    with pytest.raises(InputError, match=r"Other\.fmu: found"):
        read_system(path)


def test_a_model_with_neither_fmu_nor_library_is_refused(tmp_path):
    path = changed(tmp_path, (f', fmu = "{ROOT}/fmus/fmi2/MinimalObserver.fmu"', ""))
    with pytest.raises(InputError, match=r"found no FMU of MinimalObserver, and no library"):
        load_system(path)


def test_a_system_of_no_such_name_is_refused():
    with pytest.raises(InputError, match=r"'wheelst'.* \(closest: 'wheelset'\)"):
        load_system("wheelst")


def test_a_role_without_a_model_is_refused_when_it_is_needed(tmp_path):
    line = f'reference = {{ class = "Reference", fmu = "{ROOT}/fmus/fmi2/Reference.fmu" }}\n'
    system = read_system(changed(tmp_path, (line, "")))
    with pytest.raises(InputError, match=r"\[models\] reference: found no such model"):
        model_path(system, "reference")


def test_parameters_of_this_machine_act_as_the_defaults_of_its_model_would(
    tmp_path, minimal_path, dry_case
):
    """Reference: an FMU whose radius is set by hand before each start."""
    mine = read_system(changed(tmp_path, ("[parameters]", '[parameters]\nrW = "0.42 m"')))
    usual = read_system(changed(tmp_path))
    assert mine.values == usual.values | {"rW": 0.42}
    (cls,) = choose(mine, ["open_loop"]).values()
    part = slice(0, 2000)
    samples = (dry_case.time[part], dry_case.u[part], dry_case.y[part])
    with FMU(minimal_path, {}, {"rW": 0.42}) as theirs, open_model(mine) as ours:
        expected = cls.untuned(theirs, usual).run(*samples)
        estimate = cls.untuned(ours, mine).run(*samples)
    assert_array_equal(estimate.values, expected.values)
    with open_model(usual) as nominal:
        other = cls.untuned(nominal, usual).run(*samples)
    assert np.abs(estimate.values - other.values).max() > 1.0


def test_bands_change_what_a_filter_says_it_knows_and_no_estimate(system, dry_case):
    plain = replace(system, bands={})
    wider = replace(system, bands={"ekf": {"Fx": 1.5}})
    part = slice(0, 2000)
    samples = (dry_case.time[part], dry_case.u[part], dry_case.y[part])
    (cls,) = choose(plain, ["ekf"]).values()
    with open_model(system) as fmu:
        expected = cls.untuned(fmu, plain).run(*samples)
        estimate = cls.untuned(fmu, wider).run(*samples)
    assert_array_equal(estimate.values, expected.values)
    assert_array_equal(estimate.nis, expected.nis)
    factors = [1.5 if name == "Fx" else 1.0 for name in system.columns]
    assert_array_equal(estimate.sigma, expected.sigma * factors)


def test_what_is_derived_by_a_sensor_that_only_judges_is_asked_of_no_model(system):
    """Another model may have no wheel load: then the adhesion that is used is not estimated."""
    assert system.constants == {"rR"}
    assert set(system.indirect) == {"speed", "adhesion"}
    without = {name: value for name, value in system.values.items() if name != "Fz"}
    assert set(replace(system, values=without).indirect) == {"speed"}


def test_bands_of_no_estimator_are_refused(system):
    with pytest.raises(InputError, match=r"\[bands\.efk\]: .* name \(closest: 'ekf'\)"):
        choose(replace(system, bands={"efk": {"Fx": 1.0}}), [])


@pytest.mark.parametrize(
    ("loggers", "late"),
    [
        ('first = ["pB", "Fx"]', {"first"}),  # against that of all others
        ('a = ["pB", "Fx"]\nb = ["tauR"]', {"a", "b"}),
        ('a = ["pB", "Fx"]\nb = ["tauR", "omegaR", "omegaW"]', {"b"}),  # against that of a
        ('a = ["pB", "tauR", "omegaW", "omegaR", "Fx"]', set()),
    ],
)
def test_clocks_of_all_loggers_but_one_may_be_late(loggers, late, tmp_path):
    path = changed(tmp_path, ('speeds = ["omegaW", "omegaR"]', loggers))
    assert set(read_system(path).clocks) == late


@declared
class Valve:
    """A table by name."""

    name: str = table_name()
    unit: Unit = key("of its opening", absent="1")
    opening: tuple[float, float] = key(
        "range", name="range", unit="{unit}", ordered=True, aliases=("reach",)
    )
    side: str = key("where it sits", choices=("left", "right"), absent="left")


@declared
class Pump:
    """A table with tables."""

    EITHER: ClassVar = Either(("speed", "torque"), "one of the two", "say which is set")

    speed: float | None = key("that it keeps", unit="rad/s", absent=None)
    torque: float | None = key("that it keeps", unit="N.m", absent=None)
    lag: float = key("of its drive", unit="s", above=0.0, absent=1.0)
    valves: tuple[Valve, ...] = key("beside it", absent=())
    open: bool = key("at first", name="start.open", absent=True)


GOOD: dict[str, Any] = {
    "speed": "30 rad/s",
    "lag": "20 ms",
    "valves": {"inlet": {"reach": ["1 mm", "2 mm"], "unit": "m"}},
    "start": {"open": False},
}


def pump(content: dict[str, Any]) -> Pump:
    return read(Pump, Table(content, "pump.toml"), Scope(Path("pump.toml"), None))


def test_fields_are_read_in_their_units_by_all_their_names():
    read = pump(GOOD)
    assert (read.speed, read.torque, read.lag, read.open) == (30.0, None, 0.02, False)
    assert read.valves == (Valve("inlet", "m", (1e-3, 2e-3), "left"),)
    assert pump({"torque": "1 N.m"}) == Pump(None, 1.0, 1.0, (), True)


def with_valve(**keys: Any) -> dict[str, Any]:
    return {"valves": {"inlet": keys}}


WRONG_KEYS = {
    r"pump.toml: found unknown key 'lagg' \(closest: 'lag'\); expected only": {"lagg": "1 s"},
    r"\[start\]: found unknown key 'opened' \(closest: 'open'\)": {"start": {"opened": True}},
    r"lag: found 1.0; expected a text with a unit, such as '1.0 s'": {"lag": 1.0},
    r"found 'speed' and 'torque'; expected one .* To do: say which": {"torque": "1 N.m"},
    r"\[valves\.inlet\]: found no 'range'; expected a list 'range'": with_valve(),
    r"\[valves\.inlet\] range: found .* expected 2 numbers": with_valve(range=[1.0]),
    r"side: found 'top'; expected one of left, right": with_valve(range=[1.0, 2.0], side="top"),
}
OF_VALUES = {  # which no schema says
    r"lag: found '0 s'; expected a time above 0": {"lag": "0 s"},
    r"lag: found \[m\], a unit of another dimension": {"lag": "1 m"},
    r"range: found \[2\.0, 1\.0\]; expected \[low, high\]": with_valve(range=[2.0, 1.0]),
}


@pytest.mark.parametrize("message", [*WRONG_KEYS, *OF_VALUES])
def test_what_is_not_as_declared_is_refused_where_it_stands(message):
    wrong = GOOD | {**WRONG_KEYS, **OF_VALUES}[message]
    with pytest.raises(InputError, match=message):
        pump(wrong)
    assert validator(schema(Pump)).is_valid(wrong) == (message in OF_VALUES)


def test_schema_and_reference_have_every_key():
    validator(schema(Pump)).validate(GOOD)
    assert tables(Pump) == {"Pump": Pump, "Valve": Valve}
    page = reference(Pump)
    for row in (
        "| `lag` | [s] | 1 s | of its drive |",
        "| `valves.NAME.range`, `valves.NAME.reach` | [`unit`], [`unit`] |  | range |",
        "| `valves.NAME.side` | `left`, `right` | `left` | where it sits |",
        "| `start.open` | true or false | true | at first |",
    ):
        assert row in page
    assert "range" not in reference(Pump, separate=[Valve])


def test_a_formula_is_ordinary_arithmetic_over_names_with_dots():
    formula = Expression("-2*abs(pump.flow - 1) + max(a, 3)**2/4 - sqrt(b)*sign(c)", "file")
    assert formula.names == {"pump.flow", "a", "b", "c"}
    assert formula({"pump.flow": 3.0, "a": 1.0, "b": 9.0, "c": -2.0}) == -2 * 2 + 9 / 4 + 3


def test_names_may_hold_whole_recordings():
    time = np.linspace(0.0, 1.0, 5)
    assert_allclose(Expression("2*t - offset", "file")({"t": time, "offset": 1.0}), 2 * time - 1)


@pytest.mark.parametrize(
    "text",
    ["__import__('os')", "a if b else c", "a[0]", "abs(x=1)", "'a'", "True", "a +", "", "a < b"],
)
def test_anything_else_is_refused_where_it_stands(text):
    with pytest.raises(InputError, match=r"system\.toml, \[derived\] a is: found .* expected numb"):
        Expression(text, "system.toml, [derived] a is")


@pytest.mark.parametrize("text", ["max(a)", "max(a, b, c)", "sqrt(a, b)"])
def test_functions_take_as_many_arguments_as_they_have(text):
    with pytest.raises(InputError, match=re.escape(f"found '{text}'")):
        Expression(text, "file")


@pytest.mark.parametrize("text", ["1/(a - 1)", "1/0", "9**9**9**9", "sqrt(-a)"])
def test_a_formula_is_read_without_being_worked_out(text):
    assert Expression(text, "file").names <= {"a"}


def test_slopes_are_those_of_a_sum():
    formula = Expression("rR*b - a/2", "file")
    assert formula.slopes(("a", "b"), {"rR": 0.7}) == pytest.approx((-0.5, 0.7), rel=1e-15)


@pytest.mark.parametrize("text", ["a*b", "a + 1", "1/a", "abs(a)", "max(a, b)"])
def test_a_formula_that_is_no_sum_has_no_slopes(text):
    with pytest.raises(InputError, match="expected a sum of a, b, each times a constant"):
        Expression(text, "file").slopes(("a", "b"), {})


def test_a_formula_that_was_used_goes_to_another_process():
    used = Expression("max(a, b)/2", "a file")
    assert used({"a": 1.0, "b": 3.0}) == 1.5
    again = pickle.loads(pickle.dumps(used))
    assert (again, again.where) == (used, "a file")
    assert again({"a": 1.0, "b": 3.0}) == 1.5


def test_a_name_of_any_spelling_stands_in_quotes():
    formula = Expression("2*\"der(x)\" + 'pump flow'", "system.toml")
    assert formula.names == {"der(x)", "'pump flow'"}
    assert formula({"der(x)": 1.5, "'pump flow'": 1.0}) == 4.0
    assert Expression.of("'pump flow'", "").names == {"'pump flow'"}
    assert Expression.of("tank[1].level (m)", "").names == {"tank[1].level (m)"}
