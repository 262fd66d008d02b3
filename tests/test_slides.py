"""What a slide shows: predictions from one restart to the next, their weights, and the verdicts."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from workbench.arrays import Vector
from workbench.diagnosis import Diagnosis, catalogue
from workbench.diagnosis.data.motion import ModelSource, OpenModel, motion
from workbench.diagnosis.data.samples import Samples, compared, prepare
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.verdict import conclude
from workbench.diagnosis.simulation.prediction import Predictor
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.diagnosis.simulation.simulator import SimulatorSetup, simulating
from workbench.machines.wheelset.rig import SCENARIOS, Effects, Scenario
from workbench.machines.wheelset.rig.scenarios import Patch
from workbench.models.fmu import FMU, CoSimulation
from workbench.models.modelica import read_library
from workbench.recordings.case import Case, read_cases
from workbench.system.system import System

from .recordings import record
from .systems import WHEELSET as SYSTEM

ROOT = Path(__file__).parent.parent
MINIMAL = ROOT / "fmus" / "fmi2" / "MinimalObserver.fmu"
LIBRARY = read_library(ROOT / "modelica" / "WheelsetRig" / "package.mo")
EFFECTS = catalogue(SYSTEM, LIBRARY)
WET = {"muWR": 0.2, "polach.kA": 0.3, "polach.kS": 0.1, "polach.B": 0.2}
SLIDES = ("18_slide_160_4.8", "20_slide_120_4.6_rev", "21_slide_120_4.9")


def sliding(noise: float) -> Case:
    """A stop whose wheel slides and is caught, by the FMU's own integrator; 1: usual noise."""
    h, n = 0.005, 3200
    time = h * np.arange(n)
    # Every two seconds more than the rail bears for 0.7 s, then little: the wheel is caught.
    phase = np.where(time > 5.0, time % 2.0, 1.5)
    asked = np.select([phase < 0.7, phase < 1.1], [4.2e5, 1.5e5], 3.0e5)
    pB = asked * np.clip(time - 3.0, 0.0, 1.0)
    tauR = 10e3 * np.clip(time - 3.2, 0.0, 1.0)
    rows = []
    with CoSimulation(MINIMAL) as model:
        inputs = model.variables(["pB", "tauR"])
        outputs = model.variables(["omegaWReading", "omegaRReading", "FxReading"])
        model.start({"omegaW": 50.0 * 0.70 / 0.46, "omegaR": 50.0}, WET)
        for k in range(n):
            model.set(inputs, np.array([pB[k], tauR[k]]))
            rows.append(model.get(outputs).copy())
            after = min(k + 1, n - 1)
            for share in (np.arange(10) + 0.5) / 10:  # inputs go on a line from sample to sample
                between = [v[k] + share * (v[after] - v[k]) for v in (pB, tauR)]
                model.set(inputs, np.array(between))
                model.step(h / 10)
    omegaW, omegaR, Fx = np.array(rows).T
    rng = np.random.default_rng(5)
    signals = {
        "pB": pB,
        "tauR": tauR + noise * 40.0 * rng.standard_normal(n),
        "omegaW": omegaW + noise * np.hypot(0.002, 3e-4 * omegaW) * rng.standard_normal(n),
        "omegaR": omegaR + noise * 0.003 * rng.standard_normal(n),
        "Fx": Fx + noise * 80.0 * rng.standard_normal(n),
    }
    conditions = {
        "initial_speed": 35.0,
        "brake_pressure": 4.8e5,
        "wheel_rail": "wet",
        "discs": ("dry",) * 3,
        "direction": 1,
    }
    inputs, outputs = ("pB", "tauR"), ("omegaW", "omegaR")
    return Case("slide", "a slide", conditions, time, signals, inputs, outputs, Path("none.csv"))


def ready(case: Case, system: System = SYSTEM) -> Samples:
    with FMU(MINIMAL) as fmu:
        return prepare(case, system, compared(system, [case]), OpenModel(fmu, motion(fmu, system)))


def slip_errors(samples: Samples, values: dict[str, float]) -> Vector:
    """Of the blocks that begin as measured [m/s]."""
    with FMU(MINIMAL) as fmu:
        errors = Predictor(fmu, SYSTEM, samples.signals).errors(samples, values)
    return samples.channels(errors)[:, 0]


def test_a_slide_is_predicted_from_one_restart_to_the_next():
    samples = ready(sliding(0.0))
    spans = samples.restarted
    assert 2.0 < 0.05 * spans.sum() < 10.0  # seconds of slides
    # Solvers differ by less than a sixth of the noise of a block's mean, 3 mm/s.
    assert np.abs(slip_errors(samples, WET)[spans]).max() < 5e-4
    # Five per cent less friction: a wheel that is not restarted runs away.
    slippery = {**WET, "muWR": 0.95 * WET["muWR"]}
    free = slip_errors(replace(samples, restarts=None), slippery)
    assert np.abs(free[spans]).max() > 1.0
    # Of a force of 24 kN, 5 % accelerate the wheel by F*rW/JW, for 27.5 ms in the mean of a block;
    # what friction falls by meanwhile adds some per cent.
    expected = 0.05 * 24e3 * 0.46**2 / 110.0 * 0.0275
    late = np.abs(slip_errors(samples, slippery)[spans]).max()
    assert late == pytest.approx(expected, rel=0.1)


def test_errors_of_slides_are_as_large_as_their_weights_say():
    """Noise alone, which a restart passes on to its block, and the wheel to the next ones."""
    exclusions = tuple(
        replace(exclusion, uncertain={}) for exclusion in SYSTEM.comparison.exclusions
    )
    system = replace(SYSTEM, comparison=replace(SYSTEM.comparison, exclusions=exclusions))
    # No structure stands before these load cells.
    signals = tuple(replace(signal, mode=None) for signal in system.reference_signals)
    system = replace(system, reference_signals=signals)
    samples = ready(sliding(1.0), system)
    with simulating(SimulatorSetup(MINIMAL, system, (samples,))) as simulator:
        weighed = simulator.weighed(0, WET)
    with simulating(SimulatorSetup(MINIMAL, system, (weighed,))) as simulator:
        errors = simulator.at(0, WET).errors
    spans = weighed.restarted
    # Of some 150 blocks, the standard deviation of a mean square is an eighth; the noise itself is
    # estimated to a tenth. The force bends where friction is greatest, which linear weights miss.
    squares = np.square(errors[spans]).mean(axis=0)
    assert squares[:2] == pytest.approx([1.0] * 2, abs=0.45)
    assert squares[2] < 2.0
    with simulating(SimulatorSetup(MINIMAL, system, (samples,))) as simulator:
        unweighed = simulator.at(0, WET).errors
    assert np.square(unweighed[spans])[:, 0].mean() > 3.0


def diagnosed(
    everything: Path, folder: Path, scenarios: list[Scenario], seed: int, effects: Effects
) -> tuple[Diagnosis, list[dict[str, int]]]:
    for scenario in scenarios:
        record(scenario, seed, effects, folder / scenario.name)
    with ResidualModel(
        ModelSource(everything, SYSTEM, {}), read_cases([folder], SYSTEM)
    ) as simulations:
        diagnosis = conclude(Fit(simulations, EFFECTS), EFFECTS, lambda _: None)
        return diagnosis, [recording.set_aside for recording in simulations.recordings]


@pytest.mark.long
@pytest.mark.parametrize(
    ("planted", "name", "size"),
    [("adhesion_recovery", "AdhesionRecovery", 0.3), ("falling_friction", "FallingFriction", 0.3)],
)
def test_what_slip_makes_of_friction_is_named_from_three_slides(
    planted, name, size, everything, tmp_path
):
    scenarios = [SCENARIOS[slide] for slide in SLIDES]
    diagnosis, aside = diagnosed(everything, tmp_path, scenarios, 801, Effects(**{planted: size}))
    assert [cause.effect.name for cause in diagnosis.causes] == [name]
    gain = diagnosis.causes[0].parameters["gain"]
    assert gain.low <= size <= gain.high
    assert not any(samples["slide"] for samples in aside)


def test_nothing_is_found_in_slides_where_nothing_is_missing(everything, tmp_path):
    scenarios = [SCENARIOS[slide] for slide in SLIDES]
    diagnosis, aside = diagnosed(everything, tmp_path, scenarios, 802, Effects())
    assert diagnosis.verdict == "nothing"
    assert not any(samples["slide"] for samples in aside)


@pytest.mark.long
def test_a_patch_that_no_law_explains_is_left_out(everything, tmp_path):
    """Low adhesion from the sixth to the eighth second, on a rail that is said to be dry."""
    patched = replace(SCENARIOS["04_dry_160_4.2"], patch=Patch(6.0, 8.0, 0.12))
    others = [SCENARIOS[scenario] for scenario in ("03_dry_120_3.6", "05_dry_120_2.7_rev")]
    diagnosis, aside = diagnosed(everything, tmp_path, [patched, *others], 803, Effects())
    assert diagnosis.verdict == "nothing"
    assert [samples["slide"] > 0 for samples in aside] == [False, True, False]
