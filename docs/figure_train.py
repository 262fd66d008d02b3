"""Tables of the train's pages: its distance, its monitoring, and how often its faults are named."""

from functools import partial
from itertools import groupby
from pathlib import Path

import numpy as np
from figure import Figure, Summary, Table
from figure_tables import labelled, sizes, verdict

from workbench.system.units import in_spoken_unit

# What an independent simulator planted in four stops each, by the name of the set.
FAULTS = {
    "pads_axle": "pads of axle 3, -15 %",
    "isolated_unit": "one of three units of axle 6 isolated, -33 %",
    "dragging": "brake of axle 5 drags with 1500 N.m",
    "cylinder_lag_bogie": "cylinders of bogie 3 lag by 0.4 s",
    "radius_axle": "radius of axle 2, -2.5 mm",
    "glazing": "15 %",
}
# Sets whose stops are predicted, each by the others.
PREDICTED = {
    "healthy": "sound train, dry and wet, 80 to 160 km/h",
    "history": "forty stops of months, in which one axle loses 12 % of its friction",
    "pads_axle": "four stops of a train whose axle 3 has lost 15 %",
}
LOSS = "pads of axle 7 lose 12 %, from stop 15 to 30"


def _prepared(name: str) -> str:
    folder = f"labelled/{name}" if name in FAULTS else name
    return f"prepare train --from {{recordings}}/train/{folder} --out {{out}}/stops/{name}"


def _distance(name: str, options: str, out: str) -> str:
    return f"distance --system train {{out}}/stops/{name} {options} --out {{out}}/distance/{out}"


_SAFETY = _distance("healthy", "--samples 1000", "healthy")


def ends(summary: Summary, form: str) -> str:
    """A value with its interval."""
    value, low, high = (format(summary[key], form) for key in ("ratio", "low", "high"))
    return f"{value} ({low} to {high})"


def safety(summary: Summary) -> Table:
    """The safety level by decade."""
    rows: Table = [["one stop in", "ratio (95 %)", "variation of the probability"]]
    rows[0] = [*rows[0], "plain sampling for the same"]
    for level in summary["safety"]:
        digits, _, decade = f"{level['plain_stops']:.1e}".partition("e")
        variation = f"{100.0 * level['variation']:.2g} %"
        stops = f"{digits}e{int(decade)} stops"
        rows.append([f"1e{level['decade']}", ends(level, ".3f"), variation, stops])
    return rows


def plain(summary: Summary) -> Table:
    """The safety level beside that of stops that were drawn by themselves."""
    drawn = f"{summary['plain']['samples']:,} plain stops (95 %)".replace(",", " ")
    rows: Table = [["one stop in", "subset simulation (95 %)", drawn]]
    counted = {level["decade"]: ends(level, ".4f") for level in summary["plain"]["levels"]}
    for level in summary["safety"]:
        decade = level["decade"]
        rows.append([f"1e{decade}", ends(level, ".4f"), counted.get(decade, "too few")])
    return rows


def predicted(*summaries: Summary) -> Table:
    """How many stops are in the bands of the others, and how wide these are."""
    width = "width, of that of a known machine, median (least to most)"
    rows: Table = [["stops, each by the others", "in the 95 % band", width, "beyond the claim"]]
    for text, summary in zip(PREDICTED.values(), summaries, strict=True):
        held, stops = summary["held"], summary["stops"]
        widths = [stop["width"] for stop in stops if not stop["outside"]]
        low, middle, high = np.quantile(widths, (0.0, 0.5, 1.0))
        away = [stop["outside"] for stop in stops if stop["outside"]]
        reasons = f": {'; '.join(sorted(set(away)))}" if away else ""
        rows.append(
            [
                text,
                f"{held['stops']} of {held['of']}",
                f"{middle:.2f} ({low:.2f} to {high:.2f})",
                f"{len(away)}{reasons}",
            ]
        )
    return rows


def monitored(history: Summary, cause: Summary, healthy: Summary) -> Table:
    """What is told of two machines over their recordings."""
    rows: Table = [["recordings", "injected", "used", "reported"]]
    for name, planted, summary in (("history", LOSS, history), ("healthy", "nothing", healthy)):
        used, refused = summary["recordings"], len(summary["refused"])
        alarms = "; ".join(summary["sentences"]) or "no alarms"
        rows.append([f"`{name}`", planted, f"{used} of {used + refused}", alarms])
    named = f"{verdict(cause)}: {'; '.join(map(sizes, cause['causes']))}"
    rows.insert(2, ["its cause, by `--diagnose`", LOSS, "the last eight", named])
    return rows


def _share(summary: Summary) -> str:
    interval = f"{100.0 * summary['low']:.0f} to {100.0 * summary['high']:.0f} %"
    return f"{summary['hits']} of {summary['of']} ({interval})"


def named(summary: Summary) -> Table:
    """How often faults of the virtual train are named, all places of one kind together."""
    rows: Table = [["injected", "right, with its place or group (95 %)", "verdict on the others"]]
    effects, wrong = sorted(summary["effects"].items()), 0
    for effect, some in groupby(effects, lambda item: item[0].partition("[")[0]):
        places = dict(some)
        hits, of, others = 0, 0, dict.fromkeys(("nothing", "unexplained", "failed"), 0)
        for name, place in places.items():
            hits += sum(share["hits"] for share in place["right_first"].values())
            of += sum(share["of"] for share in place["right_first"].values())
            for word in others:
                others[word] += summary["confusion"][name].get(word, 0)
        ((multiple, _),) = place["right_first"].items()
        (size,), unit = in_spoken_unit([place["size"] * float(multiple)], place["unit"])
        wrong += of - hits - sum(others.values())
        text = ", ".join(f"{count} {word}" for word, count in others.items() if count)
        rows.append([f"{effect}, {size:.3g} {unit}", f"{hits} of {of}", text])
    sound = summary["false_alarms"]
    rows += [
        ["all faults", _share(summary["right_first"]), f"{wrong} a wrong name"],
        ["healthy trains: false alarms", _share(sound), ""],
        ["95 % intervals that contain the injected size", _share(summary["coverage"]), ""],
    ]
    return rows


TRAIN = {
    "safety": Figure(
        (_prepared("healthy"), _SAFETY),
        (Path("distance/healthy/distance.json"),),
        safety,
    ),
    "plain": Figure(
        (
            _prepared("healthy"),
            _distance("healthy", "--samples 100 --safety 5 --plain 100000", "plain"),
        ),
        (Path("distance/plain/distance.json"),),
        plain,
        long=True,
    ),
    "predicted": Figure(
        (
            *map(_prepared, PREDICTED),
            _SAFETY,
            *(
                _distance(name, "--samples 800 --safety 0", name)
                for name in PREDICTED
                if name != "healthy"
            ),
        ),
        tuple(Path("distance", name, "distance.json") for name in PREDICTED),
        predicted,
    ),
    "monitor": Figure(
        (
            "monitor {recordings}/train/history --system train --diagnose "
            "--out {out}/monitor/history",
            "monitor {recordings}/train/healthy --system train --out {out}/monitor/healthy",
        ),
        (
            Path("monitor/history/summary.json"),
            Path("monitor/history/cause/summary.json"),
            Path("monitor/healthy/summary.json"),
        ),
        monitored,
        long=True,
    ),
    "faults": Figure(
        (
            *map(_prepared, FAULTS),
            *(f"diagnose --system train {{out}}/stops/{n} --out {{out}}/train/{n}" for n in FAULTS),
        ),
        tuple(Path("train", name, "summary.json") for name in FAULTS),
        partial(labelled, FAULTS),
        long=True,
    ),
    "named": Figure(
        (
            "power --system train --clean 300 --sizes 4 --repeats 2 --pairs 0 --resume "
            "--out {out}/train/power",
        ),
        (Path("train/power/power.json"),),
        named,
        long=True,
    ),
}
