"""Published schemas take what is there and refuse what the readers refuse."""

import copy
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import workbench.system.template
from workbench.cli.schemas import gains_schema, summaries, system_schema
from workbench.system.installed import system_files

from .schemas import check, validator
from .systems import WHEELSET

PACKAGE = Path(workbench.__file__).parent
SYSTEMS = {
    **system_files(),
    "template": Path(workbench.system.template.__file__).with_name("system.toml"),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_every_system_file_is_as_the_schema_says(name):
    validator(system_schema()).validate(tomllib.loads(SYSTEMS[name].read_text()))


WRONG: dict[str, Callable[[dict[str, Any]], object]] = {
    "an unknown key": lambda system: system.update(inputz={}),
    "no outputs": lambda system: system.pop("outputs"),
    "a unit that is a number": lambda system: system["outputs"]["h"].update(unit=1),
    "noise that is a list": lambda system: system["outputs"]["h"].update(noise=["1 mm"]),
    "an unknown key of a signal": lambda system: system["outputs"]["h"].update(noize="1 mm"),
    "a model without a class": lambda system: system["models"]["observer"].pop("class"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_system_file_is_refused(name):
    content = tomllib.loads(SYSTEMS["template"].read_text())
    WRONG[name](content)
    assert not validator(system_schema()).is_valid(content)


OF_A_STOP: dict[str, Callable[[dict[str, Any]], object]] = {
    "an unknown key": lambda stop: stop.update(sped="vTrain"),
    "no speed is asked": lambda stop: stop["asked"].pop("speed"),
    "a pressure at some time": lambda stop: stop["asked"]["pressure"].update(at="then"),
    "an input along nothing": lambda stop: stop["inputs"]["pB1"].update(along="1 m"),
    "neither spread nor share": lambda stop: stop["differs"][0].pop("spread"),
    "a limit on no side": lambda stop: stop["outside"][0].pop("above"),
    "three constants": lambda stop: stop["rating"]["constants"].update({"9 km/h": [1.0, 2.0, 3.0]}),
}


@pytest.mark.parametrize("name", OF_A_STOP)
def test_a_wrong_table_of_how_a_machine_stops_is_refused(name):
    content = tomllib.loads(SYSTEMS["train"].read_text())
    OF_A_STOP[name](content["distance"])
    assert not validator(system_schema()).is_valid(content)


def test_tuned_gains_that_come_along_are_as_the_schema_says_and_others_are_not():
    schema = validator(gains_schema(WHEELSET))
    files = sorted((PACKAGE / "machines" / "wheelset" / "gains").glob("*.toml"))
    assert files
    for path in files:
        schema.validate(tomllib.loads(path.read_text()))
    good = tomllib.loads(files[0].read_text())
    for wrong in (
        {**good, "estimator": "nobody"},
        {**good, "gains": {"L11": "1"}},
        {**good, "gain": {}},
        {"estimator": good["estimator"]},
    ):
        assert not schema.is_valid(wrong)


@pytest.fixture(scope="module")
def results(of_a_stop) -> Path:
    return of_a_stop


def test_a_summary_is_as_its_schema_says_and_of_no_other_command(summary):
    check("simulate", summary)
    assert {"accuracy", "tune", "diagnose", "observability", "next", "power"} < set(summaries())
    for command, schema in summaries().items():
        assert validator(schema).is_valid(summary) == (command == "simulate")


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("answer", "sentence"), ""),
        (("answer", "headline", "worst error of Fx, ekf", "better"), "larger"),
        (("cases", "01_dry_80_1.5", "estimators", "ekf", "z"), "0.1"),
        (("cases", "01_dry_80_1.5", "estimators", "ekf", "more"), 1),
        (("provenance", "run", "data", "01_dry_80_1.5"), "abc"),
        (("provenance", "run", "system"), None),
        (("more",), {}),
    ],
)
def test_a_wrong_summary_is_refused(summary, path, value):
    wrong = copy.deepcopy(summary)
    inner = wrong
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    assert not validator(summaries()["simulate"]).is_valid(wrong)
