"""Figures of a search: how it converged, and what it did to each case."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from workbench.runtime.files import replacing, warning_if_unwritable
from workbench.tuning.checkpoint import Generation


def draw_convergence(history: Sequence[Generation], path: Path) -> None:
    """Draw `convergence` to a file."""
    with warning_if_unwritable(), replacing(path) as stream:
        convergence(history).savefig(stream, format="png", dpi=120)


def convergence(history: Sequence[Generation]) -> Figure:
    """Best z and share of work saved, by generation."""
    figure = Figure(figsize=(8, 5), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    generations = np.arange(len(history))
    top.step(generations, [g.z for g in history], where="post")
    top.set(ylabel="best z [1]", title=f"z = {history[-1].z:.4g}, worst case {history[-1].worst}")
    bottom.plot(generations, [100 * g.saved for g in history], label="work saved")
    share = [100 * sum(g.unstable.values()) / g.candidates for g in history]
    bottom.plot(generations, share, "--", label="unstable candidates")
    bottom.set(xlabel="generation", ylabel="[%]", ylim=(0, 100))
    bottom.legend()
    for axes in (top, bottom):
        axes.grid(alpha=0.3)
    return figure


def draw_cases(cases: Mapping[str, Mapping[str, float]], path: Path) -> None:
    """z_k of each case of a summary with reasoned and with tuned gains."""
    names = list(cases)
    before, after = ([case[z] for case in cases.values()] for z in ("z_k_reasoned", "z_k"))
    figure = Figure(figsize=(8, 1.2 + 0.32 * len(names)), layout="constrained")
    axes = figure.subplots()
    rows = np.arange(len(names))
    axes.barh(rows - 0.2, before, 0.4, label="reasoned", color="0.7")
    axes.barh(rows + 0.2, after, 0.4, label="tuned")
    axes.axvline(max(after), color="0.3", linestyle=":", label="z, tuned")
    axes.set_yticks(rows, names)
    axes.invert_yaxis()
    axes.set_xlabel("z_k [1]")
    axes.legend()
    with warning_if_unwritable(), replacing(path) as stream:
        figure.savefig(stream, format="png", dpi=120)
