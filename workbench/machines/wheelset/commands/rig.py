"""`workbench rig`: recordings from the virtual rig."""

from __future__ import annotations

import argparse
import dataclasses
import json
import time
from collections.abc import Sequence
from concurrent.futures import as_completed
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.cli.arguments import (
    Commands,
    add_number,
    add_out,
    add_reference,
    add_repeated,
    add_seed,
    add_system,
    add_workers,
    positive,
)
from workbench.cli.output import CommandResult, Output
from workbench.errors import InputError
from workbench.runtime.files import locked_folder, write_whole
from workbench.runtime.pool import Pool
from workbench.system.plugins import find_plugin

if TYPE_CHECKING:
    from workbench.machines.wheelset.rig import Effects, Scenario
    from workbench.system.system import System

WORKERS_NEED = ("workbench.machines.wheelset.rig",)


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    rig = commands.add_parser(
        "rig",
        help=text,
        description="Make recordings by co-simulation of the multibody model with drive, brake, "
        "wheel-slide protection, pads and sensors. Each case folder also holds truth.csv and "
        "truth.json, which no estimator reads. The same seed gives the same bytes. With another "
        "--system, its own simulated rig makes a set, with truth.json beside it.",
        epilog="examples:\n"
        "  workbench rig --out /tmp/rig\n"
        "  workbench rig --list\n"
        "  workbench rig --case 15_locked_wheel --out /tmp/rig\n"
        "  workbench rig --pads constant --effect fx_gain=0.015 --seed 7 --out /tmp/rig\n"
        "  workbench rig --next results/next --out /tmp/rig\n"
        "  workbench rig --system train --effect 'pads[3]=0.15' --out /tmp/stops",
    )
    add_out(rig, "results/rig")
    rig.add_argument("--list", action="store_true", help="list scenarios and effects, and end")
    add_repeated(
        rig, "--case NAME", "scenario, may be repeated (default: the fourteen standard ones)"
    )
    rig.add_argument(
        "--next",
        type=Path,
        metavar="RESULT",
        help="make the best experiment of a result of 'workbench next' in place of scenarios",
    )
    add_seed(rig, "tolerances and noise")
    add_repeated(
        rig, "--effect NAME=VALUE", "inject an effect, or change one of the pads; may be repeated"
    )
    rig.add_argument(
        "--pads",
        choices=("ordinary", "constant"),
        default="ordinary",
        help="friction of dry pads: with speed, temperature and force, or constant as in the "
        "nominal model (default: %(default)s)",
    )
    add_number(rig, "--rate HZ", positive, 200, "of the recording, a divisor of 1000")
    add_number(rig, "--truth-every N", positive, 1, "write the truth of every Nth sample only")
    add_reference(rig, "that makes the recordings")
    add_system(rig)
    add_workers(rig)
    return rig


def _format_list() -> str:
    from workbench.machines.wheelset.rig import ORDINARY_PADS, SCENARIOS, STANDARD, Effects

    effects = "\n".join(
        f"  {field.name:<18} [{field.metadata['unit']}]".ljust(28) + field.metadata["text"]
        for field in dataclasses.fields(Effects)
    )
    pads = ", ".join(
        f"{name}={gain:g}" for name, gain in dataclasses.asdict(ORDINARY_PADS).items() if gain
    )
    scenarios = "\n".join(f"  {name:<26} {scenario.title}" for name, scenario in SCENARIOS.items())
    return f"""\
scenarios, of which the first {len(STANDARD)} are standard:
{scenarios}

effects, zero if not given:
{effects}
  phiW is the angle of the wheelset; phases are drawn for each stop.
  Ordinary pads have {pads}."""


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Make the recordings, or list what can be made."""
    from workbench.machines.wheelset import PLUGIN
    from workbench.machines.wheelset.rig import (
        CONSTANT_PADS,
        ORDINARY_PADS,
        SCENARIOS,
        Effects,
        plant,
        proposed_stop,
        select,
    )
    from workbench.system.registry import load_system

    system = load_system(options.system)
    if find_plugin(system.plugin) is not PLUGIN:
        return _of_another(options, output, system)
    if options.list:
        output.result(_format_list())
        return CommandResult(
            {
                "scenarios": {name: scenario.title for name, scenario in SCENARIOS.items()},
                "effects": {
                    field.name: dict(field.metadata) for field in dataclasses.fields(Effects)
                },
            }
        )
    scenarios = [proposed_stop(options.next, system)] if options.next else select(options.case)
    pads = ORDINARY_PADS if options.pads == "ordinary" else CONSTANT_PADS
    effects = plant(pads, options.effect)
    with locked_folder(options.out):
        return _make_recordings(options, output, system, scenarios, effects)


def _of_another(options: argparse.Namespace, output: Output, system: System) -> CommandResult:
    """Make a set of recordings of another machine by its plugin, or list what can be made.

    The injected effects stand in `truth.json` beside them, which nothing reads.
    """
    from workbench.studies.power.planting import assigned
    from workbench.studies.power.virtual_rig import open_virtual_rig

    own = {"next": None, "pads": "ordinary", "rate": 200, "truth_every": 1}
    for name, usual in own.items():
        if getattr(options, name) != usual:
            raise InputError(
                where=f"--{name.replace('_', '-')} {getattr(options, name)}",
                found="an option of the roller rig",
                expected=f"none of that of '{system.name}'",
                remedy="leave it out",
            )
    rig = open_virtual_rig(system, options.case, options.reference)
    known = {effect.name: effect for effect in rig.plantables}
    if options.list:
        recordings = "\n".join(f"  {name}" for name in rig.recordings)
        effects = "\n".join(
            f"  {f'{name} [{effect.unit}]':<28} {effect.effect}" for name, effect in known.items()
        )
        output.result(f"recordings:\n{recordings}\n\neffects, zero if not given:\n{effects}")
        named = {name: effect.effect for name, effect in known.items()}
        return CommandResult({"recordings": rig.recordings, "effects": named})
    gains = assigned(options.effect, known)
    rig.write(rig.simulate(options.seed, gains), gains, options.out)
    truth: dict[str, Any] = {
        "system": system.name,
        "seed": options.seed,
        "effects": [
            {"name": n, "effect": known[n].effect, "size": size, "unit": known[n].unit}
            for n, size in gains.items()
        ],
    }
    write_whole(options.out / "truth.json", json.dumps(truth, indent=1) + "\n")
    count = len(rig.recordings)
    output.result(f"{count} recordings in {options.out}")
    return CommandResult({"out": options.out, "cases": count, "of": count})


def _make_recordings(
    options: argparse.Namespace,
    output: Output,
    system: System,
    scenarios: Sequence[Scenario],
    effects: Effects,
) -> CommandResult:
    from workbench.machines.wheelset.rig import check_files
    from workbench.models.fmu import CoSimulation
    from workbench.system.registry import model_path
    from workbench.system.system import REFERENCE

    check_files([options.out / scenario.name for scenario in scenarios], options.rate)
    fmu = options.reference or model_path(system, REFERENCE)
    with CoSimulation(fmu):
        pass  # a file that is no FMU is refused here, once
    begin = time.perf_counter()
    interrupted = False
    setup = _Setup(effects, options.seed, options.rate, options.truth_every, fmu, options.out)
    # A stop that is under way at Ctrl-C is finished and kept, in a process even if it is alone.
    workers = min(options.workers, len(scenarios))
    with Pool(workers, nullcontext, setup, isolated=True) as pool:
        tasks = [pool.submit(_make, scenario) for scenario in scenarios]
        try:
            for count, task in enumerate(as_completed(tasks), 1):
                output.step(count, len(tasks), task.result(), begin)
        except KeyboardInterrupt:
            interrupted = True
            pool.finish()
    kept = sum(task.done() and not task.cancelled() for task in tasks)
    output.result(f"{kept} of {len(tasks)} cases in {options.out}")
    status = 130 if interrupted else 0
    return CommandResult({"out": options.out, "cases": kept, "of": len(tasks)}, status=status)


@dataclass(frozen=True)
class _Setup:
    """How scenarios are made; see `simulate` and `write_recording`."""

    effects: Effects
    seed: int
    rate: int
    truth_every: int
    fmu: Path
    out: Path


def _make(setup: _Setup, scenario: Scenario) -> str:
    """Make and write one case; returns a line for people."""
    from workbench.machines.wheelset.rig import simulate, write_recording

    stop = simulate(scenario, setup.seed, setup.effects, setup.fmu)
    folder = setup.out / scenario.name
    write_recording(stop, setup.effects, setup.rate, folder, setup.truth_every)
    seconds = stop.standstill - stop.drawn.coasting
    return f"{scenario.name:<26} stopped in {seconds:5.1f} s"
