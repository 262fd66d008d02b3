"""What the commands share: systems and recordings that are asked for."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from workbench.case import Case, check_names, read_cases
from workbench.commands.arguments import nearby
from workbench.errors import InputError
from workbench.system import FULL, OBSERVER, System
from workbench.system_file import with_model
from workbench.systems import load_system


def given_cases(paths: Sequence[Path], system: System) -> list[Case]:
    """The cases that are asked for, or those that come with the system.

    Raises
    ------
    InputError
        If there are none, or one cannot be read.
    """
    if not paths and system.cases is None:
        raise InputError(
            where="command line",
            found="no CASE, and a system that comes without",
            expected="folders of recordings",
            remedy=f"name them, or write cases = 'FOLDER' in {nearby(system.source)}",
        )
    cases = read_cases(paths or [system.cases], system)  # type: ignore[list-item]  # seen above
    for case in cases:
        for doubt in case.doubts:
            print(f"warning: {doubt}", file=sys.stderr, flush=True)
    return cases


def chosen_system(options: argparse.Namespace) -> tuple[System, list[Case]]:
    """The system that is asked for, with the models and names that are given, and the cases.

    Raises
    ------
    InputError
        If system, models or cases cannot be read, or do not fit each other.
    """
    system = load_system(options.system)
    cases = given_cases(options.cases, system)
    names = model_names(options.map, system, cases)
    if options.fmu is not None or names:
        path = options.fmu or system.model(OBSERVER).path
        system = with_model(system.with_names(names), OBSERVER, path)
    if options.full_fmu is not None:
        system = with_model(system, FULL, options.full_fmu)
    return system, cases


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
    given: dict[str, str] = {}
    for entry in mapped:
        ours, equals, theirs = entry.partition("=")
        if not equals or ours in given:
            raise InputError(
                where=f"command line, --map {entry}",
                found=f"a second name for '{ours}'" if equals else "no '='",
                expected="OURS=THEIRS, once for each variable",
                remedy="write for instance --map p=pressure",
            )
        given[ours] = theirs
    given = check_names(given, "command line, --map", system)
    names: dict[str, str] = {}
    for case in cases:
        for ours, theirs in case.names.items():
            if names.setdefault(ours, theirs) != theirs and ours not in given:
                raise InputError(
                    where=f"{case.source.parent / 'case.toml'}, [model.names] {ours}",
                    found=f"'{theirs}', in a case before it '{names[ours]}'",
                    expected="the same name in all cases, because one FMU runs on all",
                    remedy=f"run these cases apart, or decide with --map {ours}=NAME",
                )
    return check_names(names | given, "--map and [model.names]", system)
