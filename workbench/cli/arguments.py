"""What the options of commands share; nothing here takes time to import."""

import argparse
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeAlias

from workbench.runtime import resources
from workbench.system.installed import usual_system

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


def nearby(path: Path) -> Path:
    """Shorten a path to what people type for it: relative to the working directory, if inside."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


def positive(text: str) -> int:
    """Type of an argument that is a whole number of 1 or more."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value} is not 1 or more")
    return value


def count(text: str) -> int:
    """Type of an argument that is a whole number of 0 or more."""
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{value} is below 0")
    return value


def above_zero(text: str) -> float:
    """Type of an argument that is a number above zero."""
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return value


def share(text: str) -> float:
    """Type of an argument that is a number between zero and one."""
    value = float(text)
    if not 0.0 < value < 1.0:
        raise argparse.ArgumentTypeError(f"{text} is not between 0 and 1")
    return value


def add_number(
    parser: argparse.ArgumentParser,
    usage: str,
    number: Callable[[str], float],
    default: float,
    text: str,
) -> None:
    """Add an option with a number, such as `--budget GENERATIONS`, whose help says its default."""
    option, metavar = usage.split()
    text = text if "(default" in text else f"{text} (default: %(default)s)"
    parser.add_argument(option, type=number, default=default, metavar=metavar, help=text)


def add_repeated(parser: argparse.ArgumentParser, usage: str, text: str) -> None:
    """Add an option that may be given several times, such as `--case NAME`."""
    option, _, metavar = usage.partition(" ")
    parser.add_argument(option, action="append", default=[], metavar=metavar, help=text)


def add_flags(parser: "argparse._ActionsContainer", flags: Mapping[str, str]) -> None:
    """Add options that are given or not, each with its help."""
    for option, text in flags.items():
        parser.add_argument(option, action="store_true", help=text)


def add_isolated(parser: argparse.ArgumentParser) -> None:
    """Add the option --isolated, which `main` reads before the command is run."""
    text = (
        "sandbox for untrusted FMUs, on Linux: no network, and no writing except to results "
        "and temporary files. A line says what this system supports"
    )
    add_flags(parser, {"--isolated": text})


def add_system(parser: argparse.ArgumentParser) -> None:
    """Add the option --system, which `load_system` reads."""
    parser.add_argument(
        "--system",
        default=usual_system(),
        metavar="NAME|FILE",
        help="an installed system, or a system file (default: %(default)s)",
    )


def add_workers(parser: argparse.ArgumentParser) -> None:
    """Add how many processes work."""
    text = "processes (default: one per processor, %(default)s)"
    add_number(parser, "--workers N", positive, os.cpu_count() or 1, text)


def add_run(parser: argparse.ArgumentParser) -> None:
    """Add how a command that writes a page is run: processes, a report, isolated or not."""
    add_workers(parser)
    add_pdf(parser)
    add_isolated(parser)


def add_model(parser: argparse.ArgumentParser) -> None:
    """Add the observer model, which may be one that a diagnosis has extended."""
    parser.add_argument(
        "--fmu",
        "--model",
        type=Path,
        metavar="FILE",
        help="observer model, or an extension of it (default: the system's)",
    )


def add_platforms(parser: argparse.ArgumentParser, fmu: str, usual: str) -> None:
    """Add for which platforms an FMU is compiled."""
    parser.add_argument(
        "--platforms",
        choices=("native", "all"),
        default=usual,
        help=f"of {fmu}: this machine's, or all (default: %(default)s)",
    )


def add_recordings(parser: argparse.ArgumentParser, out: str) -> None:
    """Add the cases to read and the folder to write to."""
    parser.add_argument(
        "cases",
        nargs="*",
        type=Path,
        metavar="CASE",
        help="case folder, folder of case folders, or log file, whose channels have the system's "
        "names or were confirmed by 'workbench import' (default: the system's)",
    )
    add_recording_options(parser)
    add_out(parser, out)


def add_out(parser: argparse.ArgumentParser, folder: str) -> None:
    """Add the folder to write to."""
    parser.add_argument(
        "--out",
        type=Path,
        default=Path(folder),
        metavar="DIR",
        help="where to write (default: %(default)s)",
    )


def add_pdf(parser: argparse.ArgumentParser) -> None:
    """Add whether the page is printed."""
    text = "also print the page, as a report to sign (report.pdf); needs Chromium"
    add_flags(parser, {"--pdf": text})


def add_seed(parser: argparse.ArgumentParser, of: str) -> None:
    """Add the seed, the same of which gives the same numbers."""
    add_number(parser, "--seed N", count, 1, f"of {of}")


def add_effects(parser: argparse.ArgumentParser, purpose: str) -> None:
    """Add which effects, and the library that has them."""
    parser.add_argument(
        "--effects",
        nargs="+",
        default=[],
        metavar="NAME",
        help=f"effects to {purpose} (default: all of the library)",
    )
    parser.add_argument(
        "--library",
        type=Path,
        metavar="FILE",
        help="package.mo of the Modelica library (default: the system's)",
    )


def add_reference(parser: argparse.ArgumentParser, purpose: str) -> None:
    """Add the detailed model."""
    parser.add_argument(
        "--reference",
        type=Path,
        metavar="FILE",
        help=f"FMU {purpose} (default: the system's reference model)",
    )


def add_recording_options(parser: argparse.ArgumentParser) -> None:
    """Add options of recordings without a case.toml, which `recording_options` reads."""
    add_repeated(
        parser,
        "--condition NAME=VALUE",
        "test condition of log files, as in case.toml, such as load='2 kN' or "
        "surface=new,worn; "
        "'unknown' if nobody knows; may be repeated",
    )
    add_repeated(
        parser,
        "--column SIGNAL=CHANNEL",
        "channel of a signal, or of time, in log files. Add its unit if the file has none or "
        "a wrong one, such as 'time=Zeit [ms]'; may be repeated",
    )
    parser.add_argument(
        "--sample-rate",
        metavar="RATE",
        help="sample rate of log files without times, such as '200 Hz'",
    )


def example_case() -> Path:
    """The first of the cases that come with the package, for the examples of a command's help."""
    return nearby(min(resources.cases().iterdir()))


def add_models(parser: argparse.ArgumentParser) -> None:
    """Add the FMUs and their names of variables, which `chosen_system` reads."""
    for option, name in (("--fmu", "observer"), ("--full-fmu", "full observer")):
        parser.add_argument(
            option, type=Path, metavar="FILE", help=f"{name} model (default: the system's)"
        )
    add_map(parser)


def add_map(parser: argparse.ArgumentParser) -> None:
    """Add the option --map, which `model_names` reads."""
    add_repeated(
        parser,
        "--map OURS=THEIRS",
        "the FMU's own name of a variable, such as p=pressure; may be repeated "
        "(also in case.toml, [model.names])",
    )
