"""One stop on the virtual rig: the multibody model beside drive, brake and pads at 1 kHz."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.machines.wheelset.rig.brake import (
    DEAD_TIME,
    PROTECTION_PERIOD,
    Brake,
    Valve,
    WheelSlideProtection,
)
from workbench.machines.wheelset.rig.drive import Drive, Losses
from workbench.machines.wheelset.rig.effects import Effects
from workbench.machines.wheelset.rig.pads import FRICTION, Pads
from workbench.machines.wheelset.rig.scenarios import Scenario
from workbench.machines.wheelset.rig.wheel import CleanedContact, OutOfRoundWheel, falls
from workbench.models.fmu import CoSimulation

RATE = 1000  # [Hz] of the co-simulation

TRUTH = {
    "Fx": "N",
    "Fcell": "N",
    "slip": "m/s",
    "omegaW": "rad/s",
    "omegaR": "rad/s",
    "tauR": "N.m",
    "pB": "Pa",
    "pads": "Pa",
    "muWR": "1",
    **{f"muDC{i}": "1" for i in (1, 2, 3)},
    **{f"temperature{i}": "degC" for i in (1, 2, 3)},
    **{f"film{i}": "1" for i in (1, 2, 3)},
    "phiW": "rad",
}

FELT = {"Fperp": "N"}
"""Known besides, for sensors alone: the force that presses the pads of one disc."""

_OUTPUTS = ("Fx", "FcellL", "FcellR", "slip", *(f"discPower[{i}]" for i in (1, 2, 3)))
_INPUTS = (
    "pB",
    "tauR",
    "dmuWR",
    "actuation.kappa",
    "wheelsetLoss.c0",
    *(f"muDCunit[{i}]" for i in (1, 2, 3)),
)
_POLACH = {
    "dry": {"polach.kA": 1.0, "polach.kS": 0.4, "polach.A": 0.4, "polach.B": 0.6},
    "wet": {"polach.kA": 0.3, "polach.kS": 0.1, "polach.A": 0.4, "polach.B": 0.2},
}
# Springs and dampers of the longitudinal mode, in series: with these powers of its frequency, its
# shape and its share of the critical damping stay.
MODE = {
    f"{spring}[{i}].{parameter}": power
    for i in (1, 2)
    for spring, suffix in (("longitudinal", ""), ("axleBox", "[1]"))
    for parameter, power in ((f"c{suffix}", 2), (f"d{suffix}", 1))
}
_RUN_IN = 1.0  # [s] before the recording, in which the model settles under the wheelset's drag
_STANDSTILL = 0.05  # [m/s]
_REST = 2.0  # [s] recorded after standstill
_LONGEST = 300.0  # [s]


@dataclass(frozen=True)
class Drawn:
    """What differs from stop to stop, within the tolerances of the rig."""

    # JW, JR, Fz, muDC, muWR: value over nominal
    JW: float
    JR: float
    Fz: float
    muDC: float
    muWR: float
    coasting: float  # [s] from the start of the recording to the brake demand


@dataclass(frozen=True)
class Phases:
    """Where the wheel of this stop starts, [rad] by the effects that turn with it."""

    disc_thickness: float
    out_of_round: float
    pole_ring: float


@dataclass(frozen=True, eq=False)
class StopTruth:
    """The truth of one stop."""

    # scenario, seed: what was asked for
    scenario: Scenario
    seed: int
    drawn: Drawn  # deviations of this stop
    phases: Phases  # of this stop
    time: Vector  # (n,) [s] in steps of 1/RATE, negative before the recording
    truth: Mapping[str, Vector]  # (n,) each, by the names of TRUTH and FELT
    standstill: float  # [s] when wheelset and roller stood, or the recording ended
    model: str  # hash of the FMU

    def at(self, time: Vector, name: str) -> Vector:
        """Signal at other times, (m,)."""
        return np.interp(time, self.time, self.truth[name])


def simulate(scenario: Scenario, seed: int, effects: Effects, fmu_path: Path) -> StopTruth:
    """Make one stop.

    Parameters
    ----------
    seed : with the scenario's number it fixes all that is drawn, noise included.
    effects : what is planted.
    fmu_path : multibody model, a Co-Simulation FMU.

    Raises
    ------
    InputError
        If the FMU is not a model of the rig, or the wheelset does not stop in 300 s.
    """
    drawn = _draw(np.random.default_rng([seed, scenario.number, 0]), effects)
    rng = np.random.default_rng([seed, scenario.number, 6])
    phases = Phases(*rng.uniform(-np.pi, np.pi, 3).tolist())
    with CoSimulation(fmu_path) as fmu:
        rows, standstill = _brake_to_standstill(fmu, scenario, drawn, phases, effects)
        model = fmu.sha256
    time = np.arange(len(rows)) / RATE - _RUN_IN
    truth = dict(zip((*TRUTH, *FELT), np.array(rows).T.copy(), strict=True))
    return StopTruth(scenario, seed, drawn, phases, time, truth, standstill, model)


def _draw(rng: np.random.Generator, effects: Effects) -> Drawn:
    """Draw from the tolerances of the data sheet, one sigma each."""
    scatter = (1.0 + effects.tolerances) * rng.normal(0.0, [0.01, 0.002, 0.003, 0.02, 0.02])
    JW, JR, Fz, muDC, muWR = 1.0 + scatter
    coasting = round(rng.uniform(3.0, 5.0), 3)
    return Drawn(float(JW), float(JR), float(Fz), float(muDC), float(muWR), coasting)


def _parameters(
    nominal: Mapping[str, float], scenario: Scenario, drawn: Drawn, effects: Effects
) -> dict[str, float]:
    """Parameters of the FMU that are not nominal; all of them are constant during a stop."""
    changed = {
        "rW": nominal["rW"] + effects.wheel_radius,
        "rR": nominal["rR"] + effects.roller_radius,
        "JW": nominal["JW"] * drawn.JW * (1.0 + effects.wheel_inertia),
        "JR": nominal["JR"] * drawn.JR * (1.0 + effects.roller_inertia),
        "Fz": scenario.conditions.wheel_load * drawn.Fz * (1.0 + effects.wheel_load),
        "muWR": scenario.muWR * drawn.muWR,
        "muDC": FRICTION,
        "actuation.p0": nominal["actuation.p0"] + effects.return_spring,
    }
    for c in ("c0", "c1", "c2"):
        changed[f"wheelsetLoss.{c}"] = nominal[f"wheelsetLoss.{c}"] * (
            1.0 + effects.wheelset_losses
        )
        changed[f"rollerLoss.{c}"] = nominal[f"rollerLoss.{c}"] * (1.0 + effects.roller_losses)
    for name, power in MODE.items():
        changed[name] = nominal[name] * (1.0 + effects.structure) ** power
    changed |= _POLACH[scenario.conditions.wheel_rail]
    for k in ("polach.kA", "polach.kS"):
        changed[k] *= 1.0 + effects.creep_stiffness
    return changed


def _brake_to_standstill(
    fmu: CoSimulation, scenario: Scenario, drawn: Drawn, phases: Phases, effects: Effects
) -> tuple[list[tuple[float, ...]], float]:
    """Rows of the truth, and the time of standstill, or of the end [s]."""
    inputs, outputs = fmu.variables(_INPUTS), fmu.variables(_OUTPUTS)
    nominal = fmu.defaults
    parameters = _parameters(nominal, scenario, drawn, effects)
    rW, rR = parameters["rW"], parameters["rR"]
    kappa, p0 = nominal["actuation.kappa"], parameters["actuation.p0"]
    conditions, dt = scenario.conditions, 1.0 / RATE
    velocity = conditions.initial_speed * conditions.direction
    omegaW, omegaR, phiW, Fx, slip = velocity / rW, velocity / rR, 0.0, 0.0, 0.0
    states = [fmu.states.index(name) for name in ("omegaW", "omegaR", "wheelset.phi")]
    fmu.start({"omegaW": omegaW, "omegaR": omegaR}, parameters)

    losses = Losses(*(nominal[f"rollerLoss.{c}"] for c in ("c0", "c1", "c2")))
    drive = Drive(nominal["JR"], scenario.imitated, losses, omegaR, dt)
    brake = Brake(effects.cylinder_lag, effects.caliper_hysteresis, dt)
    pads = Pads(effects, conditions, drawn.muDC, phases.disc_thickness, dt)
    wheel = OutOfRoundWheel(effects.out_of_round, phases.out_of_round, rW, parameters["JW"])
    contact = CleanedContact(effects.adhesion_recovery, dt)
    protection = WheelSlideProtection(conditions.initial_speed)
    valve = Valve.FILL
    period = round(PROTECTION_PERIOD * RATE)
    rows: list[tuple[float, ...]] = []
    standstill = None
    for k in range(round((_RUN_IN + _LONGEST) * RATE)):
        t = k / RATE - _RUN_IN
        braking = t - drawn.coasting
        speed = abs(omegaW) * rW
        if standstill is None and braking > 0.0 and max(speed, abs(omegaR) * rR) < _STANDSTILL:
            standstill = t
        if standstill is None and t >= scenario.lasts:
            return rows, t
        if standstill is not None:
            if t >= standstill + _REST:
                return rows, standstill
            valve = Valve.VENT
        elif scenario.protected and k % period == 0:
            valve = protection.step(abs(omegaW) * nominal["rW"])

        brake.step(scenario.demand(braking) if braking >= DEAD_TIME else 0.0, valve)
        ratio = kappa * brake.efficiency
        force = ratio * max(0.0, brake.pads - p0)
        turn = phiW + 0.5 * dt * omegaW  # in the middle of the time for which inputs are held
        mu = pads.friction(speed, force, turn)
        tauR = drive.step(omegaR, stopped=standstill is not None)
        falling = falls(effects.falling_friction, slip)
        muWR = scenario.friction(braking) * drawn.muWR * contact.friction * falling
        # A torque on the wheelset enters the model as a change of its loss.
        push = math.copysign(1.0, omegaW) * wheel.torque(omegaW, turn, Fx)
        drag = parameters["wheelsetLoss.c0"] - push
        held = (brake.pads, tauR, muWR - parameters["muWR"], ratio, drag)
        inputs.values[:] = (*held, *(value / FRICTION for value in mu))
        fmu.set(inputs, inputs.values)
        Fx, FcellL, FcellR, slip, *powers = fmu.get(outputs).tolist()
        motion = (Fx, FcellL + FcellR, slip, omegaW, omegaR, tauR, brake.cylinder, brake.pads)
        rows.append((*motion, muWR, *mu, *pads.temperature, *pads.film, phiW, force))
        pads.heat(powers, speed, force)
        contact.rub(0.5 * abs(Fx * slip))
        rim, omegaR, phiW = fmu.step(dt)[states].tolist()
        omegaW = wheel.speed(rim, phiW)
    raise InputError(
        where=scenario.name,
        found=f"{abs(omegaR) * rR:.1f} m/s after {_LONGEST:g} s",
        expected="a brake that stops the train",
        remedy="plant smaller effects",
    )
