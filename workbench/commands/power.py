"""`workbench power`: how much the diagnosis can be trusted."""

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from workbench.commands.arguments import (
    Commands,
    add_isolated,
    add_system,
    add_workers,
    positive,
    require_compiler,
)
from workbench.diagnosis import Effect
from workbench.diagnosis.thresholds import thresholds
from workbench.files import claimed
from workbench.power import (
    Diagnosed,
    Repertoire,
    VirtualRig,
    diagnose_sets,
    open_virtual_rig,
    plan,
    summarise,
)
from workbench.power.diagnosing import library_effects
from workbench.power.planting import Group, plan_sheet_errors, some
from workbench.power.sensitivity import values, vary_sets
from workbench.power.sheet import summarise_sheet
from workbench.report.power import format_power, write_power
from workbench.report.power_checks import (
    format_sheet,
    format_thresholds,
    write_sheet,
    write_thresholds,
)
from workbench.system import REFERENCE, System
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
        "  python -m workbench power --clean 200 --resume\n"
        "  python -m workbench power --thresholds --sets 8\n"
        "  python -m workbench power --sheet-error --repeats 2",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    _add_sets(parser)
    add_workers(parser)
    _add_checks(parser)
    parser.add_argument("--resume", action="store_true", help="go on from the verdicts in --out")
    add_system(parser)
    for option, default_path, text in (
        ("--fmu", None, "model that makes the recordings (default: the system's 'reference')"),
        ("--library", None, "package.mo of the Modelica library (default: the system's)"),
        ("--out", Path("results/power"), "where to write (default: %(default)s)"),
    ):
        parser.add_argument(option, type=Path, default=default_path, metavar="PATH", help=text)
    add_isolated(parser)
    parser.set_defaults(run=_power)


def _add_sets(parser: argparse.ArgumentParser) -> None:
    """Add which sets of recordings are made."""
    for option, default, text in (
        ("--clean", 50, "sets without an effect"),
        ("--repeats", 3, "sets of each effect at each size"),
        ("--pairs", 30, "sets with two effects, at the largest size"),
        ("--sets", 8, "sets of --thresholds, of all kinds alike"),
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


def _add_checks(parser: argparse.ArgumentParser) -> None:
    """Add what is asked instead of how often the diagnosis is right."""
    checks = parser.add_mutually_exclusive_group()
    for option, text in (
        (
            "--thresholds",
            "halve and double each threshold of the diagnosis on the same recordings, "
            "and tell what changes (into OUT/thresholds)",
        ),
        (
            "--sheet-error",
            "make recordings of a rig that differs from its data sheet in --repeats "
            "sets of each error, and tell what is said (into OUT/sheet_error)",
        ),
    ):
        checks.add_argument(
            option,
            action="store_const",
            const=option[2:].replace("-", "_"),
            dest="check",
            help=text,
        )


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
    reference = options.fmu or model_path(system, REFERENCE)
    rig = open_virtual_rig(system, options.case, reference)
    effects = library_effects(system)
    with claimed(options.out):
        return _checked(options, system, rig, effects)


def _checked(
    options: argparse.Namespace, system: System, rig: VirtualRig, effects: tuple[Effect, ...]
) -> int:
    """What is asked for, once there is a place for it."""
    run = {"thresholds": _thresholds, "sheet_error": _sheet_error}.get(options.check, _usual)
    print(f"sets of {len(rig.recordings)} recordings", flush=True)
    return run(options, system, rig, effects)


def _provenance(options: argparse.Namespace, rig: VirtualRig, interrupted: bool) -> dict[str, Any]:
    return {
        "workbench": version("wheelset-workbench"),
        "seed": options.seed,
        "stops": list(rig.recordings),
        "interrupted": interrupted,
    }


def _reporter() -> Callable[[str], None]:
    begin = time.perf_counter()

    def report(line: str) -> None:
        print(f"{time.perf_counter() - begin:7.0f} s  {line}", flush=True)

    return report


def _planned(
    options: argparse.Namespace, rig: VirtualRig, effects: tuple[Effect, ...]
) -> list[Group]:
    repertoire = Repertoire(rig.plantables, effects)
    sizes = sorted(set(options.sizes))
    return plan(repertoire, options.clean, sizes, options.repeats, options.pairs, options.seed)


def _usual(
    options: argparse.Namespace, system: System, rig: VirtualRig, effects: tuple[Effect, ...]
) -> int:
    groups = _planned(options, rig, effects)
    results, interrupted = _diagnosed(options, groups, system, rig, effects, options.out)
    summary = summarise(results, Repertoire(rig.plantables, effects))
    write_power(summary, effects, _provenance(options, rig, interrupted), options.out)
    print(format_power(summary))
    print(f"data and figures: {options.out}")
    return 130 if interrupted else 0


def _sheet_error(
    options: argparse.Namespace, system: System, rig: VirtualRig, effects: tuple[Effect, ...]
) -> int:
    out = options.out / "sheet_error"
    groups = plan_sheet_errors(rig.sheet_errors, options.repeats, options.seed)
    results, interrupted = _diagnosed(options, groups, system, rig, effects, out)
    rows = summarise_sheet(results)
    write_sheet(rows, _provenance(options, rig, interrupted), out)
    print(format_sheet(rows))
    print(f"data: {out}")
    return 130 if interrupted else 0


def _thresholds(
    options: argparse.Namespace, system: System, rig: VirtualRig, effects: tuple[Effect, ...]
) -> int:
    sets = some(_planned(options, rig, effects), options.sets, options.seed)
    results, interrupted = vary_sets(
        sets, system, rig, effects, workers=options.workers, report=_reporter()
    )
    usual = values(thresholds(len(effects)))
    out = options.out / "thresholds"
    write_thresholds(results, usual, _provenance(options, rig, interrupted), out)
    print(format_thresholds(results, usual))
    print(f"data: {out}")
    return 130 if interrupted else 0


def _diagnosed(
    options: argparse.Namespace,
    groups: Sequence[Group],
    system: System,
    rig: VirtualRig,
    effects: tuple[Effect, ...],
    out: Path,
) -> tuple[list[Diagnosed], bool]:
    return diagnose_sets(
        groups,
        system,
        rig,
        effects,
        out,
        seed=options.seed,
        workers=options.workers,
        resume=options.resume,
        report=_reporter(),
    )
