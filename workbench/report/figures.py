"""Figures like Figs. 8 and 9 of Schwarz et al. (2018): inputs, creep force, residual."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from workbench.objective import braking_window, low_pass
from workbench.report.results import CaseResult

# Colours that differ in lightness too (Wong 2011, Nature Methods 8, 441).
_COLOURS = {
    "open_loop": "#999999",
    "direct_inversion": "#E69F00",
    "disturbance_observer": "#0072B2",
}
_STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "lines.linewidth": 1.0,
    "svg.hashsalt": "workbench",
}


def draw_case(result: CaseResult, roller_radius: float, path: Path) -> None:
    """Draw one case to `path` (PNG): inputs and outputs, creep force, residual, friction.

    Residuals are shown as they are judged: below 5 Hz. The band is the braking window.
    """
    case = result.case
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(9.0, 9.5), layout="constrained")
        inputs, force, residual, friction = figure.subplots(
            4, 1, sharex=True, height_ratios=[1.0, 1.6, 1.0, 1.0]
        )
        figure.suptitle(f"{case.name}: {case.title}", fontsize=10)
        inputs.plot(case.time, case.omegaW, label="omegaW", color="#0072B2")
        inputs.plot(case.time, case.omegaR, label="omegaR", color="#56B4E9")
        inputs.set_ylabel("angular velocity [rad/s]")
        pressure = inputs.twinx()
        pressure.plot(case.time, case.pB / 1e5, label="pB", color="#D55E00")
        pressure.set_ylabel("pB [bar]")
        pressure.grid(visible=False)
        pressure.spines["right"].set_visible(True)
        handles = [*inputs.get_lines(), *pressure.get_lines()]
        inputs.legend(handles, [str(h.get_label()) for h in handles], ncols=3, loc="upper right")

        if case.Fx is not None:
            measured = low_pass(case.time, case.Fx)
            force.plot(case.time, case.Fx / 1e3, color="#BBBBBB", linewidth=0.5, label="measured")
            force.plot(case.time, measured / 1e3, color="black", label="measured, below 5 Hz")
        window = braking_window(case, roller_radius)
        for name, run in result.runs.items():
            colour = _COLOURS.get(name)
            estimate = run.signal("Fx")
            force.plot(case.time, estimate / 1e3, color=colour, linewidth=0.9, label=name)
            if case.Fx is not None:
                error = low_pass(case.time, estimate - case.Fx)
                score = result.scores[name].Fx_nrmse
                label = name if score is None else f"{name} ({100 * score:.2f} %)"
                residual.plot(case.time, error / 1e3, color=colour, label=label)
            for signal, shade in (("muWR", "#009E73"), ("muDC", "#CC79A7")):
                if name == "disturbance_observer":
                    friction.plot(case.time, run.signal(signal), color=shade, label=signal)
        if case.Fx is not None:
            # Open loop may be off by the whole force: the axis serves the estimators that follow.
            scale = 0.15 * float(abs(low_pass(case.time, case.Fx)).max()) / 1e3
            residual.set_ylim(-scale, scale)
            residual.legend(loc="upper right", ncols=3, fontsize=7)
        if window.stop > window.start:
            begin, end = case.time[window.start], case.time[window.stop - 1]
            for axes in (force, residual, friction):
                axes.axvspan(begin, end, color="#0072B2", alpha=0.04, linewidth=0)
        force.set_ylabel("Fx [kN]")
        force.legend(loc="upper right", ncols=3, fontsize=7)
        residual.set_ylabel("Fx error [kN]")
        residual.axhline(0.0, color="black", linewidth=0.5)
        friction.set_ylabel("friction [1]")
        friction.set_ylim(0.0, 0.6)
        friction.legend(loc="upper right", ncols=2)
        friction.set_xlabel("time [s]")
        figure.align_ylabels()
        figure.savefig(path, dpi=110, metadata={"Software": None})
