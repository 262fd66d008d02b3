"""The step of estimators: of its order, damped as it must be, as accurate as sensors need."""

import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.stats import chi2

from workbench import case_from_frame
from workbench.arrays import Matrix, Vector
from workbench.models.fmu import FMU
from workbench.models.native import instance
from workbench.models.simulation import Drive, Simulation
from workbench.observers import estimators_of
from workbench.observers.estimators import step as method
from workbench.observers.estimators.step import advance, model_step, restart
from workbench.observers.layout import layout
from workbench.observers.replay import replay
from workbench.recordings.case import Case
from workbench.system.registry import load_system, open_model
from workbench.system.system import System

from .built import MACHINES
from .exported import run_fmu, run_python, write_fmu
from .test_export_laws import assert_same

pytest.importorskip("rumoca", reason="needs the extra [compiler]")
pytest.importorskip("ziglang", reason="needs the extra [compiler]")

H, NOISE, OMEGA = 0.01, 1e-3, np.sqrt(10.0)


@pytest.fixture(scope="module")
def spring(tmp_path_factory):
    folder = tmp_path_factory.mktemp("swing")
    for path in (MACHINES / "motions").iterdir():
        shutil.copy(path, folder)
    return load_system(folder)


@pytest.fixture(scope="module")
def fmu(spring):
    with open_model(spring) as model:
        yield model


def swing() -> tuple[Vector, Vector, Vector]:
    """Time, force, held between samples, and positions of 20 s of the undamped mass, exactly."""
    time = H * np.arange(2001)
    force = np.sign(np.sin(0.7 * time))
    places, s, v = [], 1.0, 0.0
    for F in force:
        places.append(s)
        steady = 1.0 + F / 10.0
        a, b = s - steady, v / OMEGA
        c, d = np.cos(OMEGA * H), np.sin(OMEGA * H)
        s, v = steady + a * c + b * d, OMEGA * (b * c - a * d)
    return time, force, np.array(places)


def recorded(system: System, noise: float) -> Case:
    time, force, places = swing()
    scatter = noise * np.random.default_rng(3).standard_normal(time.size)
    scatter[0] = 0.0
    table = {"time [s]": time, "F [N]": force, "s [m]": places + scatter}
    return case_from_frame(system, pd.DataFrame(table))


def test_a_linear_model_takes_a_step_of_order_three_that_forgets_what_is_stiff():
    def R(z: complex) -> complex:
        W = 1.0 / (1.0 - method._G * z)
        return W + (W - 1.0) * (method._C + method._D * W) * W

    errors = [abs(R(z) - np.exp(z)) for z in (0.02j, 0.01j)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.05)  # of a step: order + 1
    assert abs(R(-1e9)) < 1e-8
    assert max(abs(R(1j * y)) for y in np.linspace(0.0, 1e3, 20001)) <= 1.0 + 1e-12


@pytest.mark.parametrize("off", [0.0, 3.0])
def test_a_swing_does_not_fade_without_feedback(off, spring, fmu):
    """Where what is measured is far off, too, as by the zero of a sensor from the second sample."""
    cls, case = estimators_of(spring)["open_loop"], recorded(spring, 0.0)
    case = replace(case, signals={**case.signals, "s": case["s"] + off * (case.time > 0.0)})
    run = replay(case, cls.untuned(fmu, spring))
    # 1e-4 of the range after 20 s, what is asked of an integrator with a tolerance of 1e-8.
    places = swing()[2]
    assert_allclose(run.signal("s"), places, rtol=0.0, atol=1e-4 * np.ptp(places))


def test_an_output_is_read_at_the_inputs_of_its_sample(spring, fmu):
    """An evaluation within a step is at inputs between."""
    straight = replace(spring, inputs=(replace(spring.inputs[0], held=False),), reported={"R": "N"})
    cls, time = estimators_of(spring)["open_loop"], H * np.arange(400)
    force = np.sin(7.0 * time)
    estimator = cls.untuned(fmu, straight)
    values = np.asarray(estimator.run(time, force[:, None], np.full((400, 1), np.nan)).values)
    assert estimator.steps[0].accurate[0] == 1.0
    place, acts = (values[:, list(straight.columns).index(name)] for name in ("s", "R"))
    assert_allclose(acts, force - 10.0 * (place - 1.0), rtol=0.0, atol=1e-12)


def test_a_step_of_a_linear_model_ends_at_the_rate_that_the_next_one_begins_with(spring, fmu):
    """Its error is the same with and without an evaluation there."""
    case, cls, errors = recorded(spring, 0.0), estimators_of(spring)["open_loop"], []
    estimator = cls.untuned(fmu, spring)
    steps = np.diff(case.time, prepend=case.time[0])
    for evaluated in (False, True):
        estimator.start(case.u[0], case.y[0])
        for k in range(10):
            estimator.advance(steps[k : k + 1], case.u[k : k + 1], case.y[k : k + 1])
            if evaluated:
                estimator._state.ended[:] = np.nan  # no inputs that a step begins at
        errors.append(estimator._state.error.copy())
    assert_allclose(errors[0], errors[1], rtol=1e-9)
    assert np.abs(errors[0]).min() > 0.0


def test_a_whole_simulation_errs_by_no_more_than_the_tolerance_of_its_steps(spring, fmu):
    time, force, places = swing()
    simulated = Simulation(fmu, ["F"], ["s"], [1.0]).run(Drive(time, force[:, None]), {})
    # 1e-8 of the state and its nominal value a step, which an undamped mass keeps.
    assert_allclose(simulated[:, 0], places, rtol=0.0, atol=time.size * 1e-8 * (1.0 + 2.0))


def test_a_whole_simulation_takes_parts_where_samples_are_far_apart(spring, fmu):
    """Four samples in a period: a step from one to the next errs by some 1e-3 of the swing."""
    time = 0.5 * np.arange(41.0)
    drive = Drive(time, np.zeros((time.size, 1)))
    simulated = Simulation(fmu, ["F"], ["s"], [0.0]).run(drive, {"s": 1.5})
    # At most 100 parts of 1e-8 (1 + 1.5) in each interval, by the limit of their number.
    exact = 1.0 + 0.5 * np.cos(OMEGA * time)
    assert_allclose(simulated[:, 0], exact, rtol=0.0, atol=40 * 100 * 2.5e-8)


def test_a_whole_simulation_of_a_stiff_motion_goes_on_implicitly(relaxation):
    time = 10.0 * np.arange(201)
    with open_model(relaxation) as fmu:
        drive = Drive(time, np.zeros((time.size, 1)))
        simulated = Simulation(fmu, ["F"], ["s", "w"], [0.0]).run(drive, {})
    assert_allclose(simulated, lienard(1000.0, time), rtol=0.0, atol=1e-4 * 4.0)


@pytest.mark.parametrize("name", ["ekf", "ukf", "mhe", "imm", "smoother"])
def test_filters_of_an_exact_model_err_by_less_than_a_sensor(spring, fmu, name):
    run = replay(recorded(spring, NOISE), estimators_of(spring)[name].untuned(fmu, spring))
    assert np.sqrt(np.mean((run.signal("s") - swing()[2])[200:] ** 2)) < 0.5 * NOISE
    # The mean of 1800 values with one degree of freedom, of which 3 standard deviations are 0.1; a
    # filter whose states may walk, which these do not, expects a little more than there is.
    assert 0.85 < np.mean(run.nis[200:]) < 1.1


def stepped(fmu: FMU, system: System, walk: float, h: float, count: int) -> Matrix:
    """States after each of `count` steps of h [s], (count, n), of a filter with a random walk."""
    fmu.start({})
    model, n = instance(fmu, ["F"], [], []), len(fmu.states)
    work, places = model_step(fmu, np.full(n, walk), 1, n), layout(fmu, system)
    z, states = fmu.get_states(), []
    restart(work, np.zeros(2))
    work.accurate[0] = 1.0
    for k in range(count):
        work.begin[:] = [0.0, k * h]
        work.end[:] = [0.0, (k + 1) * h]
        assert advance(model, places, work, z, h, False) == 0
        states.append(z.copy())
    assert work.coarse[0] == 0.0
    return np.array(states)


@pytest.fixture(scope="module")
def relaxation(spring):
    return load_system(spring.library.parent / "relaxation.toml")


def lienard(mu: float, time: Vector) -> Matrix:
    """Both states of Van der Pol's equation by Radau at 1e-10, (n, 2)."""

    def rates(t: float, x: Vector) -> list[float]:
        return [mu * (x[0] - x[0] ** 3 / 3.0 - x[1]), x[0] / mu]

    span = 0.0, float(time[-1])
    states: Matrix = solve_ivp(rates, span, [2.0, 0.0], "Radau", time, rtol=1e-10, atol=1e-12).y.T
    return states


def test_a_step_alone_is_of_order_two_at_least(relaxation):
    end, errors = 0.5, []
    with open_model(relaxation) as fmu:
        for count in (4000, 8000):
            h = end / count
            # So large a walk allows any error: no step is taken in parts.
            states = stepped(fmu, relaxation, 1e30, h, count)
            time = h * np.arange(count + 1)
            errors.append(np.abs(states[-1] - lienard(1000.0, time)[-1]).max())
    assert np.log2(errors[0] / errors[1]) > 1.9


def test_a_stiff_relaxation_jumps_when_it_should(relaxation):
    """A step of 10 s meets jumps of microseconds, and takes them in parts."""
    time = 10.0 * np.arange(201)
    with open_model(relaxation) as fmu:
        states = stepped(fmu, relaxation, 0.0, 10.0, 200)
    # A jump in between is a matter of microseconds; samples lie beside it.
    assert_allclose(states, lienard(1000.0, time)[1:], rtol=0.0, atol=1e-4 * 4.0)


def test_reactions_of_robertson_go_as_they_should(spring):
    system = load_system(spring.library.parent / "robertson.toml")

    def rates(t: float, x: Vector) -> list[float]:
        there, back = 0.04 * x[0], 1e4 * x[1] * x[2]
        return [back - there, there - back - 3e7 * x[1] ** 2, 3e7 * x[1] ** 2]

    time = 0.4 * np.arange(101)
    exact = solve_ivp(rates, (0.0, 40.0), [1.0, 0.0, 0.0], "Radau", time, rtol=1e-10, atol=1e-14)
    with open_model(system) as fmu:
        states = stepped(fmu, system, 0.0, 0.4, 100)
    # 1e-4 of the largest size of each, the second of which is 4e-5.
    assert (np.abs(states - exact.y.T[1:]) < 1e-4 * np.abs(exact.y.T).max(axis=0)).all()


@pytest.mark.parametrize("name", ["ekf", "ukf"])
def test_innovations_of_an_exact_swing_pass_chi_squared(spring, fmu, name):
    """A hundred swings whose start, states and mass scatter by as much as the filter is told."""
    estimator = estimators_of(spring)[name].untuned(fmu, spring)
    walk, spread = estimator._settings.walk, estimator._settings.spread
    time, runs, places = H * np.arange(1001), 100, []
    rng = np.random.default_rng(1)
    states = np.array([1.0, 0.0, 0.0])[:, None] + spread[:, None] * rng.standard_normal((3, runs))
    for _ in time:
        places.append(states[0])
        states = states + np.sqrt(H) * walk[:, None] * rng.standard_normal((3, runs))
        a, v, omega = states[0] - 1.0, states[1], np.sqrt(10.0 / (1.0 + states[2]))
        c, d = np.cos(omega * H), np.sin(omega * H)
        states = np.array([1.0 + a * c + v / omega * d, v * c - omega * a * d, states[2]])
    y = np.array(places) + NOISE * rng.standard_normal((time.size, runs))
    u = np.zeros((time.size, 1))
    squares = [np.nansum(estimator.run(time, u, y[:, [k]]).nis[1:]) for k in range(runs)]
    low, high = chi2.interval(0.95, time.size - 1)
    count = np.count_nonzero((low < np.array(squares)) & (np.array(squares) < high))
    # Of a hundred runs that pass with 95 % each, fewer than 89 do so once in a hundred times.
    assert count >= 89


def test_a_slow_motion_keeps_the_step_of_first_order(spring, fmu):
    """At rest there is nothing that a step of first order damps: results stay what they were."""
    time = H * np.arange(400)
    places = 1.0 + NOISE * np.random.default_rng(4).standard_normal(time.size)
    places[0] = 1.0
    table = {"time [s]": time, "F [N]": 0.0 * time, "s [m]": places}
    case = case_from_frame(spring, pd.DataFrame(table))
    for name in ("open_loop", "ekf", "ukf"):
        estimator = estimators_of(spring)[name].untuned(fmu, spring)
        replay(case, estimator)
        assert [step.accurate[0] for step in estimator.steps] == [0.0]


@pytest.mark.parametrize("name", ["ekf", "ukf", "mhe"])
def test_samples_one_by_one_and_exported_filters_take_the_same_steps(spring, fmu, tmp_path, name):
    case = recorded(spring, NOISE).part(slice(0, 600))
    estimator = estimators_of(spring)[name].untuned(fmu, spring)
    rows = [estimator.init(case.time[0], case.u[0], case.y[0])]
    for k in range(1, case.time.size):
        rows.append(estimator.step(case.time[k], case.u[k], case.y[k]))
    assert estimator.steps[0].accurate[0] == 1.0
    expected = run_python(estimator, case.time, case.u, case.y)
    assert_allclose([row.values for row in rows], expected[:, : rows[0].values.size], rtol=1e-12)
    path = write_fmu(tmp_path / "estimator.fmu", estimator)
    assert_same(run_fmu(path, case.time, case.u, case.y), expected)
