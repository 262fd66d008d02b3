"""`workbench diagnose`: what a simulation gets wrong, the cause, and a better model."""

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from importlib.metadata import version
from pathlib import Path

from workbench.case import Case
from workbench.commands.arguments import (
    Commands,
    add_isolated,
    add_recordings,
    add_system,
    add_workers,
    given_cases,
    require_compiler,
)
from workbench.diagnosis import Effect, choose, diagnose, read_effects
from workbench.errors import InputError, closest
from workbench.files import claimed
from workbench.modelica import Library, read_library
from workbench.report.diagnosis import write_diagnosis
from workbench.system import OBSERVER, System
from workbench.system_file import with_model
from workbench.systems import load_system, open_model


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "diagnose",
        description="Compare recordings with the observer model: show where the simulation is "
        "wrong, name the physical cause, say what cannot be told apart, extend the Modelica "
        "model, and measure the gain on recordings that were held out. Writes a page to read "
        "(index.html), summary.json, data (CSV), figures (PNG, SVG) and the extended model. Needs "
        "the extra [compiler]. Ctrl-C ends the search for more causes and keeps those that were "
        "found. Exit status 0 for any verdict.",
        epilog="examples:\n"
        "  python -m workbench diagnose my_recordings --out results/mine\n"
        "  python -m workbench diagnose --system my_machine --effects Seepage\n"
        "  python -m workbench diagnose my_recordings --held-out 'cold_*'\n"
        "  python -m workbench diagnose new_recordings --model results/mine/model/Extended.fmu\n"
        "  python -m workbench diagnose my_recordings --system my_machine/system.toml\n"
        "  python -m workbench diagnose --list",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_recordings(parser, out="results/diagnose")
    add_system(parser)
    parser.add_argument(
        "--held-out",
        nargs="+",
        default=[],
        metavar="CASE",
        help="recordings by name (* is any letters), on which only errors of both models are "
        "measured",
    )
    parser.add_argument(
        "--model",
        type=Path,
        metavar="FMU",
        help="observer model, or an extension of it (default: the system's)",
    )
    parser.add_argument(
        "--effects",
        nargs="+",
        default=[],
        metavar="NAME",
        help="effects to consider (default: all of the library)",
    )
    parser.add_argument(
        "--list", action="store_true", help="list the effects of the library, and end"
    )
    parser.add_argument(
        "--library",
        type=Path,
        metavar="FILE",
        help="package.mo of the Modelica library (default: the system's)",
    )
    parser.add_argument(
        "--platforms",
        choices=("native", "all"),
        default="native",
        help="of the extended FMU: this machine's, or all (default: %(default)s)",
    )
    add_workers(parser)
    add_isolated(parser)
    parser.set_defaults(run=_diagnose)


def _parted(cases: Sequence[Case], patterns: Sequence[str]) -> tuple[list[Case], list[Case]]:
    """Recordings that are fitted, and those that are held out."""
    names = [case.name for case in cases]
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in names):
            raise InputError(
                where=f"--held-out {pattern}",
                found=f"no recording of this name{closest(pattern, names)}",
                expected=f"some of {', '.join(names)}",
                remedy="correct the name",
            )
    held_out = [
        case for case in cases if any(fnmatchcase(case.name, pattern) for pattern in patterns)
    ]
    return [case for case in cases if case not in held_out], held_out


def _diagnose(options: argparse.Namespace) -> int:
    system = load_system(options.system)
    if options.library is not None:
        system = replace(system, library=options.library)
    if options.model is not None:
        system = with_model(system, OBSERVER, options.model)
    library = read_library(system.library)
    effects = choose(options.effects, read_effects(library, system.models[OBSERVER].name))
    if options.list:
        print("\n".join(f"{effect.name:<29} {effect.text}" for effect in effects))
        return 0
    require_compiler()
    cases, held_out = _parted(given_cases(options.cases, system), options.held_out)
    with claimed(options.out):
        return _run(options, system, library, effects, cases, held_out)


def _run(
    options: argparse.Namespace,
    system: System,
    library: Library,
    effects: tuple[Effect, ...],
    cases: Sequence[Case],
    held_out: Sequence[Case],
) -> int:
    begin = time.perf_counter()

    def report(line: str) -> None:
        print(f"{time.perf_counter() - begin:6.1f} s  {line}", flush=True)

    report(f"{len(cases)} recordings" + f", {len(held_out)} held out" * bool(held_out))
    outcome = diagnose(
        *(system, cases, library, effects, options.out, options.workers, report),
        held_out=held_out,
        every_platform=options.platforms == "all",
    )
    with open_model(system) as model:
        provenance = {
            "workbench": version("wheelset-workbench"),
            "system": system.name,
            "model": {"file": model.path.name, "model": model.name, "sha256": model.sha256},
            "effects": [effect.name for effect in effects],
        }
    print(f"\n{outcome.summary()}")
    page = write_diagnosis(outcome, provenance, options.out, options.workers)
    report("done")
    print(f"to read: {page}, data and figures beside it")
    return 130 if outcome.diagnosis.interrupted else 0
