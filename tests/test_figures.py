"""Tables of the page of figures are written from what the commands found."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
_found = importlib.util.spec_from_file_location("figures", ROOT / "docs" / "figures.py")
assert _found is not None
assert _found.loader is not None
figures = importlib.util.module_from_spec(_found)
_found.loader.exec_module(figures)

WORST = {
    "worst": {
        "ekf": {
            "force, dry discs": {"quantity": "force", "value": 0.00181, "stop": "01"},
            "delay at 90 % of the force": {"quantity": "rise_delay", "value": None, "stop": "09"},
        }
    }
}
COVERED = {
    "stops": {
        "01": {"estimators": {"ekf": {"covers": {"Fx": 0.93}}, "open_loop": {"force": 0.5}}},
        "02": {"estimators": {"ekf": {"covers": {"Fx": 0.95}}, "open_loop": {"force": 0.6}}},
    }
}
FADE = {"fade": {"value": 4.28e-4, "low": 4.07e-4, "high": 4.5e-4, "unit": "1/K"}}
SHARE = {"value": 95.0, "low": 75.1, "high": 99.87, "unit": "%", "better": "higher"}


@pytest.mark.parametrize("name", figures.FIGURES)
def test_each_table_has_one_place_on_the_page(name: str) -> None:
    assert len(figures.block(name).findall(figures.PAGE.read_text())) == 1


@pytest.mark.parametrize("name", figures.FIGURES)
def test_what_is_said_to_be_written_is_of_its_command(name: str) -> None:
    (text,) = figures.block(name).findall(figures.PAGE.read_text())
    if said := re.search(r"\*Written by `make figures` from (.*)\.\*$", text):
        commands = re.findall(r"`workbench ([^`]+)`", said[1])
        places = {"out": figures.RESULTS.as_posix(), "recordings": "FOLDER"}
        assert commands == [one.format_map(places) for one in figures.FIGURES[name].commands]


def test_tables_say_what_was_found() -> None:
    header, force, *_ = table = figures.worst(WORST)
    assert (header[1], force[:3]) == ("goal", ["force, dry discs", "2 %", "0.18 %"])
    assert {row[0]: row[2] for row in table}["delay at 90 % of the force"] == "never"
    # The mean of the stops; an estimator without bands has no column.
    (_, *names), (_, *force), *_ = figures.covered(COVERED)
    assert (len(names), force) == (1, ["94.0 %"])
    found = figures.causes({"causes": [{"effect": "BrakeFade", "parameters": FADE}]})
    estimate = "fade 4.28 (4.07 to 4.5) % per 100 K"
    assert found[1:] == [["BrakeFade", "fade 4.0 % per 100 K", estimate]]
    headline = {"both of a pair": SHARE, "right cause and no other": {**SHARE, "value": None}}
    assert figures.shares({"answer": {"headline": headline}})[1:] == [
        ["both of a pair", "80 %", "95 %", "75.1 to 99.9 %"],
        ["right cause and no other", "", "n/a", ""],
    ]


def test_sets_that_are_labelled_have_a_row_each() -> None:
    cause = {"effect": "BrakeFade", "confusable_with": ["WaterFilm"], "parameters": FADE}
    named = {"verdict": "found", "causes": [cause], "gain": {"before": 55.2, "after": 1.12}}
    nothing = {"verdict": "nothing", "causes": [], "gain": None}
    sets = [named if name == "fade" else nothing for name in figures.LABELLED]
    _, clean, _, fade, *_ = figures.singles(*sets)
    assert clean == ["`clean`", "nothing", "nothing", "", ""]
    estimate = "fade 4.28 (4.07 to 4.5) % per 100 K"
    planted = "fade 7.0 % per 100 K"
    assert fade == ["`fade`", "BrakeFade or WaterFilm", planted, estimate, "55.2 → 1.1"]


def test_folds_stand_beside_each_other_by_the_stops_that_were_left_out() -> None:
    fold = {"cases": ["04_dry_160_4.2", "09_wet"], "reasoned": 0.158, "tuned": None}
    fold |= {"error_reasoned": 0.0046, "error": 0.0172}
    first = {"estimator": "disturbance_observer", "judged": "Fx", "folds": [fold]}
    header, row = figures.folds(first, {**first, "estimator": "ekf"})
    assert header[1:3] == ["disturbance observer: z, untuned to tuned", "error of Fx"]
    assert header[3] == "EKF: z, untuned to tuned"
    assert row == ["04, 09", *2 * ["0.158 → n/a", "0.46 % → 1.72 %"]]


def test_without_their_recordings_tables_stay(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before = figures.PAGE.read_text()
    monkeypatch.setattr("sys.argv", ["figures.py", "singles"])
    figures.main()
    assert "singles: stays as it is, for it needs --recordings" in capsys.readouterr().out
    assert figures.PAGE.read_text() == before


def test_a_table_is_written_in_its_place_and_nothing_else_is_touched() -> None:
    page = "before\n\n<!-- figures: accuracy -->\n\nold\n\n<!-- figures end -->\n\nafter\n"
    text = figures.placed(page, "accuracy", WORST)
    assert text == page.replace("old", figures.written("accuracy", WORST))
    assert "| force, dry discs | 2 % | 0.18 % |\n" in text
    with pytest.raises(SystemExit, match="found 0 places for coverage, expected one"):
        figures.placed(page, "coverage", COVERED)
