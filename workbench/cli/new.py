"""`workbench new`: a system of one's own to begin with."""

from __future__ import annotations

import argparse
import shlex
import shutil
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from workbench.cli.arguments import Commands, add_flags, add_recording_options, nearby
from workbench.cli.output import CommandResult, Output
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.recordings.channels import RecordingOptions
    from workbench.recordings.formats import RecordedFile
    from workbench.studies.drafting import Draft


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "new",
        help=text,
        description="Write a commented system file, a small Modelica library with one slot and "
        "one effect, and recordings of a tank. The commands simulate, tune and diagnose work on "
        "it. Change it into your own machine. With --fmu and --recordings, write the "
        "system file of that FMU, and import the recordings. Signals are matched by "
        "name, unit and plausible values. Noise, sample time and ranges are "
        "estimated, each with its reason beside it.",
        epilog="examples:\n"
        "  workbench new my_machine\n"
        "  workbench simulate --system my_machine\n"
        "  workbench diagnose --system my_machine\n"
        "  workbench new my_plant --fmu plant.fmu --recordings monday.csv tuesday.csv\n"
        "  workbench fit --system my_plant",
    )
    parser.add_argument("folder", type=Path, metavar="DIR", help="where to write; made as needed")
    parser.add_argument("--fmu", type=Path, metavar="FILE", help="model of the machine, an FMU")
    parser.add_argument(
        "--recordings", nargs="+", type=Path, default=[], metavar="FILE", help="log file"
    )
    add_recording_options(parser)
    add_flags(parser, {"--yes": "take what is proposed without a question"})
    return parser


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Write the system."""
    from workbench.system.template import refuse_present, write_system

    if options.fmu or options.recordings:
        if not (options.fmu and options.recordings):
            raise InputError(
                where="command line",
                found="--fmu alone" if options.fmu else "--recordings alone",
                expected="the FMU of a machine, and recordings of it",
                remedy="give both, or none for a tank to begin with",
            )
        refuse_present([options.folder / "system.toml"])
        return _from_fmu(options, output)
    written = [nearby(path) for path in write_system(options.folder)]
    output.result("\n".join(map(str, written)))
    output.result(f"next: workbench simulate --system {shlex.quote(str(options.folder))}")
    return CommandResult({"written": written})


def _from_fmu(options: argparse.Namespace, output: Output) -> CommandResult:
    from importlib import import_module

    from workbench.cli.inputs import read_files
    from workbench.models.description import MODEL_EXCHANGE, read_description
    from workbench.runtime.files import write_whole
    from workbench.studies.drafting import system_text

    description = read_description(options.fmu)
    files = read_files(options.recordings, output)
    draft = _confirmed(options, output, list(files.values()))
    folder, fmu = options.folder, options.folder / options.fmu.name
    folder.mkdir(parents=True, exist_ok=True)
    if not (fmu.exists() and fmu.samefile(options.fmu)):
        shutil.copyfile(options.fmu, fmu)
    path = folder / "system.toml"
    write_whole(path, system_text(draft, fmu.name))
    columns = [
        f"{name}={'-' * channel.reversed}{channel.channel}"
        + (f" [{channel.unit}]" if channel.unit else "")
        for name, channel in draft.columns.items()
    ]
    importing = argparse.Namespace(
        **{**vars(options), "column": columns, "files": options.recordings, "apart": False},
        out=folder / "recordings",
        system=str(folder),
        together=False,
        whole=False,
    )
    imports = import_module("workbench.cli.import").run(importing, output, files)
    smooth = MODEL_EXCHANGE in description.interfaces and not description.event_indicators
    real = all(signal.variable.real for signal in draft.signals)
    real &= all(s.variable.variability == "continuous" for s in draft.signals if s.role == "inputs")
    which = "" if smooth and real else " --estimator open_loop"
    output.result(
        f"wrote {nearby(path)}: read its comments"
        + (f", {len(draft.questions)} of them questions" if draft.questions else "")
    )
    quoted = shlex.quote(str(folder))
    output.result(f"next: workbench simulate --system {quoted}{which}")
    output.result(f"      workbench fit --system {quoted}")
    output.result(f"      workbench diagnose --system {quoted}")
    result = {
        "written": [nearby(path), nearby(fmu)],
        "signals": {signal.name: signal.channel.channel for signal in draft.signals},
        "questions": list(draft.questions),
        "unmatched": dict(draft.unmatched),
        "imports": imports.result["imports"],
    }
    return CommandResult(result, imports.units, imports.status)


def _confirmed(options: argparse.Namespace, output: Output, files: list[RecordedFile]) -> Draft:
    from workbench.cli.import_confirmation import answers
    from workbench.cli.inputs import step_of
    from workbench.models.description import read_description
    from workbench.recordings.channels import RecordingOptions, parse_named
    from workbench.studies.drafting import draft_system, signal_names

    description = read_description(options.fmu)
    names = signal_names(description)

    def named(entries: list[str], where: str, known: RecordingOptions) -> RecordingOptions:
        ours = [
            f"{names.get(name.strip(), name.strip())}={channel}"
            for name, _, channel in (entry.partition("=") for entry in entries)
        ]
        columns = dict(parse_named(entry, where, names.values()) for entry in ours)
        return replace(known, columns={**known.columns, **columns})

    known = named(options.column, "command line, --column", RecordingOptions(step=step_of(options)))
    draft = draft_system(description, files, known)
    output.result(_format(draft))
    if draft.questions and not (options.yes or output.json):
        corrections = answers(files, bool(draft.questions))
        if corrections:
            draft = draft_system(description, files, named(corrections, "answer", known))
            output.result(_format(draft))
        draft = replace(draft, questions=())  # somebody has seen them
    return draft


def _format(draft: Draft) -> str:
    lines = [f"{draft.description.path}: {draft.description.name}, FMI {draft.description.version}"]
    for signal in draft.signals:
        samples = draft.samples(signal)
        low, high = min(v.min() for v in samples), max(v.max() for v in samples)
        unit = f" [{signal.channel.unit}]" if signal.channel.unit else ""
        lines.append(
            f"  {signal.name:<16} {signal.channel.channel}{unit}: "
            f"{low:.4g} to {high:.4g} {signal.unit} ({signal.reason})"
        )
    if draft.time:
        lines.append(f"  {'time':<16} {draft.time.channel}")
    lines += [f"  ? {name}: {why}" for name, why in draft.unmatched.items()]
    lines += [f"  ? {question}" for question in draft.questions]
    lines += [f"  left out   {', '.join(draft.left)}"] * bool(draft.left)
    return "\n".join(lines)
