"""A fleet: each machine is watched as it is alone, wherever recordings lie and whoever works."""

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest

import workbench as wb
from workbench.__main__ import main
from workbench.studies.monitoring import STATE
from workbench.system.registry import load_system

from .schemas import check
from .train_stops import write_stop


@pytest.fixture(scope="module")
def fleet(tmp_path_factory) -> Path:
    """Two machines of two stops, and one whose recordings are none."""
    folder = tmp_path_factory.mktemp("fleet")
    for machine, pads in (("one", {}), ("two", {3: 0.27})):
        for number in (1, 2):
            write_stop(folder / machine / f"0{number}", 10 * len(pads) + number, pads)
    (folder / "broken" / "01").mkdir(parents=True)
    return folder


def watched(where: str, out: Path, *more: str) -> dict[str, dict[str, object]]:
    words = ["monitor", where, "--system", "train", "--fleet", "--out", str(out), *more]
    assert main([*words, "--quiet"]) == 0
    said = json.loads((out / "fleet.json").read_text())
    check("fleet", said)
    return {machine["machine"]: machine for machine in said["machines"]}


@pytest.fixture(scope="module")
def local(fleet, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("local")
    watched(str(fleet), out, "--workers", "1")
    return out


def estimates(out: Path) -> pd.DataFrame:
    return pd.read_csv(out / "estimates.csv")


def test_each_machine_is_watched_as_it_is_alone(fleet, local, tmp_path):
    told = pd.read_csv(local / "fleet.csv").set_index("machine")
    assert list(told["recordings"]) == [0, 2, 2]
    assert "no recording that can be used" in told.loc["broken", "refusal"]
    alone = wb.monitor(load_system("train"), fleet / "two", out=tmp_path, workers=1)
    frame = alone.to_frame().to_csv(index=False, float_format="%.8g")
    assert (local / "two" / "estimates.csv").read_text() == frame


def test_a_fleet_goes_on_from_its_states_and_reads_urls(fleet, local, tmp_path):
    out, where = tmp_path / "out", tmp_path / "fleet"
    shutil.copytree(local, out)
    shutil.copytree(fleet, where)
    write_stop(where / "one" / "03", 3, {})
    watch = watched(f"file://{where}", out, "--workers", "1")
    assert watch["one"]["recordings"] == 3
    assert watch["two"]["recordings"] == 2
    # What was known is as it was, to the last digit: it was not estimated again.
    before = estimates(local / "one")
    after = estimates(out / "one")
    known = after[after["recording"].isin(before["recording"].unique())]
    assert list(known["estimate"]) == list(before["estimate"])
    assert (out / "one" / STATE).stat().st_size > 500


def test_a_cluster_finds_the_same(fleet, local, tmp_path):
    import distributed

    # In processes of their own: within this one, after hundreds of tests, a task may never end.
    options = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": ":0"}
    with distributed.LocalCluster(processes=True, **options) as cluster:
        watched(str(fleet), tmp_path, "--cluster", cluster.scheduler_address)
    for name in ("one", "two"):
        pd.testing.assert_frame_equal(estimates(tmp_path / name), estimates(local / name))


@pytest.mark.parametrize(
    ("where", "more", "found"),
    [
        ("nowhere", ["--fleet"], "what cannot be read"),
        ("no-such://x/y", ["--fleet"], "what cannot be read"),
        (".", ["--fleet", "--diagnose"], "--diagnose"),
        (".", ["--cluster", "tcp://127.0.0.1:1"], "add --fleet"),
    ],
)
def test_what_makes_no_sense_is_refused(where, more, found, tmp_path, capsys):
    words = ["monitor", where, "--system", "train", "--out", str(tmp_path / "out"), *more]
    assert main(words) == 2
    assert found in capsys.readouterr().err
