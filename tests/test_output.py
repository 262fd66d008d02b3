"""Where results go and how far work is: a place that takes none is told before, files are whole."""

import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path

import lxml.html
import pytest

from workbench.__main__ import main
from workbench.errors import InputError
from workbench.pages.parts import number_of
from workbench.runtime import files
from workbench.runtime.engine import ProgressReporter, StepReporter
from workbench.runtime.files import (
    locked_folder,
    replacing,
    require_writable,
    warning_if_unwritable,
    write_json,
    write_whole,
)

COMMANDS = {
    "simulate": ["simulate", "cases/01_dry_80_1.5"],
    "observability": ["observability", "cases/01_dry_80_1.5"],
    "tune": ["tune", "disturbance_observer", "--cases", "cases/01_dry_80_1.5"],
    "diagnose": ["diagnose", "cases/01_dry_80_1.5"],
    "export": ["export"],
    "power": ["power", "--clean", "1"],
    "monitor": ["monitor", "cases"],
    "rig": ["rig", "--case", "01_dry_80_1.5", "--workers", "1"],
    "accuracy": ["accuracy", "cases/01_dry_80_1.5"],
}


@contextmanager
def at_most(size: int) -> Iterator[None]:
    """No file may be larger, as on a disk that is full by then [byte]."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def refused(command: str, out: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """What is said when a command cannot write; nothing of its work is begun."""
    assert main([*COMMANDS[command], "--out", str(out)]) == 2
    printed = capsys.readouterr()
    assert "s left" not in printed.err
    assert "done" not in printed.err
    assert printed.out == ""
    return printed.err


@pytest.mark.parametrize("command", COMMANDS)
def test_a_place_that_takes_no_results_is_refused_before_the_work(
    root, tmp_path, monkeypatch, capsys, command
):
    monkeypatch.chdir(root)
    (tmp_path / "file").write_text("mine")
    message = refused(command, tmp_path / "file", capsys)
    assert "a file, and no folder" in message
    assert message.count("\n") == 1
    assert (tmp_path / "file").read_text() == "mine"


def test_a_folder_that_takes_no_results_is_refused_whatever_it_lacks(tmp_path):
    (tmp_path / "file").write_text("mine")
    for out, match in (
        (tmp_path / "file" / "below", "Not a directory"),
        (tmp_path / ("long" * 100), "File name too long"),
        (Path("/proc/results"), "No such file or directory"),
    ):
        with pytest.raises(InputError, match=match), locked_folder(out):
            pass
    full, taken = tmp_path / "full", tmp_path / "taken"
    with at_most(4_900_000), pytest.raises(InputError, match="File too large"), locked_folder(full):
        pass  # less than is asked for
    another = pytest.raises(InputError, match="another run that writes there")
    with locked_folder(taken), another, locked_folder(taken):
        pass


def test_a_run_lets_go_of_its_folder_after_any_end(tmp_path):
    script = (
        "from pathlib import Path; import os, sys\n"
        "from workbench.runtime.files import locked_folder\n"
        "with locked_folder(Path(sys.argv[1])): os.kill(os.getpid(), 9)"
    )
    subprocess.run([sys.executable, "-c", script, str(tmp_path)], check=False)
    with locked_folder(tmp_path):
        assert not list(tmp_path.iterdir())


def test_a_child_that_outlives_its_run_does_not_hold_the_folder(tmp_path):
    script = (
        "from pathlib import Path; import os, sys, time\n"
        "from workbench.runtime.files import locked_folder\n"
        "with locked_folder(Path(sys.argv[1])):\n"
        "    if os.fork(): time.sleep(60)\n"
        "    print(os.getpid(), flush=True); os.kill(os.getppid(), 9)\n"
        "    os.close(1); os.close(2); time.sleep(60)"
    )
    command = [sys.executable, "-c", script, str(tmp_path)]
    child = int(subprocess.run(command, check=False, capture_output=True, text=True).stdout)
    try:
        os.kill(child, 0)  # it lives
        with locked_folder(tmp_path):
            pass
    finally:
        os.kill(child, signal.SIGKILL)


def test_where_folders_cannot_be_locked_results_are_written(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "fcntl", None)
    with locked_folder(tmp_path / "new"):
        assert list((tmp_path / "new").iterdir()) == []


def test_the_rest_of_a_file_whose_run_was_killed_is_removed(tmp_path):
    for name in ("page.html.123.part", "mine.part", "other"):
        (tmp_path / name).write_text("")
    with locked_folder(tmp_path):
        assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.part", "other"]


def test_the_rest_of_a_file_whose_worker_was_ended_is_removed(tmp_path):
    """As SIGTERM does while workers draw."""
    with suppress(SystemExit), locked_folder(tmp_path):
        (tmp_path / "figure.png.123.part").write_text("")
        raise SystemExit(143)
    assert not list(tmp_path.iterdir())


def test_a_file_that_cannot_be_written_is_refused_before_the_work(tmp_path):
    (tmp_path / "file").write_text("")
    for path, match in (
        (tmp_path, "a folder, and no file"),
        (tmp_path / "file" / "x.json", "Not a directory|File exists"),
        (tmp_path / ("x" * 300), "File name too long"),
    ):
        with pytest.raises(InputError, match=match):
            require_writable(path)
    write_whole(tmp_path / ("x" * 255), "the longest name")
    assert sorted(len(path.name) for path in tmp_path.iterdir()) == [4, 255]


def test_a_figure_that_cannot_be_written_costs_no_numbers(root, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(root)
    name = "01_dry_80_1.5"
    for suffix in ("png", "svg"):  # a folder stands where a figure is to be
        (tmp_path / f"{name}.{suffix}" / "mine").mkdir(parents=True)
    arguments = ["simulate", f"cases/{name}", "--estimator", "open_loop", "--figures"]
    assert main([*arguments, "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr()
    assert printed.err.count("warning: ") == 2
    assert "open_loop" in printed.out
    written = sorted(path.name for path in tmp_path.iterdir() if path.is_file())
    assert written == [f"{name}.csv", f"{name}.npz", "index.html", "summary.json"]


def test_what_fills_the_disk_leaves_no_half_of_a_file(tmp_path):
    with at_most(1000):
        with warning_if_unwritable():
            write_whole(tmp_path / "figure.svg", "x" * 2000)
        with pytest.raises(InputError, match="File too large"):
            write_whole(tmp_path / "page.html", "x" * 2000)
    assert os.listdir(tmp_path) == []


def test_text_bytes_and_json_are_written_in_folders_made_as_needed(tmp_path):
    folder = tmp_path / "a" / "b"
    write_whole(folder / "text", "µ\n")
    write_whole(folder / "bytes", b"\x00\n")
    write_json(folder / "json", {"µ": [1.5, None]})
    assert (folder / "text").read_bytes() == "µ\n".encode()
    assert (folder / "bytes").read_bytes() == b"\x00\n"
    assert json.loads((folder / "json").read_text()) == {"µ": [1.5, None]}
    assert sorted(file.name for file in folder.iterdir()) == ["bytes", "json", "text"]


def test_what_fails_half_way_leaves_the_file_as_it_was(tmp_path):
    path = tmp_path / "result"
    write_whole(path, "before")

    def half() -> None:
        with replacing(path) as stream:
            stream.write(b"aft")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        half()
    assert path.read_text() == "before"
    assert [file.name for file in tmp_path.iterdir()] == ["result"]


def test_a_part_that_takes_long_says_how_much_is_left_of_it():
    lines: list[str] = []
    done = ProgressReporter(lines.append, "simulations", interval=0.0).part(4)
    for step in range(4):
        done(step)
    assert [line.partition(",")[0] for line in lines] == [f"{n} simulations" for n in (1, 2, 3, 4)]
    assert re.fullmatch(r"1 simulations, about \d+ s left of these 4", lines[0])
    assert lines[-1] == "4 simulations"  # nothing is left


def test_parts_add_up_from_any_thread():
    lines: list[str] = []
    pace = ProgressReporter(lines.append, "simulations", interval=0.0)

    def part(size: int) -> None:
        done = pace.part(size)
        for step in range(size):
            done(step)

    with ThreadPoolExecutor(4) as threads:
        list(threads.map(part, [25, 50, 75, 100]))
    assert sorted(int(line.split()[0]) for line in lines) == list(range(1, 251))


def test_what_is_soon_done_says_nothing():
    lines: list[str] = []
    done = ProgressReporter(lines.append, "simulations", interval=3600.0).part(100)
    for step in range(100):
        done(step)
    assert lines == []


def test_each_of_a_known_number_of_steps_says_what_came_of_it_and_what_is_left():
    lines: list[str] = []
    progress = StepReporter(lines.append, 12)
    for name in ("first", "second"):
        progress.step(name)
    assert re.fullmatch(r"\[ 1/12\] first, about \d+ s left", lines[0])
    assert re.fullmatch(r"\[ 2/12\] second, about \d+ s left", lines[1])


# --- a page as a report on paper ---


CASE = "01_dry_80_1.5"


@pytest.fixture(scope="module")
def results(tmp_path_factory, root) -> Path:
    """One estimator on one recorded stop, printed."""
    if shutil.which("chromium") is None:
        pytest.skip("no chromium")
    out = tmp_path_factory.mktemp("printed")
    case = str(root / "cases" / CASE)
    assert main(["simulate", case, "--estimator", "ekf", "--pdf", "--out", str(out)]) == 0
    return out


def test_report_has_a_few_pages(results):
    printed = (results / "report.pdf").read_bytes()
    assert printed.startswith(b"%PDF-")
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 4


def test_report_tells_number_version_and_data_and_has_lines_to_sign(results):
    summary = json.loads((results / "summary.json").read_text())
    run = summary["provenance"]["run"]
    (footer,) = lxml.html.fromstring((results / "index.html").read_bytes()).xpath("//footer")
    text = " ".join(footer.text_content().split())
    assert text.startswith(f"Report {number_of(summary)} ")
    assert run["workbench"] in text
    assert run["data"][CASE] in text
    for line in ("Compiled", "Checked", "Approved"):
        assert f"{line}: name, date, signature" in text


def test_another_result_has_another_number(results):
    summary = json.loads((results / "summary.json").read_text())
    number = number_of(summary)
    assert number == number_of(json.loads(json.dumps(summary)))
    summary["cases"][CASE]["estimators"]["ekf"]["z"] *= 1.0 + 1e-15
    assert number_of(summary) != number


def test_without_a_browser_nothing_is_begun(tmp_path, root, monkeypatch, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    out = tmp_path / "out"
    assert main(["simulate", str(root / "cases" / CASE), "--pdf", "--out", str(out)]) == 2
    assert "install chromium, or leave --pdf out" in capsys.readouterr().err
    assert not out.exists()
