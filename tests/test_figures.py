"""Tables of the pages are written from what the commands found."""

from dataclasses import replace
from pathlib import Path

import figure_tables as tables
import figure_train as train
import figures
import pytest
from figure_machines import MACHINES, machines

from workbench.studies.power.following import summarise_following
from workbench.studies.power.left_out import summarise_left_out

ROOT = Path(__file__).parents[1]
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
def test_what_is_said_to_be_written_is_of_its_command(name):
    (text,) = figures.block(name).findall(figures.page_of(name).read_text())
    if "Written by" in text:
        assert text.endswith(f"\n\n{figures.origin(figures.FIGURES[name].commands)}")


def test_tables_say_what_was_found():
    header, force, *_ = table = tables.worst(WORST)
    assert (header[1], force[:3]) == ("goal", ["force, dry discs", "2 %", "0.18 %"])
    assert {row[0]: row[2] for row in table}["delay at 90 % of the force"] == "never"
    # Mean and least of the stops; an estimator without bands has no column.
    (stops, *names), (_, *force), *_ = tables.coverage(COVERED)
    assert (stops, len(names), force) == ("2 stops", 1, ["94.0 % (93 %)"])
    rows = tables.causes({"causes": [{"effect": "BrakeFade", "parameters": FADE}]})
    estimate = "fade 4.28 (4.07 to 4.5) % per 100 K"
    assert rows[1:] == [["BrakeFade", "fade 4.0 % per 100 K", estimate]]
    headline = {"both of a pair": SHARE, "right cause and no other": {**SHARE, "value": None}}
    assert tables.shares({"answer": {"headline": headline}})[1:] == [
        ["both of a pair", "80 %", "95 %", "75.1 to 99.9 %"],
        ["right cause and no other", "", "n/a", ""],
    ]


def test_sets_that_are_labelled_have_a_row_each():
    cause = {"effect": "BrakeFade", "confusable_with": ["WaterFilm"], "parameters": FADE}
    named = {"verdict": "found", "causes": [cause], "gain": {"before": 55.2, "after": 1.12}}
    nothing = {"verdict": "nothing", "causes": [], "gain": None}
    sets = [named if name == "fade" else nothing for name in tables.LABELLED]
    _, clean, _, fade, *_ = tables.labelled(tables.LABELLED, *sets)
    assert clean == ["`clean`", "nothing", "nothing", "", ""]
    estimate = "fade 4.28 (4.07 to 4.5) % per 100 K"
    planted = "fade 7.0 % per 100 K"
    assert fade == ["`fade`", "BrakeFade or WaterFilm", planted, estimate, "55.2 → 1.1"]


def test_folds_stand_beside_each_other_by_the_stops_that_were_left_out():
    fold = {"cases": ["04_dry_160_4.2", "09_wet"], "reasoned": 0.158, "tuned": None}
    fold |= {"error_reasoned": 0.0046, "error": 0.0172}
    first = {"estimator": "disturbance_observer", "judged": "Fx", "folds": [fold]}
    header, row = tables.folds(first, {**first, "estimator": "ekf"})
    assert header[1:3] == ["disturbance observer: z, untuned to tuned", "error of Fx"]
    assert header[3] == "EKF: z, untuned to tuned"
    assert row == ["04, 09", *2 * ["0.158 → n/a", "0.46 % → 1.72 %"]]


def test_the_next_stop_stands_beside_what_was_said_before_it_and_after():
    made = {"experiment": "a step", "foreseen": True, "parts": True, "named": ["FxGain"]}
    made |= {"separations": []}
    other = made | {"foreseen": False, "parts": False, "named": ["FxGain", "DriveTorqueGain"]}
    row = {"planted": "FxGain", "multiple": 8.0, "group": other["named"], "proposed": made}
    row |= {"sensed": None}
    fitted = {"sensor": "the arms", **made}
    rows = [
        row | {"drawn": [made, other]},
        row | {"proposed": other, "drawn": [other, other]},
        row | {"proposed": other, "drawn": [other, other], "sensed": fitted},
        row | {"proposed": other, "drawn": [], "sensed": fitted | {"parts": False}},
        row | {"group": ["FxGain"], "proposed": None, "drawn": []},
    ]
    table = tables.followed({"sets": rows, **summarise_following(rows)})
    header, first, second, third, last = table
    both = "FxGain or DriveTorqueGain"
    assert len(header) == len(last)
    assert first == ["FxGain x 8", both, "a step", "FxGain", "1 of 2"]
    assert second == ["FxGain x 8", "DriveTorqueGain or FxGain", "none discriminates", "", ""]
    named = "none discriminates; with a sensor of the arms"
    assert third[0] == "FxGain x 8, FxGain x 8"
    assert third[2:] == [named, "its own cause 1 of 2 times", ""]
    ends = "discriminates: 1 of 1; where none was foreseen to, 0 of 3, with a named sensor 1 of 2"
    assert last[3:] == [f"{ends}; together 2 of 4", "1 of 6"]


def test_a_tuning_stands_beside_the_runs_before_and_after_it():
    def runs(**errors: float) -> dict[str, object]:
        names = {name: {"Fx_nrmse": error, "z": 10 * error} for name, error in errors.items()}
        return {"cases": {"01_dry_80": {"estimators": names}, "07_wet_80": {"estimators": names}}}

    usual, better = (dict.fromkeys(tables.TUNED, error) for error in (0.02, 0.01))
    tuning = {"gains": {"a": 1, "b": 2}, "z_reasoned": 0.2, "z": 0.1, "work": {"saved": 0.8}}
    header, z, worst, wet, dry, saved = tables.tuned(runs(**usual), *2 * (tuning, runs(**better)))
    assert header[1] == "disturbance observer (2 gains)"
    assert [z[1], saved[1]] == ["0.200 → 0.100", "80 %"]
    assert {worst[1], wet[1], dry[1]} == {"2.00 % → 1.00 %"}
    sets = (runs(**usual), runs(**better), runs(**better))
    assert [row[1] for row in tables.tuned_elsewhere(*sets, *sets)[1:]] == 2 * ["2.00 % → 1.00 %"]
    assert tables.judged_by(runs(**usual), runs(**better), runs(**better))[1:3] == [
        ["untuned", "0.200", "2.00 %"],
        ["tuned by the load cells", "0.100", "1.00 %"],
    ]


def test_a_machine_is_told_by_what_was_held_out_in_the_unit_of_who_published_it():
    def error(unit: str, channel: str = "", **more: object) -> dict[str, object]:
        sizes = {"rms": [0.3, 0.04], "mean_absolute": [0.2, 0.02]}
        return {"unit": unit, "samples": 100, "held_out": True, "channel": channel, **sizes, **more}

    units = {"mrad": "rad", "mbar": "Pa", "mV": "V"}
    summaries = [
        {
            "causes": [{"effect": "Leak", "confusable_with": []}],
            "errors": [
                error(
                    units.get(machine.unit, machine.unit),
                    machine.channel,
                    held_out=bool(machine.held_out),
                ),
                error("m", "other", held_out=not machine.held_out),
            ],
        }
        for machine in MACHINES.values()
    ]
    _, *rows = machines(*summaries)
    written = dict(zip(MACHINES, (row[2:] for row in rows), strict=True))
    assert written["cascaded_tanks"] == ["0.3 V", "0.04 V", "Leak"]
    assert written["servo_pendulum"] == ["200 mrad", "20 mrad", "Leak"]
    # Of two recordings the rms is that of all their samples: sqrt((100*0.3^2 + 300*0.5^2)/400).
    machine = MACHINES["O-ring"]
    longer = error("N", samples=300, rms=[0.5, 0.5])
    assert machine.errors({"errors": [error("N"), longer]})[0] == pytest.approx(0.458, abs=5e-4)


def test_without_their_recordings_tables_stay(monkeypatch, capsys):
    before = figures.page_of("singles").read_text()
    monkeypatch.setattr("sys.argv", ["figures.py", "singles"])
    figures.main()
    assert "singles: stays as it is, for it needs --recordings" in capsys.readouterr().out
    assert figures.page_of("singles").read_text() == before


def test_a_command_that_fails_costs_its_own_table(monkeypatch, capfd, tmp_path):
    before = figures.page_of("machines").read_text()
    command = ["figures.py", "machines", "--recordings", str(tmp_path / "none")]
    monkeypatch.setattr("sys.argv", command)
    monkeypatch.setitem(
        figures.FIGURES,
        "machines",
        replace(figures.FIGURES["machines"], commands=(MACHINES["cascaded_tanks"].prepare,)),
    )
    assert figures.main() == 1
    out = capfd.readouterr().out
    assert "machines: stays as it is, for `workbench prepare cascaded_tanks" in out
    assert figures.page_of("machines").read_text() == before


def test_a_table_is_written_in_its_place_and_nothing_else_is_touched():
    text = "before\n\n<!-- figures: accuracy -->\n\nold\n\n<!-- figures end -->\n\nafter\n"
    page = figures.placed(text, "accuracy", WORST)
    assert page == text.replace("old", figures.written("accuracy", WORST))
    assert "| force, dry discs | 2 % | 0.18 % |\n" in page
    with pytest.raises(SystemExit, match="found 0 places for coverage, expected one"):
        figures.placed(text, "coverage", COVERED)


def test_a_safety_level_stands_beside_plain_stops_as_far_as_these_reach():
    level = {"decade": 1, "ratio": 0.97051, "low": 0.9672, "high": 0.9743}
    rare = {**level, "decade": 7, "variation": 0.0232, "plain_stops": 1.96e10}
    first = {**level, "variation": 0.1284, "plain_stops": 1.1e4}
    header, *_, last = train.safety({"safety": [first, rare]})
    assert header[0] == "one stop in"
    assert last == ["1e7", "0.971 (0.967 to 0.974)", "2.3 %", "2.0e10 stops"]
    drawn = {"samples": 100_000, "levels": [level]}
    header, seen, unseen = train.plain({"safety": [first, rare], "plain": drawn})
    assert header[2] == "100 000 plain stops (95 %)"
    assert seen == ["1e1", *2 * ["0.9705 (0.9672 to 0.9743)"]]
    assert unseen[2] == "too few"


def test_stops_beyond_the_claim_count_apart_with_their_reasons():
    widths = [{"width": width, "outside": ""} for width in (1.0, 1.1, 1.5)]
    slide = {"width": 9.0, "outside": "an axle slides"}
    predictions = {"held": {"of": 3, "stops": 2}, "stops": [*widths, slide, slide]}
    _, row, *_ = train.predicted(*len(train.PREDICTED) * (predictions,))
    assert row[1:] == ["2 of 3", "1.10 (1.00 to 1.50)", "2: an axle slides"]


def test_what_monitoring_tells_stands_beside_what_was_planted():
    summary = {"recordings": 40, "refused": {}, "sentences": ["axle 7: -12 %"]}
    sound = {"recordings": 6, "refused": {"07": "", "08": ""}, "sentences": []}
    cause = {"effect": "BrakeFade", "confusable_with": [], "parameters": FADE}
    _, first, second, third = train.monitored(summary, {"causes": [cause]}, sound)
    assert first[1:] == [train.LOSS, "40 of 40", "axle 7: -12 %"]
    assert second[3] == "BrakeFade: fade 4.28 (4.07 to 4.5) % per 100 K"
    assert third[1:] == ["nothing", "6 of 8", "no alarms"]


def test_faults_of_all_places_count_together():
    right, missed = {"4": {"hits": 1, "of": 1}}, {"4": {"hits": 0, "of": 1}}
    share = {"hits": 1, "of": 2, "low": 0.0126, "high": 0.987}
    summary = {
        "effects": {
            "WeakPads[1]": {"size": 0.0375, "unit": "1", "right_first": right},
            "WeakPads[2]": {"size": 0.0375, "unit": "1", "right_first": missed},
        },
        "confusion": {"WeakPads[1]": {"WeakPads[1]": 1}, "WeakPads[2]": {"unexplained": 1}},
        **dict.fromkeys(("right_first", "false_alarms", "coverage"), share),
        "wrong": [],
    }
    _, pads, whole, *_ = train.named(summary)
    assert pads == ["WeakPads, 15 %", "1 of 2", "1 unexplained"]
    assert whole == ["all faults", "1 of 2 (1 to 99 %)", "0 a wrong name"]


def test_a_law_is_right_where_the_cause_acts():
    none = {"left_out": ["A"], "verdict": "unexplained", "named": [], "laws": [], "asked": True}
    none |= {"rig": "--seed 7 --effect a=0.1", "slot_right": False, "before": None, "after": None}
    none |= {"after_with_it": None, "function_error": None}
    right = none | {"laws": ["a law"], "slot_right": True, "before": 52.91, "after": 1.32}
    right |= {"after_with_it": 1.0, "function_error": 0.042}
    unknown = right | {"left_out": [], "named": ["B"], "after_with_it": None}
    unknown |= {"function_error": None}
    rows = [right, unknown, none, none | {"verdict": "found", "named": ["B"], "asked": False}]
    header, first, second, third, last = tables.laws({"sets": rows, **summarise_left_out(rows)})
    assert len(header) == len(last)
    assert first == ["A", "unexplained", "a law", "yes", "52.9 → 1.32", "1", "4.2 %"]
    assert second == ["a, in no catalogue", "B", "a law", "yes", "52.9 → 1.32", "", ""]
    assert third[2:] == ["nothing", "", "", "", ""]
    assert last[3:] == ["2 of 3", "1 of 1 gain 80 %", "", "1 of 1 within 15 %"]


def test_a_size_in_bars_stays_in_its_cell():
    row = {"planted": "A", "multiple": 8.0, "group": ["A", "B"], "drawn": [], "sensed": None}
    made = {"experiment": "|v| rises", "foreseen": True, "parts": True, "named": ["A"]}
    rows = [row | {"proposed": made | {"separations": []}}]
    page = figures.written("next", {"sets": rows, **summarise_following(rows)})
    assert r"| A or B | \|v\| rises | A |" in page
