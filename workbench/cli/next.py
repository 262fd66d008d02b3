"""`workbench next`: the experiment that tells apart what a diagnosis could not."""

from __future__ import annotations

import argparse
import json
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.cli.arguments import Commands, add_out, add_run
from workbench.cli.extras import require_compiler
from workbench.cli.output import CommandResult, Output, read_result
from workbench.errors import InputError
from workbench.runtime.engine import Engine
from workbench.runtime.files import locked_folder, read_text

if TYPE_CHECKING:
    from workbench.diagnosis.inference.rivals import Rivals


_SUMMARY = "summary.json"

WORKERS_NEED = ("workbench.studies.design",)


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "next",
        help=text,
        description="Say which recording to make next: of all experiments that the system file "
        "allows, those that part best the causes which a diagnosis could not tell apart; or, of a "
        "single cause, that make its size most sure. Three are proposed, with the separation that "
        "is left when every model is fitted again, the chance that the right cause is then named, "
        "and the cost. Writes next.json, experiments.csv (all that were tried) and a figure of "
        "the responses. Needs the extra [compiler].",
        epilog="examples:\n"
        "  python -m workbench diagnose my_recordings --out results/mine\n"
        "  python -m workbench next results/mine\n"
        "  python -m workbench next results/mine --system my_machine --out results/mine_next",
    )
    parser.add_argument(
        "result", type=Path, metavar="RESULT", help="folder of a diagnosis, with summary.json"
    )
    parser.add_argument(
        "--system",
        default="",
        metavar="NAME|FILE",
        help="an installed system, or a system file (default: that of the diagnosis, by its name)",
    )
    add_out(parser, "results/next")
    add_run(parser)
    return parser


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Rank the experiments that a system allows."""
    from workbench.pages.provenance import run_of
    from workbench.studies.design import next_stop
    from workbench.studies.design.report import write_next_stop
    from workbench.system.registry import load_system

    file = options.result / _SUMMARY
    summary = _read(file)
    rivals = _rivals(summary, file)
    system = load_system(options.system or str(summary["provenance"]["system"]))
    require_compiler()
    with locked_folder(options.out):
        proposed = next_stop(system, rivals, Engine(options.workers, output.stage))
        provenance = {
            "run": run_of("next", system, {"diagnosis": file}),
            "workbench": version("wheelset-workbench"),
            "system": system.name,
            "diagnosis": str(options.result),
        }
        page = write_next_stop(proposed, provenance, options.out)
    output.stage("done")
    output.result(proposed.summary())
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
        if summary["verdict"] not in ("nothing", "found", "partly explained", "unexplained"):
            raise KeyError("verdict")
        str(summary["provenance"]["system"])
    except (ValueError, KeyError, TypeError, RecursionError):
        raise _strange(file, remedy) from None
    found: dict[str, Any] = summary
    return found


def _rivals(summary: dict[str, Any], file: Path) -> Rivals:
    """What it left undecided."""
    from workbench.diagnosis.inference.rivals import read_rivals

    if summary["verdict"] not in ("found", "partly explained"):
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
