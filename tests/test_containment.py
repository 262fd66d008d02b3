"""A hostile FMU harms the process it is tried in, and nothing else; what it did is named."""

import json
import re
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from workbench.__main__ import main
from workbench.errors import FMUError, InputError
from workbench.models import fmu_cache, trial
from workbench.models.checks import check
from workbench.models.description import Description, read_description
from workbench.models.fmu import FMU, CoSimulation
from workbench.models.trial import ContainedError, NoAnswerError
from workbench.runtime.supervision import Limits

from .hostile_fmus import NAME, compile_library, rewritten
from .processes import needs_compiler

pytestmark = needs_compiler


@pytest.fixture(autouse=True)
def places(tmp_path, monkeypatch) -> Path:
    """A memory, a cache, a folder of temporary files of its own; returns the last."""
    monkeypatch.setattr(
        fmu_cache.platformdirs, "user_cache_dir", lambda name: str(tmp_path / "cache")
    )
    fmu_cache._remembered.cache_clear()
    fmu_cache._is_own.cache_clear()
    folder = tmp_path / "tmp"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    # Of waiting generous, for a machine that has other work to do.
    monkeypatch.setenv("WORKBENCH_TRIAL", "processor=1 answer=60 memory=512 file=10")
    return folder


@pytest.fixture
def plan(monkeypatch) -> Callable[[str], None]:
    """Sets what the FMU does."""
    return lambda call: monkeypatch.setenv("HOSTILE", call)


CALL = "fmi2GetDerivatives"
CALLS = [
    *("load", "fmi2Instantiate", "fmi2SetupExperiment", "fmi2SetReal", "fmi2GetReal"),
    *("fmi2EnterInitializationMode", "fmi2ExitInitializationMode", "fmi2NewDiscreteStates"),
    *("fmi2EnterContinuousTimeMode", "fmi2SetTime", "fmi2GetContinuousStates"),
    *("fmi2SetContinuousStates", "fmi2GetDirectionalDerivative", "fmi2GetFMUstate"),
    *("fmi2SetFMUstate", "fmi2FreeFMUstate", "fmi2Reset", "fmi2FreeInstance"),
]
ATTACKS = {
    "exit": f"ended the process with exit status 0 in {CALL}",
    "_exit": f"ended the process with exit status 0 in {CALL}",
    "abort": f"crashed with SIGABRT in {CALL}",
    "crash": f"crashed with SIGSEGV in {CALL}",
    "overflow": f"crashed with SIGSEGV in {CALL}",
    "kill": f"crashed with SIGKILL in {CALL}",
    "eat": f"crashed with SIGSEGV in {CALL}.*512 MB of memory",
    "ask": f"crashed with SIGSEGV in {CALL}.*512 MB of memory",
    "flood": f"crashed with SIGXFSZ in {CALL}.*files of 10 MB",
    "spin": rf"did not return from {CALL} within \d\.\d s of processor time",
    "daemon": f"ended the process with exit status 0 in {CALL}",
    "split": f"ended the process with exit status 0 in {CALL}",
    "spin_at_exit": "did not return from unloading of its library",
    "scribble": "wrote to a file that another had opened",
    "scribble_and_leave": f"ended the process with exit status 0 in {CALL}",
    "traced": "had its process traced as a debugger does",
    "stopped": "had its process traced as a debugger does",
    "round_up": "changed how the processor rounds",
}


@pytest.mark.parametrize("attack", ATTACKS)
def test_what_an_fmu_did_is_named_and_leaves_nothing(attack, hostile_path, places, plan):
    plan(f"{attack} {CALL} 2")
    with pytest.raises(ContainedError, match=f"^evil.fmu: {ATTACKS[attack]}"):
        FMU(hostile_path)
    assert list(places.iterdir()) == []


LOG = "((fmi2CallbackLogger)((Instance *)c)->importer.callback)(NULL, NULL, fmi2Error, NULL, "
# What is done in a function without an error, and what is said of it.
WRONGS = {
    "inputs": ("fmi2SetReal", "((double *)value)[0] += 1.0;", "wrote into what it was given"),
    "states": ("fmi2SetContinuousStates", "((double *)x)[0] += 1.0;", "wrote into what it was"),
    "no rates": ("fmi2GetDerivatives", "return fmi2OK;", "wrote no value where one was asked for"),
    "no outputs": ("fmi2GetReal", "return fmi2Warning;", "wrote no value where one was asked"),
    "no time": (
        "fmi2NewDiscreteStates",
        "eventInfo->nextEventTimeDefined = 1; eventInfo->nextEventTime = 0.0 / 0.0; return fmi2OK;",
        "its next time event is at nan s",
    ),
    "escapes": (
        "fmi2SetTime",
        LOG + r'"\033[2Jgone\nerror: forged"); return fmi2Error;',
        r"returned error: \\x1b\[2Jgone\\nerror: forged\.",
    ),
    "escapes by a byte": (
        "fmi2SetTime",
        LOG + r'"\302\233[2Jgone"); return fmi2Error;',
        r"returned error: \\x9b\[2Jgone\.",
    ),
}


@pytest.mark.parametrize("wrong", WRONGS)
def test_what_a_call_does_without_an_error_and_may_not_is_told(wrong, root, tmp_path):
    function, code, message = WRONGS[wrong]

    def change(folder: Path) -> None:
        file = folder / "sources" / "fmi2.c"
        head = rf"(?m)^fmi2Status {function}\([^{{;]*\) \{{"
        text, count = re.subn(head, lambda match: f"{match[0]} {code}", file.read_text())
        assert count == 1
        file.write_text(text)
        compile_library(folder, NAME)

    path = rewritten(root / "fmus" / "fmi2" / f"{NAME}.fmu", tmp_path / "wrong.fmu", change)
    with pytest.raises(FMUError, match=f"^wrong.fmu: .*{message}"):
        FMU(path).start({})


@pytest.mark.parametrize("refusal", ["beg", "refuse"])
def test_an_error_within_the_limits_is_no_trial_that_was_passed(refusal, hostile_path, plan):
    plan(f"{refusal} {CALL} 2")
    for _ in range(2):
        with pytest.raises(FMUError, match=f"{CALL} returned error: .* 512 MB of memory"):
            FMU(hostile_path)


@pytest.mark.parametrize("call", CALLS)
def test_every_call_of_an_observer_is_tried(call, hostile_path, plan):
    plan(f"exit {call} 1")
    named = "loading of its library" if call == "load" else call
    with pytest.raises(ContainedError, match=f"exit status 0 in {named} "):
        FMU(hostile_path)


def test_a_solver_of_its_own_is_tried_where_it_is_used(hostile_path, plan):
    plan("crash fmi2DoStep 1")
    FMU(hostile_path).close()
    with pytest.raises(ContainedError, match="SIGSEGV in fmi2DoStep"):
        CoSimulation(hostile_path)


def test_one_that_waits_is_not_measured_rather_than_unfit(hostile_path, places, plan, monkeypatch):
    plan(f"wait {CALL} 1")
    monkeypatch.setenv("WORKBENCH_TRIAL", "answer=1")
    with pytest.raises(NoAnswerError, match=r"did not answer from .* within 1 s, .* for 0\.\d s"):
        FMU(hostile_path)
    assert list(places.iterdir()) == []


def test_limits_that_cannot_be_read_are_refused(hostile_path, monkeypatch):
    for text in ("processor=fast", "time=3", "memory=-1", "answer=nan"):
        monkeypatch.setenv("WORKBENCH_TRIAL", text)
        with pytest.raises(InputError, match=f"found '{text}'"):
            FMU(hostile_path)


# --- what is remembered ---


@pytest.fixture
def tried(monkeypatch) -> list[str]:
    """Names of the FMUs that were tried."""
    names: list[str] = []
    original = trial.run_trial

    def run_trial(description: Description, *arguments: Any) -> str:
        names.append(description.path.name)
        return original(description, *arguments)

    monkeypatch.setattr(trial, "run_trial", run_trial)
    return names


def test_a_sound_fmu_is_tried_once_and_remembered_by_its_hash(hostile_path, tmp_path, tried):
    copy = tmp_path / "copy.fmu"
    shutil.copy(hostile_path, copy)
    other = rewritten(copy, tmp_path / "other.fmu", lambda folder: (folder / "new").touch())
    for path in (copy, copy, hostile_path, other, other):
        fmu_cache._remembered.cache_clear()  # as in another process
        FMU(path).close()
    assert tried == ["copy.fmu", "other.fmu"]


@pytest.mark.parametrize("forged", [b"", b"\0" * 32])
def test_an_fmu_is_not_sound_because_another_says_so(forged, hostile_path, tmp_path, tried):
    known = tmp_path / "cache" / "known"
    known.mkdir(parents=True, mode=0o700)
    for suffix in ("", "-exchange"):
        (known / f"{read_description(hostile_path).sha256}{suffix}").write_bytes(forged)
    FMU(hostile_path).close()
    assert tried == ["evil.fmu"]


def test_an_unsound_fmu_is_tried_again(hostile_path, tried, plan):
    plan("exit load 1")
    for _ in range(2):
        with pytest.raises(ContainedError):
            FMU(hostile_path)
    assert tried == ["evil.fmu"] * 2


def test_the_process_remembers_where_nothing_can_be_kept(hostile_path, tmp_path, tried):
    (tmp_path / "cache").write_text("a file where the folder should be")
    for _ in range(2):
        FMU(hostile_path).close()
    assert tried == ["evil.fmu"]


def test_the_projects_own_fmus_are_not_tried(minimal_path, tried):
    FMU(minimal_path).close()
    assert tried == []


@pytest.mark.parametrize("version", ["fmi2", "fmi3"])
@pytest.mark.parametrize("interface", ["Model Exchange", "Co-Simulation"])
def test_the_trial_makes_no_call_that_a_sound_fmu_refuses(root, version, interface):
    """A refusal ends the trial, so that it must be none of the trial's own making."""
    description = read_description(root / "fmus" / version / "Reference.fmu")
    with trial.unpacked(description, interface) as folder:
        assert trial.run_trial(description, interface, folder, Limits()) == ""


@pytest.mark.parametrize("interface", ["Model Exchange", "Co-Simulation"])
def test_a_trial_makes_each_call_at_most_a_hundred_times(hostile_path, plan, interface):
    """So it takes what its process takes to start: an FMU that ends it at the next is sound."""
    description = read_description(hostile_path)
    with trial.unpacked(description, interface) as folder:
        for call in [*CALLS[1:], "fmi2CompletedIntegratorStep", "fmi2DoStep"]:
            plan(f"exit {call} 101")
            assert trial.run_trial(description, interface, folder, Limits()) == "", call


# --- the check ---

QUICK = Limits(processor=1.0, answer=60.0)


def test_a_call_that_returns_at_first_and_then_not_is_named_by_its_check(hostile_path, plan):
    plan("spin fmi2Instantiate 30")
    findings = {finding.name: finding for finding in check(hostile_path, 60, QUICK)}
    finding = findings["instantiations"]
    assert finding.passed is False
    assert re.search(
        r"^the FMU did not return from a call within 1 s of processor time after 2\d instances$",
        finding.reason,
    )
    assert findings["rollback"].passed


def test_a_process_that_ends_well_before_its_time_is_a_failure(hostile_path, plan):
    plan("exit fmi2Instantiate 30")
    findings = {finding.name: finding for finding in check(hostile_path, 60, QUICK)}
    reason = "the FMU ended the process with exit status 0 after"
    assert findings["instantiations"].passed is False
    assert findings["instantiations"].reason.startswith(reason)


def test_the_check_shows_what_it_finds_as_it_goes_and_what_an_unfit_fmu_would_do_for(
    hostile_path, plan, capsys
):
    plan("exit fmi2SerializedFMUstateSize 1")
    assert main(["fmu", "check", str(hostile_path), "--instantiations", "5"]) == 1
    printed = capsys.readouterr().out
    assert "FAILED" in printed
    assert "observers on recordings: it would do" in printed
    assert "tools that roll back: no, for serialised rollback" in printed


def test_an_fmu_that_does_not_answer_is_neither_fit_nor_unfit(
    hostile_path, tmp_path, plan, monkeypatch, capsys
):
    plan(f"wait {CALL} 1")
    monkeypatch.setenv("WORKBENCH_TRIAL", "answer=1")
    assert main(["fmu", "check", str(hostile_path)]) == 3
    assert "evil.fmu (WheelsetRig.MinimalObserver): not measured" in capsys.readouterr().out
    assert main(["fmu", "check", str(hostile_path), "--json"]) == 3
    assert json.loads(capsys.readouterr().out)["result"]["fit"] is None
