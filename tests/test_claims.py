"""The claims of the libraries' `Tests`: each is built and simulated, its asserts must hold."""

import re
import shutil
from pathlib import Path
from typing import Any

import fmpy
import pytest

from .built import build_here

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


def simulate(package: Path, claim: str, scratch: Path) -> list[str]:
    """Run a claim to its StopTime; returns what the FMU complained of.

    Co-Simulation by the FMU's own integrator, then Model Exchange by CVODE: what holds at the
    accuracy of one integrator alone is no claim on the model. It is built once for each state of
    library and compiler.
    """
    model = f"{package.parent.name}.Tests.{claim}"
    path = scratch / f"{claim}.fmu"
    build_here(package, model, path)
    experiment = fmpy.read_model_description(str(path)).defaultExperiment
    messages: list[str] = []

    def log(_: object, __: bytes, status: int, ___: bytes, message: bytes) -> None:
        if status >= 1:
            messages.append(message.decode())

    for interface in ("CoSimulation", "ModelExchange"):
        try:
            fmpy.simulate_fmu(
                str(path),
                fmi_type=interface,
                stop_time=float(experiment.stopTime),
                relative_tolerance=float(experiment.tolerance),
                output_interval=0.01,
                logger=log,
            )
        except Exception as error:  # FMPy raises bare Exception when a call returns an error
            messages.append(str(error))
    return messages


@pytest.mark.parametrize("library", LIBRARIES, ids=lambda library: library.name)
def test_every_claim_is_listed(library):
    listed = [claim for one, claim in CLAIMS if one == library]
    assert sorted(listed) == sorted(p.stem for p in (library / "Tests").glob("[A-Z]*.mo"))


@pytest.mark.parametrize(
    ("library", "claim"),
    [parameters(*claim) for claim in CLAIMS],
    ids=lambda value: getattr(value, "name", value),
)
def test_claim(library, claim, tmp_path):
    assert simulate(library / "package.mo", claim, tmp_path) == []


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
    claim.write_text(claim.read_text().replace("kS=1.0", "kS=0.9"))
    messages = simulate(copy / "package.mo", claim.stem, tmp_path)
    assert any("Polach's slope at zero slip differs from K" in message for message in messages)
