"""`workbench check`: whether a library of effects is fit for a diagnosis."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from workbench.cli.arguments import Commands, add_recording_options
from workbench.cli.extras import require_compiler
from workbench.cli.output import CommandResult, Output
from workbench.system.units import with_unit

if TYPE_CHECKING:
    from workbench.studies.library_check import EffectResult


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "check",
        help=text,
        description="Check a system's library of effects. Simulate the models of its package Tests "
        "with their asserts. Compare the model with all effects at zero with the nominal one. Run "
        "each effect at the size that matters, and show the output that it changes most. Needs the "
        "extra [compiler]. Exit status: 0 sound, 1 something is wrong.",
        epilog="examples:\n"
        "  workbench check my_machine\n"
        "  workbench check cascaded_tanks my_recordings/morning --json",
    )
    parser.add_argument("system", metavar="SYSTEM", help="a system: its name, file or folder")
    parser.add_argument(
        "cases",
        nargs="*",
        type=Path,
        metavar="CASE",
        help="recordings whose inputs drive the effects (default: the system's)",
    )
    add_recording_options(parser)
    return parser


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Check the library of a system."""
    from workbench.cli.inputs import given_cases
    from workbench.studies.library_check import check_library
    from workbench.system.registry import load_system

    require_compiler()
    system = load_system(options.system)
    checked = check_library(system, given_cases(options, system), output.stage)
    for claim in checked.claims:
        output.result(f"{'FAILED' if claim.failures else 'holds ':<7} claim {claim.name}")
        for failure in claim.failures:
            output.result(f"        {failure}")
    for effect in checked.effects:
        output.result(_line(effect))
    broken = sum(bool(claim.failures) for claim in checked.claims)
    unusable = sum(bool(effect.failure) for effect in checked.effects)
    output.result(
        f"{checked.library}: {broken} of {len(checked.claims)} claims fail, "
        f"{unusable} of {len(checked.effects)} effects cannot be used"
    )
    return CommandResult(asdict(checked), {}, 0 if checked.sound else 1)


def _line(effect: EffectResult) -> str:
    size = f"{effect.name} at {with_unit(effect.size, effect.unit)}"
    if effect.failure:
        return f"FAILED  effect {size}: {effect.failure}"
    if effect.doubt:
        return f"doubt   effect {size}: {effect.doubt}"
    change = f"changes {effect.signal} by {effect.change:.3g} times its noise"
    return f"shows   effect {size} {change} ({effect.case})"
