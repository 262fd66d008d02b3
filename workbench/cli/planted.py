"""Recordings of a machine whose plugin can inject effects: of `workbench rig`, any system."""

import argparse
import json
from typing import Any

from workbench.cli.output import CommandResult, Output
from workbench.runtime.files import write_whole
from workbench.studies.power.planting import assigned
from workbench.studies.power.virtual_rig import open_virtual_rig
from workbench.system.system import System


def make_planted(options: argparse.Namespace, output: Output, system: System) -> CommandResult:
    """Make a set of recordings of one machine, or list what can be made.

    What is planted stands in `truth.json` beside them, which nothing reads.

    Raises
    ------
    InputError
        If the system has no virtual rig, or that cannot do what is asked.
    """
    rig = open_virtual_rig(system, options.case, options.reference)
    known = {plantable.name: plantable for plantable in rig.plantables}
    if options.list:
        recordings = "\n".join(f"  {name}" for name in rig.recordings)
        effects = "\n".join(
            f"  {f'{n} [{plantable.unit}]':<28} {plantable.effect}"
            for n, plantable in known.items()
        )
        output.result(f"recordings:\n{recordings}\n\neffects, zero if not given:\n{effects}")
        return CommandResult(
            {"recordings": rig.recordings, "effects": {n: known[n].effect for n in known}}
        )
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
