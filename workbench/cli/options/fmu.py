"""What `workbench fmu` may be told."""

import argparse
from pathlib import Path

from workbench.cli.arguments import Commands, above_zero, add_isolated, positive


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command and its jobs to the parser; `text` is its line in the list of all."""
    fmu = commands.add_parser("fmu", help=text)
    jobs = fmu.add_subparsers(required=True, metavar="JOB")
    _add_build(jobs)
    _add_info(jobs)
    _add_check(jobs)
    return fmu


def _add_build(jobs: Commands) -> None:
    build = jobs.add_parser(
        "build",
        help="compile Modelica models to FMUs",
        description="Compile Modelica models to FMUs (Model Exchange and Co-Simulation). "
        "Needs the extra [compiler].",
        epilog="examples:\n"
        "  python -m workbench fmu build --all\n"
        "  python -m workbench fmu build MyRig/package.mo MyRig.Model --fmi 3 --out model.fmu\n"
        "  python -m workbench fmu build --all --check\n"
        "  python -m workbench fmu build --all --compiler omc",
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
        epilog="example:\n  python -m workbench fmu info model.fmu",
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
        epilog="example:\n  python -m workbench fmu check my_model.fmu --json > fitness.json",
    )
    checking.add_argument("fmu", type=Path, metavar="FILE", help="the FMU")
    checking.add_argument(
        "--instantiations",
        type=positive,
        default=2000,
        metavar="N",
        help="instances to make, one after the other (default: %(default)s)",
    )
    checking.add_argument(
        "--limit",
        type=above_zero,
        metavar="SECONDS",
        help="processor time that a call of the FMU may take (default: 3)",
    )
    add_isolated(checking)
    checking.set_defaults(job="check")
