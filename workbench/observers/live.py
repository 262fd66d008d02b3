"""A window that shows estimators at work, sample by sample, as they would run on a vehicle."""

import time
from collections.abc import Sequence
from itertools import cycle
from textwrap import wrap

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.lines import Line2D

from workbench.errors import InputError
from workbench.observers import Estimator
from workbench.pages.figures import ESTIMATORS, LIGHT
from workbench.pages.views import named, per_shown, shown_unit
from workbench.recordings.case import Case
from workbench.system.system import System

_PAUSE = 0.1  # [s] between two drawings
_WIDTH = 110  # characters of a line above the figure


class LiveWindow:
    """Judged signal and estimated quantities, one case at a time.

    Closing it ends the show, not the run.
    """

    def __init__(self, system: System) -> None:
        self._system = system
        self._signals = [system.objective.signal, *(quantity.name for quantity in system.estimated)]
        units = [shown_unit(system, name) for name in self._signals]
        self._titles = [
            f"{named(system, name)} [{unit}]"
            for name, unit in zip(self._signals, units, strict=True)
        ]
        self._units = np.array(
            [per_shown(system, n, u) for n, u in zip(self._signals, units, strict=True)]
        )
        try:
            self._figure, axes = plt.subplots(
                len(self._signals),
                1,
                sharex=True,
                squeeze=False,
                height_ratios=[2, *[1] * len(system.estimated)],
                figsize=(9, 7),
                layout="constrained",
            )
            self._axes = axes[:, 0]
            framework = self._figure.canvas.required_interactive_framework
            found = f"no window (matplotlib fell back on '{plt.get_backend()}')"
        except ImportError as error:
            framework, found = None, f"no window ({error})"
        if framework is None:
            plt.close("all")
            raise InputError(
                where="--live",
                found=found,
                expected="a display (DISPLAY or WAYLAND_DISPLAY) and a toolkit such as Tk or Qt",
                remedy="run without --live and read index.html, or run it on a desktop with "
                "MPLBACKEND unset",
            )
        plt.show(block=False)

    def show(
        self, case: Case, estimators: Sequence[Estimator], warnings: Sequence[str] = ()
    ) -> None:
        """Step each estimator through a recording, one after the other, and draw what it says.

        Warnings stand above, such as quantities of which estimates are guesses.
        """
        if not self._open():
            return
        reference, *quantities = self._axes
        for axes, title in zip(self._axes, self._titles, strict=True):
            axes.clear()
            axes.set_title(title, loc="left", fontsize=9)
            axes.grid(alpha=0.25)
        self._axes[-1].set_xlabel("time [s]")
        reference.set_xlim(case.time[0], case.time[-1])
        for axes, quantity in zip(quantities, self._system.estimated, strict=True):
            axes.set_ylim(quantity.low, quantity.high)
        if self._signals[0] in case:
            measured = case[self._signals[0]] / self._units[0]
            reference.plot(case.time, measured, color=LIGHT["raw"], lw=0.5, label="measured")
        for estimator, style in zip(estimators, cycle(ESTIMATORS), strict=False):
            name = estimator.label
            curves = [axes.plot([], [], color=LIGHT[style], label=name)[0] for axes in self._axes]
            reference.legend(loc="lower center", ncols=4, fontsize=8)
            lines = [line for text in warnings for line in wrap(text, _WIDTH)]
            self._figure.suptitle("\n".join([f"{case.name}: {name}", *lines]), fontsize=10)
            self._step(case, estimator, curves)

    def wait(self) -> None:
        """Keep the last picture until the window is closed."""
        if self._open():
            print("close the window to end", flush=True)
            plt.show()

    def _step(self, case: Case, estimator: Estimator, lines: Sequence[Line2D]) -> None:
        u, y = case.u, case.y
        columns = [list(estimator.system.columns).index(name) for name in self._signals]
        estimator.set_conditions(case.conditions)
        values = np.full((case.time.size, len(self._signals)), np.nan)
        drawn = time.monotonic()
        for k, t in enumerate(case.time):
            advance = estimator.init if k == 0 else estimator.step
            values[k] = advance(t, u[k], y[k]).values[columns] / self._units
            last = k == case.time.size - 1
            if last or time.monotonic() - drawn > _PAUSE:
                if not self._open():
                    return
                for line, signal in zip(lines, values.T, strict=True):
                    line.set_data(case.time[: k + 1], signal[: k + 1])
                self._axes[0].relim()
                self._axes[0].autoscale_view(scalex=False)
                self._figure.canvas.draw()
                self._figure.canvas.flush_events()
                drawn = time.monotonic()

    def _open(self) -> bool:
        return bool(plt.fignum_exists(self._figure.number))
