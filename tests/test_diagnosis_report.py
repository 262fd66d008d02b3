"""The page of `diagnose`: the verdict and its evidence, for an engineer without the tool."""

import json
import re
import shutil
import signal
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import lxml.html
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from workbench.__main__ import main
from workbench.diagnosis import Residuals
from workbench.diagnosis.figures import FAST, lasting, lasting_blocks, recording_figure
from workbench.diagnosis.inference.residuals import Balance
from workbench.diagnosis.report import write_diagnosis_page
from workbench.machines.wheelset.rig import CONSTANT_PADS, plant
from workbench.pages.figures import CaseFigure
from workbench.system.system import System

from .page_rules import check_page, data, script, section, text
from .processes import running
from .recordings import record
from .scenarios import short
from .schemas import check
from .systems import WHEELSET

STOPS = {"01_dry_80_1.5": 45.0, "03_dry_120_3.6": 70.0, "05_dry_120_2.7_rev": 60.0}  # from [km/h]
PLANTED = 150.0  # [N] of the load cells, some ten times the noise of half a second
TWINS = {"FxOffset", "ApexOffset"}  # of which either may be named first
EFFECTS = ["BrakeFade", "BeddingIn", "WheelRadius", *sorted(TWINS)]


def diagnose(root: Path, stops: Path, out: Path) -> Path:
    """Through the command line, with few effects to be quick."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(root)
        flags = ["--certainty", "--figures", "--out", str(out)]
        assert main(["diagnose", str(stops), "--effects", *EFFECTS, *flags]) == 0
    return out


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
        channels=WHEELSET.comparison.channels,
        block_time=time[kept],
        before=after + step[:, None],
        after=after,
        sigma=np.ones_like(after),
    )


@pytest.fixture(scope="module")
def stops(tmp_path_factory) -> Path:
    """Three stops of the virtual rig, whose load cells have a wrong zero."""
    folder = tmp_path_factory.mktemp("stops")
    effects = plant(CONSTANT_PADS, [f"fx_offset={PLANTED}"])
    for seed, (name, speed) in enumerate(STOPS.items()):
        record(short(name, speed), seed, effects, folder / name)
    return folder


@pytest.fixture(scope="module")
def results(root, stops, once) -> Path:
    return once("diagnosis", lambda out: diagnose(root, stops, out))


def test_summary_and_page_are_as_all_are(results, summary):
    check("diagnose", summary)
    check_page(results / "index.html", summary)


def steps(path: str) -> np.ndarray:
    """Points of a path of relative steps, (n, 2)."""
    return np.cumsum(np.array(re.findall(r"-?\d+", path), float).reshape(-1, 2), axis=0)


# --- the page as a whole ---


def test_verdict_comes_first_in_one_sentence_and_names_the_planted_effect_and_its_twin(
    page, summary
):
    headline = page.find_class("headline")[0]
    assert summary["sentence"] in text(headline)
    assert all(twin in text(headline) for twin in TWINS)
    assert text(headline).count(". ") <= 1  # after the verdict's name
    assert headline.getparent().tag == "header"


def test_page_links_to_all_files_beside_it_and_its_drawings_tell_numbers(page):
    links = {Path(unquote(address)).name for address in page.xpath("//a/@href")}
    figures = {*STOPS, "dependences", "confusability", "gain"}
    for suffix in (".csv", ".png", ".svg"):
        assert links >= {name + suffix for name in figures}
    for drawing in page.xpath("//svg[not(ancestor::svg)]"):
        assert re.search(r"\d", drawing.get("aria-label"))


# --- the figure that convinces ---


def test_every_stop_has_a_figure_and_the_clearest_comes_first(page, results):
    names = [text(heading) for heading in page.xpath("//article[figure]/h3")]
    assert sorted(names) == sorted(STOPS)
    clearness = []
    for name in names:
        table = pd.read_csv(results / f"{name}.csv")
        ratio = (
            table.filter(like="lasting_before.") / table.filter(like="lasting_sigma.").to_numpy()
        )
        clearness.append((ratio**2).mean().max())
    assert clearness[0] == max(clearness)
    # What was there, errors by channel, residuals: above each other on one axis of time.
    panels = page.xpath("//article[figure][1]//g[@class='axes']/text[@class='title']")
    first = [text(panel) for panel in panels[:8]]
    assert [title.split()[0] for title in first] == [
        *("Speed", "Brake", "Slip:", "Speed", "Creep", "Wheelset", "Roller", "Slip")
    ]


def test_curves_of_the_page_are_those_of_the_data(page, results):
    name = text(page.xpath("//article[figure]/h3")[0])
    table = pd.read_csv(results / f"{name}.csv")
    axes = page.xpath("//article[figure][1]//g[starts-with(text, 'Creep force')]")[0]
    low, high = float(axes.get("data-low")), float(axes.get("data-high"))
    for style, column in (("0", "lasting_before.Fx [N]"), ("2", "lasting_after.Fx [N]")):
        path = axes.xpath(f".//path[@class='curve style-{style}']/@d")[0]
        x, y = steps(path).T if path.count("M") == 1 else steps(path[: path.rindex("M")]).T
        shown = high - y * (high - low) / 4000
        at = table["time [s]"].iloc[0] + x / 1e3
        # Half a level of rounding in value; half a millisecond in time does not show.
        assert_allclose(
            shown, np.interp(at, table["time [s]"], table[column]), atol=0.6 * (high - low) / 4000
        )


def test_the_noise_band_holds_what_the_extended_model_leaves_and_not_the_effect(results):
    for name in STOPS:
        table = pd.read_csv(results / f"{name}.csv")
        band = 2.0 * table["lasting_sigma.Fx [N]"]
        # 95 % of white noise; the load cell rings, and neighbouring means are not independent.
        assert (abs(table["lasting_after.Fx [N]"]) < band).mean() > 0.8
        assert (abs(table["lasting_before.Fx [N]"]) < band).mean() < 0.3


# --- evidence in tables ---


def test_dependences_are_those_of_the_summary_before_and_after(page, summary):
    table = data(page, "dependence-table")
    for dependence in summary["dependences"]:
        assert (
            float(table.at[dependence["influence"], f"{dependence['channel']}, nominal"])
            == dependence["before"]
        )
        assert (
            float(table.at[dependence["influence"], f"{dependence['channel']}, extended"])
            == dependence["after"]
        )
    assert table.size == 2 * len(summary["dependences"])


def test_cause_is_told_with_interval_unit_twin_and_the_experiment(page, summary):
    (cause,) = summary["causes"]
    article = section(page, "causes").xpath(".//article")[0]
    assert cause["effect"] in text(article.find("h3"))
    for name, parameter in cause["parameters"].items():
        row = article.xpath(f".//tr[th='{name}']")[0]
        value, low, high = (float(cell.get("data-value")) for cell in row[1:4])
        assert (value, low, high) == (parameter["value"], parameter["low"], parameter["high"])
        assert text(row[4]) == parameter["unit"]
    assert cause["confusable_with"]
    assert cause["confusable_with"][0] in text(article)
    assert cause["separation"] in text(article)
    assert f"{100 * cause['explained']:.1f} %" in text(article)


def test_a_size_is_told_with_what_noise_alone_allows_and_what_its_error_goes_with(page, summary):
    (cause,), certainty = summary["causes"], summary["certainty"]
    ((name, estimated),) = cause["parameters"].items()
    size = f"{cause['effect']} {name}"
    ends = certainty["likelihood"][size]
    row = section(page, "causes").xpath(f".//article//tr[th='{name}']")[0]
    assert [float(cell.get("data-value")) for cell in row[6:8]] == [ends["low"], ends["high"]]
    # The interval also holds forms of laws and companions.
    assert estimated["low"] < ends["low"] < estimated["value"] < ends["high"] < estimated["high"]
    rows = dict(zip(certainty["unknowns"], certainty["correlations"], strict=True))
    others = {n: c for n, c in zip(rows, rows[size], strict=True) if n != size and abs(c) >= 0.3}
    shown = text(section(page, "causes").xpath(".//article")[0])
    # While the roller slows down evenly its inertia takes a constant torque, as a wrong zero does.
    assert set(others) == {"JR by recording"}
    for other, correlation in others.items():
        assert re.search(rf"{other} \((correlation )?{re.escape(f'{correlation:+.2f}')}\)", shown)
    assert ("goes with that of no other" in shown) == (not others)
    # A wrong zero is linear: no start ends elsewhere.
    assert certainty["starts"]["sentence"] in text(section(page, "causes"))
    assert certainty["starts"]["same"] == 4


def test_each_candidate_has_one_row_the_best_first(page, summary):
    table = data(page, "candidate-table")
    falls = table["fall, cross-validated"]
    assert sorted(table.index) == sorted(
        {candidate["effect"] for candidate in summary["candidates"]}
    )
    assert falls.is_monotonic_decreasing
    units = {text(row[0]): text(row[3]) for row in page.xpath("//*[@id='candidate-table']//tr")}
    assert (units["FxOffset"], units["WheelRadius"], units["BrakeFade"]) == ("N", "m", "1/K")
    for name, fall in falls.items():
        assert fall == max(o["held_out"] for o in summary["candidates"] if o["effect"] == name)
    outcomes = {text(row[0]): text(row[-1]) for row in page.xpath("//*[@id='candidate-table']//tr")}
    (cause,) = summary["causes"]
    (twin,) = TWINS - {cause["effect"]}
    assert (outcomes[cause["effect"]], outcomes[twin]) == ("cause", "as good as the cause")
    assert outcomes["BrakeFade"] == ""
    for effect, reason in summary["not_visible"].items():
        assert f"{effect}, {reason}" in text(section(page, "causes"))


def test_matrix_frames_what_was_found_and_reads_out_its_twin(page, summary):
    (matrix,) = page.find_class("matrix")
    assert len(matrix.xpath("./rect")) == len(summary["confusability"]["effects"]) ** 2
    frame = matrix.xpath("./path[@class='mark']/@d")[0]
    framed = matrix.xpath("./text[@class='found' and @y]")[0]
    assert text(framed).endswith(summary["causes"][0]["effect"])
    assert abs(float(framed.get("y")) - float(frame.split()[1].split("H")[0])) < 24.0
    for label in (matrix.get("aria-label"), text(section(page, "confusability"))):
        assert re.search(r"ApexOffset and FxOffset|FxOffset and ApexOffset", label)


def test_gain_is_drawn_for_every_stop_and_for_all(page, summary):
    (dots,) = page.find_class("dots")
    gain = summary["gain"]
    names = [text(label) for label in dots.xpath("./text[@text-anchor='end']")]
    assert sorted(names) == sorted([*gain["recordings"], "all recordings"])
    values = [{**gain["recordings"], "all recordings": gain}[name] for name in names]
    circles = [float(x) for x in dots.xpath("./circle/@cx")]
    diamonds = [
        float(re.match(r"M([\d.]+)", d)[1])
        for d in dots.xpath("./path[contains(@class, 'diamond')]/@d")
    ]
    # One scale for both: position is linear in the logarithm.
    logs = np.log([*(value["before"] for value in values), *(value["after"] for value in values)])
    slope, start = np.polyfit(logs, [*circles, *diamonds], 1)
    assert slope > 0.0
    assert_allclose([*circles, *diamonds], start + slope * logs, atol=0.1)  # [px] as rounded
    shown = text(section(page, "gain"))
    for number in (gain["before"], gain["after"], gain["low"], gain["high"]):
        assert f"{number:.2f}" in shown


def test_extended_model_is_shown_as_written_with_the_next_command(page, summary):
    shown = section(page, "model").xpath(".//pre/code")
    assert shown[0].text_content().strip() == Path(summary["model"]["modelica"]).read_text().strip()
    assert "redeclare" in shown[0].text_content()
    assert f"diagnose NEW_RECORDINGS --model {summary['model']['fmu']}" in shown[1].text_content()
    assert "simulate" not in shown[1].text_content()


def test_levels_and_samples_set_aside_are_reported(page, summary):
    entries = section(page, "baseline").xpath(".//dt")
    shown = {text(entry): text(entry.getnext()).split()[0] for entry in entries}
    assert shown == {name: f"{level['value']:.4g}" for name, level in summary["levels"].items()}
    aside = data(page, "aside-table")
    for name, counts in summary["set_aside"].items():
        assert {reason: int(aside.at[name, reason]) for reason in counts} == counts


# --- the best estimate ---


def test_best_estimates_of_the_recording_shown_are_those_of_the_data(page, results, summary):
    smoothed = summary["smoothed"]
    assert smoothed["recording"] == text(page.xpath("//article[figure]/h3")[0])
    table = pd.read_csv(results / "smoothed.csv")
    rows = {text(row[0]): row for row in page.get_element_by_id("estimate-table").find("tbody")}
    # While braking: from 0.1 bar to 1 m/s, of a wheel of 0.46 m, which a sample may round.
    braking = table["measured.pB [Pa]"].gt(1e4), table["measured.omegaW [rad/s]"].abs().gt(2.17)
    window = slice(braking[0].idxmax(), braking[1][::-1].idxmax() + 1)
    for j, (model, numbers) in enumerate(smoothed["models"].items()):
        force, friction = numbers["Fx"], numbers["muDC"]
        value, sigma = (
            table[f"{model}.{prefix}Fx [N]"][window].mean() for prefix in ("", "sigma_")
        )
        assert_allclose(force["value"], value, rtol=1e-3)
        assert_allclose(force["high"] - force["low"], 2 * 1.96 * sigma, rtol=1e-2)
        cell = rows["Creep force Fx [kN]"][1 + 2 * j]
        assert float(cell.get("data-value")) == pytest.approx(force["value"] / 1e3)
        shown, half = map(float, text(cell).split(" ± "))
        # In kN, with two digits of the band of some 20 N.
        assert_allclose([shown, half], [force["value"] / 1e3, 1.96e-3 * sigma], atol=6e-4)
        assert 0.25 < friction["low"] < friction["value"] < friction["high"] < 0.35
        # Cells that are wrong by 150 N, fifteen times the band, stay outside whatever the model.
        assert force["inside"] < 0.1
    assert {"nominal_model", "extended_model"} == set(smoothed["models"])
    legend = section(page, "estimate").xpath(".//ul[@class='legend']/li")
    assert {"style-0", "style-2"} <= {entry.get("class") for entry in legend}


# --- summaries that were changed ---


@pytest.fixture
def figure(dry_case, system) -> CaseFigure:
    span = lasting_blocks(system)
    return recording_figure(residuals(gap=False), dry_case, system, "with FxOffset", span)


def written(
    system: System, summary: dict[str, Any], figures: list[CaseFigure], folder: Path
) -> Any:
    """The page of a summary that was changed, without an extended model."""
    changed = {**summary, "model": dict.fromkeys(summary["model"])}
    path = write_diagnosis_page(system, {**changed, "smoothed": None}, figures, None, folder)
    return lxml.html.fromstring(path.read_bytes())


def test_the_unexplained_is_no_cause(system, summary, figure, tmp_path):
    unexplained = {
        **summary,
        "verdict": "unexplained",
        "causes": [],
        "gain": None,
        "partial": ["BrakeFade"],
        "sentence": "Something is missing.",
    }
    page = written(system, unexplained, [figure], tmp_path)
    assert text(page.find_class("headline")[0]) == "Unexplained. Something is missing."
    causes = section(page, "causes")
    assert not causes.xpath("article")
    assert "BrakeFade would explain a part, which is no proof" in text(causes)
    assert not page.xpath("//*[@class='mark']")
    assert "is not explained" in text(section(page, "shown"))


def test_a_fit_from_elsewhere_that_ended_lower_is_a_warning(system, summary, figure, tmp_path):
    starts = {
        "behind": [0.0, -40.0, None],
        "same": 1,
        "lower": 40.0,
        "sentence": "One lower by 40.",
    }
    changed = {**summary, "certainty": {**summary["certainty"], "starts": starts}}
    causes = section(written(system, changed, [figure], tmp_path), "causes")
    (warning,) = [element for element in causes.find_class("warning") if "lower" in text(element)]
    assert "0.0, -40.0, no end" in text(warning)


def test_a_diagnosis_that_was_not_asked_says_nothing_of_how_sure_sizes_are(
    system, summary, figure, tmp_path
):
    page = written(system, {**summary, "certainty": None}, [figure], tmp_path)
    assert "noise alone" not in text(section(page, "causes"))
    assert "Multi-start" not in text(section(page, "causes"))


def test_a_deviation_beyond_its_tolerance_is_flagged(system, summary, figure, tmp_path):
    deviations = {"a": {"muDC": 2.6, "JR": -2.4}, "b": {"muDC": -2.6, "JR": 0.0}}
    page = written(system, {**summary, "deviations": deviations}, [figure], tmp_path)
    table = page.get_element_by_id("deviation-table")
    assert [text(cell) for cell in table.find_class("warning")] == ["⚠ +2.60", "⚠ -2.60"]


def test_observers_are_compared_at_every_stop_that_could_be_judged(
    system, summary, figure, tmp_path
):
    errors = {name: {"before": 0.021, "after": 0.004} for name in STOPS}
    errors["03_dry_120_3.6"] = {"before": 0.03, "after": None}
    page = written(system, {**summary, "observers": {"ekf": errors}}, [figure], tmp_path)
    table = page.get_element_by_id("observer-table")
    assert [[text(cell) for cell in row] for row in table.find("tbody")] == [
        ["01_dry_80_1.5", "2.10", "0.40"],
        ["03_dry_120_3.6", "3.00", "n/a"],
        ["05_dry_120_2.7_rev", "2.10", "0.40"],
    ]
    without = written(system, {**summary, "observers": {}}, [figure], tmp_path)
    assert not without.xpath("//*[@id='observer-table']")


def test_pages_of_six_and_fourteen_long_stops_stay_small(system, summary, dry_case, tmp_path):
    """Residuals of noise, of every kind, are the longest that curves can be."""
    long_stop = residuals(gap=True)
    rng = np.random.default_rng(2)
    balances = tuple(
        Balance(name, name, "N.m", "N.m", rng.normal(size=long_stop.time.size))
        for name in ("wheelset", "roller", "slip")
    )
    long = replace(long_stop, balances=balances)
    for count, most in ((6, 3e6), (14, 3e6)):
        figures = [
            replace(
                recording_figure(long, dry_case, system, "with X", lasting_blocks(system)),
                name=f"stop_{k}",
            )
            for k in range(count)
        ]
        written(system, summary, figures, tmp_path)
        assert (tmp_path / "index.html").stat().st_size < most


# --- in a browser ---


@pytest.fixture(scope="module")
def browser(results, probe) -> dict[str, Any]:
    """What a script that uses the page finds."""
    return probe(results / "index.html", script("diagnosis"))


def test_page_opens_without_errors_and_draws_every_figure(browser):
    assert browser["errors"] == []
    assert [len(heights) for heights in browser["panels"]] == [8, 8, 8, 8]
    assert min(min(heights) for heights in browser["panels"]) > 35  # [px] that can be read
    assert min(browser["curves"]) > 0
    assert min(browser["sizes"]) > 100
    assert browser["overflow"] <= 0


def test_the_matrix_and_all_else_fit_a_narrow_screen(results, narrow):
    narrow(results / "index.html")


def test_candidates_sort_on_click(browser, summary):
    best: dict[str, float] = {}
    for candidate in summary["candidates"]:
        best.setdefault(candidate["effect"], candidate["gain"])
    first, by_name, down, up = browser["orders"]
    assert first == list(best)
    assert by_name == sorted(best)
    assert down == sorted(best, key=lambda name: -best[name])
    # Effects that are as good as each other may stand either way.
    assert [best[name] for name in up] == sorted(best.values())
    assert sorted(up) == sorted(best)


def test_only_stops_and_the_best_estimate_of_one_zoom(browser):
    assert browser["tools"] == len(STOPS) + 1
    assert browser["zoomed"][2] == 0.5 * browser["whole"][2]


def test_heat_follows_the_share(browser):
    """Cells of equal share have one colour, others another."""
    alpha = [
        float(re.search(r"([\d.]+)\)$", colour)[1]) if colour.endswith(")") else 0.0
        for colour in browser["heat"]
    ]
    assert_allclose(alpha, 0.45 * np.array(browser["shares"]), atol=0.01)


LASTING = 10  # blocks of 50 ms


def test_half_a_lasting_time_is_ten_blocks(system):
    assert lasting_blocks(system) == LASTING


def test_noise_alone_leaves_one_and_a_lasting_error_stands_out():
    before, after = lasting(residuals(gap=False), LASTING).noises()
    # 80 independent means: one standard deviation of their rms is 8 %.
    assert_allclose(after, 1.0, atol=0.3)
    # Ten sigma of a block, in means over ten blocks, for 70 % of the time.
    assert_allclose(before, 10.0 * np.sqrt(10.0 * 0.7), rtol=0.05)


def test_an_error_that_turns_with_the_wheel_is_shown_where_means_would_hide_it(dry_case, system):
    long_stop = residuals(gap=False)
    turning = long_stop.after + 5.0 * (-1.0) ** np.arange(len(long_stop.after))[:, None]
    long_stop = replace(long_stop, before=turning)
    assert (lasting(long_stop, LASTING).noises()[0] < 1.5).all()
    assert (lasting(long_stop, FAST).noises()[0] > 4.5).all()
    figure = recording_figure(long_stop, dry_case, system, "with X", FAST)
    assert "means over 50 ms" in figure.finding


def test_no_mean_and_no_line_bridges_what_was_set_aside(dry_case, system):
    long_stop = residuals(gap=True)
    quiet, loud = long_stop.block_time < 10.0, long_stop.block_time > 15.0
    assert abs(lasting(long_stop, LASTING).before[quiet]).max() < 3.0
    assert lasting(long_stop, LASTING).before[loud].min() > 7.0
    figure = recording_figure(long_stop, dry_case, system, "with X", LASTING)
    inside = (figure.time > 10.0) & (figure.time < 15.0)
    for panel in figure.panels:
        for curve in panel.curves:
            assert np.isnan(curve.values[inside]).all()
            assert np.isfinite(curve.values[~inside]).all()


@pytest.fixture(scope="module")
def forceless(root, stops, once) -> Any:
    """The page of the same stops without Fx, in which nothing is wrong then."""

    def run(folder: Path) -> Path:
        for name in STOPS:
            (folder / "stops" / name).mkdir(parents=True)
            shutil.copy(stops / name / "case.toml", folder / "stops" / name)
            table = pd.read_csv(stops / name / "measured.csv")
            forces = [column for column in table if column.startswith("Fx")]
            table.drop(columns=forces).to_csv(folder / "stops" / name / "measured.csv", index=False)
        return diagnose(root, folder / "stops", folder / "out")

    return lxml.html.fromstring((once("forceless", run) / "index.html").read_bytes())


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.long
def test_an_interrupted_search_keeps_what_it_found(root, stops, tmp_path):
    """Ctrl-C while a second cause is sought."""
    arguments = ["diagnose", str(stops), "--effects", *EFFECTS, "--out", str(tmp_path)]
    searches = 0
    with running("-m", "workbench", *arguments) as run:
        for line in run.stderr:
            searches += "signatures" in line
            if searches == 2 and "signatures" in line:
                run.send_signal(signal.SIGINT)
    assert run.returncode == 130
    summary = json.loads((tmp_path / "summary.json").read_text())
    (cause,) = summary["causes"]
    assert cause["effect"] in TWINS
    assert summary["gain"]["after"] < summary["gain"]["before"]
    assert Path(summary["model"]["fmu"]).is_file()
    page = lxml.html.fromstring((tmp_path / "index.html").read_bytes())
    assert "interrupted" in text(page.find_class("warning")[0])
    assert "more may be missing" in text(page.get_element_by_id("answer"))


def test_without_force_the_verdict_says_what_that_costs(forceless):
    headline = text(forceless.find_class("headline")[0])
    assert headline.startswith("Nothing.")
    assert "Without a measured creep force, fewer effects" in headline
    assert any(
        "Creep force Fx was not measured" in text(element)
        for element in forceless.find_class("warning")
    )
    titles = [text(title) for title in forceless.xpath("//article//text[@class='title']")]
    assert not [title for title in titles if "force" in title or "balance" in title]
    # What it was is estimated nevertheless.
    estimated = section(forceless, "estimate").xpath(".//text[@class='title']")
    assert any(text(title).startswith("Creep force") for title in estimated)


def test_where_nothing_is_missing_nothing_is_claimed(forceless):
    assert not forceless.find_class("dots")
    assert not forceless.xpath("//section[@aria-labelledby='model']")
    assert not forceless.xpath("//a[@href='#model']")
    assert "Nothing was extended" in text(section(forceless, "gain"))
    assert not forceless.xpath("//path[contains(@class, 'style-2')]")
    assert text(section(forceless, "causes")).startswith("Causes, strongest first None.")
