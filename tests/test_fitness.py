"""The check of FMUs: our own is fit, and each deliberate fault is named by its own finding."""

import json
import re
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from workbench.__main__ import main
from workbench.errors import InputError
from workbench.models.checks import CheckResult, check, is_fit
from workbench.models.fmu import FMU
from workbench.observers import estimators_of
from workbench.observers.gains import usual_gains
from workbench.observers.replay import replay
from workbench.runtime.supervision import Limits

from .edits import replaced
from .hostile_fmus import compile_library, rewritten
from .processes import needs_compiler

NAME = "MinimalObserver"

# Enough for a fault that comes with the 40th instance.
FEW = 60

CRASH = "*(volatile int *)0 = 1;"

# The finding that names a fault; a line of the FMU's sources/instance.c; what stands there instead.
FAULTS = {
    "reset keeps values": (
        "reset and replay",
        "memcpy(s->value, model_start, (NX + NU + NP) * sizeof *s->value);",
        "if (s->value[NX + NU] == 0.0) "
        "memcpy(s->value, model_start, (NX + NU + NP) * sizeof *s->value);",
    ),
    "set states are ignored": (
        "state injection",
        "return status == STATUS_OK ? set_columns(i, 0, NX, x) : status;",
        "return status;",
    ),
    "derivatives count calls at one time": (
        "function of states",
        "        xdot[k] = source[k];\n    }\n    return STATUS_OK;",
        "        xdot[k] = source[k];\n    }\n"
        "    static double at = -1.0;\n    static int calls;\n"
        "    calls = i->state.time == at ? calls + 1 : 0;\n    at = i->state.time;\n"
        "    xdot[0] *= 1.0 + 0.01 * calls;\n    return STATUS_OK;",
    ),
    "rollback forgets a state": (
        "rollback",
        "    i->state = *s;",
        "    const double kept = i->state.value[1];\n    i->state = *s;\n"
        "    if (s->kind == MODEL_EXCHANGE) i->state.value[1] = kept;",
    ),
    "rollback forgets the integrator's step": (
        "rollback in Co-Simulation",
        "    i->state = *s;",
        "    i->state = *s;\n    if (s->kind == CO_SIMULATION) i->state.memory.step = 0.0;",
    ),
    "serialised bytes forget an input": (
        "serialised rollback",
        "    return store(i, &state, saved);",
        "    state.value[NX + 1] = 0.0;\n    return store(i, &state, saved);",
    ),
    "directional derivative has the wrong sign": (
        "directional derivatives",
        "sensitivity[k] = i->work[place];",
        "sensitivity[k] = -i->work[place];",
    ),
    "Co-Simulation drifts": (
        "Co-Simulation against Model Exchange",
        "case OUTCOME_REACHED:",
        "case OUTCOME_REACHED: s->value[1] *= 1.001;",
    ),
    "40th instance crashes": (
        "instantiations",
        "    instance_reset(i);\n    return i;",
        f"    static int count;\n    if (++count == 40) {CRASH}\n"
        "    instance_reset(i);\n    return i;",
    ),
    "40th load crashes": (
        "loads of the library",
        '#include "instance.h"',
        '#include "instance.h"\n#include <stdlib.h>\n#include <stdio.h>\n'
        "__attribute__((constructor)) static void count_loads(void) {\n"
        '    char text[16];\n    const char *const before = getenv("LOADS_OF_FAULTY_FMU");\n'
        "    const int loads = before ? atoi(before) + 1 : 1;\n"
        f"    if (loads == 40) {CRASH}\n"
        '    snprintf(text, sizeof text, "%d", loads);\n'
        '    setenv("LOADS_OF_FAULTY_FMU", text, 1);\n}',
    ),
    "instances cannot be freed": ("start", "        i->importer.release(i);", CRASH),
    "directional derivative takes 6 ms": (
        "time of states and step",
        "    if (knowns == 1 && known != NULL && seed != NULL) {",
        "    usleep(6000);\n    if (knowns == 1 && known != NULL && seed != NULL) {",
    ),
}
HANGS = (
    "    const double *const source = status == STATUS_OK ? derivatives(i) : NULL;",
    "    const double *const source = NULL;\n    for (;;) {}",
)
LEAKS = (
    "    i->importer = *importer;",
    "    i->importer = *importer;\n    memset(importer->allocate(1, 20000), 1, 20000);",
)


def faulty(original: Path, path: Path, old: str, new: str) -> Path:
    """Copy of an FMU with a fault in its runtime."""

    def change(folder: Path) -> None:
        source = folder / "sources" / "instance.c"
        # The adjoint begins as the directional derivative does, but comes after it.
        text = replaced(source.read_text(), (old, new))
        source.write_text(f"#include <unistd.h>\n{text}")
        compile_library(folder, NAME)

    return rewritten(original, path, change)


def failed(findings: Iterable[CheckResult]) -> list[str]:
    return [finding.name for finding in findings if finding.passed is False]


def by_name(findings: Iterable[CheckResult], name: str) -> CheckResult:
    return next(finding for finding in findings if finding.name == name)


@pytest.mark.parametrize("version", ["fmi2", "fmi3"])
def test_own_fmu_is_fit_in_every_respect(root, version):
    path = root / "fmus" / version / f"{NAME}.fmu"
    if not path.exists():
        pytest.skip(f"no {path.name} of {version}")
    findings = check(path, 500)
    assert [(f.name, f.reason) for f in findings if not f.passed] == []
    assert is_fit(findings)
    assert by_name(findings, "instantiations").value == 500
    assert by_name(findings, "loads of the library").value == 500


@needs_compiler
@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_named_by_its_own_finding(fault, minimal_path, tmp_path):
    name, old, new = FAULTS[fault]
    findings = check(faulty(minimal_path, tmp_path / "faulty.fmu", old, new), FEW)
    assert failed(findings) == [name]
    assert not is_fit(findings)
    assert len(by_name(findings, name).reason.split()) > 3


@needs_compiler
def test_crash_is_named_by_its_signal_and_the_instances_before_and_leaves_no_files(
    minimal_path, tmp_path, monkeypatch
):
    _, old, new = FAULTS["40th instance crashes"]
    path = faulty(minimal_path, tmp_path / "faulty.fmu", old, new)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    findings = check(path, FEW)
    assert list(scratch.iterdir()) == []
    finding = by_name(findings, "instantiations")
    # The first instance is made before the counting starts.
    assert finding.value == 38
    assert finding.reason == "the FMU crashed with SIGSEGV after 38 instances"
    assert "not measured" in by_name(findings, "memory growth").reason


@needs_compiler
def test_wrong_derivative_is_named_with_both_values(minimal_path, tmp_path):
    name, old, new = FAULTS["directional derivative has the wrong sign"]
    reason = by_name(check(faulty(minimal_path, tmp_path / "faulty.fmu", old, new), 1), name).reason
    slopes = re.search(r"is (\S+) by the FMU, (\S+) by differences", reason)
    # Six digits are printed.
    assert float(slopes[1]) == pytest.approx(-float(slopes[2]), rel=1e-4)


@needs_compiler
def test_an_fmu_with_wrong_derivatives_is_differentiated_by_differences(minimal_path, tmp_path):
    """Its own would be wrong steps of each estimator, and nothing in the results would show it."""
    _, old, new = FAULTS["directional derivative has the wrong sign"]
    with (
        FMU(faulty(minimal_path, tmp_path / "faulty.fmu", old, new)) as wrong,
        FMU(rewritten(minimal_path, tmp_path / "right.fmu", lambda folder: None)) as right,
    ):
        assert not wrong.has_directional_derivatives
        assert right.has_directional_derivatives
        for fmu in (wrong, right):
            fmu.start({})
        # Central differences, whose steps are 6e-6 of a value.
        assert_allclose(wrong.state_jacobian(), right.state_jacobian(), rtol=1e-5, atol=1e-6)


@needs_compiler
@pytest.mark.parametrize(
    "product", ["(i->state.time > 1.0 ? 0.9 : 1.0)", "(i->state.value[0] < 60.0)"]
)
def test_derivatives_that_are_wrong_along_a_recording_alone_are_not_used(
    product, minimal_path, tmp_path, system, dry_case
):
    """By the time or by a state: where the model starts they are right."""
    line = "    /* One column of all derivatives"
    fault = f"const double scaled = seed[0] * {product};\n    seed = &scaled;\n"
    path = faulty(minimal_path, tmp_path / "faulty.fmu", line, fault + line)
    with FMU(path) as wrong, FMU(minimal_path) as right:
        assert wrong.has_directional_derivatives
        right.has_directional_derivatives = False
        runs = [
            replay(dry_case, ekf(fmu, system, usual_gains(ekf, fmu, system)))
            for ekf in [estimators_of(system)["ekf"]]
            for fmu in (wrong, right)
        ]
        assert not wrong.has_directional_derivatives
    assert_array_equal(*(run.estimate for run in runs))
    with FMU(path) as again:
        assert not again.has_directional_derivatives


@needs_compiler
def test_leak_is_named_by_memory_growth(minimal_path, tmp_path):
    findings = check(faulty(minimal_path, tmp_path / "faulty.fmu", *LEAKS), 500)
    assert failed(findings) == ["memory growth"]
    # 20 kB each: 20 MB in 1000, and whole pages.
    assert by_name(findings, "memory growth").value == pytest.approx(20.0, rel=0.2)


@needs_compiler
def test_call_that_hangs_is_stopped(minimal_path, tmp_path):
    path = faulty(minimal_path, tmp_path / "faulty.fmu", *HANGS)
    findings = check(path, FEW, Limits(processor=1.0, answer=60.0))
    assert failed(findings) == ["start"]
    reason = by_name(findings, "start").reason
    assert re.search(r"did not return from fmi2\w+ within \d\.\d s of processor time", reason)
    assert by_name(findings, "rollback").reason == "not tried: needs 'start'"


def test_what_an_fmu_does_not_offer_is_not_applicable(minimal_path, tmp_path):
    def restrict(folder: Path) -> None:
        file = folder / "modelDescription.xml"
        text = re.sub(r"<CoSimulation.*</CoSimulation>", "", file.read_text(), flags=re.DOTALL)
        for flag in ("canSerializeFMUstate", "providesDirectionalDerivative"):
            text = text.replace(f'{flag}="true"', "")
        file.write_text(text)

    findings = check(rewritten(minimal_path, tmp_path / "bare.fmu", restrict), FEW)
    reasons = {f.name: f.reason for f in findings if f.passed is None}
    assert is_fit(findings)
    assert reasons == {
        "serialised rollback": "not tried: the FMU does not serialise its state "
        "(canSerializeFMUState)",
        "rollback in Co-Simulation": "not tried: the FMU has no Co-Simulation",
        "directional derivatives": "not tried: the FMU offers none; Jacobians are differences, "
        "which take more calls",
        "Co-Simulation against Model Exchange": "not tried: the FMU has no Co-Simulation",
        "memory growth": "not tried: shows from 500 instantiations on",
    }


@pytest.fixture
def co_simulation_only(minimal_path, tmp_path) -> Path:
    def restrict(folder: Path) -> None:
        file = folder / "modelDescription.xml"
        text = file.read_text()
        file.write_text(re.sub(r"<ModelExchange.*</ModelExchange>", "", text, flags=re.DOTALL))

    return rewritten(minimal_path, tmp_path / "slave.fmu", restrict)


def test_fmu_without_model_exchange_is_refused(co_simulation_only):
    with pytest.raises(InputError, match=r"Co-Simulation only; expected Model Exchange"):
        check(co_simulation_only)


def test_command_describes_an_fmu_without_model_exchange(co_simulation_only, capsys):
    assert main(["fmu", "info", str(co_simulation_only)]) == 0
    printed = capsys.readouterr().out
    assert "Co-Simulation: saves state" in printed
    assert "Model Exchange" not in printed
    assert re.search(r"^pB +input +0\.0 +Pa +Brake cylinder pressure$", printed, re.MULTILINE)


def test_command_tells_programs_what_it_describes(minimal_path, capsys):
    assert main(["fmu", "info", str(minimal_path), "--json"]) == 0
    written = json.loads(capsys.readouterr().out)["result"]
    with FMU(minimal_path) as fmu:
        assert written["sha256"] == fmu.sha256
        assert written["states"] == list(fmu.states)
        assert {v["name"]: v["unit"] for v in written["variables"]} == fmu.units


def test_command_tells_findings_and_ends_with_0_for_a_fit_fmu(minimal_path, capsys):
    arguments = ["fmu", "check", str(minimal_path), "--instantiations", "5"]
    assert main([*arguments, "--json"]) == 0
    written = json.loads(capsys.readouterr().out)["result"]
    assert written["fit"] is True
    assert written["fmu"]["fmi"] == "2.0"
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    assert all(finding["name"] in printed for finding in written["findings"])


@needs_compiler
def test_command_gives_the_reason_and_ends_with_1_for_an_unfit_fmu(minimal_path, tmp_path, capsys):
    _, old, new = FAULTS["set states are ignored"]
    path = faulty(minimal_path, tmp_path / "faulty.fmu", old, new)
    assert main(["fmu", "check", str(path), "--instantiations", "5"]) == 1
    printed = capsys.readouterr().out
    assert "'omegaW' was set, but the FMU returns another state" in printed
    assert "not fit" in printed


def test_command_ends_with_2_for_a_wrong_file(co_simulation_only, capsys):
    assert main(["fmu", "check", str(co_simulation_only)]) == 2
    assert main(["fmu", "check", __file__]) == 2
    assert "no FMU" in capsys.readouterr().err


def test_state_serialised_by_one_instance_continues_in_another(minimal_path):
    with FMU(minimal_path) as first, FMU(minimal_path) as other:
        first.start({"omegaW": 60.0, "omegaR": 39.5})
        first.set(first.variables(["pB"]), np.array([3.6e5]))
        saved = first.save()
        data = first.serialise(saved)
        first.release(saved)
        other.start({})
        restored = other.deserialise(data)
        other.restore(restored)
        other.release(restored)
        assert_array_equal(other.step(0.01), first.step(0.01))
        assert other.get_states()[0] < 60.0


@pytest.mark.parametrize("reload", [False, True])
def test_renewed_instance_starts_as_the_first_did(minimal, reload):
    minimal.start({"omegaW": 60.0, "omegaR": 39.5})
    first = minimal.step(0.01)
    minimal.renew(reload=reload)
    minimal.start({"omegaW": 60.0, "omegaR": 39.5})
    assert_array_equal(minimal.step(0.01), first)
