"""The claims of `WheelsetRig.Tests`: each model is built and simulated, its asserts must hold."""

import shutil
from pathlib import Path

import fmpy
import pytest

pytest.importorskip("casadi")
pytest.importorskip("rumoca")

from workbench import compiler

LIBRARY = Path(__file__).parent.parent / "modelica" / "WheelsetRig"
CLAIMS = (LIBRARY / "Tests" / "package.order").read_text().split()


def simulate(package: Path, claim: str, folder: Path) -> list[str]:
    """Build a claim and co-simulate it to its StopTime; returns what the FMU complained of."""
    path = folder / f"{claim}.fmu"
    compiler.build(package, f"WheelsetRig.Tests.{claim}", path, platforms=["linux-x86_64"])
    experiment = fmpy.read_model_description(str(path)).defaultExperiment
    messages: list[str] = []

    def log(_: object, __: bytes, status: int, ___: bytes, message: bytes) -> None:
        if status >= 1:
            messages.append(message.decode())

    try:
        fmpy.simulate_fmu(
            str(path),
            fmi_type="CoSimulation",
            stop_time=float(experiment.stopTime),
            relative_tolerance=float(experiment.tolerance),
            output_interval=0.01,
            logger=log,
        )
    except Exception as error:  # FMPy raises bare Exception when a call returns an error
        messages.append(str(error))
    return messages


def test_every_claim_is_listed() -> None:
    assert sorted(CLAIMS) == sorted(p.stem for p in (LIBRARY / "Tests").glob("[A-Z]*.mo"))


@pytest.mark.parametrize("claim", CLAIMS)
def test_claim(claim: str, tmp_path: Path) -> None:
    assert simulate(LIBRARY / "package.mo", claim, tmp_path) == []


def test_a_wrong_claim_fails_with_its_text(tmp_path: Path) -> None:
    copy = tmp_path / "WheelsetRig"
    shutil.copytree(LIBRARY, copy)
    claim = copy / "Tests" / "PolachSlopeIsKalkerStiffness.mo"
    claim.write_text(claim.read_text().replace("kS=1.0", "kS=0.9"))
    messages = simulate(copy / "package.mo", claim.stem, tmp_path)
    assert any("Polach's slope at zero slip differs from K" in message for message in messages)
