"""`workbench import`: files of recorders as case folders."""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from workbench.commands.arguments import nearby
from workbench.commands.inputs import read_condition, told
from workbench.commands.output import Done, Output
from workbench.conditions import UNKNOWN
from workbench.errors import InputError
from workbench.files import claimed
from workbench.foreign import RecordedFile, read_foreign
from workbench.importing import (
    IMPORTED,
    Import,
    case_name,
    describe,
    import_files,
    imported,
    store,
    write,
    write_record,
)
from workbench.importing.figure import draw_cuts
from workbench.mapping import (
    TIME,
    ProposedMapping,
    Told,
    listed,
    parse_named,
    propose,
    stored_columns,
    usable,
)
from workbench.system import System
from workbench.systems import load_system
from workbench.units import si_factor


def run(options: argparse.Namespace, output: Output) -> Done:
    """Import files, each by itself; what is refused leaves the others."""
    system = load_system(options.system)
    known = told(options, system)
    recordings = [options.files] if options.together else [[path] for path in options.files]
    refused: list[str] = []
    with claimed(options.out):
        record = imported(options.out)
        for paths in recordings:
            try:
                record = _one(paths, record, system, known, options, output)
            except InputError as error:
                print(f"error: {error}", file=sys.stderr, flush=True)
                refused.append(str(error))
    if len(refused) < len(recordings):
        output.result(f"see {IMPORTED} in {nearby(options.out)}")
        output.result(f"next: workbench simulate --system {options.system} {nearby(options.out)}")
    told_all = {"out": options.out, "imports": record, "refused": refused}
    return Done(told_all, {"begins": "s", "ends": "s", "seconds": "s"}, 2 if refused else 0)


def _one(
    paths: Sequence[Path],
    record: list[dict[str, Any]],
    system: System,
    known: Told,
    options: argparse.Namespace,
    output: Output,
) -> list[dict[str, Any]]:
    """Import what is one recording; returns what is imported by now."""
    files = [read_foreign(path) for path in paths]
    stored = stored_columns(options.out, system)
    told_by_now = replace(known, columns={**usable(stored, files), **known.columns})
    proposal, conditions = _confirmed(files, told_by_now, system, options.yes, output)
    hashes = [one.sha256 for one in files]
    others = [one for one in record if [file["sha256"] for file in one["files"]] != hashes]
    name = _free_name(paths[0], others)
    one = import_files(name, files, proposal, system, conditions, whole=options.whole)
    write(one, options.out, system)
    store(options.out, {**stored, **proposal.named})
    if len(one.parts) > 1:
        draw_cuts(one, name, system, options.out)
    _tell(one, output)
    by_now = [*others, describe(one, system)]
    write_record(options.out, system, by_now)
    return by_now


def _free_name(path: Path, others: Sequence[Mapping[str, Any]]) -> str:
    """Name of a case that no other file has taken."""
    taken = {case for one in others for case in one["cases"]}
    name = case_name(path)
    if all(case.removeprefix(case[:3]) != name and case != name for case in taken):
        return name
    return f"{name}_{path.suffix[1:] or 'file'}"


def _confirmed(
    files: Sequence[RecordedFile], known: Told, system: System, yes: bool, output: Output
) -> tuple[ProposedMapping, dict[str, Any]]:
    """Channels and conditions, after one question at most.

    Raises
    ------
    InputError
        If they are not confirmed, or something is missing.
    """
    proposal = propose(files, system, known.columns, known.step)
    output.result(_shown(files, proposal, system))
    conditions = dict(known.conditions)
    if proposal.certain:
        return proposal, conditions
    if yes or output.json:  # a program is asked nothing
        return _complete(files, proposal, proposal.doubts), conditions
    columns = dict(known.columns)
    for answer in _answers(files, proposal):
        if answer.partition("=")[0].strip() in (TIME, *system.signals):
            signal, channel = parse_named(answer, "answer", system)
            columns[signal] = channel
        else:
            name, value = read_condition(answer, system)
            conditions[name] = value
    proposal = propose(files, system, columns, known.step)
    return _complete(files, proposal, []), conditions


def _answers(files: Sequence[RecordedFile], proposal: ProposedMapping) -> list[str]:
    """What the user answers to a proposal: nothing, or corrections."""
    taken = "name what is missing" if proposal.problems else "Enter takes this"
    print(f"{taken}; correct with 'SIGNAL=CHANNEL [unit]; CONDITION=VALUE'; n refuses: ", end="")
    try:
        answer = input().strip()
    except EOFError:
        print()
        answer = "n"
    if answer.casefold() in ("n", "no"):
        raise InputError(
            where=", ".join(str(one.path) for one in files),
            found="channels that nobody confirmed",
            expected="an answer, or --yes",
            remedy="answer, or name channels with --column, and take the rest with --yes",
        )
    return [part.strip() for part in answer.split(";") if part.strip()]


def _complete(
    files: Sequence[RecordedFile], proposal: ProposedMapping, doubts: Sequence[str]
) -> ProposedMapping:
    """The proposal, if all that is needed has a channel.

    Raises
    ------
    InputError
        If something has none.
    """
    if problems := [*proposal.problems, *doubts]:
        raise InputError(
            where=", ".join(str(one.path) for one in files),
            found="; ".join(problems),
            expected="a channel for each signal that the system needs",
            remedy="name it, --column 'SIGNAL=CHANNEL [unit]'"
            + (f", of {listed(proposal.left)}" if proposal.left else ""),
        )
    return proposal


def _shown(files: Sequence[RecordedFile], proposal: ProposedMapping, system: System) -> str:
    """What a file is and what its channels are taken for, a line each."""
    lines = [f"{one.path}: {one.kind}" for one in files]
    for clock in proposal.clocks.values():
        held = clock.times[np.isfinite(clock.times)]
        channel = f"{clock.channel} [{clock.unit}]" if clock.channel else "-"
        steps = f"{held.size} samples, every {float(np.median(np.diff(held))):.4g} s"
        lines.append(f"  {TIME:<10} {channel:<28} {steps} ({clock.reason})")
    for name, one in proposal.assigned.items():
        signal = system.signals[name]
        scale = si_factor(signal.shown, signal.unit, name)
        low, high = np.nanmin(one.values) / scale, np.nanmax(one.values) / scale
        via = f" = {one.formula}" if one.formula else ""
        channel = f"{one.label} [{one.unit}]{via}"
        lines.append(
            f"  {name:<10} {channel:<28} {signal.label}, {low:.4g} to {high:.4g} {signal.shown} "
            f"({one.reason})"
        )
    lines += [f"  ? {one}" for one in (*proposal.problems, *proposal.unmatched)]
    if proposal.left:
        lines.append(f"  left out   {listed(proposal.left)}")
    return "\n".join(lines)


def _tell(one: Import, output: Output) -> None:
    """Say what was written, what nobody knows, and what is unlikely."""
    for doubt in one.measured.doubts:
        print(f"warning: {doubt}", file=sys.stderr, flush=True)
    for piece in one.pieces:
        unknown = [key for key, source in piece.sources.items() if source == UNKNOWN]
        known = [f"{key} {value}" for key, value in piece.conditions.items() if key not in unknown]
        words = [f"{piece.time.size} samples, {piece.time[-1]:.4g} s", *known]
        words += [f"unknown: {', '.join(unknown)} (--condition says it)"] * bool(unknown)
        output.result(f"  {piece.name}: {'; '.join(words)}")
        for doubt in piece.doubts:
            print(f"warning: {doubt}", file=sys.stderr, flush=True)
