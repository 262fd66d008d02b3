"""`workbench power`: how much the diagnosis can be trusted."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from workbench.cli.extras import require_compiler
from workbench.cli.output import CommandResult, Output, read_result
from workbench.diagnosis.inference.thresholds import of_system
from workbench.errors import InputError, closest
from workbench.pages.provenance import run_of
from workbench.runtime.engine import Engine
from workbench.runtime.files import locked_folder
from workbench.studies.power import (
    Plantable,
    PowerStudy,
    Repertoire,
    SetVerdict,
    VirtualRig,
    diagnose_sets,
    open_virtual_rig,
    plan,
    read_recorded_sets,
    summarise,
)
from workbench.studies.power.diagnosing import library_effects
from workbench.studies.power.following import follow_proposals, summarise_following
from workbench.studies.power.left_out import propose_left_out, summarise_left_out
from workbench.studies.power.planned import predict_campaign
from workbench.studies.power.planting import Group, plan_sheet_errors, some
from workbench.studies.power.report import (
    format_followed,
    format_left_out,
    format_plan,
    format_power,
    format_sheet,
    format_thresholds,
    write_followed,
    write_left_out,
    write_plan,
    write_power,
    write_sheet,
    write_thresholds,
)
from workbench.studies.power.sensitivity import values, vary_sets
from workbench.studies.power.sheet import summarise_sheet
from workbench.system.registry import load_system, model_path
from workbench.system.system import REFERENCE


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Make, diagnose and count."""
    require_compiler()
    system = load_system(options.system)
    if options.library:
        system = replace(system, library=options.library)
    effects = library_effects(system)
    if options.recorded:
        sets = read_recorded_sets(system, options.recorded)
        with locked_folder(options.out):
            output.progress(f"{len(sets.recordings)} recorded sets")
            return _usual(options, output, PowerStudy(system, sets, effects), sets.groups)
    known = model_path(system, REFERENCE) if REFERENCE in system.models else None
    rig = open_virtual_rig(system, options.case, options.reference or known)
    study = PowerStudy(system, rig, effects)
    with locked_folder(options.out):
        output.progress(f"sets of {len(rig.recordings)} recordings")
        if options.check is None:
            return _usual(options, output, study, _planned(options, study))
        checks = {
            "thresholds": _thresholds,
            "sheet_error": _sheet_error,
            "leave_out_effect": _left_out,
            "plan": _plan_campaign,
            "follow": _followed,
        }
        return checks[options.check](options, output, study)


def _chosen(names: Sequence[str], rig: VirtualRig) -> tuple[Plantable, ...]:
    """Effects to plant, by the names of the library, or of the rig where the library has none."""
    known = {plantable.effect or plantable.name: plantable for plantable in rig.plantables}
    for name in names:
        if name not in known:
            raise InputError(
                where=f"--effects {name}",
                found=f"no effect that the virtual rig can plant{closest(name, known)}",
                expected=f"some of {', '.join(known)}",
                remedy="choose others, or leave --effects out for all",
            )
    return tuple(one for name, one in known.items() if name in names or not names)


def _provenance(
    options: argparse.Namespace, study: PowerStudy, interrupted: bool
) -> dict[str, Any]:
    return {
        "run": run_of("power", study.system, {}),
        "workbench": version("wheelset-workbench"),
        "seed": options.seed,
        "stops": list(study.rig.recordings),
        "interrupted": interrupted,
    }


def _planned(options: argparse.Namespace, study: PowerStudy) -> list[Group]:
    repertoire = Repertoire(_chosen(options.effects, study.rig), tuple(study.effects))
    sizes = sorted(set(options.sizes))
    counts = (options.clean, sizes, options.repeats, options.pairs)
    if not (groups := plan(repertoire, *counts, options.seed)):
        raise InputError(
            where="command line, --clean, --repeats and --pairs",
            found="no set at all",
            expected="one or more",
            remedy="raise one of them",
        )
    return groups


def _usual(
    options: argparse.Namespace, output: Output, study: PowerStudy, groups: Sequence[Group]
) -> CommandResult:
    results, interrupted = _diagnosed(options, output, groups, study, options.out)
    summary = summarise(results, Repertoire(study.rig.plantables, tuple(study.effects)))
    write_power(summary, study.effects, _provenance(options, study, interrupted), options.out)
    output.result(format_power(summary))
    output.result(f"to read: {options.out / 'index.html'}, data and figures beside it")
    done = _written(options.out / "power.json", interrupted)
    return replace(done, page=options.out / "index.html")


def _sheet_error(options: argparse.Namespace, output: Output, study: PowerStudy) -> CommandResult:
    out = options.out / "sheet_error"
    groups = plan_sheet_errors(study.rig.sheet_errors, options.repeats, options.seed)
    results, interrupted = _diagnosed(options, output, groups, study, out)
    rows = summarise_sheet(results)
    write_sheet(rows, _provenance(options, study, interrupted), out)
    return _told(output, format_sheet(rows), out / "sheet_error.json", interrupted)


def _left_out(options: argparse.Namespace, output: Output, study: PowerStudy) -> CommandResult:
    out = options.out / "left_out"
    largest = argparse.Namespace(**vars(options) | {"sizes": [max(options.sizes)], "pairs": 0})
    engine = Engine(options.workers, output.stage)
    rows, interrupted = propose_left_out(_planned(largest, study), study, engine)
    summary = summarise_left_out(rows)
    write_left_out(summary, rows, _provenance(options, study, interrupted), out)
    return _told(output, format_left_out(summary, rows), out / "left_out.json", interrupted)


def _thresholds(options: argparse.Namespace, output: Output, study: PowerStudy) -> CommandResult:
    sets = some(_planned(options, study), options.sets, options.seed)
    results, interrupted = vary_sets(sets, study, Engine(options.workers, output.stage))
    usual = values(of_system(study.system.comparison, len(study.effects)))
    out = options.out / "thresholds"
    write_thresholds(results, usual, _provenance(options, study, interrupted), out)
    return _told(output, format_thresholds(results, usual), out / "thresholds.json", interrupted)


def _plan_campaign(options: argparse.Namespace, output: Output, study: PowerStudy) -> CommandResult:
    out = options.out / "plan"
    sizes, wanted = sorted(set(options.sizes)), _chosen(options.effects, study.rig)
    output.stage("one set without any effect is made and diagnosed")
    rows = predict_campaign(study, wanted, sizes, options.seed)
    write_plan(rows, sizes, _provenance(options, study, False), out)
    return _told(output, format_plan(rows, sizes), out / "plan.json", False)


def _followed(options: argparse.Namespace, output: Output, study: PowerStudy) -> CommandResult:
    out = options.out / "followed"
    alone = argparse.Namespace(**vars(options) | {"clean": 0, "pairs": 0})
    engine = Engine(options.workers, output.stage)
    rows, interrupted = follow_proposals(_planned(alone, study), study, engine)
    summary = summarise_following(rows)
    write_followed(summary, rows, _provenance(options, study, interrupted), out)
    return _told(output, format_followed(summary, rows), out / "followed.json", interrupted)


def _told(output: Output, text: str, path: Path, interrupted: bool) -> CommandResult:
    """Say what was found and where it is written."""
    output.result(text)
    output.result(f"data: {path.parent}")
    return _written(path, interrupted)


def _written(path: Path, interrupted: bool) -> CommandResult:
    """What was written; sizes are in the unit that stands beside them, or of `matters`."""
    return CommandResult(read_result(path), {"seconds": "s"}, 130 if interrupted else 0)


def _diagnosed(
    options: argparse.Namespace,
    output: Output,
    groups: Sequence[Group],
    study: PowerStudy,
    out: Path,
) -> tuple[list[SetVerdict], bool]:
    engine = Engine(options.workers, output.stage, out)
    return diagnose_sets(groups, study, engine, seed=options.seed, resume=options.resume)
