"""Two real tanks: their recordings are read, and what they are known to do is named."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from workbench.__main__ import main
from workbench.case import Case, read_cases
from workbench.prepare import write_cases
from workbench.systems import load_system

pytest.importorskip("casadi", reason="needs the extra [compiler]")
pytest.importorskip("rumoca", reason="needs the extra [compiler]")
pytest.importorskip("ziglang", reason="needs the extra [compiler]")


@pytest.fixture(scope="module")
def folder(published_cases: Callable[[str, str], Path]) -> Path:
    return published_cases("cascaded_tanks", "cascaded_tanks")


def read(folder: Path) -> dict[str, Case]:
    return {one.name: one for one in read_cases([folder], load_system("cascaded_tanks"))}


def test_both_layouts_hold_the_same_recordings(
    folder: Path, published: Callable[[str], Path], tmp_path: Path
) -> None:
    for name in ("estimation", "test"):
        shutil.copytree(published("cascaded_tanks") / name, tmp_path / "set" / name)
    write_cases("cascaded_tanks", tmp_path / "set", tmp_path / "cases")
    published, digits = read(folder), read(tmp_path / "cases")
    assert published.keys() == digits.keys() == {"estimation", "test"}
    for name, case in published.items():
        assert case.time.size == 1024
        assert_allclose(np.diff(case.time), 4.0)
        for signal in ("pump", "level2"):
            # Five digits of values below 10 V.
            assert_allclose(case[signal], digits[name][signal], rtol=0, atol=5.1e-5)


def test_the_sensor_ends_at_its_limit(folder: Path) -> None:
    level = read(folder)["estimation"]["level2"]
    high = load_system("cascaded_tanks").signals["level2"].limits[1]
    assert level.max() == high
    assert (level == high).sum() > 20


@pytest.fixture(scope="module")
def found(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, object]:
    """What a diagnosis says of the record for estimation."""
    out = tmp_path_factory.mktemp("diagnosis")
    options = ["--system", "cascaded_tanks", "--out", str(out), "--workers", "1"]
    assert main(["diagnose", str(folder / "estimation"), *options]) == 0
    summary: dict[str, object] = json.loads((out / "summary.json").read_text())
    return summary


def test_the_overflow_of_the_upper_tank_is_named(found: dict[str, object]) -> None:
    assert found["verdict"] == "found"
    causes = {one["effect"]: one for one in found["causes"]}
    parameters = causes["UpperOverflow"]["parameters"]
    # All that the upper tank cannot hold runs over, part of it into the lower one.
    assert parameters["spilled"]["high"] == 1.0
    assert 0.0 < parameters["share"]["low"] < parameters["share"]["high"] < 1.0


def test_the_pump_needs_some_voltage_or_what_looks_like_it(found: dict[str, object]) -> None:
    groups = [{one["effect"], *one["confusable_with"]} for one in found["causes"]]
    assert any("PumpDeadZone" in group for group in groups)


def test_half_of_the_error_goes(found: dict[str, object]) -> None:
    (errors,) = found["errors"]
    before, after = errors["rms"]
    assert after < 0.5 * before
