"""`workbench next`: the experiment that tells apart what a diagnosis could not."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from workbench.cli.arguments import Commands, add_out, add_run
from workbench.cli.extras import require_compiler
from workbench.cli.output import CommandResult, Output, read_result
from workbench.errors import InputError
from workbench.runtime.engine import Engine
from workbench.runtime.files import locked_folder, parse_table, read_text
from workbench.runtime.resources import own_version

if TYPE_CHECKING:
    from workbench.diagnosis.inference.rivals import Rivals


WORKERS_NEED = ("workbench.studies.design", "workbench.models.loops_ready", "scipy.signal")


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "next",
        help=text,
        description="Recommend the next experiment, of all that the system file allows: the one "
        "that best discriminates between the candidates of a diagnosis. For a single "
        "effect, the one that makes its size most precise. Three are proposed, with "
        "the separation of the refitted models, the chance that the right effect is "
        "then named, and the cost. Writes next.json, experiments.csv (all that were "
        "tried) and a figure of "
        "the responses. Needs the extra [compiler].",
        epilog="examples:\n"
        "  workbench diagnose my_recordings --out results/mine\n"
        "  workbench next results/mine\n"
        "  workbench next results/mine --system my_machine --out results/mine_next",
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

    file = options.result / "summary.json"
    diagnosed, rivals = _read_rivals(file)
    system = load_system(options.system or diagnosed)
    require_compiler()
    with locked_folder(options.out):
        proposal = next_stop(system, rivals, Engine(options.workers, output.stage))
        provenance = {
            "run": run_of("next", system, {"diagnosis": file}),
            "workbench": own_version(),
            "system": system.name,
            "diagnosis": str(options.result),
        }
        page = write_next_stop(proposal, provenance, options.out)
    output.stage("done")
    output.result(proposal.summary())
    output.result(f"to read: {page}, data and figure beside it")
    return CommandResult(
        read_result(options.out / "next.json"), {"duration": "s", "every": "s"}, page=page
    )


def _read_rivals(file: Path) -> tuple[str, Rivals]:
    from workbench.diagnosis.inference.rivals import read_rivals

    remedy = "give the folder that 'workbench diagnose' wrote, as it wrote it"
    text = read_text(file, remedy)
    try:
        summary = parse_table(text)
        verdict, system = summary["verdict"], summary["provenance"]["system"]
        if not isinstance(system, str) or not isinstance(verdict, str):
            raise KeyError("provenance")
        if verdict in ("found", "partly explained"):
            remedy = "diagnose the recordings anew with this version"
            return system, read_rivals(summary["rivals"])
        if verdict not in ("nothing", "unexplained"):
            raise KeyError("verdict")
    except (AttributeError, LookupError, OverflowError, RecursionError, TypeError, ValueError):
        raise InputError(
            where=str(file),
            found="no summary of a diagnosis with its candidates",
            expected="what 'workbench diagnose' writes",
            remedy=remedy,
        ) from None
    raise InputError(
        where=str(file),
        found=f"the verdict '{verdict}'",
        expected="a named effect, whose candidates or size need another recording",
        remedy="diagnose more recordings first",
    )
