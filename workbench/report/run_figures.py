"""Figures of runs: inputs, outputs, what is judged, residual.

After Figs. 8 and 9 of Schwarz et al. (2018).
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import cycle

import numpy as np

from workbench.cosim import Run
from workbench.fmu import Vector
from workbench.lab import BAND
from workbench.objective import judged_window
from workbench.report.figures import ESTIMATORS, CaseFigure, Curve, Panel
from workbench.report.views import (
    below,
    called,
    label,
    per_shown,
    percent,
    rounded,
    shown_unit,
    titled,
    views,
)
from workbench.simulation import OVERCONFIDENT, CaseResult
from workbench.system import System, View

_REFERENCE = "raw"  # style


def case_figure(result: CaseResult, styles: Sequence[str] = ESTIMATORS) -> CaseFigure:
    """Describe the figure of a case.

    Residuals are shown as they are judged: below the bandwidth. Bands hold 95 %.

    Parameters
    ----------
    styles : of the estimators, in turn.
    """
    system, case = result.system, result.case
    chosen = dict(zip(result.runs, cycle(styles), strict=False))
    window = judged_window(case, system)
    judged, panels = case.time[window], []
    for view in views(system):
        panels.append(_seen(result, chosen, view))
        if system.objective.judged in view.signals:
            panels.append(_residual(result, chosen, window))
    panels.append(_probabilities(result.runs.values()))
    return CaseFigure(
        name=case.name,
        title=case.title,
        finding=_finding(result),
        time=case.time,
        window=(float(judged[0]), float(judged[-1])) if judged.size else None,
        legend=tuple(_legend(result, chosen)),
        panels=tuple(panel for panel in panels if panel.curves),
    )


def run_figure(run: Run) -> CaseFigure:
    """Describe a figure of one estimate alone, a panel for each signal."""
    panels = []
    for name, unit in run.columns.items():
        if not np.isnan(run.signal(name)).all():
            curve = Curve("2", run.signal(name), _band(run, name, 1.0))
            panels.append(_panel(name, unit, _claimed(curve, run, name)))
    panels += [panel for panel in [_probabilities([run])] if panel.curves]
    legend = (("2", run.estimator),)
    return CaseFigure(run.case, run.summary(), "", run.time, None, legend, tuple(panels))


def _seen(result: CaseResult, styles: dict[str, str], view: View) -> Panel:
    """One panel: what was measured of its signals, and what was estimated.

    Of the judged signal, what was measured sets the range: an estimator may start or end with a
    spike, and a sensor may ring.
    """
    system, case = result.system, result.case
    unit = shown_unit(system, view.signals[0])
    fed = {one.name for one in (*system.inputs, *system.outputs)}
    known = [(styles[name], run) for name, run in result.runs.items()]
    best = [] if result.reference is None else [(_REFERENCE, result.reference)]
    curves: list[Curve] = []
    measured, here = None, system.under(case.conditions)
    for number, name in enumerate(view.signals):
        factor, judged = per_shown(system, name, unit), name == system.objective.judged
        if judged or name not in fed:
            for style, run in known if name in fed else known + best:
                curves += _estimated(run, style, name, factor)
        if judged and (measured := result.measured()) is not None:
            measured = measured / factor
            if below(system):
                curves.insert(0, Curve("raw", case[name] / factor))
            curves.append(Curve("measured", measured))
        elif name in case or _is_fed(system, name):
            values = here.signal(name, case.signals) / factor
            curves.append(Curve("measured", values, dashed=number > 0))
    signals = [curve.values for curve in curves]
    low, high = _range(signals) if measured is None else _range([measured], margin=0.25)
    return Panel(
        titled(view, unit),
        unit,
        low if view.low is None else view.low,
        high if view.high is None else view.high,
        view.height,
        tuple(curves),
    )


def _is_fed(system: System, name: str) -> bool:
    """Whether a signal is derived from what is fed; a sensor that only judges has its own panel."""
    judged = {one.name for one in system.judged}
    return any(one.name == name and not one.formula.names & judged for one in system.derived)


def _residual(result: CaseResult, styles: dict[str, str], window: slice) -> Panel:
    """Error of the judged signal by estimator."""
    system = result.system
    judged = system.objective.judged
    unit = shown_unit(system, judged)
    curves = [
        Curve(styles[name], error / per_shown(system, judged, unit))
        for name in result.runs
        if (error := result.error(name)) is not None
    ]
    reach = _reach([np.abs(curve.values[window]) for curve in curves])
    within = f", {below(system)}" if below(system) else ""
    title = f"Error of {judged}, estimated - measured{within} [{unit}]"
    return Panel(title, unit, -reach, reach, 1.1, tuple(curves))


def _probabilities(runs: Iterable[Run]) -> Panel:
    """Probability of each mode of the estimators that weigh models, one line style each."""
    modes = [one for run in runs for one in run.probability.items()]
    title = "Probability of " + ", ".join(name.replace("_", " ") for name, _ in modes) + " [1]"
    curves = [Curve(ESTIMATORS[i % len(ESTIMATORS)], one) for i, (_, one) in enumerate(modes)]
    return Panel(title, "1", -0.05, 1.05, 0.6, tuple(curves))


def _estimated(run: Run, style: str, signal: str, factor: float) -> list[Curve]:
    """Curves of an estimator that knows the signal, with its band."""
    if signal not in run.columns or not np.isfinite(run.signal(signal)).any():
        return []
    curve = Curve(style, run.signal(signal) / factor, _band(run, signal, factor))
    return _claimed(curve, run, signal)


def _claimed(curve: Curve, run: Run, signal: str) -> list[Curve]:
    """A curve in up to two parts: what is claimed, and dashed what is not."""
    if signal not in run.claimed:
        return [curve]
    claimed = run.claimed[signal]
    parts = (
        replace(curve, values=np.where(claimed, curve.values, np.nan)),
        Curve(curve.style, np.where(claimed, np.nan, curve.values), dashed=True),
    )
    return [part for part in parts if np.isfinite(part.values).any()]


def _band(run: Run, signal: str, factor: float) -> Vector | None:
    """Half of the 95 % band of an estimated signal, in its panel's unit; None without."""
    sigma = run.deviation(signal)
    return None if np.isnan(sigma).all() else BAND * sigma / factor


def _panel(name: str, unit: str, curves: Sequence[Curve]) -> Panel:
    ends = _range([curve.values for curve in curves])
    return Panel(f"{name} [{unit}]", unit, *ends, 1.0, tuple(curves))


def _range(signals: Sequence[Vector], margin: float = 0.08) -> tuple[float, float]:
    """Lowest and highest value with a margin on both sides; 0 to 1 where there is none."""
    values = np.concatenate([*signals, []])  # none, where nothing was estimated
    values = values[np.isfinite(values)]
    if not values.size:
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    room = margin * (high - low) or 1.0
    return low - room, high + room


def _reach(errors: Sequence[Vector]) -> float:
    """Half the axis of the residual: shows all of the best two, and cuts an open loop.

    Parameters
    ----------
    errors : magnitudes where they count, one array for each estimator, NaN where it failed.
    """
    peaks = sorted(float(e.max()) for e in errors if e.size and np.isfinite(e).all())
    return 1.1 * peaks[min(1, len(peaks) - 1)] if peaks else 1.0


def _legend(result: CaseResult, styles: dict[str, str]) -> list[tuple[str, str]]:
    """Style and text of each entry."""
    system, judged = result.system, result.system.objective.judged
    entries = [("measured", "measured")]
    if judged in result.case and below(system):
        entries = [
            ("measured", f"measured ({judged} {below(system)})"),
            ("raw", f"measured {judged}, unfiltered"),
        ]
    for name, style in styles.items():
        share, text = result.scores[name].nrmse, label(name, system)
        entries.append((style, text if share is None else f"{text} ({percent(share)})"))
    if result.reference is not None:
        best = label(result.reference.estimator, system)
        entries.append((_REFERENCE, f"reference, as no sensor reads it: {best}"))
    return entries


def _finding(result: CaseResult) -> str:
    """Errors of the estimators, the least first."""
    system, signal = result.system, result.system.objective.judged
    judged = sorted(
        (score.nrmse, label(name, system), score.rms)
        for name, score in result.scores.items()
        if score.nrmse is not None and score.rms is not None
    )
    if not judged:
        reasons = sorted({score.reason for score in result.scores.values()})
        return f"Estimated, not judged: {'; '.join(reasons)}."
    share, first, rms = judged[0]
    others = ", ".join(f"{name} {percent(value)}" for value, name, _ in judged[1:])
    trust = "".join(
        f" The {label(name, system)} is overconfident: its innovations have {ratio:.1f} times the "
        "variance that it says."
        for name in result.runs
        if (ratio := result.surprise(name)) > OVERCONFIDENT
    )
    return (
        f"The {first} errs least: {percent(share)} of the mean {called(system, signal)}, "
        f"{rounded(rms)} {system.unit(signal)} rms" + (f"; {others}." if others else ".") + trust
    )
