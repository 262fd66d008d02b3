"""The engine is of no machine: words of wheelset and train stand in their own folders alone."""

import re
from pathlib import Path

import pytest

from workbench.diagnosis import read_effects
from workbench.models.modelica import read_library
from workbench.system.system import OBSERVER

ROOT = Path(__file__).parent.parent
KINDS = (".py", ".html", ".js", ".css", ".c", ".h")
# What a rig is made of, in prose; a wheel of Python and that of a mouse are none.
PROSE = "[Rr]ollers?|[Dd]iscs?|[Ss]lip(s|ping)?|[Bb]rak(e|es|ed|ing)|[Aa]dhesion|[Cc]reep(age)?"
ALLOWED = {"direction", "speed"}  # words of every field


@pytest.fixture(scope="module")
def names(system) -> set[str]:
    """Names that the system file and the library of the wheelset give to things."""
    library = read_library(system.library)
    effects = read_effects(library, system.models[OBSERVER].name)
    return {
        library.name,
        *system.signals,
        *system.reported,
        *(signal.reading for signal in system.signals.values()),
        *(key.name for key in (*system.derived, *system.estimated, *system.conditions)),
        *system.corrections,
        *system.comparison.tolerances,
        *(name for condition in system.conditions for name in condition.parameters),
        *(model.name for model in system.models.values()),
        *(effect.name for effect in effects),
        "Polach",
    } - ALLOWED


def sources() -> list[Path]:
    package = ROOT / "workbench"
    own = (package / "machines" / "wheelset", package / "machines" / "train")
    return sorted(
        path
        for path in package.rglob("*")
        if path.suffix in KINDS and not any(map(path.is_relative_to, own))
    )


@pytest.mark.parametrize("source", sources(), ids=lambda p: str(p.relative_to(ROOT / "workbench")))
def test_no_source_names_what_one_machine_has(source, names):
    words = re.compile(rf"\b({'|'.join(map(re.escape, names))}|{PROSE})\b")
    lines = enumerate(source.read_text().splitlines(), 1)
    assert [(number, line.strip()) for number, line in lines if words.search(line)] == []
