"""The figure that shows where a long recording was cut."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from workbench.pages.figures import save_figure
from workbench.recordings.importing import Import
from workbench.system.system import System
from workbench.system.units import si_factor

_MOST = 4000  # samples of a curve, twice the pixels that it is drawn on


def draw_cuts(imported: Import, name: str, system: System, out: Path) -> None:
    """Draw the signals that cuts follow, with what is kept shaded, as `NAME_cuts.png` and SVG.

    Without a rule of the system it shows the first output.
    """
    rule = system.cutting
    names = [rule.begins.signal, rule.ends.signal] if rule else [system.outputs[0].name]
    sheet = Figure(figsize=(11.0, 1.0 + 2.0 * len(names)), layout="constrained")
    sheet.suptitle(f"{name}: {len(imported.pieces)} recordings", fontsize=10)
    time, signals = imported.measured.time, imported.measured.signals
    drawn = np.arange(0, time.size, max(1, time.size // _MOST))
    rows = sheet.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for axes, signal in zip(rows, names, strict=True):
        values = system.signal(signal, signals)
        known = system.signals.get(signal)
        unit = known.shown if known else system.unit(signal)
        scale = si_factor(unit, known.unit, signal) if known else 1.0
        axes.plot(time[drawn], values[drawn] / scale, linewidth=0.8, color="0.2")
        label = known.label if known else signal
        axes.set_title(f"{label} [{unit}]", fontsize=9, loc="left")
        for part in imported.parts:
            span = time[part.first], time[part.end - 1]
            if not part.reason:
                axes.axvspan(*span, color="tab:green", alpha=0.15, linewidth=0)
    for piece in imported.pieces:
        rows[0].annotate(
            piece.name.split("_")[0],
            (time[piece.samples[0]], 1.0),
            xycoords=("data", "axes fraction"),
            va="top",
            fontsize=8,
        )
    rows[-1].set_xlabel("time [s]; shaded: kept")
    save_figure(sheet, [out / f"{name}_cuts.png", out / f"{name}_cuts.svg"])
