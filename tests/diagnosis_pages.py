"""Stops with a wrong load cell, their diagnosis and its page; residuals made by hand."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from workbench.__main__ import main
from workbench.diagnosis import Residuals
from workbench.diagnosis.inference.residuals import Balance
from workbench.system.registry import load_system

STOPS = {"01_dry_80_1.5": 45.0, "03_dry_120_3.6": 70.0, "05_dry_120_2.7_rev": 60.0}  # from [km/h]
PLANTED = 150.0  # [N] of the load cells, some ten times the noise of half a second
TWINS = {"FxOffset", "ApexOffset"}  # of which either may be named first
EFFECTS = ["BrakeFade", "BeddingIn", "WheelRadius", *sorted(TWINS)]


def diagnose(root: Path, stops: Path, out: Path) -> Path:
    """Through the command line, with few effects to be quick."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(root)
        assert (
            main(["diagnose", str(stops), "--certainty", "--effects", *EFFECTS, "--out", str(out)])
            == 0
        )
    return out


def text(element: Any) -> str:
    return " ".join(element.text_content().split())


def section(page: Any, name: str) -> Any:
    return page.xpath(f"//section[@aria-labelledby='{name}']")[0]


def residuals(gap: bool) -> Residuals:
    """A stop of 40 s with white noise, an error in its second half, and perhaps a slide."""
    rng = np.random.default_rng(1)
    time = np.arange(800) * 0.05
    kept = (time < 10.0) | (time > 15.0) if gap else time >= 0.0
    after = rng.normal(size=(kept.sum(), 3))
    step = np.where(time[kept] > 12.0, 10.0, 0.0)
    slip = np.where(kept, 1e-3, np.nan)
    return Residuals(
        name="stop",
        time=time,
        balances=(Balance("slip", "Slip, as measured", "m/s", "mm/s", slip),),
        channels=load_system("wheelset").comparison.channels,
        block_time=time[kept],
        before=after + step[:, None],
        after=after,
        sigma=np.ones_like(after),
    )
