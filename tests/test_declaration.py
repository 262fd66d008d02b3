"""A key of a file is declared once: reader, refusals, schema and reference follow."""

from pathlib import Path
from typing import Any, ClassVar

import pytest

from workbench.errors import InputError
from workbench.system.declaration import Either, Scope, Unit, declared, key, table_name
from workbench.system.reader import read
from workbench.system.reference import reference, schema, tables
from workbench.system.tables import Table

from .schemas import validator


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


MISTAKES = {
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


@pytest.mark.parametrize("message", [*MISTAKES, *OF_VALUES])
def test_what_is_not_as_declared_is_refused_where_it_stands(message):
    wrong = GOOD | {**MISTAKES, **OF_VALUES}[message]
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
    assert "range" not in reference(Pump, apart=[Valve])
