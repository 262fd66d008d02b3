"""`workbench check`: whether a library of effects is fit for a diagnosis."""

import json
from pathlib import Path

import pytest

from workbench.__main__ import main
from workbench.system.template import write_system

from .edits import edit

TRUE_CLAIM = """
  package Tests
    model WallSeepsInProportionToLevel
      Real h(start=0.5, fixed=true);
      Seepage wall(nominal=2.0, h=h, k=1e-3);
    equation
      der(h) = -0.1*h;
      assert(abs(wall.actual - 2.0 - 1e-3*h) < 1e-12, "the wall seeps by another law");
      annotation (experiment(StopTime=0.1, Tolerance=1e-6));
    end WallSeepsInProportionToLevel;
  end Tests;
"""


@pytest.fixture
def library(tmp_path):
    """The system of the template, and what replaces text of its library."""
    write_system(tmp_path / "tank")
    package = tmp_path / "tank" / "package.mo"

    def change(old: str, new: str) -> Path:
        return edit(package, (old, new), count=1).parent

    return change


def checked(folder: Path, capsys, status: int) -> dict:
    """What `check --json` says, with this exit status."""
    assert main(["check", str(folder), "--json"]) == status
    return json.loads(capsys.readouterr().out)["result"]


def test_a_sound_library_shows_each_effect_and_holds_its_claims(library, capsys):
    folder = library("end Tank;", f"{TRUE_CLAIM}end Tank;")
    result = checked(folder, capsys, 0)
    (claim,) = result["claims"]
    (effect,) = result["effects"]
    assert claim == {"name": "Tank.Tests.WallSeepsInProportionToLevel", "failures": []}
    assert (effect["name"], effect["signal"], effect["failure"]) == ("Seepage", "h", "")
    assert effect["change"] > 1.0


def test_a_claim_that_does_not_hold_is_named_with_its_text(library, capsys):
    wrong = TRUE_CLAIM.replace("- 1e-3*h", "- 2e-3*h")
    result = checked(library("end Tank;", f"{wrong}end Tank;"), capsys, 1)
    (claim,) = result["claims"]
    assert any("the wall seeps by another law" in text for text in claim["failures"])


def test_a_claim_that_does_not_compile_fails_and_effects_are_tried_all_the_same(library, capsys):
    wrong = TRUE_CLAIM.replace("Seepage wall", "Sepage wall")
    result = checked(library("end Tank;", f"{wrong}end Tank;"), capsys, 1)
    (claim,) = result["claims"]
    assert "Sepage" in claim["failures"][0]
    assert [effect["name"] for effect in result["effects"]] == ["Seepage"]


def test_an_effect_that_is_not_nominal_at_zero_is_refused_with_its_line(library, capsys):
    folder = library("actual = nominal + k*h", "actual = nominal + k*h + 1e-5")
    assert main(["check", str(folder)]) == 2
    error = capsys.readouterr().err
    assert "Tank.Seepage" in error
    assert "package.mo:" in error
    assert "all sizes at zero: h differs by" in error


def test_an_effect_that_changes_nothing_cannot_be_used(library, capsys):
    folder = library("actual = nominal + k*h", "actual = nominal + 0.0*k*h")
    (effect,) = checked(folder, capsys, 1)["effects"]
    assert effect["failure"] == "it changes no signal of these recordings"


def test_a_size_that_matters_and_lies_outside_of_its_bounds_is_named(library, capsys):
    folder = library("matters=1e-5", "matters=1.0")
    (effect,) = checked(folder, capsys, 1)["effects"]
    assert effect["failure"].startswith("matters = 1 lies outside of the bounds")


def test_a_system_without_a_library_is_refused(library, capsys):
    folder = library("end Tank;", "end Tank;")
    (folder / "package.mo").unlink()
    assert main(["check", str(folder)]) == 2
    assert "package.mo" in capsys.readouterr().err
