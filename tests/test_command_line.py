"""Every command says its result in one way, and begins at once."""

import json
import os
import re
import subprocess
import sys
import tomllib

import pytest

from workbench.__main__ import main
from workbench.cli import doctor
from workbench.cli.extras import PURPOSES
from workbench.cli.parser import command_line, parsers
from workbench.models.fmu_cache import cache_folder

from .processes import python

HEAVY = ("numba", "numpy", "scipy", "matplotlib", "pandas", "fmpy", "pint")
PARSERS = [parser for parser in parsers(command_line("")) if " " in parser.prog]


@pytest.fixture(autouse=True)
def _from_the_checkout(root, monkeypatch) -> None:
    monkeypatch.chdir(root)


def document(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> dict[str, object]:
    """What a command prints with --json: one document, and nothing else."""
    status = main([*arguments, "--json"])
    printed = json.loads(capsys.readouterr().out)
    assert printed["status"] == status
    assert printed["command"] == arguments[0]
    return printed


# --- one way to say what was found ---


def test_json_is_all_that_standard_output_takes_and_what_the_file_says(tmp_path, capsys):
    case = "cases/01_dry_80_1.5"
    arguments = ["simulate", case, "--estimator", "ekf", "--workers", "1", "--out", str(tmp_path)]
    printed = document(arguments, capsys)
    assert printed["result"] == json.loads((tmp_path / "summary.json").read_text())
    assert printed["units"] == {"Fx_rms_N": "N", "seconds": "s"}


def test_progress_goes_to_standard_error_unless_nobody_asks(tmp_path, capsys):
    case = "cases/01_dry_80_1.5"
    arguments = ["simulate", case, "--estimator", "ekf", "--workers", "1", "--out", str(tmp_path)]
    assert main(arguments) == 0
    printed, progress = capsys.readouterr()
    assert re.search(r"^\[  1/1\] 01_dry_80_1\.5 .* s, about 0 s left$", progress, re.MULTILINE)
    assert "s left" not in printed
    assert main(["--quiet", *arguments]) == 0
    assert capsys.readouterr() == (printed, "")


@pytest.mark.parametrize("options", [[], ["--json"]])
def test_a_reader_that_has_gone_costs_nothing_but_the_text(root, options):
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-m", "workbench", *options, "systems"]
    run = subprocess.run(command, cwd=root, stdout=write, stderr=subprocess.PIPE, check=False)
    os.close(write)
    assert (run.returncode, run.stderr) == (0, b"")


@pytest.mark.parametrize("option", ["--out", "--workers"])
def test_two_dashes_are_no_value(option, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["simulate", "cases", f"{option}=--"])
    assert ended.value.code == 2
    assert f"{option}=--: expected a value" in capsys.readouterr().err


def test_a_mistake_is_a_document_too(capsys):
    error = document(["simulate", "cases/nowhere"], capsys)["error"]
    assert isinstance(error, dict)
    assert error["where"] == "cases/nowhere"
    assert error["found"] == "no such folder"
    assert set(error) == {"message", "where", "found", "expected", "remedy"}


@pytest.mark.parametrize(
    "arguments",
    [
        ["systems"],
        ["prepare", "cascaded_tanks"],
        ["rig", "--list"],
        ["diagnose", "--list"],
        ["fmu", "info", "fmus/fmi2/MinimalObserver.fmu"],
        ["completion", "bash"],
    ],
    ids=" ".join,
)
def test_what_lists_or_describes_tells_programs_the_same(arguments, capsys):
    assert document(arguments, capsys)["result"]
    assert main(["--json", *arguments]) == 0
    json.loads(capsys.readouterr().out)


# --- the same option means the same everywhere ---


def test_an_option_takes_the_same_everywhere():
    """Kind of value and number of values by option; only files and folders differ by command."""
    meant: dict[str, set[tuple[object, ...]]] = {}
    for parser in PARSERS:
        for action in parser._actions:
            for option in action.option_strings:
                form = (type(action).__name__, action.type, action.nargs)
                meant.setdefault(option, set()).add(form)
    twice = {option: kinds for option, kinds in meant.items() if len(kinds) > 1}
    # An exported observer is one; a run has several. 'power' has sets that are clean of effects,
    # 'doctor' a cache to be cleaned.
    assert set(twice) == {"--estimator", "--clean"}
    assert {form[1:] for form in twice["--estimator"]} == {(None, None)}


@pytest.mark.parametrize("parser", PARSERS, ids=lambda item: item.prog)
def test_every_command_knows_json_and_quiet(parser):
    options = {option for action in parser._actions for option in action.option_strings}
    assert {"--json", "--quiet", "--help"} <= options


# --- it begins at once ---


def test_help_imports_nothing_that_takes_time():
    """numba and what it needs take two seconds; half a second is what people wait for."""
    helps = [[*parser.prog.split()[1:], "--help"] for parser in PARSERS]
    script = f"""
import sys
import workbench
from workbench.__main__ import main
for asked in {[["--version"], ["--help"], *helps]}:
    try:
        main(asked)
    except SystemExit as end:
        if end.code or (heavy := set(sys.modules) & set({HEAVY})):
            sys.exit(f"{{asked}}: {{end.code}}, {{heavy}}")
"""
    assert python("-c", script).stderr == ""


# --- completion ---


def test_the_script_completes_commands_options_and_choices(root, tmp_path, capsys):
    """In bash itself: what it offers after each beginning of a line."""
    assert main(["completion", "bash"]) == 0
    script = tmp_path / "workbench.bash"
    script.write_text(capsys.readouterr().out)

    def offered(*words: str) -> set[str]:
        line = " ".join(f"'{word}'" for word in words)
        ask = f"source {script}; COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; "
        ask += 'COMP_LINE="${COMP_WORDS[*]}"; COMP_POINT=${#COMP_LINE}; '
        ask += "_shtab_workbench; printf '%s\\n' \"${COMPREPLY[@]}\""
        run = subprocess.run(
            ["bash", "-c", ask], cwd=root, capture_output=True, text=True, check=False
        )
        return set(run.stdout.split())

    assert {"simulate", "diagnose", "rig", "doctor"} <= offered("workbench", "")
    assert offered("workbench", "diag") == {"diagnose"}
    assert {"--held-out", "--json"} <= offered("workbench", "diagnose", "--")
    assert offered("workbench", "diagnose", "--platforms", "") == {"native", "all"}


# --- doctor ---


def test_every_extra_has_a_purpose(root):
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    assert set(project["optional-dependencies"]) == set(PURPOSES)


def test_a_sound_installation_has_nothing_wrong(capsys):
    offered = {
        finding["name"]: finding for finding in document(["doctor"], capsys)["result"]["findings"]
    }
    assert {extra["state"] for extra in offered.values()} <= {"ok", "missing"}
    assert offered["fmus/fmi2/Reference.fmu"]["state"] == "ok"
    if offered["extra [compiler]"]["state"] == "ok":
        assert offered["compiler"]["found"] == "compiled and ran a model with the state x"


def test_a_cached_file_that_is_gone_does_not_end_the_report(tmp_path, monkeypatch, capsys):
    """As where another program deletes it meanwhile: it is listed, but cannot be measured."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = cache_folder()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "gone").symlink_to(tmp_path / "nothing")
    findings = document(["doctor"], capsys)["result"]["findings"]
    (state,) = (finding["state"] for finding in findings if finding["name"] == "cache")
    assert state == "ok"


def test_the_cache_is_measured_by_part_and_deleted_on_demand(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = cache_folder()
    for part, size in (("fmus", 2_000_000), ("0123456789abcdef", 3_000_000)):
        (folder / part / "deeper").mkdir(parents=True)
        (folder / part / "deeper" / "file").write_bytes(bytes(size))
    monkeypatch.setattr(doctor, "missing_packages", lambda extra: ["casadi"] * bool(extra))
    assert main(["doctor"]) == 0
    printed = capsys.readouterr().out
    assert f"{folder}: 5 MB (FMUs 2 MB, compiled loops 3 MB)" in printed
    assert main(["doctor", "--clean"]) == 0
    printed = capsys.readouterr().out
    assert f"{folder}: 5 MB deleted" in printed
    assert list(folder.iterdir()) == []


def test_a_changed_fmu_and_a_cache_out_of_reach_are_told_with_what_to_do(
    root, tmp_path, monkeypatch, capsys
):
    kept = tmp_path / "fmus"
    (kept / "fmi2").mkdir(parents=True)
    (kept / "manifest.json").write_bytes((root / "fmus" / "manifest.json").read_bytes())
    (kept / "fmi2" / "Reference.fmu").write_bytes(b"another")
    monkeypatch.setattr(doctor, "fmus", lambda: kept)
    monkeypatch.setattr(doctor, "missing_packages", lambda extra: ["casadi"] * bool(extra))
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    assert main(["doctor"]) == 1
    text = capsys.readouterr().out
    assert re.search(
        r"^wrong +fmus/fmi2/Reference.fmu +its SHA-256 is not that", text, re.MULTILINE
    )
    assert re.search(r"^wrong +fmus/fmi3/Reference.fmu +no such file$", text, re.MULTILINE)
    assert re.search(r"^ +to do: make fmus$", text, re.MULTILINE)
    assert re.search(r"^missing +extra \[compiler\] +for .*; without casadi$", text, re.MULTILINE)
    assert re.search(r"^wrong +cache +/dev/null/", text, re.MULTILINE)
    assert "set XDG_CACHE_HOME to a folder that can be written" in text
