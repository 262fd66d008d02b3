"""`workbench power`: how much the diagnosis can be trusted."""

import argparse
import os
import time
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

from workbench.commands.arguments import Commands, add_system, positive, require_compiler
from workbench.power import Repertoire, diagnose_sets, open_virtual_rig, plan, summarise
from workbench.power.diagnosing import library_effects
from workbench.report.power import format_power, write_power
from workbench.systems import load_system, model_path


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "power",
        description="Plant effects in the virtual rig, diagnose the recordings without telling, "
        "and count: false alarms on clean sets, right names against the size of the effect, pairs, "
        "causes that are not in the catalogue, coverage of the intervals. Writes power.json, "
        "figures (PNG, SVG) and the verdict on each set (sets.jsonl). Takes hours; Ctrl-C keeps "
        "what there is and reports it, --resume goes on. Needs the extra [compiler].",
        epilog="examples:\n"
        "  python -m workbench power\n"
        "  python -m workbench power --clean 5 --sizes 4 --repeats 1 --pairs 5 --out /tmp/quick\n"
        "  python -m workbench power --clean 200 --resume",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    for option, default, text in (
        ("--clean", 50, "sets without an effect"),
        ("--repeats", 3, "sets of each effect at each size"),
        ("--pairs", 30, "sets with two effects, at the largest size"),
        ("--workers", os.cpu_count() or 1, "processes"),
    ):
        parser.add_argument(
            option,
            type=positive,
            default=default,
            metavar="N",
            help=f"{text} (default: %(default)s)",
        )
    parser.add_argument(
        "--sizes",
        type=_size,
        nargs="+",
        default=[0.5, 1.0, 2.0, 4.0],
        metavar="X",
        help="multiples of the least size that is worth a finding (default: 0.5 1 2 4)",
    )
    parser.add_argument(
        "--seed", type=positive, default=1, metavar="N", help="of all sets (default: %(default)s)"
    )
    parser.add_argument(
        "--case",
        action="append",
        default=[],
        metavar="NAME",
        help="recording of a set, may be repeated (default: those that are usual for the system)",
    )
    parser.add_argument("--resume", action="store_true", help="go on from the verdicts in --out")
    add_system(parser)
    for option, default_path, text in (
        ("--fmu", None, "model that makes the recordings (default: the system's 'reference')"),
        ("--library", None, "package.mo of the Modelica library (default: the system's)"),
        ("--out", Path("results/power"), "where to write (default: %(default)s)"),
    ):
        parser.add_argument(option, type=Path, default=default_path, metavar="PATH", help=text)
    parser.set_defaults(run=_power)


def _size(text: str) -> float:
    """Type of an argument that is a number above 0."""
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return value


def _power(options: argparse.Namespace) -> int:
    require_compiler()
    system = load_system(options.system)
    if options.library:
        system = replace(system, library=options.library)
    reference = options.fmu or model_path(system, "reference")
    rig = open_virtual_rig(system, options.case, reference)
    effects = library_effects(system)
    repertoire = Repertoire(rig.plantables, effects)
    sizes = sorted(set(options.sizes))
    groups = plan(repertoire, options.clean, sizes, options.repeats, options.pairs, options.seed)
    begin = time.perf_counter()

    def report(line: str) -> None:
        print(f"{time.perf_counter() - begin:7.0f} s  {line}", flush=True)

    report(f"{sum(map(len, groups))} sets of {len(rig.recordings)} recordings")
    results, interrupted = diagnose_sets(
        groups,
        system,
        rig,
        effects,
        options.out,
        seed=options.seed,
        workers=options.workers,
        resume=options.resume,
        report=report,
    )
    summary = summarise(results, repertoire)
    provenance = {
        "workbench": version("wheelset-workbench"),
        "seed": options.seed,
        "stops": list(rig.recordings),
        "interrupted": interrupted,
    }
    write_power(summary, effects, provenance, options.out)
    print(format_power(summary))
    print(f"data and figures: {options.out}")
    return 130 if interrupted else 0
