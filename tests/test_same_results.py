"""Two states of the code are the same only if all that was kept of them is."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.results.__main__ import main
from tests.results.rules import PLACES, RESULTS, applied

ROOT = Path(__file__).parents[1]
TABLE = "files/out/a.csv"
REFUSED = """
import pytest
from workbench.errors import InputError

@pytest.mark.parametrize("value", [1, 2])
def test_refused(value, tmp_path):
    remedy = "REMEDY" if value == 2 else "go on"
    with pytest.raises(InputError):
        raise InputError(
            where=f"{tmp_path}/x.csv", found=f"{value}", expected="3", remedy=remedy
        )
"""


@pytest.fixture
def kept(tmp_path) -> tuple[Path, Path]:
    """Two folders of the same results."""
    before, after = tmp_path / "before", tmp_path / "after"
    for name, text in {
        TABLE: "time [s],h [m]\n0,1.25\n1,1.5\n",
        "files/out/index.html": "<p>1.25 m</p>\n",
        "said/01_simulate/status": "0",
    }.items():
        path = before / "tank" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    shutil.copytree(before, after)
    return before, after


def difference(kept: tuple[Path, Path], capsys: pytest.CaptureFixture[str], *options: str) -> str:
    """What is said of a difference; nothing if there is none."""
    status = main(["compare", *map(str, kept), *options])
    text = capsys.readouterr().out
    assert (status == 0) == (text == "the same\n")
    return text if status else ""


def test_equal_results_are_the_same(kept, capsys):
    assert difference(kept, capsys) == ""


def test_a_number_that_changed_is_told_with_its_line(kept, capsys):
    (kept[1] / "tank" / TABLE).write_text("time [s],h [m]\n0,1.25\n1,1.5000000001\n")
    assert difference(kept, capsys) == (
        f"tank: 1\n  tank/{TABLE}, line 3\n    - 1,1.5\n    + 1,1.5000000001\n"
    )


def test_a_file_or_a_part_that_one_lacks_is_told(kept, capsys):
    (kept[0] / "tank" / "files/out/old.csv").touch()
    (kept[1] / "tank" / "files/out/more.csv").touch()
    (kept[1] / "train").mkdir()
    printed = difference(kept, capsys)
    assert "old.csv: gone" in printed
    assert "more.csv: new" in printed
    assert "train: not kept before" in printed
    assert "train" not in difference(kept, capsys, "--only", "tank")


def test_pages_may_be_left_out(kept, capsys):
    (kept[1] / "tank" / "files/out/index.html").write_text("<p>1.25 metres</p>\n")
    assert difference(kept, capsys).startswith("pages: 1\n")
    assert difference(kept, capsys, "--no-pages") == ""


@pytest.mark.parametrize(
    ("name", "line", "kept"),
    [
        ("stderr", "  12.3 s  fitting Seepage\n", "<time> s  fitting Seepage\n"),
        ("stderr", "[  1/14] 01_dry  1.6 s, about 21 s left", "[  1/14] 01_dry <time>"),
        ("summary.json", '{"seconds": 0.0112, "z": 0.5}', '{"seconds": <time>, "z": 0.5}'),
        ("summary.json", f'"commit": "{"a1" * 20}-dirty"', '"commit": "<commit>"'),
        ("summary.json", f'"sha256": "{"a1" * 32}"', f'"sha256": "{"a1" * 32}"'),
        ("index.html", "27 November 2026, 10:17 UTC", "<date>"),
        ("a.csv", "0.0,12.3,2026-11-27", "0.0,12.3,2026-11-27"),
    ],
)
def test_rules_take_out_what_differs_from_run_to_run_and_no_result(name, line, kept):
    assert applied(RESULTS, name, line) == kept


def test_refusals_are_kept_by_the_name_of_the_test_and_compared(tmp_path, capsys):
    """The same test in two files, on workers and without."""
    texts = {}
    for name, remedy, workers in (("a", "mend it", "0"), ("b", "leave it", "2")):
        test, file = tmp_path / f"test_{name}.py", tmp_path / f"{name}.json"
        test.write_text(REFUSED.replace("REMEDY", remedy))
        command = [sys.executable, "-m", "pytest", str(test), "-c", str(ROOT / "pyproject.toml")]
        command += ["-p", "tests.results.refusals", "--refusals", str(file), "-n", workers]
        run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert run.returncode == 0, run.stdout
        texts[name] = json.loads(file.read_text())
    assert texts["a"]["test_refused[1]"]["refusals"] == [
        "<tmp>/x.csv: found 1; expected 3. To do: go on."
    ]
    printed = difference((tmp_path / "a.json", tmp_path / "b.json"), capsys)
    assert printed.startswith("refusals changed: 1\n  test_refused[2]\n")
    assert "mend it" in printed
    assert "leave it" in printed
    # A test that is gone takes its refusals with it.
    (tmp_path / "b.json").write_text(json.dumps({"test_refused[2]": texts["a"]["test_refused[2]"]}))
    assert "lost, with their test: 1\n  test_refused[1]" in difference(
        (tmp_path / "a.json", tmp_path / "b.json"), capsys
    )


def test_places_of_tests_are_taken_out():
    text = "/tmp/pytest-of-me/pytest-3/popen-gw1/test_x0/a/b.csv, line 3: found /tmp/tmpab12cd_e/c"
    assert applied(PLACES, "", text) == "<tmp>/a/b.csv, line 3: found <tmp>/c"
