"""Times of calls into an FMU: that they are measured, and of the same numbers."""

import dataclasses
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest

from workbench.arrays import Matrix
from workbench.benchmark.calls import points
from workbench.benchmark.horizon import HorizonTimes
from workbench.benchmark.observers import ObserverTimes, ProcessTimes
from workbench.benchmark.tuning import EvaluationTimes, TuningMemory, WorkerRates
from workbench.cli.schemas import summaries
from workbench.errors import InputError
from workbench.models.compiler.benchmark import CallTimes, time_sources
from workbench.models.description import read_description

STEP = 0.005  # [s]


@pytest.fixture
def at(minimal, system) -> Matrix:
    return points(minimal, system, np.random.default_rng(1))


def timed(path: Path, at: Matrix) -> CallTimes:
    return time_sources(read_description(path), at, STEP)


def change_source(fmu: Path, changed: Path, name: str, right: str, wrong: str) -> Path:
    """Copy an FMU with other text in one of its sources."""
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(changed, "w") as target:
        for entry in source.namelist():
            data = source.read(entry)
            if entry == f"sources/{name}":
                assert right.encode() in data
                data = data.replace(right.encode(), wrong.encode())
            target.writestr(entry, data)
    return changed


def test_calls_of_the_minimal_model_take_nanoseconds(minimal_path, at):
    times = timed(minimal_path, at)
    assert (times.states, times.inputs) == (2, 6)
    # 50 operations and five elementary functions: no computer needs less than 5 ns or, through
    # FMI, more than 5 us. A step is several evaluations.
    assert 5e-9 < times.derivatives < times.derivatives_fmi < 5e-6
    assert times.nonzeros < times.jacobian_fmi < 5e-6
    assert times.derivatives < times.step < 1e-3
    # Measured 1.2 and 1.5 on x86-64; leaves room for other processors. Without the short ways for
    # whole columns and all inputs in instance.c they are 1.5 and 2.9.
    assert times.ratios()["derivatives"] < 2.0
    assert times.ratios()["jacobian"] < 2.0


def test_the_schema_of_times_has_what_is_written_of_them():
    """A run of the command takes minutes; its file is made of these."""
    sections = summaries()["bench"]["properties"]
    observers, tuning = (sections[name]["properties"] for name in ("observers", "tuning"))
    beside = {"ratios", "unit", "steps_per_second"}
    for kind, schema in (
        (CallTimes, sections["calls"]["additionalProperties"]),
        (ObserverTimes, observers["steps"]["items"]),
        (ProcessTimes, observers["processes"]),
        (HorizonTimes, observers["horizon"]),
        (EvaluationTimes, tuning["evaluations"]["items"]),
        (WorkerRates, tuning["workers"]),
        (TuningMemory, tuning["memory"]),
    ):
        assert set(schema["properties"]) - beside == {
            field.name for field in dataclasses.fields(kind)
        }
        assert schema["required"] == list(schema["properties"])
        assert not schema["additionalProperties"]


def test_a_delay_in_the_interface_shows_in_the_ratio(minimal_path, tmp_path, at):
    slow = change_source(
        minimal_path,
        tmp_path / "slow.fmu",
        "fmi2.c",
        "    return (fmi2Status)instance_get_derivatives",
        "    for (volatile int n = 0; n < 1000; n++) {\n    }\n"
        "    return (fmi2Status)instance_get_derivatives",
    )
    # 1000 volatile increments take 200 ns or more, the plain call 30 to 100.
    assert timed(slow, at).ratios()["derivatives"] > 3.0


@pytest.mark.parametrize(
    ("right", "wrong", "found"),
    [
        ("xdot[k] = source[k]", "xdot[k] = 1.0", "derivatives differ"),
        ("sensitivity[k] = zero", "sensitivity[k] = 1.0", "Jacobians differ"),
    ],
)
def test_an_interface_that_gives_other_numbers_is_refused(
    minimal_path, tmp_path, at, right, wrong, found
):
    changed = change_source(minimal_path, tmp_path / "wrong.fmu", "instance.c", right, wrong)
    with pytest.raises(InputError, match=rf"wrong\.fmu: found {found}"):
        timed(changed, at)


def test_sources_of_fmi_3_are_refused(root, tmp_path, at):
    path = tmp_path / "three.fmu"
    shutil.copyfile(root / "fmus" / "fmi3" / "MinimalObserver.fmu", path)
    with pytest.raises(InputError, match=r"C sources of FMI 2\.0 that compile"):
        timed(path, at)
