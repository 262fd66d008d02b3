"""Figures of a diagnosis: prediction errors and residuals of a stop, dependences, twins, gain."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from workbench.case import Case
from workbench.diagnosis import Residuals
from workbench.diagnosis.residuals import RESIDUALS
from workbench.diagnosis.samples import BLOCK, CHANNELS
from workbench.fmu import Matrix, Vector
from workbench.report.figures import LIGHT, STYLE, CaseFigure, Curve, Panel, save_figure

NOMINAL, EXTENDED, NOISE = "0", "2", "raw"  # styles of curves
LASTING = 10  # blocks of 50 ms: half a second, as the residuals are smoothed
FAST = 1  # block: what turns with the wheel does not last
_BAND = 2.0  # standard deviations
_ROOM = 1.1  # of a panel over its largest value

# Scale and name of a channel in figures: title, factor from SI units, unit.
_ERRORS = {
    "slip": ("Slip", 1e3, "mm/s"),
    "omegaR": ("Roller speed omegaR", 1.0, "rad/s"),
    "Fx": ("Creep force Fx", 1.0, "N"),
}
_RESIDUALS = {
    "wheelset": ("Wheelset balance: torque that the model lacks [N.m]", 1.0),
    "roller": ("Roller balance: torque that the model lacks [N.m]", 1.0),
    "slip": ("Slip law: slip that the model lacks [mm/s]", 1e3),
}
_SLIP = ("Slip, as measured [mm/s]", 1e3)  # without Fx, what the contact explains is not known


@dataclass(frozen=True, eq=False)
class Lasting:
    """Prediction errors of a stop that last some blocks, at the middle of each.

    Attributes
    ----------
    before, after : (b, m) running means, of the nominal and of the last model, in CHANNELS.
    sigma : (b, m) their standard deviation by noise.
    """

    before: Matrix
    after: Matrix
    sigma: Matrix

    def noises(self) -> tuple[Vector, Vector]:
        """Root mean square before and after in units of the noise, (m,); noise leaves 1."""
        before, after = (
            np.sqrt(np.mean((errors / self.sigma) ** 2, axis=0))
            for errors in (self.before, self.after)
        )
        return before, after


def lasting(one: Residuals, span: int) -> Lasting:
    """Running means over a number of blocks, none across what was set aside."""
    before, after, sigma = (np.empty_like(one.sigma) for _ in range(3))
    for run in _runs(one.block_time):
        before[run] = _sums(one.before[run], span) / _sums(np.ones_like(one.sigma[run]), span)
        after[run] = _sums(one.after[run], span) / _sums(np.ones_like(one.sigma[run]), span)
        sigma[run] = np.sqrt(_sums(one.sigma[run] ** 2, span)) / _sums(
            np.ones_like(one.sigma[run]), span
        )
    return Lasting(before, after, sigma)


def at_blocks(one: Residuals) -> dict[str, Vector]:
    """Residuals at the middle of each block, (b,), SI; they are smooth over more than a block."""
    found = {}
    for name in RESIDUALS:
        if name in one.values:
            known = np.isfinite(one.values[name])
            found[name] = np.interp(one.block_time, one.time[known], one.values[name][known])
    return found


def stop_figure(one: Residuals, case: Case, extension: str, span: int) -> CaseFigure:
    """Describe the figure of a stop: where and when the simulation is wrong, against the noise.

    Parameters
    ----------
    extension : what the last model is called; empty if nothing was added to the nominal one.
    span : blocks over which errors are averaged, LASTING or FAST.
    """
    errors = lasting(one, span)
    gaps = [run.stop for run in _runs(one.block_time)[:-1]]

    def parted(values: Vector) -> Vector:
        return np.insert(values, gaps, np.nan)

    middles = [0.5 * (one.block_time[gap - 1] + one.block_time[gap]) for gap in gaps]
    panels = [
        _ranged("Roller speed omegaR, as measured [rad/s]", 0.45, case.omegaR, one, case, parted),
        _ranged("Brake pressure pB, as measured [bar]", 0.45, case.pB / 1e5, one, case, parted),
    ]
    for c, channel in enumerate(CHANNELS[: errors.sigma.shape[1]]):
        title, factor, unit = _ERRORS[channel]
        sigma = factor * errors.sigma[:, c]
        curves = [
            Curve(NOISE, parted(np.zeros(sigma.size)), parted(_BAND * sigma)),
            Curve(NOMINAL, parted(factor * errors.before[:, c])),
        ]
        if extension:
            curves.append(Curve(EXTENDED, parted(factor * errors.after[:, c])))
        shown = np.concatenate([curve.values for curve in curves] + [_BAND * sigma])
        panels.append(_symmetric(f"{title}: measured - predicted [{unit}]", 1.1, curves, shown))
    for name, values in at_blocks(one).items():
        title, factor = _RESIDUALS[name] if "wheelset" in one.values else _SLIP
        curve = Curve("measured", parted(factor * values))
        panels.append(_symmetric(title, 0.8, [curve], curve.values))
    legend = [
        (NOMINAL, "error of the nominal model, levels calibrated"),
        (NOISE, f"±{_BAND:g} standard deviations of the noise"),
        ("measured", "measured; residual of the nominal model"),
    ]
    if extension:
        legend.insert(1, (EXTENDED, f"error of the model {extension}"))
    return CaseFigure(
        name=case.name,
        title=case.title,
        finding=_finding(errors, extension, span),
        time=np.insert(one.block_time, gaps, middles),
        window=None,
        legend=tuple(legend),
        panels=tuple(panels),
    )


def draw_dependences(dependences: Sequence[Mapping[str, Any]], paths: Iterable[Path]) -> None:
    """Draw what errors go with, before and after, to each path (PNG or SVG by suffix)."""
    channels = list(dict.fromkeys(one["channel"] for one in dependences))
    influences = list(dict.fromkeys(one["influence"] for one in dependences))
    with mpl.rc_context(STYLE | {"axes.grid": False}):
        sheet = Figure(figsize=(7.5, 4.0), layout="constrained")
        plots = sheet.subplots(1, 2, sharey=True)
        for axes, key in zip(plots, ("before", "after"), strict=True):
            share = np.zeros((len(influences), len(channels)))
            for one in dependences:
                at = influences.index(one["influence"]), channels.index(one["channel"])
                share[at] = 100.0 * one[key]
            draw_heat(axes, share, 100.0)
            axes.set_xticks(range(len(channels)), channels)
            axes.set_yticks(range(len(influences)), influences)
            axes.set_title({"before": "nominal model", "after": "with what was added"}[key])
        sheet.suptitle("Share of an error's variance that follows an influence [%]")
        save_figure(sheet, paths)


def draw_confusability(
    names: Sequence[str], cosines: Matrix, found: Sequence[str], paths: Iterable[Path]
) -> None:
    """Draw the similarity of the signatures of effects; those found are marked."""
    with mpl.rc_context(STYLE | {"axes.grid": False, "font.size": 7}):
        sheet = Figure(figsize=(9.0, 9.0), layout="constrained")
        axes = sheet.subplots()
        draw_heat(axes, 100.0 * cosines, 100.0, least=50.0)
        marked = [f"▸ {name}" if name in found else name for name in names]
        axes.set_xticks(range(len(names)), names, rotation=90)
        axes.set_yticks(range(len(names)), marked)
        axes.set_title("Similarity of signatures in these data: 100 cannot be told apart")
        save_figure(sheet, paths)


def draw_gain(gain: Mapping[str, Any], paths: Iterable[Path]) -> None:
    """Draw the error of each stop, held out of the fit, before and after."""
    stops: Mapping[str, Mapping[str, float]] = gain["stops"]
    rows = [*stops, "all stops"]
    before = [*(one["before"] for one in stops.values()), gain["before"]]
    after = [*(one["after"] for one in stops.values()), gain["after"]]
    with mpl.rc_context(STYLE):
        sheet = Figure(figsize=(7.5, 1.5 + 0.3 * len(rows)), layout="constrained")
        axes = sheet.subplots()
        heights = range(len(rows))
        axes.hlines(heights, after, before, color=LIGHT["raw"])
        axes.plot(before, heights, "o", color=LIGHT[NOMINAL], label="nominal model")
        axes.plot(after, heights, "D", color=LIGHT[EXTENDED], label="extended model")
        interval = [gain["low"], gain["high"]]
        axes.plot(interval, [len(stops)] * 2, "|-", color=LIGHT[EXTENDED], label="95 % interval")
        axes.axvline(1.0, color=LIGHT["measured"], linewidth=0.8)
        axes.set_xscale("log")
        axes.set_yticks(heights, rows)
        axes.invert_yaxis()
        axes.set_xlabel("error on stops held out, in units of the noise")
        sheet.legend(loc="outside lower center", ncols=3, fontsize=8, frameon=False)
        save_figure(sheet, paths)


def _runs(time: Vector) -> list[slice]:
    """Blocks that follow each other."""
    step = np.diff(time)
    ends = np.flatnonzero(step > 1.5 * np.median(step)) + 1
    edges = [0, *(int(end) for end in ends), time.size]
    return [slice(begin, end) for begin, end in pairwise(edges)]


def _sums(values: Matrix, span: int) -> Matrix:
    """Running sums over `span` blocks along a run of them, (b, m)."""
    window = np.ones(min(span, len(values)))
    return np.column_stack([np.convolve(column, window, "same") for column in values.T])


def _ranged(
    title: str,
    height: float,
    values: Vector,
    one: Residuals,
    case: Case,
    parted: Callable[[Vector], Vector],
) -> Panel:
    curve = Curve("measured", parted(np.interp(one.block_time, case.time, values)))
    low, high = float(np.nanmin(curve.values)), float(np.nanmax(curve.values))
    room = 0.08 * (high - low) or 1.0
    return Panel(title, low - room, high + room, height, (curve,))


def _symmetric(title: str, height: float, curves: Sequence[Curve], shown: Vector) -> Panel:
    reach = _ROOM * float(np.nanmax(np.abs(shown))) or 1.0
    return Panel(title, -reach, reach, height, tuple(curves))


def _finding(errors: Lasting, extension: str, span: int) -> str:
    """Errors of each channel in units of their noise, and the largest in its own unit."""
    before, after = errors.noises()
    worst = int(np.argmax(before))
    title, factor, unit = _ERRORS[CHANNELS[worst]]
    rms = factor * float(np.sqrt(np.mean(errors.before[:, worst] ** 2)))
    arrows = ", ".join(
        f"{channel} {b:.1f}" + (f" to {a:.1f}" if extension else "")
        for channel, b, a in zip(CHANNELS, before, after, strict=False)
    )
    change = f", from the nominal model to that {extension}" if extension else ""
    return (
        f"Errors in means over {BLOCK * span:g} s, in units of their noise{change}: {arrows}. "
        f"Clearest in {title[0].lower() + title[1:]}, {rms:.3g} {unit} rms with the nominal model."
    )


def draw_heat(axes: Axes, percents: Matrix, most: float, least: float = 0.5) -> None:
    """A matrix of whole percents, written into their cells from `least` on."""
    axes.imshow(percents, cmap="Blues", vmin=0.0, vmax=1.6 * most, aspect="auto")
    for (row, column), value in np.ndenumerate(percents):
        if value >= least:
            axes.text(column, row, f"{value:.0f}", ha="center", va="center", fontsize=7)
