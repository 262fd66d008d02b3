"""The tutorials: each runs on its recordings, and what it tells is what was found."""

import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

import workbench as wb

pytest.importorskip("casadi", reason="needs the extra [compiler]")
pytest.importorskip("rumoca", reason="needs the extra [compiler]")
pytest.importorskip("ziglang", reason="needs the extra [compiler]")

DATA = {
    "cascaded_tanks": "cascaded_tanks",
    "servo_pendulum": "servo_pendulum",
    "pneumatic_cylinder": "pneumatic_cylinder",
    "air_supply": "metro_air_supply",
}
Names = dict[str, Any]


@pytest.fixture
def run(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Names]:
    """Runs a tutorial; returns its names."""
    mpl.use("agg")

    def executed(tutorial: str, data: Path | None = None) -> Names:
        folder = data or root.parent / "shared" / "recordings" / "real" / DATA[tutorial]
        if data is None and not folder.exists():
            pytest.skip("the recordings are not at hand")
        script = root / "tutorials" / f"{tutorial}.py"
        monkeypatch.setattr(sys, "argv", [str(script), str(folder), str(tmp_path / "out")])
        names = runpy.run_path(str(script), run_name="__main__")
        assert (tmp_path / "out" / "fmpy.png").stat().st_size > 10_000
        return names

    return executed


def causes(found: wb.Outcome) -> list[set[str]]:
    """Each cause with those that it cannot be told from, strongest first."""
    return [{one.effect.name, *one.confusable_with} for one in found.diagnosis.causes]


def held_out(found: wb.Outcome) -> dict[str, tuple[float, float]]:
    """Errors (rms) of single samples before and after, by recording that was not fitted."""
    return {one.recording: one.rms for one in found.errors if one.held_out}


@pytest.mark.parametrize("tutorial", DATA)
def test_a_folder_without_the_recordings_is_refused(
    tutorial: str, run: Callable[..., Names], tmp_path: Path
) -> None:
    with pytest.raises(wb.InputError, match="no such folder"):
        run(tutorial, tmp_path / "nowhere")


def test_upper_tank_overflows(run: Callable[..., Names]) -> None:
    names = run("cascaded_tanks")
    found = names["found"]
    assert causes(found)[0] == {"UpperOverflow"}
    ((before, after),) = held_out(found).values()
    assert after < 0.33 < before
    # In FMPy, with another integrator and all samples.
    assert names["error"] == pytest.approx(after, rel=0.05)


def test_servo_has_dry_or_viscous_friction_and_more_under_load(run: Callable[..., Names]) -> None:
    names = run("servo_pendulum")
    found = names["found"]
    groups = causes(found)
    assert any({"DryFriction", "ViscousFriction"} & group for group in groups)
    assert any({"LoadFriction", "LoadStribeck", "DriveFriction"} & group for group in groups)
    assert not any(one.effect.name == "Stribeck" for one in found.diagnosis.causes)
    errors = {one.recording: one.mean_absolute for one in found.errors if one.held_out}
    assert len(errors) == 4
    before, after = (sum(pair[k] for pair in errors.values()) / 4 for k in (0, 1))
    assert after < 0.04 < before
    assert names["error"] == pytest.approx(errors[names["case"].name][1], rel=0.05)


def test_friction_of_both_seals_grows_with_pressure(run: Callable[..., Names]) -> None:
    names = run("pneumatic_cylinder")
    for seal in ("O-ring", "NAPN"):
        found = names["found"][seal]
        assert any("PressureFriction" in group for group in causes(found))
        assert any({"DryFriction", "PreslidingFriction"} & group for group in causes(found))
        ((before, after),) = held_out(found).values()
        assert after < 1.25 < before
        # The first second, in which the machine starts, is told by FMPy alone.
        assert names["errors"][seal] == pytest.approx(after, rel=0.1)
    assert "LaminarLeak" in causes(names["found"]["Ultimaker_020"])[0]
    assert names["found"]["Aluminium"].diagnosis.verdict == "nothing"


def test_train_loses_air_in_one_of_five_ways(run: Callable[..., Names]) -> None:
    names = run("air_supply")
    found = names["found"]
    assert {"LaminarLeak", "OrificeLeak", "SteadyConsumption"} <= causes(found)[0]
    errors = held_out(found)
    assert len(errors) == 2
    for before, after in errors.values():
        assert after < 5.5e3 < before
    assert names["error"] == pytest.approx(errors[names["case"].name][1], rel=0.1)
