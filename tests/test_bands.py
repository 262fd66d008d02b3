"""Bands are checked by innovations, and what contradicts them is said at the top."""

import numpy as np
import pandas as pd
import pytest

from workbench import case_from_frame
from workbench.observers import choose
from workbench.observers.report import format_table, summarise_runs
from workbench.observers.simulation import CaseResult, prepare
from workbench.system.system import System

from .built import declare
from .test_held_inputs import SYSTEM, VESSEL

pytest.importorskip("rumoca", reason="needs the extra [compiler]")
pytest.importorskip("ziglang", reason="needs the extra [compiler]")

NAMES = ["open_loop", "ekf", "mhe"]


@pytest.fixture(scope="module")
def vessel(tmp_path_factory: pytest.TempPathFactory) -> System:
    folder = tmp_path_factory.mktemp("vessel")
    return declare(folder, VESSEL, SYSTEM)


def result_of(system: System, noise: float, seed: int) -> CaseResult:
    """A vessel that is filled, whose level sensor has so many times the noise that is declared."""
    time = np.arange(200.0)
    flow = np.where(time % 20.0 < 10.0, 1e-3, 0.0)
    volume = np.append(0.0, np.cumsum(flow[:-1]))
    rng = np.random.default_rng(seed)
    volume += noise * 1e-5 * rng.standard_normal(time.size)
    through = flow + 1e-6 * rng.standard_normal(time.size)
    columns = {"q [m3/s]": flow, "V [m3]": volume, "through [m3/s]": through}
    case = case_from_frame(system, pd.DataFrame({"time [s]": time, **columns}), name="filled")
    return prepare(system, choose(system, NAMES)).run(case)


def test_innovations_do_not_contradict_bands_of_a_model_and_noise_that_are_right(
    vessel: System,
) -> None:
    results = [result_of(vessel, 1.0, seed) for seed in range(20)]
    assert all(not result.contradicted for result in results)
    # The test has something to go by, though the first sample has no innovation.
    # Walks are declared, of which the vessel has none: somewhat less than 1.
    assert all(0.7 < result.surprise("ekf") < 1.17 for result in results)
    assert format_table(vessel, results[:1]).splitlines()[1].startswith("case")


def test_bands_that_innovations_contradict_are_told_at_the_top_of_all_that_is_read(
    vessel: System,
) -> None:
    result = result_of(vessel, 3.0, 0)
    assert list(result.contradicted) == ["ekf", "mhe"]
    said = "Bands of ekf are too narrow in filled: innovations have "
    assert format_table(vessel, [result]).splitlines()[1].startswith(said)
    assert said in result.summary()
    summary = summarise_runs(vessel, [result], {"run": {}})
    assert said in summary["answer"]["sentence"]
    assert summary["cases"]["filled"]["contradicted"]["ekf"] == pytest.approx(
        result.surprise("ekf"), abs=5e-4
    )
