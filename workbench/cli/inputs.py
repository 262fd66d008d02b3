"""What the commands share: systems and recordings that are asked for."""

import argparse
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from workbench.cli.arguments import nearby
from workbench.cli.output import Output, warn
from workbench.errors import InputError, unknown_name
from workbench.recordings.case import UNKNOWN, Case, check_names, read_cases
from workbench.recordings.channels import RecordingOptions, parse_named
from workbench.recordings.formats import RecordedFile, read_recorded_file
from workbench.system.reader import with_model
from workbench.system.registry import load_system
from workbench.system.system import FULL, OBSERVER, System
from workbench.system.units import quantity

_LARGE = 2_000_000  # bytes of a file, which take about a second to read


def read_files(paths: Sequence[Path], output: Output) -> dict[Path, RecordedFile]:
    """Read files of recorders; says before which large ones take long."""
    files = {}
    for path in paths:
        if path.is_file() and (size := path.stat().st_size) > _LARGE:
            output.stage(f"reading {path.name}, {size / 1e6:.0f} MB")
        files[path] = read_recorded_file(path)
    return files


def recording_options(options: argparse.Namespace, system: System) -> RecordingOptions:
    """What is said of recordings without a case.toml."""
    conditions = dict(read_condition(entry, system) for entry in options.condition)
    columns = dict(
        parse_named(entry, "command line, --column", system.signals) for entry in options.column
    )
    return RecordingOptions(conditions, columns, step_of(options))


def step_of(options: argparse.Namespace) -> float | None:
    """Time between two samples of files without times, as --sample-rate says [s]."""
    if options.sample_rate is None:
        return None
    rate = quantity(options.sample_rate, "Hz", "command line, --sample-rate")
    if not rate > 0.0:
        raise InputError(
            where="command line, --sample-rate",
            found=options.sample_rate,
            expected="samples per second, above 0",
            remedy="write for instance --sample-rate '200 Hz'",
        )
    return 1.0 / rate


def read_condition(text: str, system: System) -> tuple[str, Any]:
    """One condition as people type it, NAME=VALUE, as case.toml has it."""
    name, equals, value = (part.strip() for part in text.partition("="))
    known = next((condition for condition in system.conditions if condition.name == name), None)
    if not equals or known is None:
        raise unknown_name(
            name,
            [condition.name for condition in system.conditions],
            where=f"condition {text}",
            expected="NAME=VALUE of a condition: "
            + (
                ", ".join(condition.name for condition in system.conditions)
                or "this system has none"
            ),
        )
    words = {str(choice): choice for choice in known.choices}
    entries = [words.get(part.strip(), part.strip()) for part in value.split(",")]
    whole = value == UNKNOWN or not known.count
    return name, words.get(value, value) if whole else entries


def given_cases(options: argparse.Namespace, system: System) -> list[Case]:
    """The cases that are asked for, or those that come with the system."""
    paths: list[Path] = options.cases
    if not paths and system.cases is None:
        raise InputError(
            where="command line",
            found="no CASE, and a system that comes without",
            expected="folders of recordings",
            remedy=f"name them, or write cases = 'FOLDER' in {nearby(system.source)}",
        )
    folders = paths or [path for path in [system.cases] if path is not None]
    cases = read_cases(folders, system, recording_options(options, system))
    for case in cases:
        for doubt in case.doubts:
            warn(doubt)
    return cases


def modelled_system(options: argparse.Namespace) -> System:
    """The system that is asked for, with the observer model of --fmu if that is given."""
    system = load_system(options.system)
    return system if options.fmu is None else with_model(system, OBSERVER, options.fmu)


def chosen_system(options: argparse.Namespace) -> tuple[System, list[Case]]:
    """The system that is asked for, with the models and names that are given, and the cases."""
    system = _load(options)
    cases = given_cases(options, system)
    names = model_names(options.map, system, cases)
    if options.fmu is not None or names:
        path = options.fmu or system.model(OBSERVER).path
        system = with_model(system.with_names(names), OBSERVER, path)
    if options.full_fmu is not None:
        system = with_model(system, FULL, options.full_fmu)
    return system, cases


def _load(options: argparse.Namespace) -> System:
    """The system; where its own names are not those of its FMU, with the names of --map."""
    try:
        return load_system(options.system)
    except InputError:
        if not options.map:
            raise
        return load_system(options.system, options.fmu, _mapping(options.map))


def _mapping(entries: Sequence[str]) -> dict[str, str]:
    """What --map says: the FMU's names by ours."""
    given: dict[str, str] = {}
    for entry in entries:
        ours, equals, theirs = entry.partition("=")
        if not equals or ours in given:
            raise InputError(
                where=f"command line, --map {entry}",
                found=f"a second name for '{ours}'" if equals else "no '='",
                expected="OURS=THEIRS, once for each variable",
                remedy="write for instance --map p=pressure",
            )
        given[ours] = theirs
    return given


def model_names(
    mapped: Sequence[str], system: System, cases: Sequence[Case] = ()
) -> dict[str, str]:
    """Names of variables in the FMU, from the command line and from the cases.

    Parameters
    ----------
    mapped : the values of --map, "p=pressure"; they win over the cases.
    cases : their names must agree, because one FMU runs on all of them.

    Raises
    ------
    InputError
        If an entry cannot be read, names no variable of ours, or cases contradict each other.
    """
    typed = check_names(_mapping(mapped), "command line, --map", system)
    names: dict[str, str] = {}
    for case in cases:
        for ours, theirs in case.names.items():
            if names.setdefault(ours, theirs) != theirs and ours not in typed:
                raise InputError(
                    where=f"{case.source.parent / 'case.toml'}, [model.names] {ours}",
                    found=f"'{theirs}', in a case before it '{names[ours]}'",
                    expected="the same name in all cases, because one FMU runs on all",
                    remedy=f"run these cases apart, or decide with --map {ours}=NAME",
                )
    return check_names(names | typed, "--map and [model.names]", system)


def split_held_out(cases: Sequence[Case], patterns: Sequence[str]) -> tuple[list[Case], list[Case]]:
    """Recordings that are fitted, and those that are held out: by name, * is any letters."""
    names = [case.name for case in cases]
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in names):
            raise unknown_name(
                pattern,
                names,
                where=f"--held-out {pattern}",
                found="no recording of this name",
                expected=f"some of {', '.join(names)}",
            )
    fitted: list[Case] = []
    held_out: list[Case] = []
    for case in cases:
        out = any(fnmatchcase(case.name, pattern) for pattern in patterns)
        (held_out if out else fitted).append(case)
    return fitted, held_out
