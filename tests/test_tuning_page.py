"""The page of `tune`: every number of the summary, the bad news first."""

import copy
import io
import json
import re
import signal
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import lxml.html
import numpy as np
import pytest
from numpy.testing import assert_allclose

from workbench.__main__ import main
from workbench.observers import Gains, estimators_of
from workbench.system.registry import open_model
from workbench.system.system import System
from workbench.tuning.report import write_tuning_page

from .page_rules import check_page, data, script, text
from .processes import LONGEST, comes_true, running
from .recordings import write_beginnings
from .schemas import check
from .systems import WHEELSET

HOSTILE = '08_wet "<img src=x onerror=alert(1)>" & co'  # a folder may have this name
CASES = ("03_dry_120_3.6", HOSTILE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, root) -> Path:
    """Two short recordings."""
    return write_beginnings(tmp_path_factory.mktemp("cases"), CASES)


def command(folder: Path, out: Path, *options: str) -> list[str]:
    search = ["--cases", str(folder), "--population", "2", "--workers", "1", "--out", str(out)]
    search += ["--radius-error", "0"]
    return ["tune", "disturbance_observer", *search, *options]


@pytest.fixture(scope="module")
def results(folder, once) -> Path:
    """Through the command line, its last line beside the results."""

    def tune(out: Path) -> Path:
        with redirect_stdout(io.StringIO()) as printed:
            assert main(command(folder, out, "--budget", "2", "--folds", "2")) == 0
        (out / "printed").write_text(printed.getvalue())
        return out

    return once("tuned", tune)


def test_summary_and_page_are_as_all_are(results, summary):
    check("tune", summary)
    check_page(results / "index.html", summary)


def news(page: Any) -> str:
    return " ".join(text(element) for element in page.xpath("//header//p[@class='warning']"))


def headline(page: Any) -> str:
    return text(page.get_element_by_id("answer"))


def written(summary: dict[str, Any], folder: Path) -> Any:
    return lxml.html.fromstring(write_tuning_page(summary, folder).read_bytes())


@pytest.fixture
def changed(summary) -> dict[str, Any]:
    """A copy of the summary, to be changed."""
    return copy.deepcopy(summary)


# --- the page as a whole ---


def test_command_ends_with_the_name_of_the_page(results):
    assert str(results / "index.html") in (results / "printed").read_text().splitlines()[-1]


def test_page_follows_from_the_summary_alone(results, summary, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    again = write_tuning_page(summary, tmp_path / "elsewhere").read_text()
    there = again.replace(str(tmp_path / "elsewhere"), str(results))
    assert there == (results / "index.html").read_text()


def test_page_links_to_the_files_beside_it_and_its_drawings_tell_numbers(page):
    links = set(page.xpath("//a/@href"))
    assert links >= {"gains.toml", "summary.json", "convergence.png", "cases.png"}
    assert all(re.search(r"\d", drawing.get("aria-label")) for drawing in page.xpath("//svg"))


def test_a_hostile_name_of_a_case_stays_text(page):
    assert HOSTILE in data(page, "case-table").index
    assert HOSTILE in data(page, "fold-table").index
    assert HOSTILE in page.xpath("//svg/@aria-label")[0]
    assert HOSTILE in [text(label) for label in page.xpath("//svg/text")]
    assert not page.xpath("//img|//@onerror")


def test_page_opens_without_errors_and_draws_its_curve(results, probe):
    curve = "document.querySelector('.dots .curve')"
    shown = probe(
        results / "index.html",
        f"told.length = {curve}.getTotalLength(); told.fill = getComputedStyle({curve}).fill;"
        f"{script('tuning_narrow')}",
    )
    assert shown["errors"] == []
    assert shown["length"] > 100  # [px]
    assert shown["fill"] == "none"
    # On a narrow screen all dots are in sight, and names stand above them.
    assert shown["drawn"] == shown["room"] <= 376
    assert 0 <= min(shown["dots"]) < max(shown["dots"]) <= shown["room"]
    assert set(shown["names"]) == {0}


def test_the_convergence_and_all_else_fit_a_narrow_screen(results, narrow):
    narrow(results / "index.html")


# --- the result ---


def test_headline_tells_z_the_worst_case_and_the_bounds_in_one_sentence(page, summary):
    line = headline(page)
    z_k = sorted(((case["z_k"], name) for name, case in summary["cases"].items()), reverse=True)
    (worst, first), (next_worst, second) = z_k
    assert f"from {summary['z_reasoned']:.4g} with the model-based gains to {worst:.4g}" in line
    assert f"worst case is {first}, by {100 * (1 - next_worst / worst):.1f} % over {second}" in line
    bound = [name for name, gain in summary["gains"].items() if gain["at_bound"]]
    assert f"; {', '.join(bound) or 'no gain'} ended at a bound" in line
    assert not re.search(r"\. [A-Z]", line)


def test_gains_at_a_bound_are_named_and_flagged(changed, tmp_path):
    for name, gain in changed["gains"].items():
        gain["at_bound"] = name in ("L12", "T_muWR")
    page = written(changed, tmp_path)
    assert "; L12, T_muWR ended at a bound" in headline(page)
    table = page.get_element_by_id("gain-table")
    flagged = [row for row in table.find("tbody") if row.find_class("warning")]
    assert [text(row[0]) for row in flagged] == ["L12", "T_muWR"]
    assert all("at bound" in text(row[-1]) for row in flagged)


def test_gains_that_were_not_improved_are_not_praised(changed, tmp_path):
    changed["z"] = changed["z_reasoned"]
    changed["convergence"] = [changed["z"]]
    assert headline(written(changed, tmp_path)).startswith(f"z stays at {changed['z']:.4g}")


def test_one_case_has_no_next(changed, tmp_path):
    del changed["cases"][HOSTILE]
    changed["provenance"]["cases"].remove(HOSTILE)
    changed["folds"] = []
    page = written(changed, tmp_path)
    assert "tuned on one recording" in text(page.find(".//h1"))
    assert "the only case is 03_dry_120_3.6" in headline(page)


# --- tables and figures ---


def test_every_case_is_shown_with_its_numbers_the_worst_first(page, summary):
    table = data(page, "case-table")
    assert sorted(table.index) == sorted(CASES)
    assert table["z_k, tuned"].is_monotonic_decreasing
    for name, case in summary["cases"].items():
        row = table.loc[name]
        assert row["z_k, model-based"] == case["z_k_reasoned"]
        assert row["z_k, tuned"] == case["z_k"]
        assert row["unstable candidates"] == case["unstable"]
        assert row["change"] == case["z_k"] / case["z_k_reasoned"] - 1


def test_every_gain_is_shown_with_its_numbers_and_unit(page, summary):
    table = data(page, "gain-table")
    assert list(table.index) == list(summary["gains"])
    for name, gain in summary["gains"].items():
        row, effect = table.loc[name], summary["sensitivity"][name]
        assert (row["tuned"], row["model-based"]) == (gain["value"], gain["reasoned"])
        assert row["searched from, to"] == f"{gain['lower']:.4g}, {gain['upper']:.4g}"
        low, high = gain["as_good"]
        assert row["as good, from, to"] == f"{low:.4g}, {high:.4g}"
        assert gain["lower"] <= low <= gain["value"] <= high <= gain["upper"]
        for column, key in (("z, less", "less"), ("z, more", "more"), ("z, without", "without")):
            assert row[column] == (np.inf if effect[key] is None else effect[key])
        assert ("does not matter" in row["remark"]) == (not effect["matters"])
    units = table["unit"]
    assert units[["L12", "L21", "T_muDC"]].eq("1/s").all()
    assert units[["L13", "L24"]].eq("1/s2").all()
    assert units[["L31", "L42"]].eq("1/rad").all()
    assert units[["L33", "L44"]].eq("1/(rad.s)").all()
    assert table.at["L43", "what it does"] == "rate of dmuDC by ∫ omegaW"


TUNABLE = [name for name, cls in estimators_of(WHEELSET).items() if cls.tunable]


def gains_and_meanings(system: System, estimator: str) -> tuple[Gains, dict[str, tuple[str, str]]]:
    """Reasoned gains of an estimator, and what it tells of them."""
    cls = estimators_of(system)[estimator]
    with open_model(system, cls.role) as fmu:
        gains = cls.default_gains(fmu, system)
        return gains, cls.meanings(fmu, system, gains)


@pytest.mark.parametrize("estimator", TUNABLE)
def test_every_gain_that_can_be_tuned_has_a_meaning_and_a_unit(system, estimator):
    gains, meanings = gains_and_meanings(system, estimator)
    assert set(meanings) == set(gains.names)
    assert all(meaning and unit for meaning, unit in meanings.values())


def test_levels_of_noise_are_shown_in_the_units_of_what_they_disturb(system, changed, tmp_path):
    gain, effect = changed["gains"]["L11"], changed["sensitivity"]["L11"]
    _, meanings = gains_and_meanings(system, "ekf")
    changed |= {"estimator": "ekf", "label": estimators_of(system)["ekf"].label}
    changed["gains"] = {
        name: gain | {"meaning": meaning, "unit": unit}
        for name, (meaning, unit) in meanings.items()
    }
    page = written(changed | {"sensitivity": dict.fromkeys(meanings, effect)}, tmp_path)
    assert text(page.find(".//h1")) == "Extended Kalman filter, tuned on 2 recordings"
    units = data(page, "gain-table")["unit"]
    assert units[["omegaW_relative", "initial"]].eq("1").all()
    assert units[["omegaW", "omegaR"]].eq("rad/s").all()
    assert units[["muWR", "muDC"]].eq("1/sqrt(s)").all()


def test_a_gain_without_which_the_estimate_diverges_says_so(changed, tmp_path):
    changed["sensitivity"]["L42"] |= {"without": None, "matters": True}
    table = written(changed, tmp_path).get_element_by_id("gain-table")
    (row,) = (row for row in table.find("tbody") if text(row[0]) == "L42")
    assert text(row[-2]) == "diverges"
    assert row[-2].get("data-value") == "Infinity"  # sorts as the worst


def test_dots_of_cases_lie_on_one_axis_from_zero(page, summary):
    drawing = page.xpath("//section[@aria-labelledby='cases']//svg")[0]
    names = [text(label) for label in drawing.xpath("./text[@text-anchor='end']")]
    cases = [summary["cases"][name] for name in names]
    circles = [float(x) for x in drawing.xpath("./circle/@cx")]
    diamonds = [
        float(re.match(r"M([\d.]+)", d)[1])
        for d in drawing.xpath("./path[contains(@class, 'diamond')]/@d")
    ]
    (zero,) = (
        float(tick.get("x")) for tick in drawing.xpath("./text[@class='tick']") if text(tick) == "0"
    )
    z_k = np.array([*(c["z_k_reasoned"] for c in cases), *(c["z_k"] for c in cases)])
    places = np.array([*circles, *diamonds]) - zero
    assert_allclose(places, z_k * places[0] / z_k[0], atol=0.2)  # [px] as rounded, twice


def test_curve_of_the_convergence_holds_z_of_every_generation(page, summary):
    drawing = page.xpath("//section[@aria-labelledby='search']//svg")[0]
    path = drawing.xpath("./path[contains(@class, 'curve')]/@d")[0]
    points = np.array(re.findall(r"H([\d.]+)V([\d.]+)", path), float)
    z = np.array([*summary["convergence"], summary["z_reasoned"]])
    rule = drawing.xpath("./path[@class='noise']/@d")[0]
    heights = np.array([*points[:, 1], float(rule.split()[1].split("H")[0])])
    assert np.diff(points[:, 0]) == pytest.approx(np.ptp(points[:, 0]) / (len(points) - 1), abs=0.1)
    slope = np.ptp(heights) / np.ptp(z)
    assert_allclose(heights, heights[-1] + slope * (z[-1] - z), atol=0.2)  # [px] as rounded, twice


def test_folds_are_shown_and_lost_ones_are_bad_news(page, summary, changed, tmp_path):
    table = data(page, "fold-table")
    assert table["z, tuned without them"].is_monotonic_decreasing
    for fold in summary["folds"]:
        row = table.loc[", ".join(fold["cases"])]
        assert row["z, model-based"] == fold["reasoned"]
        assert row["z, tuned without them"] == fold["tuned"]
        assert row["z of the cases tuned on"] == fold["z"]
        assert row["error of Fx, model-based"] == fold["error_reasoned"]
        assert row["error of Fx, tuned without them"] == fold["error"]
    better, lost = changed["folds"]
    better["tuned"], lost["tuned"] = 0.9 * better["reasoned"], float("inf")
    one_lost = written(changed, tmp_path)
    assert "not better than the model-based ones in 1 of 2 folds" in news(one_lost)
    case = changed["cases"][lost["worst"]]
    case["z_k"] = 0.9 * case["z_k_reasoned"]
    assert "asks of the gains what no case asks" in news(written(changed, tmp_path))
    case["z_k"] = 1.1 * case["z_k_reasoned"]
    assert "the worst case gains at its cost" in news(written(changed, tmp_path))
    verdicts = data(one_lost, "fold-table")["verdict"]
    assert list(verdicts.index) == [", ".join(fold["cases"]) for fold in (lost, better)]
    assert list(verdicts) == ["⚠ not better", "better"]
    changed["folds"] = []
    without = written(changed, tmp_path)
    assert not without.xpath("//*[@id='fold-table']|//a[@href='#folds']")
    assert "not seen" not in news(without)


def test_folds_that_were_not_done_are_told(changed, tmp_path):
    assert "interrupted after" not in news(written(changed, tmp_path))
    del changed["folds"][1]
    assert "without each fold was interrupted after 1 of 2" in news(written(changed, tmp_path))


def test_work_and_provenance_are_told(page, summary, results):
    shown = {text(entry): text(entry.getnext()) for entry in page.xpath("//dl[@class='grid']/dt")}
    work, provenance = summary["work"], summary["provenance"]
    assert shown["Generations"] == str(work["generations"])
    assert shown["As good"].startswith(f"{work['as_good']} of the last {work['last']} candidates")
    # Two for each of the gains that are searched, of which the best is as good as itself.
    assert 1 <= work["as_good"] <= work["last"] == 2 * len(summary["gains"])
    assert shown["Candidates"].startswith(f"{work['candidates']}, ")
    assert shown["Work saved"].startswith(f"{100 * work['saved']:.2f} %")
    assert shown["Time"] == f"{work['seconds']:.1f} s"
    assert shown["Crashed or blocked workers"] == str(work["crashed"])
    assert shown["SHA-256 of the FMU"] == provenance["fmu"]["sha256"]
    assert shown["Random seed"] == str(provenance["seed"])
    for package, version in provenance["packages"].items():
        assert f"{package} {version}" in shown["Versions"]
    (use,) = page.xpath("//pre[@class='source']")
    assert text(use) == f"workbench simulate --gains {results / 'gains.toml'}"


def searched(page: Any) -> Any:
    (section,) = page.xpath("//section[@aria-labelledby='search']")
    return section


def test_a_search_that_converged_says_so(changed, tmp_path):
    assert "then converged" not in text(searched(written(changed, tmp_path)))
    changed["work"]["converged"] = True
    assert "then converged" in text(searched(written(changed, tmp_path)))


# --- bad news ---


@pytest.mark.usefixtures("ctrl_c")
def test_an_interrupted_run_says_so_and_claims_no_sensitivity(root, folder, tmp_path):
    search = command(folder, tmp_path, "--budget", "9999")
    with running("-m", "workbench", *search) as run:
        assert comes_true((tmp_path / "checkpoint.json").exists)
        run.send_signal(signal.SIGINT)
        run.communicate(timeout=LONGEST)
    assert run.returncode == 130
    page = lxml.html.fromstring((tmp_path / "index.html").read_bytes())
    generations = json.loads((tmp_path / "summary.json").read_text())["work"]["generations"]
    assert headline(page).startswith(f"Interrupted after generation {generations}: ")
    assert "Incomplete" in news(page)
    assert "--resume" in news(page)
    assert list(data(page, "gain-table").columns)[-2:] == ["unit", "remark"]


def test_an_uninterrupted_run_does_not_say_so(page):
    assert not re.search("[Ii]nterrupted|Incomplete", text(page))


def test_what_got_worse_comes_before_the_tables(changed, tmp_path):
    for case in changed["cases"].values():
        case["z_k_reasoned"] = 2.0 * case["z_k"]
    assert "Worse" not in news(written(changed, tmp_path))
    changed["cases"][HOSTILE]["z_k_reasoned"] = 0.5 * changed["cases"][HOSTILE]["z_k"]
    changed["work"]["crashed"] = 3
    changed["folds"] = []
    line = news(written(changed, tmp_path))
    assert f"Worse than with the model-based gains: {HOSTILE} (" in line
    assert "03_dry_120_3.6 (" not in line
    assert "blocked their worker: 3" in line


def test_a_search_that_could_go_on_says_with_which_gain(changed, tmp_path):
    for effect in changed["sensitivity"].values():
        effect |= {"less": 0.02, "more": -0.009, "without": None, "matters": True}
    assert "converged" not in news(written(changed, tmp_path))
    changed["sensitivity"]["L31"]["less"] = -0.034
    page = written(changed, tmp_path)
    assert "by up to 3.4 %, with another value of one gain alone (L31)" in news(page)
    remarks = data(page, "gain-table")["remark"]
    assert [name for name in remarks.index if "not converged" in remarks[name]] == ["L31"]


def test_other_estimators_are_compared_and_better_ones_are_bad_news(page, changed, tmp_path):
    assert "extended Kalman filter" in data(page, "beside-table").index
    assert not written(changed | {"beside": {}}, tmp_path).xpath("//*[@id='beside-table']")
    z, name = changed["z"], "disturbance observer"
    changed["beside"] = {
        "direct_inversion": {"label": "direct inversion", "z": 9.0 * z, "worst": HOSTILE},
        "ekf": {"label": "extended Kalman filter", "z": 0.5 * z, "worst": "03_dry_120_3.6"},
    }
    beside = written(changed, tmp_path)
    table = data(beside, "beside-table")
    order = ["extended Kalman filter", f"{name}, tuned", f"{name}, model-based", "direct inversion"]
    assert list(table.index) == order
    assert list(table["z"]) == [0.5 * z, z, changed["z_reasoned"], 9.0 * z]
    assert table.at["direct inversion", "worst case"] == HOSTILE
    assert f"without any tuning: extended Kalman filter, z = {0.5 * z:.4g}" in news(beside)
    assert "direct inversion" not in news(beside)
