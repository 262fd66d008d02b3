"""The main job, end to end, as a user runs it."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from workbench.__main__ import main
from workbench.errors import InputError
from workbench.observers import choose
from workbench.observers.gains import matrix_names
from workbench.observers.simulation import prepare
from workbench.pages.columns import read_estimates

from . import heater
from .test_figures import figures

OBSERVERS = ("disturbance_observer", "parameter_estimator", "ekf", "ukf")


@pytest.fixture(scope="module")
def results(once, root) -> Path:
    """All fourteen cases through the command line."""

    def run(out: Path) -> Path:
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(root)
            assert main(["simulate", "--out", str(out)]) == 0
        return out

    return once("simulate", run)


@pytest.fixture(scope="module")
def nrmse(summary) -> pd.DataFrame:
    """Error of Fx by case (rows) and estimator (columns)."""
    return pd.DataFrame(
        {
            name: {e: values["Fx_nrmse"] for e, values in case["estimators"].items()}
            for name, case in summary["cases"].items()
        }
    ).T


def test_all_fourteen_cases_run(nrmse):
    assert len(nrmse) == 14
    assert tuple(nrmse.columns) == ("open_loop", "direct_inversion", *OBSERVERS)
    assert nrmse.notna().all(axis=None)


@pytest.mark.parametrize("observer", OBSERVERS)
def test_observers_beat_the_open_loop_on_every_case(nrmse, observer):
    assert (nrmse[observer] < nrmse.open_loop).all()


@pytest.mark.parametrize("observer", OBSERVERS)
def test_observers_beat_direct_inversion_on_most_cases(nrmse, observer):
    better = nrmse[observer] < nrmse.direct_inversion
    assert better.sum() >= 10, nrmse[~better]


def test_chosen_estimators_alone_are_run(root, tmp_path, monkeypatch):
    """The physical model of the discs lowers the error where discs dry under way."""
    chosen = ["disturbance_observer", "disturbance_observer_disc"]
    monkeypatch.chdir(root)
    options = [word for name in reversed(chosen) for word in ("--estimator", name)]
    assert main(["simulate", "cases/12_brakewet_160_4.2", *options, "--out", str(tmp_path)]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    values = summary["cases"]["12_brakewet_160_4.2"]["estimators"]
    assert list(values) == chosen
    assert values[chosen[1]]["Fx_nrmse"] < values[chosen[0]]["Fx_nrmse"]
    assert "slope" in summary["provenance"]["disturbance_observer_disc"]["disc"]


def test_the_table_of_the_documentation_is_that_of_the_command(summary):
    (text,) = figures.block("simulate").findall((figures.PAGES / "accuracy.md").read_text())
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")]
    header, *made = figures.tables.errors(summary)
    assert rows[0] == list(header)
    for row, computed in zip(rows[2:], made, strict=True):
        assert row[0] == computed[0]
        ours, theirs = ([float(cell.split()[0]) for cell in line[1:]] for line in (row, computed))
        # The last digit: another processor may round otherwise.
        np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=0.0101)


def test_estimates_of_every_case_are_written_in_little_room(results, root, system):
    names = sorted(p.name for p in (root / "cases").iterdir())
    assert sorted(p.stem for p in results.glob("*.npz")) == names
    assert not [*results.glob("*.csv"), *results.glob("*.png"), *results.glob("*.svg")]
    assert sum(path.stat().st_size for path in results.iterdir()) < 25e6
    table = read_estimates(results / f"{names[0]}.npz")
    units = {f"disturbance_observer.{s} [{unit}]" for s, unit in system.columns.items()}
    assert {"time [s]", *units} <= set(table.columns)
    assert np.isfinite(table.to_numpy()).all()
    assert not list(results.glob("*.part"))


def test_gains_from_a_file_are_used_and_named(summary, root, tmp_path, monkeypatch):
    """The same gains give the same error; with none, nothing is learned."""
    values = summary["provenance"]["disturbance_observer"]
    name = "02_dry_100_2.7"
    errors = {}
    for share in (1.0, 0.0):
        rows = [f"{name} = {share * values[name]!r}" for name in matrix_names("L", 4, 4)]
        text = ['estimator = "disturbance_observer"', "[gains]", *rows]
        text += [f"{key} = {values[key]!r}" for key in ("T_muWR", "T_muDC")]
        text += ["[design]", f"effect = {values['effect']!r}"]
        gains, out = tmp_path / "gains.toml", tmp_path / str(share)
        gains.write_text("\n".join(text))
        monkeypatch.chdir(root)
        options = ["--gains", str(gains), "--estimator", "disturbance_observer", "--out", str(out)]
        assert main(["simulate", f"cases/{name}", *options]) == 0
        own = json.loads((out / "summary.json").read_text())
        assert "gains.toml" in own["provenance"]["disturbance_observer"]["source"]
        errors[share] = own["cases"][name]["estimators"]["disturbance_observer"]["Fx_nrmse"]
    expected = summary["cases"][name]["estimators"]["disturbance_observer"]["Fx_nrmse"]
    assert errors[1.0] == expected
    assert errors[0.0] > 5 * expected


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        (["simulate", "no_such_folder"], "no_such_folder"),
        (["simulate", "cases/01_dry_80_1.5", "--fmu", "README.md"], "no FMU"),
        (["simulate", "cases/01_dry_80_1.5", "--fmu", "missing.fmu"], "make fmus"),
    ],
)
def test_a_users_mistake_gives_status_2_and_a_message(
    root, tmp_path, monkeypatch, capsys, arguments, match
):
    monkeypatch.chdir(root)
    assert main([*arguments, "--out", str(tmp_path)]) == 2
    captured = capsys.readouterr().err
    assert match in captured
    assert "expected" in captured
    assert "Traceback" not in captured


def test_an_estimator_that_fails_in_every_case_is_no_success(root, tmp_path, capsys):
    tuned = (root / "workbench/machines/wheelset/gains/disturbance_observer.toml").read_text()
    gains = tmp_path / "gains.toml"
    gains.write_text(re.sub(r"^(L\w+ = ).*", r"\g<1>1e100", tuned, flags=re.MULTILINE))
    out = tmp_path / "out"
    arguments = ["simulate", str(root / "cases/01_dry_80_1.5"), "--workers", "1", "--out", str(out)]
    chosen = ["--estimator", "disturbance_observer", "--gains", str(gains)]
    assert main([*arguments, *chosen]) == 1
    assert "disturbance_observer estimated nothing in any case" in capsys.readouterr().err
    assert (out / "summary.json").is_file()  # with the reasons


def test_of_all_estimators_those_run_that_the_design_point_lets_be_designed(tmp_path):
    """Without heat the casing is as warm as its surroundings, and its conductance moves nothing."""
    cold, left = heater.system(tmp_path / "heater"), {}
    every = prepare(cold, choose(cold, []), leave_out=left.setdefault)
    assert list(left) == ["disturbance_observer", "parameter_estimator"]
    assert list(every.kinds) == ["open_loop", "ekf", "ukf"]
    for name in left:
        with pytest.raises(InputError, match="found Gc, which the outputs do not show"):
            prepare(cold, choose(cold, [name]))
    with pytest.raises(InputError):
        prepare(cold, choose(cold, list(left)), leave_out=left.setdefault)
