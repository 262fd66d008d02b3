"""The claims of the libraries' `Tests`: each is built and simulated, its asserts must hold."""

import re
import shutil
from pathlib import Path
from typing import Any

import pytest

from workbench.models.modelica import read_library
from workbench.studies.library_check import claim_models, failures_of_claim

from .edits import edit

LIBRARIES = sorted(
    path.parents[1]
    for path in (Path(__file__).parent.parent / "modelica").glob("*/Tests/package.mo")
)
RIG = Path(__file__).parent.parent / "modelica" / "WheelsetRig"
CLAIMS = [
    (library, claim)
    for library in LIBRARIES
    for claim in (library / "Tests" / "package.order").read_text().split()
]
# Models that take longest to build; one claim on them is among the short tests.
MULTIBODY = re.compile(r"\b(Reference|CoupledTrain|StiffCoupler)\b")
SHORT = "EnergyIsConserved"


def parameters(library: Path, claim: str) -> Any:
    text = (library / "Tests" / f"{claim}.mo").read_text()
    is_long = claim != SHORT and MULTIBODY.search(text) is not None
    return pytest.param(library, claim, marks=[pytest.mark.long] * is_long)


@pytest.mark.parametrize("library", LIBRARIES, ids=lambda library: library.name)
def test_every_claim_is_listed(library):
    listed = [f"{library.name}.Tests.{claim}" for owner, claim in CLAIMS if owner == library]
    assert sorted(listed) == sorted(claim_models(read_library(library / "package.mo")))


@pytest.mark.parametrize(
    ("library", "claim"),
    [parameters(*claim) for claim in CLAIMS],
    ids=lambda value: getattr(value, "name", value),
)
def test_claim(library, claim):
    model = f"{library.name}.Tests.{claim}"
    assert failures_of_claim(library / "package.mo", model) == []


@pytest.mark.parametrize("library", LIBRARIES, ids=lambda library: library.name)
def test_what_a_claim_allows_its_solver_is_what_it_asks_of_it(library):
    for claim in (library / "Tests").glob("[A-Z]*.mo"):
        text = claim.read_text()
        allowed = re.findall(r"constant Real tolerance\(.*?\) = (\S+)", text)
        asked = re.findall(r"\bTolerance=([^,)]+)", text)
        assert len(asked) <= 1
        assert allowed in ([], asked), claim.name


def test_a_wrong_claim_fails_with_its_text(tmp_path):
    copy = tmp_path / "WheelsetRig"
    shutil.copytree(RIG, copy)
    claim = copy / "Tests" / "PolachSlopeIsKalkerStiffness.mo"
    edit(claim, ("kS=1.0", "kS=0.9"))
    failures = failures_of_claim(copy / "package.mo", f"WheelsetRig.Tests.{claim.stem}")
    assert any("Polach's slope at zero slip differs from K" in failure for failure in failures)
