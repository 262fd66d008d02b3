"""`workbench fmu`: build FMUs from Modelica, describe them, check whether they are fit."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from workbench.cli.arguments import Commands, above_zero, add_isolated, add_number, nearby, positive
from workbench.cli.extras import require_compiler
from workbench.cli.output import CommandResult, Output, warn
from workbench.errors import InputError
from workbench.runtime.files import require_writable
from workbench.runtime.resources import CHECKOUT, fmus
from workbench.system.installed import built_models

if TYPE_CHECKING:
    from workbench.models.checks import CheckResult
    from workbench.models.description import Description


_OMC = Path("build/omc")


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command and its jobs to the parser; `text` is its line in the list of all."""
    fmu = commands.add_parser("fmu", help=text)
    jobs = fmu.add_subparsers(required=True, metavar="JOB")
    _add_build(jobs)
    _add_info(jobs)
    _add_check(jobs)
    _add_compare(jobs)
    return fmu


def _add_build(jobs: Commands) -> None:
    build = jobs.add_parser(
        "build",
        help="compile Modelica models to FMUs",
        description="Compile Modelica models to FMUs (Model Exchange and Co-Simulation). "
        "Needs the extra [compiler].",
        epilog="examples:\n"
        "  workbench fmu build --all\n"
        "  workbench fmu build MyRig/package.mo MyRig.Model --fmi 3 --out model.fmu\n"
        "  workbench fmu build --all --check\n"
        "  workbench fmu build --all --compiler omc",
    )
    build.add_argument("package", nargs="?", type=Path, help="package.mo of the library")
    build.add_argument("model", nargs="?", help="dotted name of the model")
    build.add_argument("--fmi", type=int, choices=(2, 3), default=2, help="version of FMI")
    build.add_argument(
        "--compiler",
        choices=("workbench", "omc"),
        default="workbench",
        help="omc: OpenModelica, where it is installed; FMI 2.0 (default: %(default)s)",
    )
    build.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="FMU to write (default: MODEL.fmu); with omc a folder (default: build/omc)",
    )
    build.add_argument(
        "--all",
        action="store_true",
        help="every model whose FMU comes with the package, into fmus/",
    )
    build.add_argument("--check", action="store_true", help="with --all: compare, write nothing")
    build.set_defaults(job="build")


def _add_info(jobs: Commands) -> None:
    info = jobs.add_parser(
        "info",
        help="say what an FMU is and offers",
        description="Print identity, interfaces, platforms, capabilities and variables of an FMU.",
        epilog="example:\n  workbench fmu info model.fmu",
    )
    info.add_argument("fmu", type=Path, metavar="FILE", help="the FMU")
    info.set_defaults(job="info")


def _add_check(jobs: Commands) -> None:
    checking = jobs.add_parser(
        "check",
        help="say whether an FMU is fit for observers",
        description="Try what an observer needs: replay after reset, states set from outside, "
        "rollback, derivatives, Co-Simulation against Model Exchange, many instances, memory, "
        "time per call. A crash of the FMU is a finding. Exit status: 0 fit, 1 not fit, 2 no FMU "
        "to check, 3 not measured, because the FMU did not answer in time.",
        epilog="example:\n  workbench fmu check my_model.fmu --json > fitness.json",
    )
    checking.add_argument("fmu", type=Path, metavar="FILE", help="the FMU")
    instances = "instances to make, one after the other"
    add_number(checking, "--instantiations N", positive, 2000, instances)
    checking.add_argument(
        "--limit",
        type=above_zero,
        metavar="SECONDS",
        help="processor time that a call of the FMU may take (default: 3)",
    )
    add_isolated(checking)
    checking.set_defaults(job="check")


def _add_compare(jobs: Commands) -> None:
    comparing = jobs.add_parser(
        "compare",
        help="compare the open loop of FMUs with FMPy",
        description="Simulate FMUs over their default experiments, by the open loop and by FMPy "
        "with CVode at a tolerance of 1e-8. Print a table of the largest differences, relative "
        "to the range of the signal. The verdict 'right' is within 1e-4. The verdict 'refused' "
        "says why the workbench does not run the FMU. Exit status: 0 all right or refused, 1 one "
        "is OFF.",
        epilog="example:\n  workbench fmu compare my_model.fmu other.fmu",
    )
    comparing.add_argument("fmus", type=Path, metavar="FILE", nargs="+", help="the FMUs")
    add_isolated(comparing)
    comparing.set_defaults(job="compare")


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Build, describe, check or compare FMUs."""
    jobs = {"build": _build, "info": _info, "check": _check, "compare": _compare}
    return jobs[options.job](options, output)


def _compare(options: argparse.Namespace, output: Output) -> CommandResult:
    from workbench.observers.fmpy_comparison import OFF, compare_with_fmpy, heading, row

    comparisons = []
    output.result(heading())
    for path in options.fmus:
        comparisons.append(compare_with_fmpy(path))
        output.result(row(comparisons[-1]))
    worst = any(comparison.verdict == OFF for comparison in comparisons)
    listed = [asdict(comparison) for comparison in comparisons]
    return CommandResult({"comparisons": listed}, {"time": "s"}, 1 if worst else 0)


def _build(options: argparse.Namespace, output: Output) -> CommandResult:
    require_compiler()
    from workbench.models import compiler  # an extra: everything else runs without it

    if options.all and options.package:
        raise InputError(
            where="command line, --all",
            found=f"a package, {options.package}",
            expected="none: all are those whose FMUs come with the package",
            remedy="leave one of the two out",
        )
    if options.compiler == "omc":
        return _build_with_omc(options, output)
    if options.all and options.check:
        differences = compiler.differences(built_models(), fmus())
        output.result("\n".join(differences) or f"{nearby(fmus())} matches its sources")
        return CommandResult({"differences": differences}, status=1 if differences else 0)
    if options.all:
        if CHECKOUT is None:
            raise InputError(
                where="--all",
                found="a package that was installed from a wheel",
                expected="a checkout of the sources, whose fmus/ it writes",
                remedy="compare them with --all --check, or build one model with --out",
            )
        built = compiler.build_all(built_models(), nearby(fmus()))
    else:
        _require_model(options)
        out = options.out or Path(f"{options.model.rsplit('.', 1)[-1]}.fmu")
        require_writable(out)
        built = [compiler.build(options.package, options.model, out, fmi=options.fmi)]
    for fmu in built:
        output.result(f"{fmu.path}  {fmu.sha256}")
        for note in fmu.notes:
            warn(note)
    return CommandResult({"fmus": [{"file": str(f.path), "sha256": f.sha256} for f in built]})


def _build_with_omc(options: argparse.Namespace, output: Output) -> CommandResult:
    from workbench.models.compiler.openmodelica import build_with_omc

    if options.fmi != 2 or options.check:
        raise InputError(
            where="--compiler omc",
            found=f"--fmi {options.fmi}" if options.fmi != 2 else "--check",
            expected="FMI 2.0, built, not compared: OpenModelica has no more",
            remedy="leave the option out",
        )
    if not options.all:
        _require_model(options)
    jobs = built_models() if options.all else {options.package: [options.model]}
    written = []
    for package, models in jobs.items():
        for path in build_with_omc(package, models, options.out or _OMC):
            output.result(str(path))
            written.append({"file": path})
    return CommandResult({"fmus": written})


def _require_model(options: argparse.Namespace) -> None:
    if options.model is None:
        raise InputError(
            where="command line",
            found="no model",
            expected="the dotted name of a model, or --all",
            remedy="see 'workbench fmu build --help'",
        )


def _info(options: argparse.Namespace, output: Output) -> CommandResult:
    from workbench.models.description import read_description

    description = read_description(options.fmu)
    output.result(_format_description(description))
    return CommandResult(asdict(description) | {"path": description.path.name})


def _check(options: argparse.Namespace, output: Output) -> CommandResult:
    from workbench.models.checks import check, is_fit, remember_findings, uses
    from workbench.models.description import read_description
    from workbench.runtime.supervision import usual_limits

    description = read_description(options.fmu)
    limits = usual_limits()
    if options.limit is not None:
        limits = replace(limits, processor=options.limit, answer=max(limits.answer, options.limit))
    output.result(f"{'check':<38} {'result':<7} {'value':>9} {'limit':>9}  unit")

    def begin(name: str) -> None:
        if sys.stderr.isatty() and not output.quiet:  # overwritten by the result
            print(f"{name} ...", end="\r", file=sys.stderr, flush=True)

    show = partial(_show_result, output)
    findings = check(options.fmu, options.instantiations, limits, begin, show)
    unknown = any(finding.unknown for finding in findings)
    fit = None if unknown and is_fit(findings) else is_fit(findings)
    possible = uses(findings)
    good = [use for use, failed in possible.items() if not failed]
    verdict = {
        True: "fit for observers",
        False: f"fit for {', '.join(good) or 'nothing'}; not fit for what else there is",
        None: "not measured",
    }
    output.result(f"{options.fmu.name} ({description.name}): {verdict[fit]}")
    for use, failed in possible.items() if fit is not None else ():
        reason = f"no, for {', '.join(failed)}" if failed else "it would do"
        output.result(f"    {use}: {reason}")
    remember_findings(description.sha256, [f for f in findings if f.passed is False])
    identity = {
        "file": description.path.name,
        "model": description.name,
        "fmi": description.version,
        "sha256": description.sha256,
    }
    listed = [asdict(finding) for finding in findings]
    result = {"fmu": identity, "fit": fit, "uses": possible, "findings": listed}
    return CommandResult(result, status={True: 0, False: 1, None: 3}[fit])


def _format_description(description: Description) -> str:
    lines = [
        f"model        {description.name}: {description.text}",
        f"FMI          {description.version}, made by {description.tool or 'an unnamed tool'}",
        f"token        {description.token}",
        f"sha256       {description.sha256}",
        f"platforms    {', '.join(description.platforms) or 'none, sources only'}",
        f"states       {', '.join(description.states) or 'none'}",
    ]
    for name, interface in description.interfaces.items():
        capabilities = [
            key.replace("_", " ") for key, value in asdict(interface).items() if value is True
        ]
        lines.append(f"{name}: {', '.join(capabilities) or 'no capabilities'}")
    width = max((len(v.name) for v in description.variables), default=0)
    lines.append(f"\n{'variable':<{width}}  {'causality':<11} {'start':>12}  {'unit':<14} meaning")
    for v in description.variables:
        start, unit = v.start if v.start is not None else "", v.unit or ""
        lines.append(
            f"{v.name:<{width}}  {v.causality:<11} {start:>12}  {unit:<14} {v.text}".rstrip()
        )
    return "\n".join(lines)


def _show_result(output: Output, check: CheckResult) -> None:
    value, limit = (f"{n:.4g}" if n is not None else "" for n in (check.value, check.limit))
    if check.passed is None:
        output.result(f"{check.name:<38} -       {check.reason}")
        return
    result = "passed" if check.passed else "FAILED"
    output.result(f"{check.name:<38} {result:<7} {value:>9} {limit:>9}  {check.unit}")
    if check.reason:
        output.result(f"    {check.reason}")
