"""Proposals that are followed: what the rig then makes parts what stops before left together."""

import json
from typing import Any

import pytest

from workbench.__main__ import main
from workbench.studies.power.following import SHARES, summarise_following
from workbench.studies.power.report import following_check

from .schemas import check

DISC = "the disc that brakes least, at its caliper"


def made(parts: bool, foreseen: bool, predicted: float, shown: float | None) -> dict[str, Any]:
    """A recording that was made."""
    away = [{"from": "B", "predicted": predicted, "shown": shown}]
    named = ["A"] if parts else ["A", "B"]
    return {
        **{"experiment": "a stop", "verdict": "found", "named": named, "separations": away},
        **{"foreseen": foreseen, "parts": parts},
    }


def test_what_was_followed_is_counted():
    row = {"planted": "A", "multiple": 8.0, "verdict": "found", "group": ["A", "B"], "error": ""}
    row |= {"sensed": None}
    fitted = {"sensor": "the load", **made(True, True, 9.0, 9.0)}
    rows = [
        row | {"proposed": made(True, True, 10.0, 12.1), "drawn": [made(False, True, 3.0, 1.5)]},
        row | {"proposed": made(False, True, 10.0, 11.9), "drawn": [made(True, True, 9.0, None)]},
        row | {"proposed": made(False, False, 1.0, 1.0), "drawn": [], "sensed": fitted},
        row | {"proposed": made(True, False, 2.0, -0.1), "drawn": []},
        row | {"group": ["A"], "proposed": None, "drawn": []},  # named alone by the stops before
    ]
    summary = summarise_following(rows)
    counted = {name: (one["hits"], one["of"]) for name, one in summary.items()}
    assert counted == {
        **{"proposed": (2, 4), "drawn": (1, 2), "foreseen": (1, 2), "never": (1, 2)},
        **{"sensed": (1, 1), "answered": (3, 4)},
        "separations": (4, 6),  # 1.9 of 10 off is within a fifth, the small ones within noise
    }
    told = following_check(rows).text
    assert "A or B -> A (one that is drawn: does not): a stop" in told
    assert "A or B -> A or B (one that is drawn: ): a stop; with a sensor of the load: A" in told
    assert f"2 of 4 {SHARES['proposed']} (7% to 93%)" in told


def test_a_rival_that_is_nearer_than_the_true_cause_is_predicted_as_such():
    row = {"planted": "A", "multiple": 8.0, "verdict": "found", "group": ["A", "B"], "sensed": None}
    rows = [row | {"proposed": made(False, False, -9.0, shown), "drawn": []} for shown in (-9.5, 9)]
    found = summarise_following(rows)["separations"]
    assert (found["hits"], found["of"]) == (1, 2)


def test_a_rig_that_makes_no_experiments_is_refused(tmp_path, capsys):
    assert main(["power", "--follow", "--system", "train", "--out", str(tmp_path)]) == 2
    assert "one with the method 'following'" in capsys.readouterr().err


@pytest.mark.long
def test_torque_and_force_part_where_the_drive_imitates_nothing(tmp_path):
    """With an inertia imitated, both are collinear in any stop, whatever the pressure."""
    options = ["--follow", "--effects", "FxGain", "--sizes", "8", "--repeats", "1"]
    alike = ["--case", "24_alike_80_2.7", "--case", "25_alike_80_2.7"]
    assert main(["power", *options, *alike, "--out", str(tmp_path), "--workers", "1"]) == 0
    said = json.loads((tmp_path / "followed" / "followed.json").read_text())
    check("followed", said)
    (row,) = said["sets"]
    assert set(row["group"]) >= {"FxGain", "DriveTorqueGain"}
    assert "imitates 0 kg.m2" in row["proposed"]["experiment"]
    assert (row["proposed"]["foreseen"], row["proposed"]["named"]) == (True, ["FxGain"])
    assert len(row["drawn"]) == 2
    # What imitates the whole train tells nothing, whatever else is drawn.
    assert not any(one["parts"] for one in row["drawn"] if "7840" in one["experiment"])


@pytest.mark.long
@pytest.mark.parametrize(
    ("planted", "twin", "sensor", "answer"),
    [
        # A force that leans on the load: 100 kN instead of 80 kN tells.
        ("ApexOffset", "FxOffset", "", "wheel load 100 kN"),
        # Three slightly wet discs look like one that is wetter.
        ("SingleDiscWaterFilm", "WaterFilm", f"friction force of {DISC}", ""),
        # The same law of the contact, with the friction that belongs to it.
        ("CreepStiffness", "WheelLoad", "wheel load, at the vertical cylinders", ""),
    ],
)
def test_a_twin_is_parted_by_what_is_proposed_for_it(planted, twin, sensor, answer, tmp_path):
    options = ["--follow", "--effects", planted, "--sizes", "8", "--repeats", "1"]
    alike = ["--case", "24_alike_80_2.7", "--case", "25_alike_80_2.7"]
    assert main(["power", *options, *alike, "--out", str(tmp_path), "--workers", "1"]) == 0
    said = json.loads((tmp_path / "followed" / "followed.json").read_text())
    check("followed", said)
    (row,) = said["sets"]
    assert set(row["group"]) == {planted, twin}
    made = row["proposed"]
    assert answer in made["experiment"]
    assert made["foreseen"] == made["parts"] == (not sensor)
    if sensor:
        assert row["sensed"]["sensor"] == sensor
        made = row["sensed"]
    assert made["named"] == [planted]
