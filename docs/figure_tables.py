"""Tables of the wheelset, each from the summaries that the commands of `figures.py` write."""

from collections.abc import Mapping

import numpy as np
from figure import Summary, Table

from workbench.machines.wheelset.accuracy import COVERED, ROWS, Worst
from workbench.machines.wheelset.accuracy_report import cell
from workbench.observers import label
from workbench.system.registry import load_system
from workbench.system.units import in_spoken_unit

TUNED = ("disturbance_observer", "parameter_estimator")
SYSTEM = load_system("wheelset")
# What is asked of each row of the accuracy, and of the shares of power.
GOALS = ("2 %", "4 %", "4 %", "15 %", "reached", "0.5 s", "none", "0.01", "0.02", "10 %")
ASKED = {
    "false alarms on clean sets": "at most 2 %",
    "right cause first, above noise": "95 %",
    "both of a pair": "80 %",
    "unknown cause is unexplained": "80 %",
    "intervals that contain the truth": "90 %",
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


def titled(name: str) -> str:
    """An estimator as the page calls it: EKF, disturbance observer."""
    return name.upper() if len(name) == 3 else label(name, SYSTEM)


def errors(summary: Summary) -> Table:
    """Error of the judged signal by case and estimator."""
    key = f"{SYSTEM.objective.signal}_nrmse"
    cases = summary["cases"]
    names = list(next(iter(cases.values()))["estimators"])
    rows: Table = [["case", *(titled(name) for name in names)]]
    for case, results in cases.items():
        shares = [results["estimators"][name][key] for name in names]
        rows.append(
            [case, *("n/a" if share is None else f"{100.0 * share:.2f} %" for share in shares)]
        )
    return rows


def worst(summary: Summary) -> Table:
    """The worst stop of each row, beside what is asked of it."""
    estimators = summary["worst"]
    rows: Table = [["", "goal", *(titled(name) for name in estimators)]]
    for row, goal in zip(ROWS, GOALS, strict=True):
        cells = []
        for name in estimators:
            entry = estimators[name].get(row.text)
            value = None if entry is None else entry["value"]
            endless = np.inf if value is None else value
            cells.append(cell(row, None if entry is None else Worst(entry["stop"], endless)))
        rows.append([row.text, goal, *cells])
    return rows


def coverage(summary: Summary) -> Table:
    """Share of samples whose truth a 95 % band holds, mean of the stops, and the least of them."""
    shares: dict[str, dict[str, list[float]]] = {}
    for stop in summary["stops"].values():
        for name, estimator in stop["estimators"].items():
            for quantity, share in estimator.get("covers", {}).items():
                shares.setdefault(name, {}).setdefault(quantity, []).append(share)
    rows: Table = [[f"{len(summary['stops'])} stops", *(titled(name) for name in shares)]]
    for quantity in COVERED:
        known = [share.get(quantity) for share in shares.values()]
        texts = [
            "" if held is None else f"{100.0 * np.mean(held):.1f} % ({100.0 * min(held):.0f} %)"
            for held in known
        ]
        rows.append([quantity, *texts])
    return rows


def widths(summary: Summary) -> Table:
    """What the standard deviations of each filter must be multiplied by for bands to hold 95 %."""
    bands = summary["bands"]
    quantities = [name for name in COVERED if any(name in known for known in bands.values())]
    rows: Table = [["", *(titled(name) for name in bands)]]
    for quantity in quantities:
        known = [band.get(quantity) for band in bands.values()]
        rows.append([quantity, *("" if width is None else f"{width:.2f}" for width in known)])
    return rows


def sizes(cause: Summary) -> str:
    """Parameters of a cause with their intervals, as a laboratory says them."""
    texts = []
    for name, parameter in cause["parameters"].items():
        ends = [parameter[key] for key in ("value", "low", "high")]
        # Four digits: three may hide that an interval misses.
        (value, low, high), unit = in_spoken_unit(ends, parameter["unit"])
        texts.append(f"{name} {value:.4g} ({low:.4g} to {high:.4g}) {unit}")
    return "; ".join(texts)


def verdict(summary: Summary) -> str:
    """Causes that a diagnosis names, each with what it cannot be told from, or its verdict."""
    groups = ([cause["effect"], *cause["confusable_with"]] for cause in summary["causes"])
    return "; ".join(map(" or ".join, groups)) or str(summary["verdict"])


def causes(summary: Summary) -> Table:
    """Causes in the order in which they were named, with their sizes."""
    rows: Table = [["effect", "injected", "estimate, 95 % interval"]]
    for cause in summary["causes"]:
        rows.append([cause["effect"], PLANTED.get(cause["effect"], "nothing"), sizes(cause)])
    return rows


def labelled(sets: Mapping[str, str], *summaries: Summary) -> Table:
    """What is said of each set, and what it is worth on recordings that were held out.

    Parameters
    ----------
    sets : what was planted, by name.
    """
    error = "error in cross-validation, times the noise"
    rows: Table = [["recordings", "verdict", "injected", "estimate, 95 % interval", error]]
    for (name, planted), summary in zip(sets.items(), summaries, strict=True):
        causes, gain = summary["causes"], summary["gain"]
        change = f"{gain['before']:.3g} → {gain['after']:.2g}" if gain else ""
        estimate = "; ".join(map(sizes, causes))
        rows.append([f"`{name}`", verdict(summary), planted, estimate, change])
    return rows


def change(form: str, *ends: float | None) -> str:
    """Numbers before and after."""
    return " → ".join("n/a" if end is None else form.format(end) for end in ends)


def folds(*summaries: Summary) -> Table:
    """What tuning gains on stops that it had not seen, by estimator."""
    header = ["left out"]
    rows: dict[str, list[str]] = {}
    for summary in summaries:
        name = titled(summary["estimator"])
        header += [f"{name}: z, untuned to tuned", f"error of {summary['judged']}"]
        for fold in summary["folds"]:
            numbers = ", ".join(case.partition("_")[0] for case in fold["cases"])
            errors = (error and 100.0 * error for error in (fold["error_reasoned"], fold["error"]))
            rows.setdefault(numbers, []).extend(
                [
                    change("{:.3f}", fold["reasoned"], fold["tuned"]),
                    change("{:.2f} %", *errors),
                ]
            )
    return [header, *([numbers, *cells] for numbers, cells in rows.items())]


def shares(summary: Summary) -> Table:
    """What the command found, with its intervals."""
    rows: Table = [["", "goal", "measured", "95 % interval (Clopper-Pearson)"]]
    for name, measure in summary["answer"]["headline"].items():
        known = measure["value"] is not None
        value = f"{measure['value']:.0f} {measure['unit']}" if known else "n/a"
        ends = f"{measure['low']:.1f} to {measure['high']:.1f} %" if known else ""
        rows.append([name, ASKED.get(name, ""), value, ends])
    return rows


def followed(summary: Summary) -> Table:
    """What two stops leave together, the third one that is proposed, and what all three say."""
    header = ["injected, by the least size that matters", "verdict on two stops", "the best one"]
    rows: Table = [[*header, "said of three", "drawn ones that part them"]]
    alike: dict[tuple[str, str], list[tuple[str, bool]]] = {}
    for entry in summary["sets"]:
        made = entry["proposed"]
        if made is None:
            continue
        planted = f"{entry['planted']} x {entry['multiple']:g}"
        if not made["foreseen"]:
            sensed = entry["sensed"] or {"sensor": "", "parts": False}
            group = " or ".join(sorted(entry["group"])), sensed["sensor"]
            alike.setdefault(group, []).append((planted, sensed["parts"]))
            continue
        verdict = " or ".join(made["named"]) or made["verdict"]
        drawn = f"{sum(k['parts'] for k in entry['drawn'])} of {len(entry['drawn'])}"
        rows.append([planted, " or ".join(entry["group"]), made["experiment"], verdict, drawn])
    for (group, sensor), sets in alike.items():
        planted = ", ".join(name for name, _ in sets)
        with_it = f"; with a sensor of {sensor}" * bool(sensor)
        verdict = f"its own cause {sum(parts for _, parts in sets)} of {len(sets)} times"
        rows.append([planted, group, f"none discriminates{with_it}", verdict if sensor else "", ""])
    names = ("foreseen", "never", "sensed", "answered", "drawn")
    seen, never, sensed, answered, drawn = (_of(summary[name]) for name in names)
    ends = (
        f"discriminates: {seen}; where none was foreseen to, {never}, with a named sensor {sensed}"
    )
    return [*rows, ["all", "", "", f"{ends}; together {answered}", drawn]]


def _of(summary: Summary) -> str:
    return f"{summary['hits']} of {summary['of']}"


def laws(summary: Summary) -> Table:
    """What is said of a cause that nothing else explains, and which law is proposed for it."""
    rows: Table = [["injected", "without a law", "proposed", "where the effect acts"]]
    rows[0] = [*rows[0], "error in cross-validation, times the noise", "with the true form"]
    rows[0] = [*rows[0], "off what the cause does"]
    for entry in summary["sets"]:
        if not entry["asked"]:
            continue
        planted = entry["left_out"] or [f"{_gain(entry['rig'])}, in no catalogue"]
        right = {True: "yes", False: "no", None: ""}[entry["slot_right"]] if entry["laws"] else ""
        verdict = "; ".join(entry["named"]) or entry["verdict"]
        error = change("{:.3g}", entry["before"], entry["after"]) if entry["laws"] else ""
        true = entry["after_with_it"]
        proposed = "; ".join(entry["laws"]) or "nothing"
        off = "" if entry["function_error"] is None else f"{100.0 * entry['function_error']:.1f} %"
        known = "" if true is None else f"{true:.3g}"
        rows.append([*planted, verdict, proposed, right, error, known, off])
    gain, near = f"{_of(summary['gain'])} gain 80 %", f"{_of(summary['function'])} within 15 %"
    return [*rows, ["all", "", "", _of(summary["right_slot"]), gain, "", near]]


def _gain(options: str) -> str:
    """The rig's name of what its options plant."""
    return options.partition("--effect ")[2].partition("=")[0]


def by_case(summary: Summary, name: str) -> dict[str, float]:
    """Error of the judged signal of an estimator by case [% of the mean]."""
    key = f"{SYSTEM.objective.signal}_nrmse"
    return {
        case: 100.0 * result["estimators"][name][key] for case, result in summary["cases"].items()
    }


def tuned(untuned: Summary, *summaries: Summary) -> Table:
    """What each tuning gains on the stops that it was made on: itself, and a run with its gains."""
    judged = SYSTEM.objective.signal
    texts = [f"{judged}, worst stop", f"{judged}, wet discs, mean", f"{judged}, dry discs, mean"]
    columns = [["", "z", *(f"error of {text}" for text in texts), "work saved by dropping"]]
    for name, tuning, after in zip(TUNED, summaries[::2], summaries[1::2], strict=True):
        errors = [by_case(run, name) for run in (untuned, after)]
        dry = [[v for case, v in error.items() if "_dry_" in case] for error in errors]
        wet = [[v for case, v in error.items() if "_dry_" not in case] for error in errors]
        worst = [max(error.values()) for error in errors]
        means = ([float(np.mean(end)) for end in some] for some in (wet, dry))
        columns.append(
            [
                f"{titled(name)} ({len(tuning['gains'])} gains)",
                change("{:.3f}", tuning["z_reasoned"], tuning["z"]),
                *(change("{:.2f} %", *ends) for ends in (worst, *means)),
                f"{100.0 * tuning['work']['saved']:.0f} %",
            ]
        )
    return list(zip(*columns, strict=True))


def tuned_elsewhere(*summaries: Summary) -> Table:
    """Worst errors on recordings of others: of each set a run before, and one with each gains."""
    rows: Table = [[f"worst error of {SYSTEM.objective.signal}", *map(titled, TUNED)]]
    runs = 1 + len(TUNED)
    texts = ("fourteen stops of an independent simulator", "six of it, a radius 1.5 mm off")
    for text, (before, *after) in zip(texts, (summaries[:runs], summaries[runs:]), strict=True):
        ends = (
            [max(by_case(run, name).values()) for run in (before, own)]
            for name, own in zip(TUNED, after, strict=True)
        )
        rows.append([text, *(change("{:.2f} %", *end) for end in ends)])
    return rows


def judged_by(*summaries: Summary) -> Table:
    """What gains are worth on all stops, by what judged them while they were tuned on four."""
    name = TUNED[0]
    rows: Table = [["gains", "z", f"worst error of {SYSTEM.objective.signal}"]]
    texts = ("untuned", "tuned by the load cells", "tuned by the smoother")
    for text, summary in zip(texts, summaries, strict=True):
        z = max(case["estimators"][name]["z"] for case in summary["cases"].values())
        rows.append([text, f"{z:.3f}", f"{max(by_case(summary, name).values()):.2f} %"])
    return rows


def timed_models(summary: Summary) -> Table:
    """Calls into each FMU, in brackets as a ratio to plain C."""
    rows: Table = [["", "states", "derivatives", "Jacobian", "Co-Simulation steps of 5 ms"]]
    for name, times in summary["calls"].items():
        calls = [
            f"{1e6 * times[f'{call}_fmi']:.3f} us ({times['ratios'][call]:.2f})"
            for call in ("derivatives", "jacobian")
        ]
        rows.append(
            [f"`{name}`", str(times["states"]), *calls, f"{times['steps_per_second']:,.0f} /s"]
        )
    return rows


def timed_observers(summary: Summary) -> Table:
    """Loops of observers, and how many times as long other ways take."""
    rows: Table = [
        ["observer", "us per step", "times real time", "by FMPy's methods and numpy", "in plain C"]
    ]
    for times in summary["observers"]["steps"]:
        ratios = [
            f"{times[way] / times['step']:.{2 * (way == 'c')}f} times" if times[way] else ""
            for way in ("fmpy", "c")
        ]
        name = f"{titled(times['observer'])} ({times['states']} states)"
        step, pace = f"{1e6 * times['step']:.2f}", f"{times['times_real_time']:.0f}"
        rows.append([name, step, pace, *ratios])
    return rows


def timed_horizon(summary: Summary) -> Table:
    """A sample of the moving horizon, and the same problem by CasADi and IPOPT."""
    observer = summary["observers"]["horizon"]
    return [
        ["samples", "states and frictions", "us per sample", "by CasADi and IPOPT"],
        [
            f"{observer['samples']}",
            f"{observer['unknowns']}",
            f"{1e6 * observer['ours']:.1f}",
            f"{observer['ratios']['ipopt']:.0f} times",
        ],
    ]


def said_of_errors(summary: Summary) -> Table:
    """Verdict on sets of a rig that differs from its sheet."""
    rows: Table = [["wrong in the data sheet", "verdict"]]
    for entry in summary["sets"]:
        wrong = ", ".join(
            f"{name.replace('_', ' ')} {100.0 * size:+.3g} %"
            for name, size in entry["wrong"].items()
        )
        groups = "; ".join(" or ".join(group) for group in entry["causes"])
        rows.append([wrong, groups or entry["verdict"]])
    return rows
