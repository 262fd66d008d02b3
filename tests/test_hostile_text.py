"""Files that no person writes: each is refused in a few lines that name it, and none hangs."""

import io
import json
import os
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from workbench.__main__ import main
from workbench.cli.output import Output
from workbench.errors import InputError
from workbench.machines.train.recorded import _planting
from workbench.machines.wheelset.rig.proposed import proposed_stop
from workbench.pages.runs import read_runs
from workbench.recordings.datasets import _hashes_before
from workbench.recordings.importing import imported

from .case_folders import LINES, TOML, write
from .edits import edit, replaced
from .systems import WHEELSET

DEEP = 5000
DIGITS = 5000


def zipped(path: Path) -> None:
    path.unlink()
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("measured.csv", "\n".join(LINES))


def linked(target: str) -> Callable[[Path], None]:
    def link(path: Path) -> None:
        path.unlink()
        path.symlink_to(target)

    return link


def pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def text(content: str | bytes) -> Callable[[Path], None]:
    def replace(path: Path) -> None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())

    return replace


def with_text(old: str, new: str) -> Callable[[Path], Path]:
    return lambda path: edit(path, (old, new), count=1)


WHOLE = "\n".join(LINES)
CSV: dict[str, tuple[Callable[[Path], None], str]] = {
    "a pipe": (pipe, "measured.csv: found a file that cannot be read (no regular file)"),
    "an endless device": (linked("/dev/zero"), "(no regular file)"),
    "a link to itself": (linked("measured.csv"), "measured.csv: found a file that cannot be read"),
    "a zip": (zipped, "measured.csv: found UTF-16 or binary data"),
    "UTF-16": (text(WHOLE.encode("utf-16")), "measured.csv: found UTF-16"),
    "UTF-16 without a mark": (text(WHOLE.encode("utf-16-le")), "found UTF-16"),
    "a line of a million characters": (
        text("\n".join([*LINES[:5], "1" * 1_000_000, *LINES[5:]])),
        "measured.csv, line 6: found 1000000 characters, '1111",
    ),
    "a header of a million characters": (text("x," * 500_000), "line 1: found 1000000 characters"),
    "a number of a million digits": (
        text("\n".join([*LINES[:3], f"0.3,{'9' * 100_000},-2,-48,-31,-120", *LINES[4:]])),
        "measured.csv, line 4, column 'pB'",
    ),
    "many columns": (text(",".join(f"c{k} [1]" for k in range(10_000))), "line 1, column 'time'"),
}
TOMLS: dict[str, tuple[Callable[[Path], None], str]] = {
    "lists in lists": (
        text(TOML + f"x = {'[' * DEEP}{']' * DEEP}\n"),
        "case.toml, line 10: found text that is no TOML",
    ),
    "tables in tables": (
        text(TOML + f"[model{'.a' * DEEP}]\n"),
        "case.toml, [model]: found unknown key 'a'",
    ),
    "a table in tables for a text": (
        with_text('"dry"', "{" + "a." * DEEP + "a = 1}"),
        "case.toml, [conditions] wheel_rail: found ",
    ),
    "zero in a name of a file": (
        with_text("measured.csv", "measured\\u0000.csv"),
        "[measurement] file: found 'measured\\x00.csv'; expected a text without zero",
    ),
    "a whole number of 5000 digits": (
        with_text("-1", f"-{'1' * DIGITS}"),
        "case.toml, line 7: found text that is no TOML",
    ),
    "a whole number of 5000 hexadecimal digits": (
        with_text("-1", f"0x{'1' * DIGITS}"),
        "[conditions] direction: found a number of thousands of digits",
    ),
    "a speed of 5000 digits": (
        with_text('"80 km/h"', f'"{"8" * DIGITS} km/h"'),
        "initial_speed: found '8888",
    ),
    "a title with commands for the terminal": (
        with_text('"dry"', '"\\u001b[2J\\n\\n"'),
        "wheel_rail: found '\\x1b[2J\\n\\n'",
    ),
    "a pipe": (pipe, "case.toml: found a file that cannot be read (no regular file)"),
    "UTF-16": (text(TOML.encode("utf-16")), "case.toml: found UTF-16"),
}


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The message of a command that ends with status 2; short, and of lines that people read."""
    assert main(arguments) == 2
    message = capsys.readouterr().err
    lines = message.splitlines()
    assert len(lines) <= 10
    assert message.startswith("error: ")
    assert len(message) < 3000
    assert all(line.isprintable() for line in lines)
    return message


@pytest.mark.parametrize(
    ("file", "damage"), [("measured.csv", k) for k in CSV] + [("case.toml", k) for k in TOMLS]
)
def test_a_case_that_no_person_wrote_is_refused(tmp_path, capsys, file, damage):
    case = write(tmp_path / "a")
    spoil, match = (CSV if file == "measured.csv" else TOMLS)[damage]
    spoil(case / file)
    out = str(tmp_path / "out")
    assert match in refused(["simulate", str(case), "--out", out], capsys)
    assert not Path(out).exists()


SYSTEM = "modelica/WheelsetRig/system.toml"


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("[points.design]", "design = 3\n[export.other]", "[points] design: found 3; expected"),
        ("relative_noise = 3e-4", f"relative_noise = 0x{'f' * DIGITS}", "relative_noise: found a"),
        ("relative_noise = 3e-4", f"relative_noise = 1{'0' * 4000}", "expected a finite number"),
        ("relative_noise = 3e-4", "relative_noise = nan", "relative_noise: found nan; expected a"),
        ('"rR*omegaR", unit', f'"{"(" * DEEP}rR{")" * DEEP}", unit', "is: found '((("),
        ('"rR*omegaR", unit', f'"{"rR+" * DEEP}rR", unit', "is: found 'rR+rR"),
        ('"rR*omegaR", unit', f'"rR*{"9" * 4000}", unit', "is: found 'rR*999"),
        ('MinimalObserver.fmu"', 'Minimal\\u0000.fmu"', "fmu: found '../../fmus/fmi2/Minimal\\x00"),
    ],
    ids=["design", "hexadecimal", "digits", "nan", "brackets", "sum", "constant", "zero"],
)
def test_a_system_that_no_person_wrote_is_refused(root, tmp_path, capsys, old, new, match):
    library = tmp_path / "modelica" / "WheelsetRig"
    library.mkdir(parents=True)
    (tmp_path / "fmus").symlink_to(root / "fmus")
    (library / "system.toml").write_text(replaced((root / SYSTEM).read_text(), (old, new)))
    case = str(root / "cases" / "01_dry_80_1.5")
    message = refused(["simulate", case, "--system", str(library)], capsys)
    assert "system.toml" in message
    assert match in message


@pytest.mark.parametrize(
    "line",
    [
        "design = 3",
        f"gains = {'[' * DEEP}{']' * DEEP}",
        f"estimator = 0x{'1' * DIGITS}",
        f"[gains]\nL11 = 0x{'1' * DIGITS}",
        f"[gains]\nL11 = 1{'0' * 400}",
    ],
)
def test_gains_that_no_person_wrote_are_refused(root, tmp_path, capsys, line):
    tuned = (root / "workbench/machines/wheelset/gains/disturbance_observer.toml").read_text()
    key = line.split(" = ")[0].split("\n")[-1]
    start = tuned.index("[gains]")
    head, tail = tuned[:start], tuned[start:]
    if key == "design":
        tail = tail.replace("[design]", "[unknown]")
        head += line + "\n"
    elif key == "gains":
        tail = tail.replace("[gains]", "[unknown]")
        head += line + "\n"
    elif key == "estimator":
        head = line + "\n"
    else:
        tail = line + tail.partition("\n")[2].partition("\n")[2].join(["\n", ""])
    path = tmp_path / "gains.toml"
    path.write_text(head + tail)
    case = str(root / "cases" / "01_dry_80_1.5")
    out = ["--out", str(tmp_path / "out")]
    assert "gains.toml" in refused(["simulate", case, "--gains", str(path), *out], capsys)


def test_a_path_that_cannot_be_read_is_refused(tmp_path, capsys):
    long = str(tmp_path / ("x" * 5000))
    assert "x (50" not in refused(["simulate", long], capsys)
    assert "no such file" in refused(["simulate", "--system", long], capsys)


@pytest.mark.parametrize("name", ["a\033[2J", "a\x9b2J\u202eb"])
def test_a_name_gives_a_terminal_no_commands(name, root, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(root / "cases" / "01_dry_80_1.5", tmp_path / name)
    options = ("--estimator", "open_loop", "--workers", "1", "--out", "out")
    assert main(["simulate", name, *options]) == 0
    shown = capsys.readouterr()
    for text in shown:
        assert name.encode("unicode_escape").decode() in text
        assert all(line.isprintable() for line in text.splitlines())


def test_a_name_that_is_no_utf_8_is_refused_before_the_work(tmp_path, capsys):
    (tmp_path / "b\udcff.csv").write_text("time [s],inflow [l/s],h [mm]\n0,4,950\n1,4,951\n")
    out = ["--out", str(tmp_path / "out"), "--yes"]
    message = refused(["import", str(tmp_path / "b\udcff.csv"), *out], capsys)
    assert "b\\udcff.csv, a name that is no UTF-8" in message
    assert not (tmp_path / "out").exists()


def test_a_name_that_standard_output_cannot_hold_is_written_in_its_place(monkeypatch):
    held = io.BytesIO()
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(held, "ascii"))
    Output(json=False, quiet=False).result("r_\u00fc/index.html")
    assert held.getvalue() == b"r_\\xfc/index.html\n"


@pytest.mark.skipif(os.geteuid() != 0, reason="a folder of somebody else is made by root")
def test_a_folder_without_permission_is_refused(tmp_path, capsys):
    case = write(tmp_path / "a")
    case.chmod(0)
    os.seteuid(65534)  # nobody
    try:
        message = refused(["simulate", str(case), "--out", "/tmp"], capsys)
    finally:
        os.seteuid(0)
    assert "Permission denied" in message


DEEP_LIST = "[" * 100_000
LEFT = {
    "import.json": (lambda folder, _: imported(folder), "no list of imports"),
    "prepared.json": (lambda folder, _: _hashes_before(folder), "no list of files"),
    "next.json": (proposed_stop, "no experiment that says"),
    "truth.json": (lambda folder, _: _planting(1, folder), "a truth that is not understood"),
    "summary.json": (lambda folder, _: read_runs(folder), "a summary that does not say"),
}


@pytest.mark.parametrize("name", LEFT)
def test_what_another_run_left_and_no_run_writes_is_refused(name, tmp_path):
    read, message = LEFT[name]
    large = {
        "tried": [{"conditions": {}, "inputs": {"pB": {"levels": [10**400]}}}],
        "effects": {"pads_axle": {"size": 10**400, "at": 1}},
        "imports": [1],
        "written": {"../above": ""},
    }
    half = {**large, "answer": {"sentence": "\ud800"}}
    for content in ("[]", "{", DEEP_LIST, json.dumps(large), json.dumps(half)):
        (tmp_path / name).write_text(content)
        with pytest.raises(InputError, match=f"{name}: found {message}"):
            read(tmp_path, WHEELSET)
