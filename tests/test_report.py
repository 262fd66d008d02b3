"""What `simulate` shows: the page that a colleague opens without the tool, and the live window."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from workbench.__main__ import main
from workbench.observers import label, trajectory
from workbench.observers.gains import matrix_names
from workbench.observers.report import standings, usual_error, warning_lines

from .page_rules import check_page, script
from .processes import LONGEST, python

CASES = ("02_dry_100_2.7", "07_wet_80_1.5", "09_wet_160_4.2_wsp")
FILES = (".npz", ".csv", ".png", ".svg")
UNJUDGED = '15 vehicle "A&B" <50 %>'  # a name that every quoting has to survive


@pytest.fixture(scope="module")
def results(once, root) -> Path:
    """Three recorded stops and one without Fx, through the command line."""

    def run(folder: Path) -> Path:
        source, vehicle, out = root / "cases" / "02_dry_100_2.7", folder / UNJUDGED, folder / "out"
        vehicle.mkdir()
        (vehicle / "case.toml").write_text((source / "case.toml").read_text())
        table = pd.read_csv(source / "measured.csv").drop(columns="Fx [N]").iloc[:1600]
        table.to_csv(vehicle / "measured.csv", index=False)
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(root)
            cases = [f"cases/{name}" for name in CASES]
            command = ["simulate", *cases, str(vehicle), "--csv", "--figures", "--out", str(out)]
            assert main(command) == 0
        return out

    return once("report", run)


def test_page_is_as_all_are(results, summary):
    check_page(results / "index.html", summary)


def columns(table: Any) -> list[str]:
    return [" ".join(cell.text_content().split()) for cell in table.xpath("./thead/tr/th")]


def rows(table: Any) -> list[list[Any]]:
    return [list(row) for row in table.xpath("./tbody/tr")]


def test_every_picture_states_its_finding(page, summary):
    drawings = page.xpath("//svg[not(ancestor::svg)]")
    assert len(drawings) == len(summary["cases"])
    for article, drawing in zip(page.xpath("//article"), drawings, strict=True):
        errors = [
            values["Fx_nrmse"]
            for values in summary["cases"][article.xpath("string(h3)")]["estimators"].values()
        ]
        if None in errors:
            assert "no Fx to score by" in drawing.get("aria-label")
        for error in errors:
            assert error is None or f"{100 * error:.2f} %" in drawing.get("aria-label")


def test_each_recording_has_links_to_its_files(page):
    links = [address for address in page.xpath("//a/@href") if address.endswith(FILES)]
    assert len(links) == len(FILES) * (len(CASES) + 1)


def test_numbers_are_those_of_the_summary(page, summary, system):
    table = page.get_element_by_id("case-table")
    titles = columns(table)
    best = standings(summary, "Fx")[0].name
    for row in rows(table):
        scores = summary["cases"][row[0].text_content().strip()]["estimators"]
        shown = dict(zip(titles, row, strict=True))
        expected = {f"{label(n, system)} [%]": s["Fx_nrmse"] for n, s in scores.items()}
        expected |= {"rms error [N]": scores[best]["Fx_rms_N"], "objective z": scores[best]["z"]}
        assert len(titles) == len(expected) + 2
        for title, value in expected.items():
            if value is None:
                assert shown[title].get("data-value") == ""
                assert shown[title].text_content() == "n/a"
                continue
            assert float(shown[title].get("data-value")) == value
            share = 100 if "[%]" in title else 1
            # Half of the last digit that a cell shows.
            digits = len(shown[title].text_content().partition(".")[2])
            assert_allclose(
                float(shown[title].text_content()), share * value, rtol=0, atol=0.5001 * 10**-digits
            )


def best_estimator(summary: dict[str, Any]) -> str:
    """The one whose worst case is the least."""

    def worst(name: str) -> float:
        errors = (case["estimators"][name]["Fx_nrmse"] for case in summary["cases"].values())
        return max(error for error in errors if error is not None)

    return min(next(iter(summary["cases"].values()))["estimators"], key=worst)


def test_worst_case_of_the_best_estimator_comes_first(page, summary, system):
    best = best_estimator(summary)
    errors = {n: c["estimators"][best]["Fx_nrmse"] for n, c in summary["cases"].items()}
    worst_first = sorted(CASES, key=lambda name: -errors[name])
    names = [row[0].text_content().strip() for row in rows(page.get_element_by_id("case-table"))]
    assert names == [*worst_first, UNJUDGED]
    assert page.xpath("//article/h3/text()") == names
    headline = page.find_class("headline")[0].text_content()
    assert label(best, system) in headline
    assert worst_first[0] in headline
    assert f"{100 * errors[worst_first[0]]:.2f} %" in headline


def test_the_answer_says_how_sure_it_is(page, summary):
    """The interval of the page and of the summary, by hand: Student's t of two degrees, 4.303."""
    best = best_estimator(summary)
    errors = [summary["cases"][name]["estimators"][best]["Fx_nrmse"] for name in CASES]
    middle = np.exp(np.mean(np.log(errors)))
    factor = np.exp(4.3027 * np.std(np.log(errors), ddof=1) / np.sqrt(len(errors)))
    measure = summary["answer"]["headline"][f"usual error of Fx, {best}"]
    ends = [measure[key] for key in ("value", "low", "high")]
    assert_allclose(ends, 100 * np.array([middle, middle / factor, middle * factor]), rtol=1e-4)
    value, low, high = (f"{end:.2f}" for end in ends)
    shown = f"{value} % (95 %: {low} to {high}) in a usual one"
    assert shown in page.find_class("headline")[0].text_content()


def test_intervals_hold_the_usual_error_as_often_as_they_say():
    """Of 2000 sets of three recordings, 95 % but for two standard deviations of that count."""
    errors = np.random.default_rng(1).lognormal(np.log(0.2), 0.5, (2000, 3))
    ends = np.array([usual_error(error.tolist()) for error in errors])
    held = np.mean((ends[:, 1] <= 0.2) & (ends[:, 2] >= 0.2))
    assert abs(held - 0.95) < 2 * np.sqrt(0.95 * 0.05 / 2000)


def test_page_says_what_was_run(page, summary):
    text = page.text_content()
    provenance = summary["provenance"]
    assert provenance["fmu"]["sha256"] in text
    assert provenance["fmu"]["model"] in text
    assert provenance["commit"] is None or provenance["commit"] in text
    for name in matrix_names("L", 4, 4):
        assert f"{provenance['disturbance_observer'][name]:.4g}" in text


def test_missing_scores_are_explained(page):
    warnings = [" ".join(p.text_content().split()) for p in page.find_class("warning")]
    assert any(UNJUDGED in text and "no Fx" in text for text in warnings)


def test_a_recording_without_the_cells_shows_the_smoother_as_reference(
    results, page, summary, root
):
    for name, case in summary["cases"].items():
        article = page.get_element_by_id(name.replace(" ", "_"))
        legend = [entry.text_content() for entry in article.xpath(".//ul[@class='legend']/li")]
        bands = article.xpath(".//g[starts-with(text, 'Creep force')]//path[@data-style='raw']")
        shown = "reference, as no sensor reads it: smoother, knows the whole recording" in legend
        assert shown == (name == UNJUDGED)
        assert ("band style-raw" in [band.get("class") for band in bands]) == shown
        assert case["reference"] == ("smoother" if shown else None)
    # What the cells said, which it did not see: in means over 50 ms, whose noise is 80 N / 10^0.5.
    table = pd.read_csv(results / f"{UNJUDGED}.csv")
    cells = pd.read_csv(root / "cases" / CASES[0] / "measured.csv")["Fx [N]"][: len(table)]
    block = np.arange(len(table)) // 10
    error = (table["smoother.Fx [N]"] - cells).groupby(block).mean()
    sigma = table["smoother.sigma_Fx [N]"].groupby(block).mean()
    inside = error.abs() < 1.96 * np.hypot(sigma, 80.0 / np.sqrt(10.0))
    assert inside.mean() >= 0.93
    assert not [c for c in pd.read_csv(results / f"{CASES[0]}.csv") if c.startswith("smoother")]


def test_curve_of_the_page_is_that_of_the_data(results, page):
    name = CASES[2]
    data = pd.read_csv(results / f"{name}.csv")
    plot = page.get_element_by_id(name).xpath(".//svg[@role='img']")[0]
    axes = plot.xpath("./g[starts-with(text, 'Error of Fx')]")[0]
    low, high = float(axes.get("data-low")), float(axes.get("data-high"))
    panel = axes.xpath("./svg")[0]
    levels = float(panel.get("viewbox").split()[3])
    path = panel.xpath("./path[@data-style='2']/@d")[0]
    assert path.count("M") == 1
    steps = np.array(re.findall(r"-?\d+", path), dtype=float).reshape(-1, 2)
    x, y = np.cumsum(steps, axis=0).T
    error = np.interp(x / 1e3, data["time [s]"], data["disturbance_observer.Fx_error [N]"]) / 1e3
    inside = (error > low) & (error < high)
    assert inside.mean() > 0.9
    shown = high - y * (high - low) / levels
    # Half a level of rounding; the CSV has seven digits.
    assert_allclose(shown[inside], error[inside], rtol=0, atol=0.51 * (high - low) / levels)


@pytest.fixture(scope="module")
def browser(results, probe) -> dict[str, Any]:
    """What a script that uses the page finds."""
    return probe(results / "index.html", script("report"))


def test_page_opens_without_errors_and_draws_every_panel(browser):
    assert browser["errors"] == []
    assert len(browser["visible"]) == 8
    assert min(browser["visible"]) > 40  # [px] a panel that can be read
    assert min(browser["curves"]) > 0


def test_table_sorts_on_click(browser, page, summary, system):
    """The script of the browser clicks the fourth heading twice, then the first."""
    fourth = columns(page.get_element_by_id("case-table"))[3]
    estimators = next(iter(summary["cases"].values()))["estimators"]
    (clicked,) = [name for name in estimators if f"{label(name, system)} [%]" == fourth]

    def by(estimator: str, sign: int) -> list[str]:
        errors = {n: c["estimators"][estimator]["Fx_nrmse"] for n, c in summary["cases"].items()}
        return [*sorted(CASES, key=lambda name: sign * errors[name]), UNJUDGED]

    (first, _), (down, down_sorts), (up, up_sorts), (names, name_sorts) = browser["sorts"]
    assert first == by(best_estimator(summary), -1)
    assert (down, down_sorts[3]) == (by(clicked, -1), "descending")
    assert (up, up_sorts[3]) == (by(clicked, 1), "ascending")
    assert (names, name_sorts[0]) == ([*CASES, UNJUDGED], "ascending")
    for sorts in (down_sorts, up_sorts, name_sorts):
        assert sorts.count("none") == len(sorts) - 1


def test_zoom_changes_the_view_of_all_panels_together(browser):
    whole = np.array(browser["whole"])
    duration = whole[0, 2]

    def times(key: str) -> list[float]:
        view = np.array(browser[key])
        assert np.unique(view[:, [0, 2]], axis=0).shape == (1, 2)
        return list(view[0, [0, 2]] / duration)

    assert times("whole") == [0.0, 1.0]
    assert times("in") == [0.25, 0.5]
    assert times("later") == [0.375, 0.5]
    assert times("back") == [0.25, 0.5]
    assert browser["reset"] == browser["whole"]
    assert browser["selections"] == len(whole)
    # A pixel of the pointer is 1/900 of the time.
    assert_allclose(times("dragged"), [0.25, 0.25], rtol=0, atol=2e-3)
    assert_allclose(times("moved"), [0.275, 0.25], rtol=0, atol=2e-3)
    assert_allclose(times("wheeled")[1], 0.25 * 1.002**100, rtol=1e-2)
    assert np.array(browser["closest"])[0, 2] == 200.0  # [ms]


def test_zoomed_panels_fit_what_is_visible(browser):
    """Within a quarter of a stop, some signal moves less than half of its way."""
    whole, zoomed = np.array(browser["whole"]), np.array(browser["dragged"])
    assert (zoomed[:, 3] <= 1.13 * whole[:, 3]).all()  # the margin is 6 % on either side
    assert (zoomed[:, 3] < 0.5 * whole[:, 3]).any()


def test_zoom_draws_every_sample_in_view(browser):
    """0.2 s at 200 Hz are 40 samples, and one beside the view at either end."""
    assert 39 <= browser["drawn"] <= 43


def shown_table(results: Path, page: Any) -> pd.DataFrame:
    """The data of the recording whose figure comes first."""
    return pd.read_csv(results / f"{page.xpath('string(//article/h3)')}.csv")


def test_cursor_reads_the_recorded_values_with_units(browser, results, page):
    """One sample after the middle, by the keyboard."""
    table = shown_table(results, page)
    time = table["time [s]"]
    row = table.iloc[time.searchsorted((time.iloc[0] + time.iloc[-1]) / 2) + 1]
    lines = browser["read"]
    assert float(lines[0].removesuffix(" s")) == pytest.approx(row["time [s]"], abs=1e-3)
    pressure = lines[lines.index("Brake pressure pB [bar]") + 1].split()
    # Five digits are shown; codes are 1/65534 of the range.
    assert float(pressure[0]) == pytest.approx(row["measured.pB [Pa]"] / 1e5, rel=1e-4)
    assert pressure[1] == "bar"
    force = lines[lines.index("Creep force Fx [kN]") + 1 :]
    filters = [line for line in force if line.endswith("extended Kalman filter")]
    assert float(filters[0].split()[0]) == pytest.approx(row["ekf.Fx [N]"] / 1e3, abs=1e-3)
    assert filters[0].split()[1] == "±"
    assert f"Brake pressure pB [bar]: measured {pressure[0]} bar" in browser["spoken"]
    assert browser["hidden_again"]


def test_cursor_follows_the_pointer(browser, results, page):
    time = shown_table(results, page)["time [s]"]
    middle = (time.iloc[0] + time.iloc[-1]) / 2
    # A pixel of the pointer is 1/900 of the time.
    at = float(browser["pointed"].removesuffix(" s"))
    assert at == pytest.approx(middle, abs=2e-3 * (time.iloc[-1] - time.iloc[0]))


def test_figures_fit_a_narrow_screen_with_letters_as_large_as_ever(browser):
    narrow = browser["narrow"]
    assert narrow["room"] <= 376
    assert narrow["drawn"] == narrow["room"] == narrow["scrolls"]  # one unit is one pixel
    assert narrow["right"] <= narrow["room"]
    assert 200 < narrow["panel"] < narrow["room"]
    cut = [caption for caption in narrow["captions"] if caption not in narrow["titles"]]
    assert cut
    assert narrow["note"] == "; ".join(cut)
    assert browser["wide"] == [988, narrow["captions"]]


def test_only_the_best_two_estimators_and_the_open_loop_are_shown_at_first(
    browser, summary, system
):
    best = best_estimator(summary)
    cases = [summary["cases"][name]["estimators"] for name in CASES]
    first = max(cases, key=lambda scores: scores[best]["Fx_nrmse"])
    errors = {name: score["Fx_nrmse"] for name, score in first.items()}
    shown = {label(n, system) for n in (*sorted(errors, key=errors.__getitem__)[:2], "open_loop")}
    pressed = {text.split(" (")[0]: state for text, state in browser["pressed"]}
    for name in errors:
        assert pressed[label(name, system)] == str(label(name, system) in shown).lower()


def test_legend_hides_an_estimator_everywhere(browser):
    pressed, displays = browser["hidden"]
    assert pressed == "false"
    # Force, residual, two frictions, and muWR in two parts where only some of it is claimed.
    assert displays == ["none"] * len(displays)
    assert len(displays) >= 4


def test_live_without_a_display_gives_status_2_and_a_message(root, tmp_path):
    command = ("-m", "workbench", "simulate", f"cases/{CASES[0]}", "--live", "--out", tmp_path)
    run = python(*command, DISPLAY=None, WAYLAND_DISPLAY=None)
    assert run.returncode == 2
    assert "--live: found no window" in run.stderr
    assert "run without --live" in run.stderr
    assert "Traceback" not in run.stderr


LIVE = """
import sys
from pathlib import Path
import matplotlib.pyplot as plt
from workbench.recordings.case import read_case
from workbench.observers import choose
from workbench.observers.live import LiveWindow
from workbench.observers.simulation import prepare
from workbench.system.registry import load_system

system = load_system("wheelset")
window = LiveWindow(system)
case = read_case(Path(sys.argv[1]), system)
simulation = prepare(system, choose(system, ["open_loop", "direct_inversion"]))
with simulation.estimators() as estimators:
    window.show(case, list(estimators.values()))
    lines = plt.gcf().axes[0].get_lines()
    print([(line.get_label(), len(line.get_xdata()) == case.time.size) for line in lines])
    plt.close("all")
    window.show(case, [estimators["open_loop"]])
window.wait()
"""


@pytest.mark.skipif(shutil.which("xvfb-run") is None, reason="no virtual screen")
def test_live_window_draws_whole_runs_and_may_be_closed(root):
    pytest.importorskip("tkinter", reason="no toolkit for windows")
    run = subprocess.run(
        ["xvfb-run", "-a", sys.executable, "-c", LIVE, str(root / "cases" / CASES[0])],
        cwd=root,
        env={k: v for k, v in os.environ.items() if k != "MPLBACKEND"},
        capture_output=True,
        text=True,
        timeout=LONGEST,
    )
    assert run.returncode == 0, run.stderr
    expected = [("measured", True), ("open loop", True), ("direct inversion", True)]
    assert run.stdout.strip() == str(expected)


def test_a_sentence_that_recordings_share_but_for_its_numbers_is_said_once():
    doubts = {"run1": ["v1 is up to 3.5e+07 m/s"], "run2": ["v1 is up to 12 m/s"], "run3": []}
    assert warning_lines(doubts) == ["run1, run2 (figures of run1): v1 is up to 3.5e+07 m/s."]
    others = {"run1": ["v1 is off", "x[1] is off"], "run2": ["v2 is off", "x[2] is off"]}
    assert len(warning_lines(others)) == 4


def test_a_doubt_along_recordings_is_said_once_though_its_numbers_differ(monkeypatch):
    doubts = iter(["v is up to 12 m/s", "", "v is up to 15 m/s", "w is up to 12 m/s"])
    monkeypatch.setattr(trajectory, "check_along", lambda *_, **__: next(doubts))
    said = trajectory.doubts_along(None, None, [None] * 4)
    assert said == "v is up to 12 m/s; w is up to 12 m/s"
