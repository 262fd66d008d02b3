"""A real air supply: its record is read and cut. Its leak is in its tutorial."""

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
    return published_cases("air_supply", "metro_air_supply")


def read(folder: Path) -> dict[str, Case]:
    return {
        read_case.name: read_case for read_case in read_cases([folder], load_system("air_supply"))
    }


def test_both_layouts_hold_the_same_recordings(folder, published, tmp_path):
    shutil.copytree(published("metro_air_supply") / "20200201", tmp_path / "set" / "20200201")
    write_cases("air_supply", tmp_path / "set", tmp_path / "cases")
    published, digits = read(folder), read(tmp_path / "cases")
    assert published.keys() == digits.keys()
    for name, case in published.items():
        assert_allclose(case.time, digits[name].time)
        for signal in ("COMP", "reservoir"):
            assert_allclose(case[signal], digits[name][signal], rtol=1e-12)


def test_each_cycle_begins_with_the_compressor_off_and_has_one_start(folder):
    cases = read(folder)
    assert sum(case.time.size for case in cases.values()) == 1000
    for case in cases.values():
        assert case["COMP"][0] == 1.0
        assert np.sum(np.diff(case["COMP"]) < 0.0) == 1
