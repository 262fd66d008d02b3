"""How a diagnosis is drawn: errors of each recording, what they go with, and what is gained."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.inference.residuals import Residuals
from workbench.observers.simulation import CaseResult, case_figure
from workbench.pages.figures import LIGHT, CaseFigure, Curve, Panel, save_figure, styled
from workbench.pages.views import capital, duration, named, per_shown, shown_unit
from workbench.recordings.case import Case
from workbench.system.comparison import Channel
from workbench.system.system import System
from workbench.system.units import si_factor, three_digits

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NOMINAL, EXTENDED, NOISE = "0", "2", "raw"  # styles of curves
FAST = 1  # block: what turns with a shaft does not last
_BAND = 2.0  # standard deviations
_ROOM = 1.1  # of a panel over its largest value


@dataclass(frozen=True, eq=False)
class LastingErrors:
    """Prediction errors of a recording that last some blocks, at the middle of each."""

    # before, after: (b, c) running means, of the nominal and of the last model, by channel
    before: Matrix
    after: Matrix
    sigma: Matrix  # (b, c) their standard deviation by noise

    def noises(self) -> tuple[Vector, Vector]:
        """Root mean square before and after in units of the noise, (c,); noise leaves 1."""
        before, after = (
            np.sqrt(np.nanmean((errors / self.sigma) ** 2, axis=0))
            for errors in (self.before, self.after)
        )
        return before, after


def lasting_blocks(system: System) -> int:
    """Blocks of half a lasting time: long enough for noise to fall, short enough to show a form."""
    return max(1, round(0.5 * system.comparison.lasting / system.comparison.block))


def lasting(residuals: Residuals, span: int) -> LastingErrors:
    """Running means over a number of blocks, none across what was set aside."""
    before, after, sigma = (np.empty_like(residuals.sigma) for _ in range(3))
    for run in _runs(residuals.block_time):
        known = np.isfinite(residuals.sigma[run])
        count = _sums(known.astype(float), span)
        count = np.where(count > 0.5, count, np.nan)
        before[run] = _sums(np.where(known, residuals.before[run], 0.0), span) / count
        after[run] = _sums(np.where(known, residuals.after[run], 0.0), span) / count
        variance = _sums(np.where(known, residuals.sigma[run] ** 2, 0.0), span)
        sigma[run] = np.sqrt(variance) / count
    return LastingErrors(before, after, sigma)


def at_blocks(residuals: Residuals) -> dict[str, Vector]:
    """Balances at the middle of each block, (b,), SI; they are smooth over more than a block."""
    balances = {}
    for balance in residuals.balances:
        known = np.isfinite(balance.values)
        balances[balance.name] = np.interp(
            residuals.block_time, residuals.time[known], balance.values[known]
        )
    return balances


def clearness(residuals: Residuals, span: int, explained: bool) -> float:
    """How clearly a recording shows what was found, or else how wrong the nominal model is."""
    before, after = lasting(residuals, span).noises()
    return float(np.max(before**2 - after**2 if explained else before**2))


def recording_figure(
    residuals: Residuals, case: Case, system: System, extension: str, span: int
) -> CaseFigure:
    """Describe the figure of a recording: where and when the simulation is wrong, beyond noise.

    Parameters
    ----------
    extension : what the last model is called; empty if nothing was added to the nominal one.
    span : blocks over which errors are averaged, `lasting_blocks` or FAST.
    """
    errors = lasting(residuals, span)
    gaps = [run.stop for run in _runs(residuals.block_time)[:-1]]

    def parted(values: Vector) -> Vector:
        return np.insert(values, gaps, np.nan)

    middles = [0.5 * (residuals.block_time[gap - 1] + residuals.block_time[gap]) for gap in gaps]
    panels = [_measured(system, name, residuals, case, parted) for name in _context(system)]
    for c, channel in enumerate(residuals.channels):
        panels.append(_errors(channel, errors, c, bool(extension), parted))
    for balance, values in zip(residuals.balances, at_blocks(residuals).values(), strict=True):
        factor = si_factor(balance.shown, balance.unit, balance.title)
        curve = Curve("measured", parted(values / factor))
        panels.append(_symmetric(balance.title, balance.shown, 0.8, [curve], curve.values))
    legend = [
        (NOMINAL, "error of the nominal model, levels calibrated"),
        (NOISE, f"±{_BAND:g} standard deviations of the noise"),
        ("measured", "measured" + "; residual of the nominal model" * bool(residuals.balances)),
    ]
    if extension:
        legend.insert(1, (EXTENDED, f"error of the model {extension}"))
    return CaseFigure(
        name=case.name,
        title=case.title,
        finding=_finding(residuals.channels, errors, extension, span * system.comparison.block),
        time=np.insert(residuals.block_time, gaps, middles),
        window=None,
        legend=tuple(legend),
        panels=tuple(panels),
    )


def estimate_figure(result: CaseResult) -> CaseFigure:
    """Describe the figure of the best estimates of a recording, by model."""
    figure = case_figure(result, (NOMINAL, EXTENDED))
    return replace(figure, name=f"{figure.name}, smoothed")


def draw_dependences(dependences: Sequence[Mapping[str, Any]], paths: Iterable[Path]) -> None:
    """Draw what errors go with, before and after, to each path (PNG or SVG by suffix)."""
    channels = list(dict.fromkeys(dependence["channel"] for dependence in dependences))
    influences = list(dict.fromkeys(dependence["influence"] for dependence in dependences))
    with styled(7.5, 4.0, axes_grid=False) as sheet:
        plots = sheet.subplots(1, 2, sharey=True)
        for axes, key in zip(plots, ("before", "after"), strict=True):
            share = np.zeros((len(influences), len(channels)))
            for dependence in dependences:
                at = (
                    influences.index(dependence["influence"]),
                    channels.index(dependence["channel"]),
                )
                share[at] = 100.0 * dependence[key]
            draw_heat(axes, share)
            axes.set_xticks(range(len(channels)), channels)
            axes.set_yticks(range(len(influences)), influences)
            axes.set_title({"before": "nominal model", "after": "with what was added"}[key])
        sheet.suptitle("Share of an error's variance that follows an influence [%]")
        save_figure(sheet, paths)


def draw_confusability(
    names: Sequence[str], cosines: Matrix, causes: Sequence[str], paths: Iterable[Path]
) -> None:
    """Draw the similarity of the signatures of effects; those found are marked."""
    with styled(9.0, 9.0, axes_grid=False, font_size=7) as sheet:
        axes = sheet.subplots()
        draw_heat(axes, 100.0 * cosines, least=50.0)
        marked = [f"▸ {name}" if name in causes else name for name in names]
        axes.set_xticks(range(len(names)), names, rotation=90)
        axes.set_yticks(range(len(names)), marked)
        axes.set_title("Similarity of signatures in these data: 100 is indistinguishable")
        save_figure(sheet, paths)


def draw_gain(gain: Mapping[str, Any], paths: Iterable[Path]) -> None:
    """Draw the error of each recording by fits to the others, before and after."""
    recordings: Mapping[str, Mapping[str, float]] = gain["recordings"]
    rows = [*recordings, "all recordings"]
    before = [*(recording["before"] for recording in recordings.values()), gain["before"]]
    after = [*(recording["after"] for recording in recordings.values()), gain["after"]]
    with styled(7.5, 1.5 + 0.3 * len(rows)) as sheet:
        axes = sheet.subplots()
        heights = range(len(rows))
        axes.hlines(heights, after, before, color=LIGHT["raw"])
        axes.plot(before, heights, "o", color=LIGHT[NOMINAL], label="nominal model")
        axes.plot(after, heights, "D", color=LIGHT[EXTENDED], label="extended model")
        interval = [gain["low"], gain["high"]]
        axes.plot(
            interval, [len(recordings)] * 2, "|-", color=LIGHT[EXTENDED], label="95 % interval"
        )
        axes.axvline(1.0, color=LIGHT["measured"], linewidth=0.8)
        axes.set_xscale("log")
        axes.set_yticks(heights, rows)
        axes.invert_yaxis()
        axes.set_xlabel("error in cross-validation, in units of the noise")
        sheet.legend(loc="outside lower center", ncols=3, fontsize=8, frameon=False)
        save_figure(sheet, paths)


def _runs(time: Vector) -> list[slice]:
    step = np.diff(time)
    ends = np.flatnonzero(step > 1.5 * np.median(step)) + 1
    edges = [0, *(int(end) for end in ends), time.size]
    return [slice(begin, end) for begin, end in pairwise(edges)]


def _sums(values: Matrix, span: int) -> Matrix:
    """Running sums over `span` blocks along a run of them, (b, m)."""
    window = np.ones(min(span, len(values)))
    return np.column_stack([np.convolve(column, window, "same") for column in values.T])


def _context(system: System) -> tuple[str, ...]:
    """Signals that say what happens: the led one, and what begins a recording or all inputs."""
    leading, begins = system.comparison.leading, system.comparison.begins
    first = [leading.output] if leading is not None else []
    driven = [signal.name for signal in system.inputs] if begins is None else [begins.signal]
    return tuple(dict.fromkeys([*first, *driven]))


def _measured(
    system: System,
    signal: str,
    residuals: Residuals,
    case: Case,
    parted: Callable[[Vector], Vector],
) -> Panel:
    unit = shown_unit(system, signal)
    factor = per_shown(system, signal, unit)
    values = system.under(case.conditions).signal(signal, case.signals)
    curve = Curve("measured", parted(np.interp(residuals.block_time, case.time, values / factor)))
    title = f"{capital(named(system, signal))}, as measured [{unit}]"
    return Panel.around(title, unit, 0.45, curve)


def _errors(
    channel: Channel,
    errors: LastingErrors,
    column: int,
    extended: bool,
    parted: Callable[[Vector], Vector],
) -> Panel:
    """Errors of a channel before and, if there is an extended model, after, against their noise."""
    factor = _shown(channel)
    sigma = errors.sigma[:, column] / factor
    curves = [
        Curve(NOISE, parted(np.zeros(sigma.size)), parted(_BAND * sigma)),
        Curve(NOMINAL, parted(errors.before[:, column] / factor)),
    ]
    if extended:
        curves.append(Curve(EXTENDED, parted(errors.after[:, column] / factor)))
    shown = np.concatenate([curve.values for curve in curves] + [_BAND * sigma])
    title = f"{capital(_called(channel))}: measured - predicted"
    return _symmetric(title, channel.shown, 1.1, curves, shown)


def _called(channel: Channel) -> str:
    return channel.name if channel.label == channel.name else f"{channel.label} {channel.name}"


def _shown(channel: Channel) -> float:
    """SI value of a channel that is one of its shown unit."""
    return si_factor(channel.shown, channel.unit, f"channel {channel.name}")


def _symmetric(
    title: str, unit: str, height: float, curves: Sequence[Curve], shown: Vector
) -> Panel:
    reach = _ROOM * float(np.nanmax(np.abs(shown))) or 1.0
    return Panel(f"{title} [{unit}]", unit, -reach, reach, height, tuple(curves))


def _finding(
    channels: Sequence[Channel], errors: LastingErrors, extension: str, seconds: float
) -> str:
    """Errors of each channel in units of their noise, and the largest in its own unit."""
    before, after = errors.noises()
    worst = int(np.argmax(before))
    clearest = channels[worst]
    rms = float(np.sqrt(np.mean(errors.before[:, worst] ** 2))) / _shown(clearest)
    arrows = ", ".join(
        f"{channel.name} {b:.1f}" + (f" to {a:.1f}" if extension else "")
        for channel, b, a in zip(channels, before, after, strict=True)
    )
    change = f", from the nominal model to that {extension}" if extension else ""
    return (
        f"Errors in means over {duration(seconds)}, in units of their noise{change}: {arrows}. "
        f"Clearest in {_called(clearest)}, {three_digits(rms)} {clearest.shown} rms with the "
        "nominal model."
    )


def draw_heat(axes: "Axes", percents: Matrix, least: float = 0.5) -> None:
    """A matrix of whole percents, written into their cells from `least` on."""
    axes.imshow(percents, cmap="Blues", vmin=0.0, vmax=160.0, aspect="auto")
    for (row, column), value in np.ndenumerate(percents):
        if value >= least:
            axes.text(column, row, f"{value:.0f}", ha="center", va="center", fontsize=7)
