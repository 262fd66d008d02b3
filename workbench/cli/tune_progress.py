"""Progress of `workbench tune`, and the gains that it keeps."""

import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from workbench.cli.output import Output, warn
from workbench.errors import InputError
from workbench.runtime.files import write_whole
from workbench.tuning import (
    Generation,
    Plan,
    Progress,
    TuningResult,
    tuned_gains,
)
from workbench.tuning.report import draw_convergence

_LIVE_PERIOD = 5.0  # [s] between two drawings of the convergence


class PrintedProgress(Progress):
    """Prints one line per generation, draws now and then if asked to, and keeps the gains."""

    def __init__(self, output: Output, plan: Plan, out: Path, *, live: bool) -> None:
        self._output, self._plan, self._out, self._live = output, plan, out, live
        self._drawn = -np.inf
        self.kept = False  # whether the gains could be written

    def begins(self, fold: int) -> None:
        """See Progress."""
        self._begin = time.perf_counter()
        self._done: list[Generation] = []
        if fold:
            self._output.progress(f"fold {fold} of {self._plan.folds}")

    def evolved(self, history: Sequence[Generation]) -> None:
        """See Progress."""
        last, now = history[-1], time.perf_counter()
        self._done.append(last)
        most = self._plan.generations
        left = (now - self._begin) / len(self._done) * (most + 1 - len(history))
        saved = 1.0 - sum(g.samples for g in self._done) / sum(g.of for g in self._done)
        self._output.progress(
            f"[{len(history) - 1:>3}/{most}] z {last.z:.5f}, worst {last.worst} by "
            f"{last.margin:.1%} over {last.second}; {last.candidates / last.seconds:.0f} "
            f"evaluations/s, {saved:.0%} of work saved, {sum(last.unstable.values())} unstable, at "
            f"most {left:.0f} s left"
        )
        if self._live and now - self._drawn > _LIVE_PERIOD:
            draw_convergence(history, self._out / "convergence.png")
            self._drawn = now

    def found(self, tuned: TuningResult) -> None:
        """Write the gains, first of all, so that nothing after them can lose them."""
        self.kept = write_or_print(self._out / "gains.toml", tuned_gains(tuned))

    def warn(self, message: str) -> None:
        """See Progress."""
        warn(message)


def write_or_print(path: Path, text: str) -> bool:
    """Write a result; if that fails print it instead, so that it is not lost."""
    try:
        write_whole(path, text)
    except InputError as error:
        print(f"{text}\nerror: {error} The content is above.", file=sys.stderr)
        return False
    return True
