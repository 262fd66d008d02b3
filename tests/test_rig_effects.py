"""The effects that the virtual rig plants, against closed forms and balances."""

import dataclasses
import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from workbench.machines.wheelset.rig import (
    CONSTANT_PADS,
    SCENARIOS,
    Effects,
    StopTruth,
    plant,
    simulate,
    write_recording,
)
from workbench.machines.wheelset.rig.brake import Brake, Valve
from workbench.machines.wheelset.rig.pads import Pads
from workbench.machines.wheelset.rig.run import MODE
from workbench.machines.wheelset.rig.wheel import OutOfRoundWheel
from workbench.models.fmu import FMU

from .scenarios import (
    BRAKE_RADIUS,
    REFERENCE,
    ROLLER_RADIUS,
    SEED,
    WHEEL_RADIUS,
    normal_force,
    short,
)

ROOT = Path(__file__).parents[1]
TRAIN, WHEELSET_INERTIA = 16000.0, 110.0  # kg, kg.m2, data sheet


@cache
def make(
    *planted: str, name: str = "03_dry_120_3.6", speed: float = 40.0, direction: int = 1
) -> StopTruth:
    """A stop of ten seconds on constant pads, unless said otherwise."""
    effects = plant(CONSTANT_PADS, planted)
    return simulate(short(name, speed, direction=direction), SEED, effects, REFERENCE)


def coasting(stop: StopTruth) -> np.ndarray:
    return (stop.time > 0.5) & (stop.time < stop.drawn.coasting)


def friction(stop: StopTruth, disc: int) -> np.ndarray:
    """Pad friction over that of constant pads."""
    return stop.truth[f"muDC{disc}"] / (0.30 * stop.drawn.muDC)


def friction_energy(stop: StopTruth, disc: int) -> np.ndarray:
    """Of one disc up to each time [J], from the law of the data sheet."""
    force = stop.truth[f"muDC{disc}"] * normal_force(stop)
    return np.cumsum(force * BRAKE_RADIUS * abs(stop.truth["omegaW"])) * 1e-3


def waves(signal: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Amplitudes of cosine and sine of an angle in a signal that drifts."""
    drift = np.linspace(-1.0, 1.0, signal.size)
    columns = [np.cos(angle), np.sin(angle), drift**0, drift, drift**2]
    return np.linalg.lstsq(np.column_stack(columns), signal)[0][:2]


# --- what planting leaves alone ---


def test_effects_that_vanish_change_no_byte(tmp_path):
    """All at once; beside 1, a gain of 1e-300 is lost in rounding, and no branch is skipped."""
    names = [field.name for field in dataclasses.fields(Effects)]
    # A limit of 1e-300 N is not one that vanishes, and the truth tells of a film of any size.
    apart = ("fx_limit", "water_film", "single_disc_film")
    vanishing = [f"{name}=1e-300" for name in names if name not in apart]
    folders = []
    for planted in ((), tuple(vanishing)):
        folder = tmp_path / str(len(planted))
        write_recording(make(*planted), plant(CONSTANT_PADS, planted), 200, folder)
        folders.append(folder)
    for file in ("measured.csv", "truth.csv", "case.toml"):
        assert (folders[0] / file).read_bytes() == (folders[1] / file).read_bytes()


def test_constant_pads_have_the_nominal_friction():
    stop = make()
    assert np.array_equal(stop.truth["muDC2"], np.full(stop.time.size, 0.30 * stop.drawn.muDC))


def test_phases_differ_from_stop_to_stop_and_effect_to_effect():
    stops = [make(), make(speed=20.0), make(name="02_dry_100_2.7", speed=20.0)]
    stops.append(simulate(short("03_dry_120_3.6", 20.0), SEED + 1, CONSTANT_PADS, REFERENCE))
    phases = [dataclasses.astuple(stop.phases) for stop in stops]
    assert phases[0] == phases[1]  # of one scenario and one seed
    values = np.concatenate(phases[1:])
    assert np.unique(values).size == 9
    assert (abs(values) <= np.pi).all()


def test_phase_is_told_where_its_effect_is_planted(tmp_path):
    stop = make()
    write_recording(stop, plant(CONSTANT_PADS, ["pole_ring=0.002"]), 200, tmp_path)
    made = json.loads((tmp_path / "truth.json").read_text())
    phases = {"pole_ring_phase": stop.phases.pole_ring}
    assert made["drawn"] == dataclasses.asdict(stop.drawn) | phases


@pytest.mark.parametrize(
    ("effect", "gain"),
    [
        ("speed_friction", 0.1),
        ("fade", 3e-4),
        ("pressure_exponent", 0.03),
        ("bedding_in", 0.08),
        ("cylinder_lag", 0.03),
        ("return_spring", 7e3),
        ("wheel_radius", -0.0015),
        ("wheel_load", 0.1),
        ("wheelset_losses", 1.0),
        ("roller_losses", 1.0),
        ("wheel_inertia", 0.3),
        ("roller_inertia", 0.015),
        ("structure", 0.25),
    ],
)
def test_effect_of_the_plant_changes_the_stop_itself(effect, gain):
    nominal, planted = make(), make(f"{effect}={gain}")
    assert planted.drawn == nominal.drawn
    n = int(np.searchsorted(nominal.time, nominal.drawn.coasting + 3.0))
    # The simulation repeats to the bit, so any difference is the effect's.
    assert not np.array_equal(planted.truth["slip"][:n], nominal.truth["slip"][:n])


# --- a data sheet that is wrong ---


@pytest.mark.parametrize("gain", [0.25, -0.25])
def test_longitudinal_mode_moves_and_is_damped_as_before(gain):
    """Eigenvalues at 30 m/s: of what moves, the mode of the sheet, 21.6 Hz, with 5 %."""
    modes = []
    for change in (0.0, gain):
        with FMU(REFERENCE) as fmu:
            changed = {name: fmu.defaults[name] * (1.0 + change) ** n for name, n in MODE.items()}
            fmu.start({**changed, "omegaW": 30.0 / WHEEL_RADIUS, "omegaR": 30.0 / ROLLER_RADIUS})
            values = np.linalg.eigvals(fmu.state_jacobian())
        frequencies = abs(values) / (2.0 * np.pi)
        modes.append(values[np.argmin(abs(frequencies - 21.6 * (1.0 + change)))])
    # Bodies that it moves have other springs too: half a percent of frequency, a tenth of damping.
    assert abs(modes[1]) / abs(modes[0]) == pytest.approx(1.0 + gain, rel=0.005)
    damping = [-mode.real / abs(mode) for mode in modes]
    assert damping[1] == pytest.approx(damping[0], rel=0.1)
    assert damping[0] == pytest.approx(0.05, abs=0.01)


def test_tolerances_scatter_in_proportion():
    usual = dataclasses.asdict(make(speed=20.0).drawn)
    wide = dataclasses.asdict(make("tolerances=1", speed=20.0).drawn)
    assert wide.pop("coasting") == usual.pop("coasting")
    for name, value in usual.items():
        assert wide[name] - 1.0 == pytest.approx(2.0 * (value - 1.0), rel=1e-9), name


# --- brake ---


@pytest.mark.parametrize(
    ("effect", "discs"), [("water_film", (1, 2, 3)), ("single_disc_film", (2,))]
)
def test_planted_film_leaves_with_the_energy_of_its_disc(effect, discs):
    stop = make(f"{effect}=0.3")
    for disc in (1, 2, 3):
        energy = friction_energy(stop, disc)
        film = np.exp(-energy / 0.45e6) if disc in discs else 0.0
        # The model's pads move with the frame, this calculation's do not: some 1e-3 of the energy.
        # A wet disc has 0.12 of 0.30.
        assert friction(stop, disc) == pytest.approx(1.0 - 0.3 * 0.6 * film, abs=1e-3)
        assert energy[-1] > 0.2e6  # enough to tell energy from none


def pads_of(planted: str, *discs: str) -> Pads:
    """Pads of constant friction but for what is planted, before a stop."""
    conditions = dataclasses.replace(SCENARIOS["03_dry_120_3.6"].conditions, discs=discs)
    return Pads(plant(CONSTANT_PADS, [planted]), conditions, 1.0, 0.0, 1e-3)


def test_a_wet_disc_is_no_wetter_for_a_planted_film():
    pads = pads_of("water_film=0.2", "wet", "dry", "wet")
    expected = [0.12, 0.8 * 0.30 + 0.2 * 0.12, 0.12]
    assert pads.friction(10.0, 35e3, 0.0) == pytest.approx(expected, rel=1e-12)


def test_disc_thickness_modulates_friction_with_the_angle_of_the_wheel():
    stop = make("disc_thickness=0.02")
    # Inputs are held for 1 ms: they are those of its middle.
    angle = stop.truth["phiW"] + 0.5e-3 * stop.truth["omegaW"] + stop.phases.disc_thickness
    for disc in (1, 2, 3):
        assert friction(stop, disc) == pytest.approx(1.0 + 0.02 * np.cos(angle), abs=1e-12)
    # None without pressure.
    n = int(np.searchsorted(stop.time, stop.drawn.coasting))
    assert np.array_equal(stop.truth["Fx"][:n], make().truth["Fx"][:n])


def test_calipers_give_less_force_while_pressure_rises():
    """Torque of the brake from the wheelset's balance, held at full pressure."""
    stop = make("caliper_hysteresis=0.05", speed=80.0)
    t = stop.time - stop.drawn.coasting
    held = (t > 6.0) & (t < 9.0)
    omega, force = stop.truth["omegaW"], stop.truth["Fx"]
    inertia = WHEELSET_INERTIA * stop.drawn.JW
    loss = 25.0 + 0.6 * omega + 0.004 * omega**2
    torque = WHEEL_RADIUS * force - loss - inertia * np.gradient(omega, 1e-3)
    ideal = 3.0 * BRAKE_RADIUS * stop.truth["muDC1"] * normal_force(stop)
    # The balance is exact; what the frame still moves averages out.
    assert (torque[held] / ideal[held]).mean() == pytest.approx(0.95, abs=2e-4)


def test_calipers_change_side_over_the_play_and_keep_it_in_hold():
    brake = Brake(pad_lag=0.0, hysteresis=0.05, dt=1e-3)
    seen: dict[str, list[float]] = {"rise": [], "hold": [], "fall": []}
    pressure = []
    for valve, phase in ((Valve.FILL, "rise"), (Valve.HOLD, "hold"), (Valve.VENT, "fall")):
        for _ in range(500):
            brake.step(3.6e5, valve)
            seen[phase].append(brake.efficiency)
            pressure.append(brake.pads)
    # From one side to the other over 0.2 bar, then no further.
    expected = 1.05 - 0.10 * np.minimum(1.0, np.array(pressure[:500]) / 20e3)
    assert seen["rise"] == pytest.approx(expected, abs=1e-12)
    assert set(seen["hold"]) == {seen["rise"][-1]} == {0.95}
    fallen = pressure[999] - np.array(pressure[1000:])
    expected = 0.95 + 0.10 * np.minimum(1.0, fallen / 20e3)
    assert seen["fall"] == pytest.approx(expected, abs=1e-12)
    assert fallen[0] < 2e3


# --- contact and wheel ---


def test_out_of_round_wheel_turns_slower_where_its_radius_is_larger():
    stop = make("out_of_round=2e-4")
    t = coasting(stop)
    ratio = stop.truth["omegaW"][t] / stop.truth["omegaR"][t]
    cosine, sine = waves(ratio / ratio.mean(), stop.truth["phiW"][t] + stop.phases.out_of_round)
    # The rim follows the roller to the slip that the ripple of the force needs: 1 % at 11 m/s.
    assert cosine == pytest.approx(-2e-4 / WHEEL_RADIUS, rel=0.01)
    assert abs(sine) < 0.02 * abs(cosine)


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("speed", [20.0, 40.0, 80.0])
def test_force_of_an_out_of_round_wheel_grows_with_the_square_of_speed(speed, direction):
    """F = m*v^2*amplitude/rW^2, m of wheelset and train in series at the rim."""
    stop = make("out_of_round=2e-4", speed=speed, direction=direction)
    t = coasting(stop)
    angle = stop.truth["phiW"][t] + stop.phases.out_of_round
    wheelset = WHEELSET_INERTIA * stop.drawn.JW / WHEEL_RADIUS**2
    mass = 1.0 / (1.0 / wheelset + 1.0 / TRAIN)
    ripple = mass * (speed / 3.6) ** 2 * 2e-4 / WHEEL_RADIUS**2
    cosine, sine = waves(stop.truth["Fx"][t], angle)
    # The drive lends the train's mass with a lag of 8 ms, the slip follows by 2 ms at 22 m/s.
    assert sine == pytest.approx(ripple, rel=0.02)
    assert abs(cosine) < 0.1 * ripple


@pytest.mark.parametrize("omega", [40.0, -40.0])
@pytest.mark.parametrize("phi", [0.0, 0.7, 2.0, 4.0])
def test_wheel_out_of_round_balances_its_momentum(omega, phi):
    """J*d(omega)/dt = r*Fx - brake for the true wheel, while the model's has r = rW."""
    wheel = OutOfRoundWheel(1e-5, 0.3, WHEEL_RADIUS, WHEELSET_INERTIA)
    force, brake, dt = 20e3, 9e3, 1e-6
    lever = WHEEL_RADIUS + 1e-5 * np.cos(phi + 0.3)
    torque = WHEEL_RADIUS * force - brake + wheel.torque(omega, phi, force)
    later = wheel.speed(omega + torque / WHEELSET_INERTIA * dt, phi + omega * dt)
    rate = (later - wheel.speed(omega, phi)) / dt
    effect = WHEELSET_INERTIA * rate - (WHEEL_RADIUS * force - brake)
    # What the brake leaves of the force, 200 N.m, times amplitude over radius: 4e-3 N.m.
    assert effect == pytest.approx((lever - WHEEL_RADIUS) * force, abs=0.01)


def test_braked_wheel_out_of_round_keeps_its_mean_speed_and_time_of_stopping():
    round_wheel, bumpy = make(), make("out_of_round=2e-4")
    # Terms of second order, (2e-4/0.46)^2 of the speed, are all that could shift it.
    assert bumpy.standstill == pytest.approx(round_wheel.standstill, abs=2e-3)


def test_roller_radius_shows_as_the_ratio_of_speeds_in_coasting():
    stop = make("roller_radius=0.001")
    t = coasting(stop)
    assert stop.truth["slip"][0] == pytest.approx(0.0, abs=1e-12)  # both start at one speed
    # The drag of 190 N takes 1.4e-5 of slip.
    ratio = stop.truth["omegaW"][t] / stop.truth["omegaR"][t]
    assert ratio == pytest.approx(0.701 / WHEEL_RADIUS, rel=3e-5)


def test_wheel_radius_shows_as_the_ratio_of_speeds_in_coasting():
    stop = make("wheel_radius=-0.0015")
    t = coasting(stop)
    ratio = stop.truth["omegaW"][t] / stop.truth["omegaR"][t]
    assert ratio == pytest.approx(ROLLER_RADIUS / 0.4585, rel=3e-5)


def test_slip_of_a_dry_stop_goes_with_the_inverse_of_creep_stiffness():
    stiff, soft = (make(*e, name="01_dry_80_1.5") for e in ((), ("creep_stiffness=-0.2",)))
    held = slice(*np.searchsorted(stiff.time, stiff.drawn.coasting + np.array([5.0, 10.0])))
    more = soft.truth["slip"][held] / stiff.truth["slip"][held]
    # Polach's force is one of stiffness times slip; friction falls by 0.4 % more.
    assert more == pytest.approx(1.0 / 0.8, rel=5e-3)


def test_adhesion_recovers_with_the_energy_of_slip_at_each_wheel():
    stop = make("adhesion_recovery=0.5", name="15_locked_wheel")
    power = 0.5 * abs(stop.truth["Fx"] * stop.truth["slip"])
    energy = np.concatenate([[0.0], np.cumsum(power[:-1]) * 1e-3])
    usual = 0.12 * stop.drawn.muWR
    expected = usual * (1.0 + 0.5 * (1.0 - np.exp(-energy / 250e3)))
    assert stop.truth["muWR"] == pytest.approx(expected, rel=1e-9)
    assert stop.truth["muWR"][-1] > 1.3 * usual  # more than one 250 kJ


def test_twice_the_roller_loss_is_what_the_drive_does_not_give_back():
    """The drive knows the nominal losses: the other half slows the train."""
    stop = make("roller_losses=1", speed=160.0)
    t = coasting(stop)
    omega, time = stop.truth["omegaR"][t], stop.time[t]
    deceleration = -(omega[-1] - omega[0]) / (time[-1] - time[0])
    mean = omega.mean()
    loss = 40.0 + mean + 0.02 * mean**2
    drag = ROLLER_RADIUS * stop.truth["Fx"][t].mean()
    # JR's tolerance is 1e-3 of the train; the ripple of 1.6 N.m makes 5e-3 of 360 N.m.
    assert 7840.0 * deceleration == pytest.approx(loss + drag, rel=1e-2)


# --- outside the catalogue ---


def test_friction_steps_at_90_degrees_of_the_disc():
    pads = pads_of("friction_step=-0.1", "dry", "dry", "dry")
    pads.temperature = [80.0, 90.0, 100.0]
    # tanh(4) is 7e-4 short of 1, half of which is seen.
    assert pads.friction(10.0, 35e3, 0.0) == pytest.approx([0.30, 0.285, 0.27], abs=2e-5)


def test_friction_ripples_from_first_contact():
    stop = make("friction_ripple=0.05")
    since = np.maximum(0.0, stop.time - stop.time[int(np.flatnonzero(normal_force(stop) > 0.0)[0])])
    expected = 1.0 + 0.05 * np.sin(2.0 * np.pi * 0.3 * since)
    assert friction(stop, 2) == pytest.approx(expected, abs=1e-9)
