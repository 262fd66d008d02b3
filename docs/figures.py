"""Tables of the pages, written from what the commands found: `make figures`.

    python docs/figures.py [--long] [--kept] [--recordings FOLDER] [NAME ...]

A table stands between `<!-- figures: NAME -->` and `<!-- figures end -->`, the commands that made
it below it. All other numbers of the page are typed, from the command that stands beside them. Some
tables are of recordings that are not part of the repository: without them they stay as they are.
"""

import argparse
import json
import re
import shlex
import subprocess
import sys
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path

import figure_tables as tables
from figure import Figure, Summary
from figure_machines import MACHINES, machines
from figure_tables import LABELLED, TUNED
from figure_train import TRAIN

ROOT = Path(__file__).resolve().parents[1]
PAGES = ROOT / "docs"
RESULTS = Path("results", "figures")


_RIG = ("rig --seed 1 --out {out}/rig", "accuracy {out}/rig --out {out}/accuracy")
# What is drawn for each stop hangs on the seed: with seven of them nearly a hundred stops differ.
_SEEDS = range(1, 8)
_OTHER_SEEDS = range(8, 15)  # as many, which no band is judged by
_BENCH = ("bench --out {out}/bench",)
_FOUR = ("02_dry_100_2.7", "05_dry_120_2.7_rev", "09_wet_160_4.2_wsp", "13_onedisc_100_2.7")
_QUICK = (
    f"tune disturbance_observer --cases {' '.join(f'cases/{name}' for name in _FOUR)} "
    "--budget 12 --population 4"
)


def _before_and_after(cases: str, name: str) -> tuple[str, ...]:
    """Runs of both estimators that are tuned, untuned, and of each with its gains."""
    both = " ".join(f"--estimator {estimator}" for estimator in TUNED)
    return (
        f"simulate {cases}--untuned {both} --out {{out}}/tuned/{name}/untuned",
        *(
            f"simulate {cases}--gains {{out}}/tuned/{estimator}/gains.toml "
            f"--estimator {estimator} --out {{out}}/tuned/{name}/{estimator}"
            for estimator in TUNED
        ),
    )


def _banded(name: str, seeds: Iterable[int]) -> Figure:
    """Filters with bands against the truth of the stops of some seeds."""
    rigs = " ".join(f"{{out}}/rig{seed}" for seed in seeds)
    chosen = " ".join(f"--estimator {name}" for name in ("ekf", "ukf", "mhe", "imm", "smoother"))
    return Figure(
        (
            *(f"rig --seed {seed} --out {{out}}/rig{seed}" for seed in seeds),
            f"accuracy {rigs} {chosen} --out {{out}}/{name}",
        ),
        (Path(name, "accuracy.json"),),
        getattr(tables, name),
    )


FIGURES = {
    "simulate": Figure(
        ("simulate --out {out}/simulate",), (Path("simulate/summary.json"),), tables.errors
    ),
    "accuracy": Figure(_RIG, (Path("accuracy/accuracy.json"),), tables.worst),
    "coverage": _banded("coverage", _SEEDS),
    "widths": _banded("widths", _OTHER_SEEDS),
    "diagnose": Figure(
        ("diagnose --out {out}/diagnose",), (Path("diagnose/summary.json"),), tables.causes
    ),
    "models": Figure(_BENCH, (Path("bench/bench.json"),), tables.timed_models),
    "observers": Figure(_BENCH, (Path("bench/bench.json"),), tables.timed_observers),
    "horizon": Figure(_BENCH, (Path("bench/bench.json"),), tables.timed_horizon),
    "singles": Figure(
        tuple(f"diagnose {{recordings}}/labelled/{n} --out {{out}}/singles/{n}" for n in LABELLED),
        tuple(Path("singles", name, "summary.json") for name in LABELLED),
        partial(tables.labelled, LABELLED),
    ),
    "folds": Figure(
        tuple(f"tune {name} --folds 5 --out {{out}}/tune/{name}" for name in TUNED),
        tuple(Path("tune", name, "summary.json") for name in TUNED),
        tables.folds,
        long=True,
    ),
    "tuning": Figure(
        (
            *(f"tune {name} --out {{out}}/tuned/{name}" for name in TUNED),
            *_before_and_after("", "own"),
        ),
        (
            Path("tuned/own/untuned/summary.json"),
            *(
                Path("tuned", folder, "summary.json")
                for name in TUNED
                for folder in (name, f"own/{name}")
            ),
        ),
        tables.tuned,
        long=True,
    ),
    "elsewhere": Figure(
        (
            *(f"tune {name} --out {{out}}/tuned/{name}" for name in TUNED),
            *_before_and_after("{recordings}/standard ", "standard"),
            *_before_and_after("{recordings}/labelled/radius ", "radius"),
        ),
        tuple(
            Path("tuned", folder, name, "summary.json")
            for folder in ("standard", "radius")
            for name in ("untuned", *TUNED)
        ),
        tables.tuned_elsewhere,
        long=True,
    ),
    "judged": Figure(
        (
            f"{_QUICK} --out {{out}}/judged/cells",
            f"{_QUICK} --judge-by smoother --out {{out}}/judged/smoother",
            "simulate --estimator disturbance_observer --untuned --out {out}/judged/runs/untuned",
            *(
                "simulate --estimator disturbance_observer --gains "
                f"{{out}}/judged/{by}/gains.toml --out {{out}}/judged/runs/{by}"
                for by in ("cells", "smoother")
            ),
        ),
        tuple(
            Path("judged", "runs", name, "summary.json")
            for name in ("untuned", "cells", "smoother")
        ),
        tables.judged_by,
        long=True,
    ),
    "next": Figure(
        (
            "power --follow --case 24_alike_80_2.7 --case 25_alike_80_2.7 --sizes 2 4 8 16 32 "
            "--repeats 1 --out {out}/power",
        ),
        (Path("power/followed/followed.json"),),
        tables.followed,
        long=True,
    ),
    "laws": Figure(
        ("power --leave-out-effect --sizes 8 --repeats 1 --clean 0 --out {out}/power",),
        (Path("power/left_out/left_out.json"),),
        tables.laws,
        long=True,
    ),
    "machines": Figure(
        (
            *dict.fromkeys(machine.prepare for machine in MACHINES.values()),
            *(machine.diagnose(name) for name, machine in MACHINES.items()),
        ),
        tuple(Path("real", name, "summary.json") for name in MACHINES),
        machines,
    ),
    "sheet": Figure(
        ("power --sheet-error --repeats 1 --out {out}/power",),
        (Path("power/sheet_error/sheet_error.json"),),
        tables.said_of_errors,
        long=True,
    ),
    "power": Figure(
        (
            "power --clean 50 --sizes 2 4 8 --repeats 1 --pairs 20 --seed 2 --resume "
            "--out {out}/power",
        ),
        (Path("power/power.json"),),
        tables.shares,
        long=True,
    ),
    **TRAIN,
}


def written(name: str, *summaries: Summary) -> str:
    """A table with the command that made it, as it stands on the page."""
    header, *rows = FIGURES[name].table(*summaries)
    lines = [header, ["---"] * len(header), *rows]
    text = "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in line).strip() + " |"
        for line in lines
    )
    return f"{text}\n\n{origin(FIGURES[name].commands)}"


def origin(commands: Sequence[str]) -> str:
    """What stands below a table: the commands that made it."""
    places = {"out": RESULTS.as_posix(), "recordings": "FOLDER"}
    calls = [f"workbench {command}".format_map(places) for command in commands]
    if len(calls) == 1:
        return f"*Written by `make figures` from `{calls[0]}`.*"
    lines = "\n".join(calls)
    return (
        "*Written by `make figures`.*\n\n"
        '<details markdown="1"><summary>Commands</summary>\n\n'
        f"<!-- parsed: takes minutes -->\n```sh\n{lines}\n```\n\n</details>"
    )


def block(name: str) -> re.Pattern[str]:
    """What stands between the marks of a table."""
    return re.compile(
        rf"(?<=<!-- figures: {name} -->\n\n).*?(?=\n\n<!-- figures end -->)", re.DOTALL
    )


def page_of(name: str) -> Path:
    """Page with the marks of a table; SystemExit if none has them, or several."""
    pages = [page for page in sorted(PAGES.glob("*.md")) if block(name).search(page.read_text())]
    if len(pages) != 1:
        raise SystemExit(f"{name}: found {len(pages)} pages with its marks, expected one")
    return pages[0]


def placed(page: str, name: str, *summaries: Summary) -> str:
    """The page with a table written anew."""
    table, count = block(name).subn(lambda _: written(name, *summaries), page)
    if count != 1:
        raise SystemExit(f"found {count} places for {name}, expected one")
    return table


def main() -> int:
    """Run the commands, and write their tables; returns 1 if one failed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(FIGURES)}")
    parser.add_argument(
        "--long", action="store_true", help="also what takes many minutes, or hours"
    )
    parser.add_argument("--kept", action="store_true", help="from results that are there")
    parser.add_argument(
        "--recordings",
        type=Path,
        metavar="FOLDER",
        help="of recordings that are not part of the repository; without it their tables stay",
    )
    options = parser.parse_args()
    if unknown := [name for name in options.names if name not in FIGURES]:
        parser.error(f"{', '.join(unknown)}: expected some of {', '.join(FIGURES)}")
    usual = [n for n, figure in FIGURES.items() if options.long or not figure.long]
    names = list(options.names) or usual
    if options.recordings is None and not options.kept:
        for name in [name for name in names if FIGURES[name].recorded]:
            print(f"{name}: stays as it is, for it needs --recordings")
            names.remove(name)
    failed: dict[str, str] = {}
    if not options.kept:
        failed = _failing(
            [command for name in names for command in FIGURES[name].commands], options
        )
    for name in names:
        if missing := [command for command in FIGURES[name].commands if command in failed]:
            print(f"{name}: stays as it is, for {failed[missing[0]]}")
            continue
        files = [ROOT / RESULTS / summary for summary in FIGURES[name].summaries]
        summaries = [json.loads(file.read_text()) for file in files]
        page = page_of(name)
        page.write_text(placed(page.read_text(), name, *summaries))
        print(f"{page.relative_to(ROOT)}: {name}")
    return 1 if failed else 0


def _failing(commands: Sequence[str], options: argparse.Namespace) -> dict[str, str]:
    """Run commands, each once; those that fail, and how. One that fails costs its tables only."""
    failed = {}
    for command in dict.fromkeys(commands):
        words = command.format_map({"out": RESULTS.as_posix(), "recordings": options.recordings})
        program = [sys.executable, "-m", "workbench", *shlex.split(words)]
        if code := subprocess.run(program, cwd=ROOT, check=False).returncode:
            failed[command] = f"`workbench {words}` ends with {code}"
    return failed


if __name__ == "__main__":
    sys.exit(main())
