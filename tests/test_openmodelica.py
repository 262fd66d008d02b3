"""The driver of OpenModelica: what it asks of omc, and what it makes of omc's answers.

A shell script stands in for omc: it writes down how it was called, prints what omc prints, and
leaves a file. Trajectories of real builds are compared in `test_clients`.
"""

import zipfile
from pathlib import Path

import pytest

from workbench.__main__ import main
from workbench.errors import InputError
from workbench.models.compiler.openmodelica import Message, build_with_omc, errors_in

CHECKED = (
    '"Check of Rig.M completed successfully.\nClass Rig.M has {} equation(s) and {} variable(s)."'
)

OFFERS = 'providesDirectionalDerivative="true"'


@pytest.fixture
def package(tmp_path) -> Path:
    path = tmp_path / 'a "quoted" folder' / "Rig" / "package.mo"
    path.parent.mkdir(parents=True)
    path.write_text("package Rig model M end M; end Rig;")
    return path


def stand_in(folder: Path, monkeypatch: pytest.MonkeyPatch, prints: str, *, builds: bool) -> Path:
    """Put a program 'omc' on the PATH; returns the file in which it notes its call."""
    calls, said, built = folder / "calls", folder / "said", folder / "built"
    said.write_text(prints)
    with zipfile.ZipFile(built, "w") as archive:
        archive.writestr("modelDescription.xml", OFFERS)
        archive.writestr("binaries/linux64/M.so", OFFERS)
    program = folder / "bin" / "omc"
    program.parent.mkdir()
    leave = f"cp {built} M.fmu" if builds else ":"
    program.write_text(
        f'#!/bin/sh\necho "$@" > {calls}\ncat build.mos >> {calls}\n{leave}\ncat {said}\n'
    )
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}:/bin:/usr/bin")
    return calls


def test_omc_is_asked_for_an_fmu_that_observers_can_use(tmp_path, package, monkeypatch):
    calls = stand_in(tmp_path, monkeypatch, CHECKED.format(7, 7), builds=True)
    out = tmp_path / "out" / "omc"
    assert build_with_omc(package, ["Rig.M"], out) == [out / "M.fmu"]
    with zipfile.ZipFile(out / "M.fmu") as archive:
        # Wrong without aliases: the workbench would believe them, and wreck the gains.
        assert b'"true"' not in archive.read("modelDescription.xml")
        assert archive.read("binaries/linux64/M.so") == OFFERS.encode()
    assert [p.name for p in out.iterdir()] == ["M.fmu"]
    options, load, _, tolerance, build, _ = calls.read_text().splitlines()
    assert set(options.split()) == {
        "--fmiFlags=s:cvode",
        "-d=-disableDirectionalDerivatives",  # or each state is named twice
        "--preOptModules-=introduceOutputAliases",  # or an alias is the state
        "build.mos",
    }
    assert "addClassAnnotation(Rig.M, annotate=experiment(Tolerance=1e-09));" in tolerance
    assert 'a \\"quoted\\" folder/Rig/package.mo"); getErrorString();' in load
    assert build.startswith('buildModelFMU(Rig.M, version="2.0", fmuType="me_cs"')


@pytest.mark.parametrize(
    ("prints", "match"),
    [
        (
            'true\n"[/lib/Rig/Part.mo:12:3-12:20:writable] Error: Class Foo not found.\n'
            'Error: Error occurred while flattening model Rig.M"\n',
            r"^/lib/Rig/Part.mo:12: found Class Foo not found\.",
        ),
        ('"Error: Failed to load package Rig"', "model Rig.M: found Failed to load package Rig"),
        (CHECKED.format(6, 7), "found 6 equations, 7 unknowns"),
        ("Killed", "found Killed"),
        ("", "found nothing printed"),
    ],
)
def test_what_omc_refuses_is_reported_and_nothing_is_written(
    prints, match, tmp_path, package, monkeypatch
):
    # An FMU with a missing equation may be left behind, and must not be taken.
    stand_in(tmp_path, monkeypatch, prints, builds="equation" in prints)
    with pytest.raises(InputError, match=match):
        build_with_omc(package, ["Rig.M"], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_warnings_and_notifications_are_no_errors():
    output = (
        "[/lib/A.mo:1:2-3:4:readonly] Warning: Parameter k has no value.\n"
        "[/lib/B.mo:5:6-7:8:writable] Notification: From here:\n"
        r"[C:\lib\C.mo:9:1-9:2:writable] Error: No viable alternative near token: end"
    )
    assert errors_in(output) == [Message(r"C:\lib\C.mo:9", "No viable alternative near token: end")]


def test_without_omc_the_command_says_what_is_missing(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    assert main(["fmu", "build", "--all", "--compiler", "omc"]) == 2
    assert "no program 'omc' on the PATH" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_fmi_3_is_not_asked_of_omc(capsys):
    assert main(["fmu", "build", "--all", "--compiler", "omc", "--fmi", "3"]) == 2
    assert "--compiler omc: found --fmi 3" in capsys.readouterr().err
