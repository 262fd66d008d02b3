"""Show the channels that are proposed for files, and ask to confirm them, once."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from workbench.cli.inputs import read_condition
from workbench.cli.output import Output
from workbench.errors import InputError
from workbench.recordings.channels import (
    TIME,
    NamedChannel,
    ProposedRecording,
    ProposedRecordings,
    RecordingOptions,
    listed,
    parse_named,
    propose_recordings,
)
from workbench.recordings.formats import RecordedFile
from workbench.system.system import System
from workbench.system.units import si_factor

_Row = tuple[tuple[str, ...], str, float, float]  # texts, of which recording, and its range


def confirm(
    files: Sequence[RecordedFile],
    system: System,
    stored: Mapping[str, NamedChannel],
    known: RecordingOptions,
    output: Output,
    yes: bool,
) -> tuple[ProposedRecordings, dict[str, Any]]:
    """Recordings with their channels, and conditions, after one question at most.

    Parameters
    ----------
    stored : channels that were confirmed before.
    yes : take what is proposed without a question.
    """
    proposed = propose_recordings(files, system, stored, known)
    output.result(_format(files, proposed, system))
    conditions = dict(known.conditions)
    if proposed.certain:
        return proposed, conditions
    if yes or output.json:  # a program is asked nothing
        return _complete(files, proposed, proposed.doubts), conditions
    columns = dict(known.columns)
    for answer in answers(files, bool(proposed.problems)):
        if answer.partition("=")[0].strip() in (TIME, *system.signals):
            signal, channel = parse_named(answer, "answer", system.signals)
            columns[signal] = channel
        else:
            name, value = read_condition(answer, system)
            conditions[name] = value
    proposed = propose_recordings(files, system, stored, replace(known, columns=columns))
    return _complete(files, proposed, []), conditions


def answers(files: Sequence[RecordedFile], missing: bool) -> list[str]:
    """Ask the user for corrections of a proposal, from which something is missing or not."""
    action = "name what is missing" if missing else "Enter takes this"
    print(f"{action}; correct with 'SIGNAL=CHANNEL [unit]; CONDITION=VALUE'; n refuses: ", end="")
    try:
        answer = input().strip()
    except EOFError:
        print()
        answer = "n"
    if answer.casefold() in ("n", "no"):
        raise InputError(
            where=", ".join(str(file.path) for file in files),
            found="channels that nobody confirmed",
            expected="an answer, or --yes",
            remedy="answer, or name channels with --column, and take the rest with --yes",
        )
    return [part.strip() for part in answer.split(";") if part.strip()]


def _complete(
    files: Sequence[RecordedFile], proposed: ProposedRecordings, doubts: Sequence[str]
) -> ProposedRecordings:
    if problems := [*proposed.problems, *doubts]:
        raise InputError(
            where=", ".join(str(file.path) for file in files),
            found="; ".join(problems),
            expected="a channel for each signal that the system needs",
            remedy="name it, --column 'SIGNAL=CHANNEL [unit]'"
            + (f", of {listed(proposed.left)}" if proposed.left else ""),
        )
    return proposed


def _format(files: Sequence[RecordedFile], proposed: ProposedRecordings, system: System) -> str:
    lines = [f"{file.path}: {file.format}" for file in files]
    if len(proposed.held) > 1:
        names = listed([f"'{recording.name}'" for recording in proposed.held])
        lines.append(f"  {len(proposed.held)} recordings, with the same channels: {names}")
    lines += [*_clocks(proposed.held), *_channels(proposed.held, system)]
    lines += [f"  ? {problem}" for problem in (*proposed.problems, *proposed.unmatched)]
    lines += [f"  left out   {entry}" for entry in proposed.beside]
    if proposed.left:
        lines.append(f"  left out   {listed(proposed.left)}")
    return "\n".join(lines)


def _clocks(held: Sequence[ProposedRecording]) -> Iterator[str]:
    rows: list[_Row] = []
    for recording in held:
        for clock in recording.proposal.clocks.values():
            times = clock.times[np.isfinite(clock.times)]
            channel = f"{clock.channel} [{clock.unit}]" if clock.channel else "-"
            step = f"{float(np.median(np.diff(np.unique(times)))):.4g} s"
            rows.append(((channel, step, clock.reason), recording.name, times.size, times.size))
    for (channel, step, reason), low, high, where in _merge_alike(rows, len(held)):
        samples = f"{low:.0f}" if low == high else f"{low:.0f} to {high:.0f}"
        steps = f"{samples} samples, every {step}"
        yield f"  {TIME:<10} {channel:<28} {steps} ({reason}){where}"


def _channels(held: Sequence[ProposedRecording], system: System) -> Iterator[str]:
    for signal in system.signals.values():
        scale = si_factor(signal.shown, signal.unit, signal.name)
        rows: list[_Row] = []
        for recording in held:
            if assigned := recording.proposal.assigned.get(signal.name):
                via = f" = {assigned.formula}" if assigned.formula else ""
                key = f"{assigned.label} [{assigned.unit}]{via}", assigned.reason
                low = float(np.nanmin(assigned.values)) / scale
                high = float(np.nanmax(assigned.values)) / scale
                rows.append((key, recording.name, low, high))
        for (channel, reason), low, high, where in _merge_alike(rows, len(held)):
            yield (
                f"  {signal.name:<10} {channel:<28} {signal.label}, {low:.4g} to {high:.4g} "
                f"{signal.shown} ({reason}){where}"
            )


def _merge_alike(
    rows: Sequence[_Row], count: int
) -> Iterator[tuple[tuple[str, ...], float, float, str]]:
    """Rows with the same texts as one: these, their common range, and where, if not in all."""
    for key in dict.fromkeys(key for key, *_ in rows):
        own = [row for row in rows if row[0] == key]
        names = list(dict.fromkeys(f"'{name}'" for _, name, *_ in own))
        where = "" if len(names) == count else f", in {listed(names)}"
        yield key, min(low for *_, low, _ in own), max(high for *_, high in own), where
