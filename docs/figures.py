"""Tables of `accuracy.md`, written from what the commands found: `make figures`.

    python docs/figures.py [--long] [--kept] [--recordings FOLDER] [NAME ...]

A table stands between `<!-- figures: NAME -->` and `<!-- figures end -->`, the command that made
it below it. All other numbers of the page are typed, from the command that stands beside them. Some
tables are of recordings that are not part of the repository: without them they stay as they are.
"""

import argparse
import json
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.lab import said
from workbench.report.views import label
from workbench.systems import load_system
from workbench.wheelset.accuracy import COVERED, ROWS, Worst
from workbench.wheelset.accuracy_report import cell

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "accuracy.md"
RESULTS = Path("results", "figures")
SYSTEM = load_system("wheelset")
# What is asked of each row of the accuracy, and of the shares of power.
GOALS = ("2 %", "4 %", "4 %", "15 %", "reached", "0.5 s", "none", "0.01", "0.02")
ASKED = {
    "false alarms on clean sets": "at most 2 %",
    "right cause first, above noise": "95 %",
    "both of a pair": "80 %",
    "unknown cause is unexplained": "80 %",
    "intervals that hold the truth": "90 %",
}
# What the rig plants in the stops of `cases` (`ORDINARY_PADS`), as a laboratory says it.
PLANTED = {
    "WaterFilm": "film 100 %; E0 450 kJ",
    "SpeedDependentPadFriction": "slope 20 %",
    "BrakeFade": "fade 4.0 % per 100 K",
    "PressureDependentPadFriction": "exponent 4.0 %",
}
# What an independent simulator planted in six dry stops each, by the name of the set.
LABELLED = {
    "clean": "nothing",
    "speed_friction": "slope 22 %",
    "fade": "fade 7.0 % per 100 K",
    "cylinder_lag": "80 ms",
    "radius": "-1.5 mm",
    "pole_ring": "amplitude 0.20 %",
}

TUNED = ("disturbance_observer", "parameter_estimator")

Table = list[Sequence[str]]  # the first row is the header


@dataclass(frozen=True)
class Figure:
    """A table and the commands that make it.

    Attributes
    ----------
    commands : of the workbench; they read and write below `{out}`, and may ask for `{recordings}`.
    summaries : files that the commands write, below the folder of results.
    table : of the summaries, in their order.
    long : whether they take hours.
    """

    commands: tuple[str, ...]
    summaries: tuple[Path, ...]
    table: Callable[..., Table]
    long: bool = False

    @property
    def recorded(self) -> bool:
        """Whether recordings are needed that are not part of the repository."""
        return any("{recordings}" in one for one in self.commands)


# --- tables ---


def titled(name: str) -> str:
    """An estimator as the page calls it: EKF, disturbance observer."""
    return name.upper() if len(name) == 3 else label(name, SYSTEM)


def errors(summary: Mapping[str, Any]) -> Table:
    """Error of the judged signal by case and estimator."""
    key = f"{SYSTEM.objective.judged}_nrmse"
    cases = summary["cases"]
    names = list(next(iter(cases.values()))["estimators"])
    rows: Table = [["case", *(titled(name) for name in names)]]
    for case, found in cases.items():
        shares = [found["estimators"][name][key] for name in names]
        rows.append([case, *("n/a" if one is None else f"{100.0 * one:.2f} %" for one in shares)])
    return rows


def worst(summary: Mapping[str, Any]) -> Table:
    """The worst stop of each row, beside what is asked of it."""
    found = summary["worst"]
    rows: Table = [["", "goal", *(titled(name) for name in found)]]
    for row, goal in zip(ROWS, GOALS, strict=True):
        cells = []
        for name in found:
            one = found[name].get(row.text)
            value = None if one is None else one["value"]
            endless = np.inf if value is None else value
            cells.append(cell(row, None if one is None else Worst(one["stop"], endless)))
        rows.append([row.text, goal, *cells])
    return rows


def covered(summary: Mapping[str, Any]) -> Table:
    """Share of samples whose truth a 95 % band holds, mean of the stops."""
    shares: dict[str, dict[str, list[float]]] = {}
    for stop in summary["stops"].values():
        for name, one in stop["estimators"].items():
            for quantity, share in one.get("covers", {}).items():
                shares.setdefault(name, {}).setdefault(quantity, []).append(share)
    rows: Table = [["", *(titled(name) for name in shares)]]
    for quantity in COVERED:
        known = [one.get(quantity) for one in shares.values()]
        texts = ["" if one is None else f"{100.0 * np.mean(one):.1f} %" for one in known]
        rows.append([quantity, *texts])
    return rows


def sizes(cause: Mapping[str, Any]) -> str:
    """Parameters of a cause with their intervals, as a laboratory says them."""
    texts = []
    for name, one in cause["parameters"].items():
        ends = [one[key] for key in ("value", "low", "high")]
        # Four digits: three may hide that an interval misses.
        (value, low, high), unit = said(ends, one["unit"])
        texts.append(f"{name} {value:.4g} ({low:.4g} to {high:.4g}) {unit}")
    return "; ".join(texts)


def causes(summary: Mapping[str, Any]) -> Table:
    """Causes in the order in which they were named, with their sizes."""
    rows: Table = [["cause", "planted", "estimate, 95 % interval"]]
    for cause in summary["causes"]:
        rows.append([cause["effect"], PLANTED.get(cause["effect"], "nothing"), sizes(cause)])
    return rows


def singles(*summaries: Mapping[str, Any]) -> Table:
    """What is said of each labelled set, and what it is worth on recordings that were held out."""
    error = "error on held-out stops, times the noise"
    rows: Table = [["recordings", "what is said", "planted", "estimate, 95 % interval", error]]
    for (name, planted), summary in zip(LABELLED.items(), summaries, strict=True):
        found, gain = summary["causes"], summary["gain"]
        named = ", ".join(" or ".join([c["effect"], *c["confusable_with"]]) for c in found)
        change = f"{gain['before']:.3g} → {gain['after']:.2g}" if gain else ""
        estimate = "; ".join(map(sizes, found))
        rows.append([f"`{name}`", named or summary["verdict"], planted, estimate, change])
    return rows


def folds(*summaries: Mapping[str, Any]) -> Table:
    """What tuning gains on stops that it had not seen, by estimator."""

    def change(form: str, *ends: float | None) -> str:
        return " → ".join("n/a" if one is None else form.format(one) for one in ends)

    header = ["left out"]
    rows: dict[str, list[str]] = {}
    for summary in summaries:
        name = titled(summary["estimator"])
        header += [f"{name}: z, untuned to tuned", f"error of {summary['judged']}"]
        for fold in summary["folds"]:
            numbers = ", ".join(case.partition("_")[0] for case in fold["cases"])
            errors = (one and 100.0 * one for one in (fold["error_reasoned"], fold["error"]))
            rows.setdefault(numbers, []).extend(
                [
                    change("{:.3f}", fold["reasoned"], fold["tuned"]),
                    change("{:.2f} %", *errors),
                ]
            )
    return [header, *([numbers, *cells] for numbers, cells in rows.items())]


def shares(summary: Mapping[str, Any]) -> Table:
    """What the command found, with its intervals."""
    rows: Table = [["", "goal", "measured", "95 % interval (Clopper-Pearson)"]]
    for name, one in summary["answer"]["headline"].items():
        known = one["value"] is not None
        value = f"{one['value']:.0f} {one['unit']}" if known else "n/a"
        ends = f"{one['low']:.1f} to {one['high']:.1f} %" if known else ""
        rows.append([name, ASKED.get(name, ""), value, ends])
    return rows


def timed_models(summary: Mapping[str, Any]) -> Table:
    """Calls into each FMU, in brackets as a ratio to plain C."""
    rows: Table = [["", "states", "derivatives", "Jacobian", "Co-Simulation steps of 5 ms"]]
    for name, one in summary["calls"].items():
        calls = [
            f"{1e6 * one[f'{call}_fmi']:.3f} us ({one['ratios'][call]:.2f})"
            for call in ("derivatives", "jacobian")
        ]
        rows.append([f"`{name}`", str(one["states"]), *calls, f"{one['steps_per_second']:,.0f} /s"])
    return rows


def timed_observers(summary: Mapping[str, Any]) -> Table:
    """Loops of observers, and how many times as long other ways take."""
    rows: Table = [
        ["observer", "us per step", "times real time", "by FMPy's methods and numpy", "in plain C"]
    ]
    for one in summary["observers"]["steps"]:
        ratios = [
            f"{one[way] / one['step']:.{2 * (way == 'c')}f} times" if one[way] else ""
            for way in ("fmpy", "c")
        ]
        name = f"{titled(one['observer'])} ({one['states']} states)"
        step, pace = f"{1e6 * one['step']:.2f}", f"{one['times_real_time']:.0f}"
        rows.append([name, step, pace, *ratios])
    return rows


def said_of_errors(summary: Mapping[str, Any]) -> Table:
    """Verdict on sets of a rig that differs from its sheet."""
    rows: Table = [["wrong in the sheet", "what is said"]]
    for one in summary["sets"]:
        wrong = ", ".join(
            f"{name.replace('_', ' ')} {100.0 * size:+.3g} %" for name, size in one["wrong"].items()
        )
        groups = "; ".join(" or ".join(group) for group in one["causes"])
        rows.append([wrong, groups or one["verdict"]])
    return rows


# --- the page ---

_RIG = ("rig --seed 1 --out {out}/rig", "accuracy {out}/rig --out {out}/accuracy")
_BENCH = ("bench --out {out}/bench",)
FIGURES = {
    "simulate": Figure(
        ("simulate --out {out}/simulate",), (Path("simulate/summary.json"),), errors
    ),
    "accuracy": Figure(_RIG, (Path("accuracy/accuracy.json"),), worst),
    "coverage": Figure(_RIG, (Path("accuracy/accuracy.json"),), covered),
    "diagnose": Figure(
        ("diagnose --out {out}/diagnose",), (Path("diagnose/summary.json"),), causes
    ),
    "models": Figure(_BENCH, (Path("bench/bench.json"),), timed_models),
    "observers": Figure(_BENCH, (Path("bench/bench.json"),), timed_observers),
    "singles": Figure(
        tuple(f"diagnose {{recordings}}/labelled/{n} --out {{out}}/singles/{n}" for n in LABELLED),
        tuple(Path("singles", name, "summary.json") for name in LABELLED),
        singles,
    ),
    "folds": Figure(
        tuple(f"tune {name} --folds 5 --out {{out}}/tune/{name}" for name in TUNED),
        tuple(Path("tune", name, "summary.json") for name in TUNED),
        folds,
        long=True,
    ),
    "sheet": Figure(
        ("power --sheet-error --repeats 1 --out {out}/power",),
        (Path("power/sheet_error/sheet_error.json"),),
        said_of_errors,
        long=True,
    ),
    "power": Figure(
        ("power --clean 50 --sizes 2 4 8 --repeats 1 --pairs 20 --resume --out {out}/power",),
        (Path("power/power.json"),),
        shares,
        long=True,
    ),
}


def written(name: str, *summaries: Mapping[str, Any]) -> str:
    """A table with the command that made it, as it stands on the page."""
    header, *rows = FIGURES[name].table(*summaries)
    lines = [header, ["---"] * len(header), *rows]
    text = "\n".join("| " + " | ".join(line).strip() + " |" for line in lines)
    made = ", then ".join(f"`workbench {one}`" for one in FIGURES[name].commands)
    made = made.format(out=RESULTS.as_posix(), recordings="FOLDER")
    return f"{text}\n\n*Written by `make figures` from {made}.*"


def block(name: str) -> re.Pattern[str]:
    """What stands between the marks of a table."""
    return re.compile(
        rf"(?<=<!-- figures: {name} -->\n\n).*?(?=\n\n<!-- figures end -->)", re.DOTALL
    )


def placed(page: str, name: str, *summaries: Mapping[str, Any]) -> str:
    """The page with a table written anew."""
    found, count = block(name).subn(lambda _: written(name, *summaries), page)
    if count != 1:
        raise SystemExit(f"{PAGE}: found {count} places for {name}, expected one")
    return found


def main() -> None:
    """Run the commands, and write their tables."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(FIGURES)}")
    parser.add_argument("--long", action="store_true", help="also what takes hours")
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
    usual = [n for n, one in FIGURES.items() if options.long or not one.long]
    names = list(options.names) or usual
    if options.recordings is None and not options.kept:
        for name in [one for one in names if FIGURES[one].recorded]:
            print(f"{name}: stays as it is, for it needs --recordings")
            names.remove(name)
    if not options.kept:
        for command in dict.fromkeys(one for name in names for one in FIGURES[name].commands):
            places = {"out": RESULTS.as_posix(), "recordings": options.recordings}
            words = shlex.split(command.format_map(places))
            subprocess.run([sys.executable, "-m", "workbench", *words], cwd=ROOT, check=True)
    for name in names:
        files = [ROOT / RESULTS / one for one in FIGURES[name].summaries]
        summaries = [json.loads(file.read_text()) for file in files]
        PAGE.write_text(placed(PAGE.read_text(), name, *summaries))
        print(f"{PAGE.relative_to(ROOT)}: {name}")


if __name__ == "__main__":
    main()
