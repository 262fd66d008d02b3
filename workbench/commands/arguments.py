"""What the commands share."""

import argparse
import os
import sys
import time
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TypeAlias

from workbench import resources
from workbench.case import Case, check_names, read_cases
from workbench.errors import InputError
from workbench.installed import usual_system
from workbench.system import FULL, OBSERVER, System
from workbench.system_file import with_model
from workbench.systems import load_system

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


def nearby(path: Path) -> Path:
    """Shorten a path to what people type for it: relative to the working directory, if inside."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


def positive(text: str) -> int:
    """Type of an argument that is a whole number of 1 or more."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value} is not 1 or more")
    return value


def above_zero(text: str) -> float:
    """Type of an argument that is a number above zero."""
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return value


def add_isolated(parser: argparse.ArgumentParser) -> None:
    """Add the option --isolated, which `main` reads before the command is run."""
    parser.add_argument(
        "--isolated",
        action="store_true",
        help="for FMUs that nobody vouches for: no network, and no writing but to the results and "
        "temporary files; a line says so, and what this system cannot do (Linux)",
    )


def add_system(parser: argparse.ArgumentParser) -> None:
    """Add the option --system, which `load_system` reads."""
    parser.add_argument(
        "--system",
        default=usual_system(),
        metavar="NAME|FILE",
        help="an installed system, or a system file (default: %(default)s)",
    )


def add_workers(parser: argparse.ArgumentParser) -> None:
    """Add how many processes work."""
    parser.add_argument(
        "--workers",
        type=positive,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes (default: one per processor, %(default)s)",
    )


def add_recordings(parser: argparse.ArgumentParser, out: str) -> None:
    """Add the cases to read and the folder to write to."""
    parser.add_argument(
        "cases",
        nargs="*",
        type=Path,
        metavar="CASE",
        help="case folder, or folder of case folders (default: those of the system)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path(out),
        metavar="DIR",
        help="where to write (default: %(default)s)",
    )


def example_case() -> Path:
    """The first of the cases that come with the package, for the examples of a command's help."""
    return nearby(min(resources.cases().iterdir()))


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


def add_models(parser: argparse.ArgumentParser) -> None:
    """Add the FMUs and their names of variables, which `chosen_system` reads."""
    for option, name in (("--fmu", "observer"), ("--full-fmu", "full observer")):
        parser.add_argument(
            option, type=Path, metavar="FILE", help=f"{name} model (default: the system's)"
        )
    add_map(parser)


def add_map(parser: argparse.ArgumentParser) -> None:
    """Add the option --map, which `model_names` reads."""
    parser.add_argument(
        "--map",
        action="append",
        default=[],
        metavar="OURS=THEIRS",
        help="the FMU's own name of a variable, such as p=pressure; may be repeated "
        "(also in case.toml, [model.names])",
    )


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


def installing(extra: str) -> str:
    """Say how an extra is installed: in a checkout with the versions that it pins."""
    if resources.CHECKOUT is None:
        return f"pip install 'wheelset-workbench[{extra}]'"
    return f"pip install -e '.[{extra}]' -c constraints.txt"


def require_compiler() -> None:
    """Refuse to go on without the extra that holds the Modelica compiler.

    Raises
    ------
    InputError
        If one of its packages is missing.
    """
    if missing := [name for name in ("rumoca", "casadi", "ziglang") if find_spec(name) is None]:
        raise InputError(
            where="workbench.compiler",
            found=f"no package '{missing[0]}'",
            expected="the extra [compiler], which holds the Modelica compiler",
            remedy=installing("compiler"),
        )


def show_progress(done: int, total: int, name: str, begin: float) -> None:
    """One line per finished case, with the time left."""
    elapsed = time.perf_counter() - begin
    left = elapsed / done * (total - done)
    print(f"[{done:>3}/{total}] {name:<28} {elapsed:5.1f} s, about {left:.0f} s left", flush=True)
