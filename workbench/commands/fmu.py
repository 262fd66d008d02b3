"""`workbench fmu`: build FMUs from Modelica."""

import argparse
from pathlib import Path

from workbench.commands.arguments import Commands
from workbench.errors import InputError

_FMUS = Path("fmus")
_PACKAGE = Path("modelica/WheelsetRig/package.mo")


def add_fmu(commands: Commands) -> None:
    """Add the command and its jobs to the parser."""
    fmu = commands.add_parser("fmu", help="build FMUs from Modelica")
    jobs = fmu.add_subparsers(required=True, metavar="JOB")
    build = jobs.add_parser(
        "build",
        help="compile Modelica models to FMUs",
        description="Compile Modelica models to FMUs (Model Exchange and Co-Simulation). "
        "Needs the extra [compiler].",
        epilog="examples:\n"
        "  python -m workbench fmu build --all\n"
        "  python -m workbench fmu build MyRig/package.mo MyRig.Model --fmi 3 --out model.fmu\n"
        "  python -m workbench fmu build --all --check",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    build.add_argument(
        "package", nargs="?", type=Path, default=_PACKAGE, help="package.mo (default: %(default)s)"
    )
    build.add_argument("model", nargs="?", help="dotted name of the model")
    build.add_argument("--fmi", type=int, choices=(2, 3), default=2, help="version of FMI")
    build.add_argument("--out", type=Path, metavar="FILE", help="FMU to write (default: MODEL.fmu)")
    build.add_argument("--all", action="store_true", help="everything that fmus/ holds")
    build.add_argument("--check", action="store_true", help="with --all: compare, write nothing")
    build.set_defaults(run=_build)


def _build(options: argparse.Namespace) -> int:
    try:
        from workbench import compiler  # an extra: everything else runs without it
    except ModuleNotFoundError as error:
        raise InputError(
            where="workbench.compiler",
            found=f"no package '{error.name}'",
            expected="the extra [compiler], which holds the Modelica compiler",
            remedy="run 'make fmus', or: pip install -e '.[compiler]' -c constraints.txt",
        ) from None
    if options.all and options.check:
        found = compiler.differences(options.package, _FMUS)
        print("\n".join(found) or f"{_FMUS} matches its sources")
        return 1 if found else 0
    if options.all:
        for built in compiler.build_all(options.package, _FMUS):
            print(f"{built.path}  {built.sha256}")
        return 0
    if options.model is None:
        raise InputError(
            where="command line",
            found="no model",
            expected="the dotted name of a model, or --all",
            remedy="see 'python -m workbench fmu build --help'",
        )
    out = options.out or Path(f"{options.model.rsplit('.', 1)[-1]}.fmu")
    built = compiler.build(options.package, options.model, out, fmi=options.fmi)
    print(f"{built.path}  {built.sha256}")
    return 0
