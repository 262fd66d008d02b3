"""Two real tanks: their recordings are read. What they do is in their tutorial."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from workbench.recordings.case import Case, read_cases
from workbench.recordings.datasets import write_cases
from workbench.system.registry import load_system


@pytest.fixture(scope="module")
def folder(published_cases) -> Path:
    return published_cases("cascaded_tanks", "cascaded_tanks")


def read(folder: Path) -> dict[str, Case]:
    return {
        read_case.name: read_case
        for read_case in read_cases([folder], load_system("cascaded_tanks"))
    }


def test_both_layouts_hold_the_same_recordings(folder, published, tmp_path):
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


def test_the_sensor_ends_at_its_limit(folder):
    level = read(folder)["estimation"]["level2"]
    high = load_system("cascaded_tanks").signals["level2"].limits[1]
    assert level.max() == high
    assert (level == high).sum() > 20
