"""What a folder of results holds, and what a second run did better or worse."""

import hashlib
import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from workbench.__main__ import main
from workbench.errors import InputError
from workbench.pages.columns import pack_estimates, read_estimates
from workbench.pages.runs import compare_runs, differences, read_runs

CASE = "01_dry_80_1.5"
NAME = "worst error of Fx, ekf"


@pytest.fixture(scope="module")
def results(of_a_stop) -> Path:
    return of_a_stop


def other(results: Path, to: Path, **headline: dict[str, Any]) -> Path:
    """A second run whose numbers are others."""
    shutil.copytree(results, to)
    path = to / "summary.json"
    summary = json.loads(path.read_text())
    for name, changed in headline.items():
        key = NAME if name == "error" else name
        summary["answer"]["headline"].setdefault(key, {"unit": "%", "better": "lower"})
        summary["answer"]["headline"][key] |= {"low": None, "high": None, **changed}
    path.write_text(json.dumps(summary))
    return to


def verdicts(before: Path, after: Path) -> dict[str, str]:
    (first,), (last,) = read_runs(before), read_runs(after)
    return {compare_run.name: compare_run.verdict for compare_run in compare_runs(first, last)}


def test_a_folder_says_command_date_version_system_answer_and_files(results, root, capsys):
    capsys.readouterr()
    assert main(["results", str(results.parent), "--json"]) == 0
    (entry,) = json.loads(capsys.readouterr().out)["result"]["runs"]
    summary = json.loads((results / "summary.json").read_text())
    error = summary["cases"][CASE]["estimators"]["ekf"]["Fx_nrmse"]
    assert entry["headline"][NAME]["value"] == 100.0 * error
    assert (entry["run"]["command"], entry["run"]["system"]) == ("simulate", "wheelset")
    measured = (root / "cases" / CASE / "measured.csv").read_bytes()
    assert entry["run"]["data"] == {CASE: hashlib.sha256(measured).hexdigest()}
    assert entry["files"] == {"csv": 1, "npz": 1, "html": 1, "json": 1}
    assert main(["results", str(results.parent)]) == 0
    printed = capsys.readouterr().out
    assert f"{100 * error:.4g} %" in printed
    assert entry["run"]["date"][:10] in printed
    assert summary["answer"]["sentence"] in printed


def test_estimates_come_back_to_six_digits(tmp_path):
    """Of the median of a column; the time, and what no such grid holds, to the last bit."""
    noise = np.random.default_rng(1).standard_normal(500)
    noise[7] = np.nan
    diverging = np.exp(np.linspace(-700.0, 700.0, 500))
    table = pd.DataFrame(
        {"time [s]": 1e6 + 0.005 * np.arange(500), "a [m/s]": noise, "b": 1e-6 * noise}
        | {"c": diverging, "d": np.where(noise > 2.0, np.inf, noise), "e": np.nan, "f": 0.0}
    )
    path = tmp_path / "estimates.npz"
    pack_estimates(table, path)
    back = read_estimates(path)
    assert list(back) == list(table)
    assert (np.isnan(back) == np.isnan(table)).all(axis=None)
    for name in ("a [m/s]", "b"):
        assert (back[name] - table[name]).abs().max() <= 2**-21 * table[name].abs().median()
    for name in ("c", "d", "f"):
        assert (back[name].dropna() == table[name].dropna()).all()
    assert_allclose(back["time [s]"], table["time [s]"], rtol=2e-15, atol=0.0)


def test_estimates_become_csv_on_demand(results, root, tmp_path, capsys):
    """Where there is none; that of `simulate`, unasked if it is small, has a digit more."""
    case = ["simulate", str(root / "cases" / CASE), "--estimator", "ekf", "--out", str(tmp_path)]
    assert main([*case, "--figures"]) == 0
    files = [tmp_path / f"{CASE}.{suffix}" for suffix in ("csv", "png", "svg")]
    asked = pd.read_csv(files[0])
    assert all(file.is_file() for file in files)
    written = files[0].stat().st_mtime_ns
    assert main(["results", str(tmp_path), "--csv"]) == 0
    assert files[0].stat().st_mtime_ns == written
    assert main(case) == 0
    assert [file.exists() for file in files] == [True, False, False]
    files[0].unlink()
    assert main(["results", str(tmp_path), "--csv"]) == 0
    made = pd.read_csv(files[0])
    assert list(made) == list(asked)
    # Half of the quantum of each column, and of the seventh digit of both files.
    assert ((made - asked).abs().max() <= 1.5e-6 * asked.abs().max()).all()
    (tmp_path / f"{CASE}.npz").write_bytes(b"PK")
    files[0].unlink()
    capsys.readouterr()
    assert main(["results", str(tmp_path), "--csv"]) == 2
    assert "or run 'workbench simulate' again" in capsys.readouterr().err


def test_a_run_compared_with_itself_is_unchanged(results):
    assert set(verdicts(results, results).values()) == {"unchanged"}
    (run,) = read_runs(results)
    assert differences(run, run) == []


@pytest.mark.parametrize(
    ("changed", "verdict"),
    [
        ({"value": 0.1}, "better"),
        ({"value": 0.9}, "worse"),
        ({"value": None}, "gone"),
        ({"value": float("nan")}, "gone"),
        ({"value": 0.9, "better": ""}, "changed"),
        ({"value": 0.9, "better": "higher"}, "better"),
    ],
)
def test_the_way_that_is_better_decides(results, tmp_path, changed, verdict):
    assert verdicts(results, other(results, tmp_path / "after", error=changed))[NAME] == verdict


@pytest.mark.parametrize(("low", "verdict"), [(3.0, "unclear"), (3.6, "better")])
def test_shares_whose_intervals_overlap_are_neither_better_nor_worse(
    results, tmp_path, low, verdict
):
    ways = {"unit": "%", "better": "higher"}
    first = {"value": 3.0, "low": 2.5, "high": 3.5, **ways}
    before = other(results, tmp_path / "before", share=first)
    after = other(
        results, tmp_path / "after", share={"value": 4.0, "low": low, "high": 5.0, **ways}
    )
    assert verdicts(before, after)["share"] == verdict


def test_a_number_in_another_unit_is_not_compared(results, tmp_path):
    after = other(results, tmp_path / "after", error={"value": 0.1, "unit": "N"})
    changes = compare_runs(*read_runs(results), *read_runs(after))
    assert [change.verdict for change in changes if change.name == NAME] == ["gone", "new"]


def test_what_else_differs_is_said(results, root, tmp_path, capsys):
    """The same case with one reading changed, and another estimator."""
    case = shutil.copytree(root / "cases" / CASE, tmp_path / CASE)
    measured = case / "measured.csv"
    measured.write_text(measured.read_text() + "\n")
    out = tmp_path / "after"
    assert main(["simulate", str(case), "--estimator", "ukf", "--out", str(out)]) == 0
    capsys.readouterr()
    assert main(["results", str(results), str(out)]) == 0
    printed = capsys.readouterr().out
    assert f"recordings with other content: {CASE}" in printed
    assert "settings: ekf." in printed
    (settings,) = [line for line in printed.splitlines() if "settings: " in line]
    assert re.search(r" and \d+ more$", settings)  # a dozen of them tell enough
    assert "meanings" not in settings
    assert f"gone     {NAME}" in printed


def test_runs_of_two_commands_are_not_compared(results, tmp_path):
    after = shutil.copytree(results, tmp_path / "after")
    summary = json.loads((after / "summary.json").read_text())
    summary["provenance"]["run"]["command"] = "tune"
    (after / "summary.json").write_text(json.dumps(summary))
    with pytest.raises(InputError, match=r"a run of 'tune'.*expected one of 'simulate'"):
        compare_runs(*read_runs(results), *read_runs(after))


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (None, "found none of summary.json"),
        ("{", "does not say what made it"),
        ('{"provenance": {"run": 1}, "answer": []}', "does not say what made it"),
        ("[" * 100_000, "does not say what made it"),
    ],
)
def test_a_folder_without_results_is_refused_in_words(tmp_path, content, match):
    if content is not None:
        (tmp_path / "summary.json").write_text(content)
    with pytest.raises(InputError, match=match):
        read_runs(tmp_path)


def test_what_does_not_say_what_made_it_is_warned_of_beside_others(results, tmp_path, capsys):
    shutil.copytree(results, tmp_path / "one")
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "summary.json").write_text('{"cases": {}}')
    capsys.readouterr()
    assert main(["results", str(tmp_path)]) == 0
    printed = capsys.readouterr()
    assert "old/summary.json: found a summary that does not say what made it" in printed.err
    assert "one: simulate" in printed.out


def test_results_of_other_places_are_told(results, tmp_path):
    """Two runs each, and no place that both folders have."""
    for folder, names in (("a", "12"), ("b", "34")):
        for name in names:
            shutil.copytree(results, tmp_path / folder / name)
    assert main(["results", str(tmp_path / "a"), str(tmp_path / "b")]) == 2
    shutil.copytree(results, tmp_path / "b" / "1")
    assert main(["results", str(tmp_path / "a"), str(tmp_path / "b")]) == 0
