"""Observability of states and frictions: figure, files and table."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from workbench.case import Case
from workbench.cosim import Run
from workbench.files import write_json, write_whole
from workbench.observability import (
    FRICTION_PRIOR,
    FRICTIONS,
    STRIDE,
    USEFUL,
    WINDOW,
    BrakingPoint,
    LinearTest,
    SensorNoise,
    WindowTest,
)
from workbench.report.figures import STYLE, save_figure

_COLOURS = ("#0072B2", "#D55E00")
_LINES = ("-", "--")


@dataclass(frozen=True)
class StopObservability:
    """Tests of several models along one recorded stop.

    Attributes
    ----------
    case : the recording.
    run : the estimate that makes the trajectory.
    braking : (m,) windows that end while braking.
    tests : one per model, with the same windows.
    """

    case: Case
    run: Run
    braking: NDArray[np.bool_]
    tests: tuple[WindowTest, ...]


def draw_observability(stop: StopObservability, path: Path) -> None:
    """Draw one stop to `path` (PNG): pressure and slip, then the bounds of both frictions.

    Bounds are drawn at the end of their window and shaded where the first model's are useful.
    """
    case = stop.case
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 7.0), layout="constrained")
        inputs, *rows = figure.subplots(3, 1, sharex=True)
        figure.suptitle(f"{case.name}: {case.title}", fontsize=10)
        inputs.plot(case.time, case.pB / 1e5, color="#D55E00", label="pB")
        inputs.set_ylabel("pB [bar]")
        slip = inputs.twinx()
        slip.plot(case.time, stop.run.signal("slip"), color="#0072B2", label="slip")
        slip.set_ylabel("slip velocity [m/s]")
        slip.grid(visible=False)
        slip.spines["right"].set_visible(True)
        handles = [*inputs.get_lines(), *slip.get_lines()]
        inputs.legend(handles, [str(h.get_label()) for h in handles], loc="upper right", ncols=2)
        for j, (axes, name) in enumerate(zip(rows, FRICTIONS, strict=True)):
            for test, colour, line in zip(stop.tests, _COLOURS, _LINES, strict=False):
                axes.semilogy(test.time, test.bound[:, j], line, color=colour, label=test.model)
            first = stop.tests[0]
            axes.fill_between(
                first.time,
                0.0,
                1.0,
                where=list(first.frictions_useful()[:, j]),
                transform=axes.get_xaxis_transform(),
                color=_COLOURS[0],
                alpha=0.08,
                linewidth=0,
            )
            limit, prior = USEFUL[name], FRICTION_PRIOR[j]
            axes.axhline(limit, color="black", linewidth=0.8, label=f"useful below {limit:g}")
            axes.axhline(
                prior, color="#999999", linewidth=0.8, linestyle=":", label="known beforehand"
            )
            axes.set_ylabel(f"bound of {name} [1]")
            # Room for the legend above the prior of 0.10.
            axes.set_ylim(3e-5, 2.0)
            axes.legend(loc="upper center", ncols=4, fontsize=7)
        rows[-1].set_xlabel("time [s]")
        figure.align_ylabels()
        save_figure(figure, [path])


def write_windows(stop: StopObservability, path: Path) -> None:
    """Write one CSV of a stop: end of the window, then bounds and remaining shares by model."""
    first = stop.tests[0]
    at = np.searchsorted(stop.case.time, first.time)
    columns = {
        "time [s]": first.time,
        "pB [bar]": stop.case.pB[at] / 1e5,
        "slip [m/s]": stop.run.signal("slip")[at],
        "muWR [1]": stop.run.signal("muWR")[at],
        "muDC [1]": stop.run.signal("muDC")[at],
        "braking [1]": stop.braking.astype(int),
    }
    for test in stop.tests:
        for j, name in enumerate(FRICTIONS):
            columns[f"{test.model}.bound_{name} [1]"] = test.bound[:, j]
        for j, name in enumerate(test.states):
            columns[f"{test.model}.remaining_{name} [1]"] = test.remaining[:, j]
    write_whole(path, pd.DataFrame(columns).to_csv(index=False, float_format="%.6g"))


def write_observability(
    linear: Sequence[LinearTest],
    stops: Sequence[StopObservability],
    provenance: Mapping[str, Any],
    path: Path,
) -> None:
    """Write observability.json: the linear test of each model, shares of each stop."""
    summary = {
        "provenance": provenance,
        "operating_point": asdict(BrakingPoint()),
        "noise": asdict(SensorNoise()),
        "window_s": WINDOW,
        "stride_s": STRIDE,
        "prior": dict(zip(FRICTIONS, FRICTION_PRIOR.tolist(), strict=True)),
        "useful": USEFUL,
        "linear": {test.model: _linear(test) for test in linear},
        "cases": {
            stop.case.name: {
                "title": stop.case.title,
                "braking_windows": int(stop.braking.sum()),
                "median_muWR": _median_adhesion(stop),
                "models": {test.model: _shares(test, stop) for test in stop.tests},
            }
            for stop in stops
        },
    }
    write_json(path, summary)


def _linear(test: LinearTest) -> dict[str, Any]:
    return {
        "observable": test.observable,
        "rank": test.rank,
        "states": {
            name: {"at": float(x), "scale": float(scale), "remaining": float(remaining)}
            for name, x, scale, remaining in zip(
                test.states, test.x, test.scale, test.remaining, strict=True
            )
        },
        "information": test.information.tolist(),
        "unobservable": test.unobservable,
        "invisible": test.invisible,
    }


def _median_adhesion(stop: StopObservability) -> float | None:
    """Friction wheel-rail of the trajectory, on which the bound of dmuWR depends most."""
    at = np.searchsorted(stop.case.time, stop.tests[0].time[stop.braking])
    return float(np.median(stop.run.signal("muWR")[at])) if at.size else None


def _shares(test: WindowTest, stop: StopObservability) -> dict[str, Any]:
    """Shares of the braking windows; None for a stop without braking."""
    if not stop.braking.any():
        return {"useful": None, "median_bound": None, "states_observable": None}
    useful = test.frictions_useful()[stop.braking].mean(axis=0)
    median = np.median(test.bound[stop.braking], axis=0)
    observable = test.states_observable()[stop.braking].mean(axis=0)
    return {
        "useful": dict(zip(FRICTIONS, useful.tolist(), strict=True)),
        "median_bound": dict(zip(FRICTIONS, median.tolist(), strict=True)),
        "states_observable": dict(zip(test.states, observable.tolist(), strict=True)),
    }


def format_observability(linear: Sequence[LinearTest], stops: Sequence[StopObservability]) -> str:
    """Table for the terminal: linear test by model and state, then shares of braking by case."""
    point = BrakingPoint()
    lines = [
        f"Linear test: one second at {point.speed:g} m/s, {point.pressure / 1e5:g} bar, "
        f"muWR {point.muWR:g}; left = standard deviation after it over before it"
    ]
    for test in linear:
        verdict = "observable" if test.observable else "not observable"
        information = ", ".join(f"{value:.2g}" for value in test.information[::-1])
        lines.append(f"{test.model}: rank {test.rank} of {len(test.states)}, {verdict}")
        lines.append(f"  information by direction, observable above 1: {information}")
        for name, scale, left in zip(test.states, test.scale, test.remaining, strict=True):
            strength = "invisible" if name in test.invisible else "weak"
            remark = f"  {strength}" if name in test.unobservable else ""
            lines.append(f"  {name:<10} scale {scale:8.3g}   left {100 * left:6.2f} %{remark}")
    width = max([len("case"), *(len(stop.case.name) for stop in stops)])
    header = f"{'case':<{width}}{'muWR':>7}" + "".join(
        f"{f'{name} < {USEFUL[name]:g}':>16}{'median':>10}" for name in FRICTIONS
    )
    hidden = [n for n in stops[0].tests[-1].states if n not in stops[0].tests[0].states]
    header += "".join(f"{name:>11}" for name in hidden)
    lines += [
        "",
        f"Share of braking time in which {WINDOW:g} s of samples tell: dmuWR, dmuDC "
        f"({stops[0].tests[0].model}), states ({stops[0].tests[-1].model})",
        header,
        "-" * len(header),
    ]
    for stop in stops:
        row = f"{stop.case.name:<{width}}"
        frictions, states = _shares(stop.tests[0], stop), _shares(stop.tests[-1], stop)
        if frictions["useful"] is None:
            lines.append(f"{row}  no braking")
            continue
        row += f"{_median_adhesion(stop):>7.2f}"
        for name in FRICTIONS:
            row += f"{100 * frictions['useful'][name]:>14.0f} %"
            row += f"{frictions['median_bound'][name]:>10.2g}"
        row += "".join(f"{100 * states['states_observable'][name]:>9.0f} %" for name in hidden)
        lines.append(row)
    lines.append(
        "Bounds are floors, for a right model at the estimated muWR (median) and friction that is "
        "constant within\nthe window. An estimate may err by far more where the contact differs."
    )
    return "\n".join(lines)
