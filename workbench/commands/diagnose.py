"""`workbench diagnose`: what a simulation gets wrong, the cause, and a better model."""

import argparse
import os
import time
from importlib.metadata import version
from pathlib import Path

from workbench.case import read_cases
from workbench.commands.arguments import (
    LIBRARY,
    MINIMAL_OBSERVER,
    Commands,
    add_recordings,
    nearby,
    positive,
    require_compiler,
)
from workbench.diagnosis import choose, diagnose, read_effects
from workbench.fmu import FMU
from workbench.modelica import read_library
from workbench.report.diagnosis import (
    format_diagnosis,
    summarise_diagnosis,
    write_diagnosis,
)

_BASE = "MinimalObserver"

def add(commands: Commands) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "diagnose",
        description="Compare recorded stops with the observer model: show where the simulation is "
        "wrong, name the physical cause, say what cannot be told apart, extend the Modelica model, "
        "and measure the gain on stops that were held out. Writes a page to read (index.html), "
        "summary.json, data (CSV), figures (PNG, SVG) and the extended model. Needs the extra "
        "[compiler]. Ctrl-C ends the search for more causes and keeps those that were found. Exit "
        "status 0 for any verdict.",
        epilog="examples:\n"
        "  python -m workbench diagnose my_stops --out results/mine\n"
        "  python -m workbench diagnose my_stops --effects BrakeFade CylinderLag\n"
        "  python -m workbench diagnose new_stops --model results/mine/model/Extended.fmu\n"
        "  python -m workbench diagnose --list",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_recordings(parser, out="results/diagnose")
    parser.add_argument(
        "--model",
        type=Path,
        default=nearby(MINIMAL_OBSERVER),
        metavar="FMU",
        help="minimal observer model, or an extension of it (default: %(default)s)",
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
        default=nearby(LIBRARY),
        metavar="FILE",
        help="package.mo of the Modelica library (default: %(default)s)",
    )
    parser.add_argument(
        "--platforms",
        choices=("native", "all"),
        default="native",
        help="of the extended FMU: this machine's, or all (default: %(default)s)",
    )
    parser.add_argument(
        "--workers",
        type=positive,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes (default: one per processor, %(default)s)",
    )
    parser.set_defaults(run=_diagnose)


def _diagnose(options: argparse.Namespace) -> int:
    library = read_library(options.library)
    effects = choose(options.effects, read_effects(library, _BASE))
    if options.list:
        print("\n".join(f"{effect.name:<29} {effect.text}" for effect in effects))
        return 0
    require_compiler()
    cases = read_cases(options.cases)
    begin = time.perf_counter()

    def report(line: str) -> None:
        print(f"{time.perf_counter() - begin:6.1f} s  {line}", flush=True)

    report(f"{len(cases)} stops")
    options.out.mkdir(parents=True, exist_ok=True)
    outcome = diagnose(
        cases,
        effects,
        library,
        _BASE,
        options.model,
        options.out,
        options.workers,
        report,
        every_platform=options.platforms == "all",
    )
    with FMU(options.model) as model:
        provenance = {
            "workbench": version("wheelset-workbench"),
            "model": {"file": model.path.name, "model": model.name, "sha256": model.sha256},
            "effects": [effect.name for effect in effects],
        }
    summary = summarise_diagnosis(outcome, cases, provenance)
    page = write_diagnosis(outcome, cases, summary, options.out, options.workers)
    report("done")
    print(format_diagnosis(summary))
    print(f"to read: {page}, data and figures beside it")
    return 130 if summary["interrupted"] else 0
