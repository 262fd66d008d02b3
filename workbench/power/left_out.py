"""What is proposed for a cause that the catalogue lacks: each effect left out in turn."""

import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from workbench.case import read_cases
from workbench.diagnosis import Effect, diagnose
from workbench.modelica import Library
from workbench.power.planting import Group, Planting
from workbench.power.virtual_rig import VirtualRig
from workbench.proposing import Proposal, needs_law, propose
from workbench.system import System


def propose_left_out(
    groups: Sequence[Group],
    system: System,
    library: Library,
    rig: VirtualRig,
    effects: Sequence[Effect],
    *,
    workers: int,
    report: Callable[[str], None],
) -> tuple[list[dict[str, Any]], bool]:
    """Make sets with one cause each, and diagnose them with a catalogue that lacks it.

    Parameters
    ----------
    groups : as planned; of each the first set is made, if it has one cause or none.
    effects : of the library.
    report : takes a line on what is being done.

    Returns
    -------
    rows : one for each set, as they are written to left_out.json.
    interrupted : whether Ctrl-C ended the run; what was finished is in the rows.
    """
    sets = [group[0] for group in groups if group[0].kind != "pair"]
    rows: list[dict[str, Any]] = []
    begin = time.perf_counter()
    try:
        for number, planting in enumerate(sets):
            rows.append(_row(planting, system, library, rig, effects, workers))
            left = (time.perf_counter() - begin) / (number + 1) * (len(sets) - number - 1)
            said = ", ".join(rows[-1]["laws"]) or f"{rows[-1]['verdict']}, nothing proposed"
            report(f"[{number + 1}/{len(sets)}] {planting.options}: {said}; {left:.0f} s left")
    except KeyboardInterrupt:
        return rows, True
    return rows, False


def _row(
    planting: Planting,
    system: System,
    library: Library,
    rig: VirtualRig,
    effects: Sequence[Effect],
    workers: int,
) -> dict[str, Any]:
    planted = [one for one in effects if one.name in planting.effects]
    others = [one for one in effects if one not in planted]
    row: dict[str, Any] = {
        "rig": planting.options,
        "left_out": [one.name for one in planted],
        "verdict": "failed",
        "named": [],
        "laws": [],
        "slots": [],
        "slot_right": None,
        "before": None,
        "after": None,
        "error": "",
    }
    try:
        with tempfile.TemporaryDirectory() as scratch:
            recordings, out = Path(scratch) / "recordings", Path(scratch) / "out"
            simulated = rig.simulate(planting.seed, planting.gains)
            rig.write(simulated, planting.gains, recordings)
            cases = read_cases([recordings], system)
            before = diagnose(system, cases, library, others, out, workers, _silent)
            row["verdict"] = before.diagnosis.verdict
            row["named"] = [cause.effect.name for cause in before.diagnosis.causes]
            if needs_law(before):
                row |= _told(propose(before, library, others, out, workers, _silent))
    except Exception as error:  # one set must not end a run of hours; it is counted
        row["error"] = repr(error)
    if planted:
        row["slot_right"] = bool({slot for one in planted for slot in one.slots} & {*row["slots"]})
    return row


def _told(found: Proposal) -> dict[str, Any]:
    """What is proposed; its slots are also those of laws that are as good."""
    laws = [one.law for one in found.forms.values()] if found.laws else []
    gain = found.outcome.diagnosis.gain if laws and found.outcome is not None else None
    return {
        "laws": [found.said(law) for law in found.laws],
        "slots": list(dict.fromkeys(law.place.slot.name for law in laws)),
        "before": None if gain is None else gain.before,
        "after": None if gain is None else gain.after,
    }


def _silent(line: str) -> None:
    """Progress of each set would hide that of all."""
