"""`workbench power`: how much the diagnosis can be trusted."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.cli import arguments
from workbench.cli.extras import require_compiler
from workbench.cli.output import CommandResult, Output, read_result
from workbench.errors import InputError, require_known
from workbench.runtime.engine import Engine
from workbench.runtime.files import locked_folder
from workbench.runtime.resources import own_version

if TYPE_CHECKING:
    from workbench.diagnosis import Problem
    from workbench.studies.power import Plantable, PowerStudy, Repertoire, VirtualRig
    from workbench.studies.power.planting import Group
    from workbench.studies.power.report import Check

_SIGMAS = [2.0, 4.0, 6.0, 10.0, 20.0]  # from what nobody finds to what nobody may miss
WORKERS_NEED = (
    *("workbench.studies.power", "workbench.studies.power.report"),
    *("workbench.models.loops_ready", "scipy.signal"),
)


def add(commands: arguments.Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    parser = commands.add_parser(
        "power",
        help=text,
        description="Measure by Monte Carlo simulation how often the diagnosis is right. Effects "
        "are injected into the simulated rig of the system's plugin, or else into its "
        "own model. Counted are false alarms, right names by size, pairs, effects "
        "outside the catalogue, and coverage of intervals. Writes power.json, "
        "figures (PNG, SVG) and the verdict on each set (sets.jsonl). Takes hours; Ctrl-C keeps "
        "what there is and reports it, --resume goes on. Needs the extra [compiler].",
        epilog="examples:\n"
        "  workbench power\n"
        "  workbench power --clean 5 --sizes 4 --repeats 1 --pairs 5 --out /tmp/quick\n"
        "  workbench power --effects NAME --sizes 4 --repeats 1 --clean 0\n"
        "  workbench power --clean 200 --resume\n"
        "  workbench power --thresholds --sets 8\n"
        "  workbench power --plan --case 01_dry_80_1.5 --case 04_dry_160_4.2\n"
        "  workbench power --oracle --system train\n"
        "  workbench power --sigmas --system train --repeats 1\n"
        "  workbench power --follow --case 24_alike_80_2.7 --case 25_alike_80_2.7\n"
        "  workbench power --leave-out-effect --sizes 8 --repeats 1 --clean 0\n"
        "  workbench power --sheet-error --repeats 2\n"
        "  workbench power --system train --recorded labelled healthy\n"
        "  workbench power --system my_machine --sizes 20 --form-error 0.1",
    )
    _add_sets(parser)
    arguments.add_workers(parser)
    _add_checks(parser)
    parser.add_argument("--resume", action="store_true", help="go on from the verdicts in --out")
    arguments.add_system(parser)
    arguments.add_reference(parser, "that makes the recordings")
    arguments.add_out(parser, "results/power")
    arguments.add_pdf(parser)
    arguments.add_isolated(parser)
    return parser


def _add_sets(parser: argparse.ArgumentParser) -> None:
    arguments.add_effects(parser, "inject, also those that the catalogue lacks, by the rig's names")
    for option, default, text in (
        ("--clean", 50, "sets without an effect"),
        ("--repeats", 3, "sets of each effect at each size"),
        ("--pairs", 30, "sets with two of the effects, at the largest size"),
        ("--sets", 8, "sets of --thresholds, of all kinds alike"),
    ):
        arguments.add_number(parser, f"{option} N", arguments.count, default, text)
    sizes = parser.add_mutually_exclusive_group()
    sizes.add_argument(
        "--sizes",
        type=arguments.above_zero,
        nargs="+",
        default=[0.5, 1.0, 2.0, 4.0],
        metavar="X",
        help="multiples of the least size that is worth a finding (default: 0.5 1 2 4)",
    )
    sizes.add_argument(
        "--sigmas",
        type=arguments.above_zero,
        nargs="*",
        metavar="X",
        help="in place of --sizes: multiples of an oracle's standard deviation, see --oracle "
        "(without a number: 2 4 6 10 20)",
    )
    arguments.add_seed(parser, "all sets")
    parser.add_argument(
        "--recorded",
        nargs="+",
        type=Path,
        default=[],
        metavar="FOLDER",
        help="recorded sets, each with a truth.json of its faults, in place of sets of the "
        "simulated rig",
    )
    arguments.add_repeated(
        parser,
        "--case NAME",
        "recording of a set, may be repeated (default: the usual ones of the system). "
        "Without a plugin: a folder of recordings, whose inputs drive the system's own model",
    )
    parser.add_argument(
        "--form-error",
        type=arguments.share,
        default=0.0,
        metavar="SHARE",
        help="share of its effect by which each injected law is wrong in form: its size changes "
        "with a quantity that it does not depend on. Needs a system without a rig of its own",
    )


def _add_checks(parser: argparse.ArgumentParser) -> None:
    checks = parser.add_mutually_exclusive_group()
    texts = {
        "--thresholds": "halve and double each threshold of the diagnosis on the same recordings, "
        "and report what changes (into OUT/thresholds)",
        "--leave-out-effect": "leave the injected effect out of the catalogue, and report the law "
        "proposed instead, on --repeats sets at the largest size (into OUT/left_out)",
        "--plan": "before recording: the chance that the recordings of --case show each effect at "
        "--sizes, from one set without effects (into OUT/plan)",
        "--oracle": "smallest size of each effect that the recordings of --case can show, by the "
        "exact model, sensor noise and tolerances (into OUT/oracle)",
        "--follow": "if a set leaves several candidates, simulate the proposed next experiment and "
        "some random ones, and report which discriminate (into OUT/followed)",
        "--sheet-error": "make recordings of a rig that differs from its data sheet in --repeats "
        "sets of each error, and report the verdicts (into OUT/sheet_error)",
    }
    for option, text in texts.items():
        checks.add_argument(
            option,
            action="store_const",
            const=option[2:].replace("-", "_"),
            dest="check",
            help=text,
        )


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Make, diagnose and count."""
    from workbench.diagnosis import Problem, catalogue, library_of
    from workbench.diagnosis.effects.candidates import COEFFICIENT
    from workbench.models.modelica import read_library
    from workbench.studies.power import PowerStudy, open_virtual_rig, read_recorded_sets
    from workbench.studies.power.own_model import OwnModel
    from workbench.system.registry import load_system, model_path
    from workbench.system.system import REFERENCE

    if options.sigmas is not None and (options.check or options.recorded):
        other = options.check.replace("_", "-") if options.check else "recorded"
        raise InputError(
            where="command line, --sigmas",
            found=f"--{other} beside it",
            expected="sets of the simulated rig, which are diagnosed as they are",
            remedy="leave one of them out",
        )
    system = load_system(options.system)
    if options.library:
        system = replace(system, library=options.library)
    library = library_of(system) if options.library is None else read_library(options.library)
    problem = Problem(system, (), library, catalogue(system, library))
    if library is not None or any(effect.size == COEFFICIENT for effect in problem.effects):
        require_compiler()
    if options.recorded:
        sets = read_recorded_sets(system, options.recorded)
        with locked_folder(options.out):
            output.progress(f"{len(sets.recordings)} recorded sets")
            study = PowerStudy(problem, sets)
            return _usual(options, output, study, sets.groups, _repertoire(options, study))
    known = model_path(system, REFERENCE) if REFERENCE in system.models else None
    with locked_folder(options.out):
        output.progress(f"{len(problem.effects)} effects that can be found")
        rig = open_virtual_rig(
            system,
            options.case,
            options.reference or known,
            lambda: _own_model(options, problem),
        )
        if options.form_error and not isinstance(rig, OwnModel):
            raise InputError(
                where="--form-error",
                found=f"the simulated rig of the plugin of {system.name}, whose laws are its own",
                expected="a system whose own model makes the recordings",
                remedy="leave --form-error out, or choose a system without a simulated rig",
            )
        study = PowerStudy(problem, rig)
        output.progress(f"sets of {len(rig.recordings)} recordings")
        if about := study.rig.identity.get("machine"):
            output.result(f"Recordings are made by {about}.")
        if options.check is None:
            repertoire = _repertoire(options, study)
            groups = _plan_sets(options, study, repertoire)
            return _usual(options, output, study, groups, repertoire)
        engine = Engine(options.workers, output.stage)
        check, interrupted = _CHECKS[options.check](options, study, engine)
        provenance = _provenance(options, study, interrupted)
        path = check.write(provenance, options.out / check.name)
        output.result(check.text)
        output.result(f"data: {path.parent}")
        return _result(path, interrupted)


def _own_model(options: argparse.Namespace, problem: Problem) -> VirtualRig:
    """The system's own model as a machine, where no plugin has equations of one."""
    from workbench.diagnosis.run import with_effects
    from workbench.runtime.engine import silent
    from workbench.studies.power.own_model import own_model, template_cases

    problem = replace(problem, cases=template_cases(problem.system, options.case))
    folder = options.out / "machine"
    folder.mkdir(parents=True, exist_ok=True)
    return own_model(*with_effects(problem, folder, silent), options.form_error)


def _select(names: Sequence[str], rig: VirtualRig) -> tuple[Plantable, ...]:
    """Effects to plant, by the names of the library, or of the rig where the library has none."""
    known = {plantable.effect or plantable.name: plantable for plantable in rig.plantables}
    require_known(
        names,
        known,
        where="--effects {}".format,
        found="no effect that the simulated rig can inject",
        expected="some of {}",
        remedy="choose others, or leave --effects out for all",
    )
    return tuple(plantable for name, plantable in known.items() if name in names or not names)


def _provenance(
    options: argparse.Namespace, study: PowerStudy, interrupted: bool
) -> dict[str, Any]:
    from workbench.pages.provenance import run_of

    return {
        "run": run_of("power", study.system, {}),
        "workbench": own_version(),
        "seed": options.seed,
        "stops": list(study.rig.recordings),
        "machine": study.rig.identity.get("machine", "a plugin's simulated rig"),
        "interrupted": interrupted,
    }


def _repertoire(options: argparse.Namespace, study: PowerStudy) -> Repertoire:
    """All that the rig can plant, or what --effects names in sizes by an oracle."""
    from workbench.studies.power.campaign import by_oracle

    if options.sigmas is None:
        return study.repertoire
    sigmas = sorted({*(options.sigmas or _SIGMAS)})
    return by_oracle(study, _select(options.effects, study.rig), sigmas, options.seed)


def _plan_sets(
    options: argparse.Namespace, study: PowerStudy, repertoire: Repertoire | None = None
) -> list[Group]:
    from workbench.studies.power import plan

    if repertoire is None or not repertoire.scale.chances:
        sizes = sorted({*options.sizes})
        wanted = replace(study.repertoire, plantables=_select(options.effects, study.rig))
    else:
        sizes, wanted = [float(size) for size in repertoire.scale.chances], repertoire
    groups = plan(wanted, options.clean, sizes, options.repeats, options.pairs, options.seed)
    if not groups:
        raise InputError(
            where="command line, --clean, --repeats and --pairs",
            found="no set at all",
            expected="one or more",
            remedy="raise one of them",
        )
    return groups


def _usual(
    options: argparse.Namespace,
    output: Output,
    study: PowerStudy,
    groups: Sequence[Group],
    repertoire: Repertoire,
) -> CommandResult:
    from workbench.studies.power import diagnose_sets, summarise
    from workbench.studies.power.report import format_power, write_power

    engine = Engine(options.workers, output.stage, options.out)
    results, interrupted = diagnose_sets(
        groups, study, engine, seed=options.seed, resume=options.resume
    )
    summary = summarise(results, repertoire)
    write_power(summary, study.effects, _provenance(options, study, interrupted), options.out)
    output.result(format_power(summary))
    page = options.out / "index.html"
    output.result(f"to read: {page}, data and figures beside it")
    result = replace(_result(options.out / "power.json", interrupted), page=page)
    none = len(summary["failed"]) == summary["sets"]  # of what failed, no share says anything
    return replace(result, status=1) if none and not interrupted else result


def _check_sheet_errors(
    options: argparse.Namespace, study: PowerStudy, engine: Engine
) -> tuple[Check, bool]:
    from workbench.studies.power import diagnose_sets
    from workbench.studies.power.planting import plan_sheet_errors
    from workbench.studies.power.report import sheet_check
    from workbench.studies.power.statistics import summarise_sheet

    groups = plan_sheet_errors(study.rig.sheet_errors, options.repeats, options.seed)
    engine = replace(engine, out=options.out / "sheet_error")
    results, interrupted = diagnose_sets(
        groups, study, engine, seed=options.seed, resume=options.resume
    )
    return sheet_check(summarise_sheet(results)), interrupted


def _check_left_out(
    options: argparse.Namespace, study: PowerStudy, engine: Engine
) -> tuple[Check, bool]:
    from workbench.studies.power.left_out import propose_left_out
    from workbench.studies.power.report import left_out_check

    largest = argparse.Namespace(**vars(options) | {"sizes": [max(options.sizes)], "pairs": 0})
    rows, interrupted = propose_left_out(_plan_sets(largest, study), study, engine)
    return left_out_check(rows), interrupted


def _check_thresholds(
    options: argparse.Namespace, study: PowerStudy, engine: Engine
) -> tuple[Check, bool]:
    from workbench.diagnosis.inference.thresholds import of_system
    from workbench.studies.power.planting import draw_sets
    from workbench.studies.power.report import thresholds_check
    from workbench.studies.power.sensitivity import threshold_values, vary_sets

    sets = draw_sets(_plan_sets(options, study), options.sets, options.seed)
    results, interrupted = vary_sets(sets, study, engine)
    usual = threshold_values(of_system(study.system.comparison, len(study.effects)))
    return thresholds_check(results, usual), interrupted


def _check_campaign(
    options: argparse.Namespace, study: PowerStudy, engine: Engine
) -> tuple[Check, bool]:
    from workbench.studies.power.campaign import predict_campaign
    from workbench.studies.power.report import campaign_check, draw_chances

    sizes, wanted = sorted(set(options.sizes)), _select(options.effects, study.rig)
    engine.report("one set without any effect is made and diagnosed")
    rows = predict_campaign(study, wanted, sizes, options.seed)
    draw_chances(rows, sizes, options.out / "plan")
    return campaign_check(rows, sizes), False


def _check_limits(
    options: argparse.Namespace, study: PowerStudy, engine: Engine
) -> tuple[Check, bool]:
    from workbench.studies.power.campaign import limits_of_effects
    from workbench.studies.power.report import oracle_check

    engine.report("one set without any effect is made and linearised")
    rows = limits_of_effects(study, _select(options.effects, study.rig), options.seed)
    return oracle_check(rows), False


def _check_proposals(
    options: argparse.Namespace, study: PowerStudy, engine: Engine
) -> tuple[Check, bool]:
    from workbench.studies.power.following import follow_proposals
    from workbench.studies.power.report import following_check

    alone = argparse.Namespace(**vars(options) | {"clean": 0, "pairs": 0})
    rows, interrupted = follow_proposals(_plan_sets(alone, study), study, engine)
    return following_check(rows), interrupted


_CHECKS = {
    "thresholds": _check_thresholds,
    "sheet_error": _check_sheet_errors,
    "leave_out_effect": _check_left_out,
    "plan": _check_campaign,
    "oracle": _check_limits,
    "follow": _check_proposals,
}


def _result(path: Path, interrupted: bool) -> CommandResult:
    """Result in a file; sizes are in the unit that stands beside them, or of `matters`."""
    return CommandResult(read_result(path), {"seconds": "s"}, 130 if interrupted else 0)
