"""`workbench next`: the experiment that tells apart what a diagnosis could not."""

import argparse
import json
from importlib.metadata import version
from pathlib import Path
from typing import Any

from workbench.cli.extras import require_compiler
from workbench.cli.output import CommandResult, Output, read_result
from workbench.diagnosis.inference.rivals import Rivals, read_rivals
from workbench.errors import InputError
from workbench.pages.provenance import run_of
from workbench.runtime.engine import Engine
from workbench.runtime.files import locked_folder, read_text
from workbench.studies.design import next_stop
from workbench.studies.design.report import write_next_stop
from workbench.system.registry import load_system

_SUMMARY = "summary.json"


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Rank the experiments that a system allows."""
    file = options.result / _SUMMARY
    summary = _read(file)
    rivals = _rivals(summary, file)
    system = load_system(options.system or str(summary["provenance"]["system"]))
    require_compiler()
    with locked_folder(options.out):
        found = next_stop(system, rivals, Engine(options.workers, output.stage))
        provenance = {
            "run": run_of("next", system, {"diagnosis": file}),
            "workbench": version("wheelset-workbench"),
            "system": system.name,
            "diagnosis": str(options.result),
        }
        page = write_next_stop(found, provenance, options.out)
    output.stage("done")
    output.result(found.summary())
    output.result(f"to read: {page}, data and figure beside it")
    return CommandResult(
        read_result(options.out / "next.json"), {"duration": "s", "every": "s"}, page=page
    )


def _read(file: Path) -> dict[str, Any]:
    """The summary of a diagnosis."""
    remedy = "give the folder that 'workbench diagnose' wrote, as it wrote it"
    text = read_text(file, remedy)
    try:
        summary = json.loads(text)
        if summary["verdict"] not in ("nothing", "found", "unexplained"):
            raise KeyError("verdict")
        str(summary["provenance"]["system"])
    except (ValueError, KeyError, TypeError, RecursionError):
        raise _strange(file, remedy) from None
    found: dict[str, Any] = summary
    return found


def _rivals(summary: dict[str, Any], file: Path) -> Rivals:
    """What it left undecided."""
    if summary["verdict"] != "found":
        raise InputError(
            where=str(file),
            found=f"the verdict '{summary['verdict']}'",
            expected="a cause that was found, whose rivals or size are to be told better",
            remedy="diagnose more recordings first",
        )
    try:
        return read_rivals(summary["rivals"])
    except (KeyError, TypeError, ValueError):
        raise _strange(file, "diagnose the recordings anew with this version") from None


def _strange(file: Path, remedy: str) -> InputError:
    return InputError(
        where=str(file),
        found="no summary of a diagnosis with its rivals",
        expected="what 'workbench diagnose' writes",
        remedy=remedy,
    )
