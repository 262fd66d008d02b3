"""`workbench power`: how much the diagnosis can be trusted."""

import argparse
import os
import time
from importlib.metadata import version
from pathlib import Path

from workbench.commands.arguments import Commands, positive, require_compiler
from workbench.power import measure_power, plan, summarise
from workbench.report.power import format_power, write_power
from workbench.rig import select

_REFERENCE = Path("fmus/fmi2/Reference.fmu")
_PACKAGE = Path("modelica/WheelsetRig/package.mo")
_DRY = (
    *("01_dry_80_1.5", "02_dry_100_2.7", "03_dry_120_3.6", "04_dry_160_4.2"),
    *("05_dry_120_2.7_rev", "06_dry_160_3.6_rev"),
)


def add_power(commands: Commands) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "power",
        help="measure how often the diagnosis is right",
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
        help="stop of a set, may be repeated (default: the six dry standard ones)",
    )
    parser.add_argument("--resume", action="store_true", help="go on from the verdicts in --out")
    for option, default_path, text in (
        ("--fmu", _REFERENCE, "multibody model, which makes the recordings"),
        ("--library", _PACKAGE, "package.mo of the Modelica library"),
        ("--out", Path("results/power"), "where to write"),
    ):
        parser.add_argument(
            option,
            type=Path,
            default=default_path,
            metavar="PATH",
            help=f"{text} (default: %(default)s)",
        )
    parser.set_defaults(run=_power)


def _size(text: str) -> float:
    """Type of an argument that is a number above 0."""
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return value


def _power(options: argparse.Namespace) -> int:
    require_compiler()
    scenarios = select(options.case or _DRY)
    sizes = sorted(set(options.sizes))
    groups = plan(options.clean, sizes, options.repeats, options.pairs, options.seed)
    begin = time.perf_counter()

    def report(line: str) -> None:
        print(f"{time.perf_counter() - begin:7.0f} s  {line}", flush=True)

    report(f"{sum(map(len, groups))} sets of {len(scenarios)} stops")
    results, interrupted = measure_power(
        groups,
        scenarios,
        options.fmu,
        options.library,
        options.out,
        seed=options.seed,
        workers=options.workers,
        resume=options.resume,
        report=report,
    )
    summary = summarise(results)
    provenance = {
        "workbench": version("wheelset-workbench"),
        "seed": options.seed,
        "stops": [scenario.name for scenario in scenarios],
        "interrupted": interrupted,
    }
    write_power(summary, provenance, options.out)
    print(format_power(summary))
    print(f"data and figures: {options.out}")
    return 130 if interrupted else 0
