"""The page of `simulate` of results made by hand: bands, size, ranking, contrast of colours."""

import base64
import json
import re
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import lxml.html
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from workbench.observers import choose
from workbench.observers.report import standings, summarise_runs, write_estimates, write_page
from workbench.observers.simulation import CaseResult, case_figure, prepare
from workbench.pages.figures import DARK, LIGHT, drawing, extremes, pack_samples
from workbench.pages.provenance import run_of

from .systems import WHEELSET

PROVENANCE = {
    "run": run_of("simulate", WHEELSET, {}),
    "workbench": "0",
    "commit": None,
    "python": "3",
    "packages": {},
    "fmu": {"file": "a.fmu", "model": "A", "sha256": "0" * 64},
}
SCORE = {"Fx_nrmse": None, "Fx_rms_N": 1.0, "z": 1.0, "seconds": 1.0, "reason": ""}


@given(values=st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=200), blocks=st.integers(1, 50))
def test_decimation_keeps_ends_and_extremes(values, blocks):
    signal = np.array(values)
    kept = extremes(signal, blocks)
    assert kept[0] == 0
    assert kept[-1] == signal.size - 1
    assert (np.diff(kept) > 0).all()
    assert kept.size <= 2 * blocks + 2
    assert signal[kept].min() == signal.min()
    assert signal[kept].max() == signal.max()


def contrast(colour: str, other: str) -> float:
    """Contrast of two colours, WCAG 2.2."""

    def luminance(colour: str) -> float:
        c = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
        linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    light, dark = sorted((luminance(colour), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize(("theme", "curves"), [(0, LIGHT), (1, DARK)])
def test_contrast_is_enough_in_both_themes(root, theme, curves):
    """WCAG 2.2 AA: 4.5 for text, 3 for graphics."""
    css = (root / "workbench" / "pages" / "page.css").read_text()
    named = dict(re.findall(r"--(\w+): (#\w{6});", css.split(":root {")[1 + theme]))
    for text in ("text", "quiet", "accent", "warning"):
        assert contrast(named[text], named["ground"]) >= 4.5
        assert contrast(named[text], named["raised"]) >= 4.5
    for colour in curves.values():
        assert contrast(colour, named["ground"]) >= 3.0


@pytest.fixture(scope="module")
def uncertain(dry_case, system) -> CaseResult:
    """Two estimators, the second with a standard deviation of Fx in the first half."""
    result = prepare(system, choose(system, ["open_loop", "direct_inversion"])).run(dry_case)
    run = result.runs["direct_inversion"]
    sigma = np.full_like(run.estimate, np.nan)
    sigma[: len(sigma) // 2, list(system.columns).index("Fx")] = 1e3  # [N]
    return replace(result, runs={**result.runs, "direct_inversion": replace(run, sigma=sigma)})


def write(result: CaseResult, path: Path, planned: int) -> Any:
    """A page of one case."""
    summary = summarise_runs(result.system, [result], PROVENANCE)
    write_page(result.system, summary, [case_figure(result)], planned, path)
    return lxml.html.fromstring(path.read_bytes())


def test_standard_deviations_become_bands_and_columns(uncertain, tmp_path):
    page = write(uncertain, tmp_path / "index.html", planned=1)
    bands = page.xpath("//path[contains(@class, 'band')]")
    assert [band.get("data-style") for band in bands] == ["1"]
    panel = bands[0].xpath("./ancestor::g[1]")[0]
    assert "Creep force" in panel.xpath("string(text)")
    steps = np.array(re.findall(r"-?\d+", bands[0].get("d")), dtype=float).reshape(-1, 2)
    x, y = np.cumsum(steps, axis=0).T
    half = 1e3 * (uncertain.case.time[-1] - uncertain.case.time[0]) / 2
    assert_allclose(x.max(), half, rtol=0, atol=200.0)  # [ms] two blocks of the band
    # The band closes with the lower edge below the upper one by twice 1.96 standard deviations.
    height = (y[-1] - y[0]) / 4000 * (float(panel.get("data-high")) - float(panel.get("data-low")))
    assert_allclose(height, 3.92, rtol=0.01)  # [kN] rounded to levels of some 10 N
    write_estimates(uncertain, tmp_path / "case.csv")
    table = pd.read_csv(tmp_path / "case.csv")
    assert [c for c in table if "sigma" in c] == ["direct_inversion.sigma_Fx [N]"]


def test_speeds_are_told_in_kilometres_per_hour_beside(uncertain):
    """10 m/s are 36 km/h: both scales of a panel agree at every tick."""
    figure = case_figure(uncertain)
    panel = replace(figure.panels[0], unit="m/s", low=-1.0, high=21.0)
    (drawn,) = drawing(replace(figure, panels=(panel,)))["panels"]
    assert drawn["further"]["unit"] == "km/h"
    for y, text in drawn["further"]["ticks"]:
        level = panel.high - (y - drawn["top"]) / drawn["height"] * (panel.high - panel.low)
        assert float(text) == pytest.approx(3.6 * level)
    others = drawing(figure)["panels"]
    assert not any(other["further"] for other in others if other["unit"] != "m/s")


def test_a_panel_of_nothing_but_zeros_is_drawn(uncertain):
    """A model of integers, as a counter, may be without any error."""
    figure = case_figure(uncertain)
    panel = replace(figure.panels[0], low=-0.0, high=0.0)
    (drawn,) = drawing(replace(figure, panels=(panel,)))["panels"]
    assert (drawn["low"], drawn["high"]) == (-1.0, 1.0)


def test_samples_are_those_of_the_curves(uncertain):
    """What packing.py says of its codes, taken back by hand."""
    figure = case_figure(uncertain)
    header, text = pack_samples(figure)
    count = json.loads(header)["samples"]
    planes = np.frombuffer(zlib.decompress(base64.b64decode(text)), np.uint8)
    low, high = planes.reshape(2, -1, count).astype(np.int64)
    folded = low | (high << 8)
    codes = np.cumsum((folded >> 1) ^ -(folded & 1), axis=1) & 0xFFFF
    ticks = (codes[0] << 16 | codes[1]) / (2**32 - 1)
    span = figure.time[-1] - figure.time[0]
    assert_allclose(figure.time[0] + ticks * span, figure.time, atol=1e-8 * span)
    rows = iter(codes[2:])
    curves = [curve for panel in figure.panels for curve in panel.curves]
    for curve, ranges in zip(curves, json.loads(header)["curves"], strict=True):
        for values, (least, most) in zip((curve.values, curve.reach), ranges, strict=False):
            row = next(rows)
            decoded = np.where(row == 65535, np.nan, least + (most - least) * row / 65534)
            # Half a code of rounding.
            assert_allclose(decoded, values, rtol=0, atol=0.51 * (most - least) / 65534 + 1e-12)


def test_pages_of_fourteen_cases_and_six_noisy_estimators_stay_below_3_MB(uncertain, tmp_path):
    run = uncertain.runs["direct_inversion"]
    rng = np.random.default_rng(1)
    noise = rng.normal(1.0, 0.1, (run.time.size, 1))
    estimate = np.nan_to_num(run.estimate, nan=0.3) * noise
    noisy = replace(run, estimate=estimate, sigma=0.1 * np.abs(estimate))
    names = [f"estimator_{k}" for k in range(6)]
    figure = case_figure(
        replace(
            uncertain,
            runs=dict.fromkeys(names, noisy),
            scores=dict.fromkeys(names, uncertain.scores["direct_inversion"]),
        )
    )
    estimators = {name: {**SCORE, "Fx_nrmse": 0.1} for name in names}
    case = {"title": "", "estimators": estimators, "doubts": [], "warnings": []}
    cases = {f"case_{k}": {**case, "contradicted": {}, "contradictions": {}} for k in range(14)}
    figures = [replace(figure, name=name) for name in cases]
    answer = {"answer": {"sentence": "Six estimators."}}
    summary = {**answer, "provenance": PROVENANCE, "weights": {"Fx": 1}, "cases": cases}
    write_page(uncertain.system, summary, figures, len(cases), tmp_path / "index.html")
    pages = {path.stem: lxml.html.fromstring(path.read_bytes()) for path in tmp_path.glob("*.html")}
    assert (tmp_path / "index.html").stat().st_size > 1e6
    assert all(path.stat().st_size < 3e6 for path in tmp_path.glob("*.html"))
    # Each case has one figure with all its samples, here or on the page that is linked.
    links = pages["index"].xpath("//article//a[contains(@href, '.html')]/@href")
    assert sorted(links) == sorted(f"{name}.html" for name in pages if name != "index")
    assert sum(len(page.xpath("//*[@class='samples']")) for page in pages.values()) == 14


def test_an_interrupted_run_says_so(uncertain, tmp_path):
    page = write(uncertain, tmp_path / "index.html", planned=3)
    assert "1 of 3 cases" in page.find_class("warning")[0].text_content()
    assert not write(uncertain, tmp_path / "index.html", planned=1).find_class("warning")


def test_an_estimator_that_fails_on_a_hard_case_does_not_win():
    cases = {
        "easy": {
            "estimators": {
                "brave": {**SCORE, "Fx_nrmse": 0.02},
                "brittle": {**SCORE, "Fx_nrmse": 0.01},
            }
        },
        "hard": {"estimators": {"brave": {**SCORE, "Fx_nrmse": 0.05}, "brittle": SCORE}},
    }
    ranking = standings({"cases": cases}, "Fx")
    assert [standing.name for standing in ranking] == ["brave", "brittle"]
    assert (ranking[0].case, ranking[0].worst) == ("hard", 0.05)
    assert (ranking[1].judged, ranking[1].worst) == (1, 0.01)
