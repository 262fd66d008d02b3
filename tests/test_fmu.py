"""The extended-FMI pattern on the built FMU, against independent evaluations and FMPy."""

import itertools
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

from workbench.errors import FMUError, InputError
from workbench.models import fmu_cache
from workbench.models.description import MODEL_EXCHANGE, read_description
from workbench.models.fmu import FMU, CoSimulation
from workbench.models.native import (
    OK,
    co_simulation_instance,
    do_step,
    raise_on_failure,
    read,
    set_inputs,
)
from workbench.observers.fmpy_comparison import (
    LIMIT,
    NO_REFERENCE,
    OFF,
    REFUSED,
    RIGHT,
    _Problem,
    compare_with_fmpy,
)

from .hostile_fmus import rewritten

INPUTS = ["pB", "tauR", "dmuWR", "dmuDC", "correctionW", "correctionR"]


def rig_equations(x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, float]:
    """Nominal plant written out by hand: der(omegaW), der(omegaR) and Fx, in SI units."""
    omegaW, omegaR = x
    pB, tauR, dmuWR, dmuDC, correctionW, correctionR = u
    w, v = 0.70 * omegaR - 0.46 * omegaW, np.hypot(0.70 * omegaR, 0.1)
    mu = (0.15 + dmuWR) * (0.6 * np.exp(-0.6 * abs(w)) + 0.4)
    eps = np.pi * 9.68e6 * abs(w) / (4 * 80e3 * mu * v)
    Fx = 2 * 2 * 80e3 * mu / np.pi * (eps / (1 + eps**2) + np.arctan(0.4 * eps)) * np.sign(w)
    sign_W, sign_R = np.tanh(omegaW / 0.05), np.tanh(omegaR / 0.05)
    brake = 3 * (0.30 + dmuDC) * 10.86e3 * max(0.0, pB / 1e5 - 0.25) * 0.300 * sign_W
    loss_W = (25 + 0.6 * abs(omegaW) + 0.004 * omegaW**2) * sign_W
    loss_R = (40 + 1.0 * abs(omegaR) + 0.02 * omegaR**2) * sign_R
    rates = [
        (0.46 * Fx - brake - loss_W) / 110 + correctionW,
        (tauR - 0.70 * Fx - loss_R) / 1500 + correctionR,
    ]
    return np.array(rates), Fx


points = st.tuples(
    st.tuples(st.floats(-100, 100), st.floats(-65, 65)),
    st.tuples(
        st.floats(0, 5e5),
        st.floats(-2e4, 2e4),
        st.floats(-0.1, 0.25),
        st.floats(-0.2, 0.15),
        st.floats(-5, 5),
        st.floats(-5, 5),
    ),
)


@settings(max_examples=100, deadline=None)
@given(points)
def test_derivatives_equal_an_independent_evaluation(minimal_path, point):
    x, u = map(np.array, point)
    with FMU(minimal_path) as fmu:
        fmu.start({})
        fmu.set(fmu.variables(INPUTS), u)
        fmu.set_states(x)
        rates = fmu.derivatives()
        (force,) = fmu.get(fmu.variables(["Fx"]))
    expected, expected_force = rig_equations(x, u)
    # Rounding of the slip (1e-14 m/s) times the steepest force (1.4e8 N/(m/s)), over JW/rW.
    assert_allclose(rates, expected, rtol=1e-9, atol=1e-7)
    assert_allclose(force, expected_force, rtol=1e-9, atol=1e-5)


@pytest.mark.parametrize("omegaR", [1.0, 20.0, 63.0, -40.0])
def test_jacobians_equal_differences(minimal, omegaR):
    minimal.start({})
    inputs, outputs = (
        minimal.variables(INPUTS),
        minimal.variables(["omegaW", "omegaR", "Fx", "slip"]),
    )
    u = np.array([2.7e5, 5e3, 0.1, -0.05, 0.0, 0.0])
    x = np.array([(0.70 * omegaR - np.sign(omegaR) * 0.02) / 0.46, omegaR])
    minimal.set(inputs, u)
    minimal.set_states(x)
    exact = minimal.linearise(inputs, outputs)
    minimal.has_directional_derivatives = False
    differences = minimal.linearise(inputs, outputs)
    for name in "ABCD":
        a, b = getattr(exact, name), getattr(differences, name)
        # Central differences: truncation and rounding are of order eps^(2/3) = 4e-11, times the
        # curvature of the slip law at 1 m/s.
        assert_allclose(a, b, rtol=2e-5, atol=2e-5 * np.abs(a).max())
    assert np.abs(exact.A).max() > 1.0


def brake_input(t: np.ndarray | float) -> np.ndarray | float:
    """Pressure of a stop [Pa]: a smooth rise to 2 bar from 0.5 s on."""
    return 2e5 * (1 - np.exp(-np.maximum(0.0, np.asarray(t) - 0.5)))


@pytest.fixture(scope="module")
def held_pressure_stop(minimal_path) -> tuple[np.ndarray, np.ndarray]:
    """Reference trajectory: Radau at 1e-10 on the FMU's derivatives, inputs held per 10 ms."""
    times = np.arange(0.0, 4.0, 0.01)
    states = [np.array([80.0, 80.0 * 0.46 / 0.70])]
    with FMU(minimal_path) as fmu:
        fmu.start({})
        pressure = fmu.variables(["pB"])

        def rates(t: float, x: np.ndarray) -> np.ndarray:
            fmu.set_states(x)
            return fmu.derivatives()

        for begin, end in itertools.pairwise(times):
            fmu.set(pressure, np.array([brake_input(begin)]))
            solution = solve_ivp(
                rates, (begin, end), states[-1], method="Radau", rtol=1e-10, atol=1e-10
            )
            states.append(solution.y[:, -1])
    return times, np.array(states)


def test_co_simulation_equals_model_exchange(minimal_path, held_pressure_stop):
    times, states = held_pressure_stop
    signal = np.array(
        [(t, p) for t, p in zip(times, brake_input(times), strict=True)],
        dtype=[("time", float), ("pB", float)],
    )
    result = fmpy.simulate_fmu(
        str(minimal_path),
        fmi_type="CoSimulation",
        start_time=0.0,
        stop_time=float(times[-1]),
        output_interval=0.01,
        relative_tolerance=1e-8,
        start_values={"omegaW": states[0, 0], "omegaR": states[0, 1]},
        input=signal,
        output=["omegaW", "omegaR"],
    )
    simulated = np.column_stack([result["omegaW"], result["omegaR"]])
    # Tolerance 1e-8 of about 80 rad/s per step, accumulated over 400 steps; FMPy holds the input
    # of the beginning of each interval, as the reference does.
    assert_allclose(simulated, states, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("version", ["fmi2", "fmi3"])
def test_compiled_loops_step_as_the_fmu_itself_does(root, version):
    path, read_ = root / "fmus" / version / "MinimalObserver.fmu", ["omegaW", "omegaR", "Fx"]
    with CoSimulation(path) as called, CoSimulation(path) as compiled:
        inputs, outputs = called.variables(["pB", "tauR"]), called.variables(read_)
        for fmu in (called, compiled):
            fmu.start({"omegaW": 60.0, "omegaR": 39.5})
        running = co_simulation_instance(compiled, inputs.names, read_)
        for k in range(100):
            values = np.array([1e5 * np.sin(0.1 * k) ** 2, 50.0 * k])
            called.set(inputs, values)
            called.step(0.005)
            running.u[:] = values
            assert set_inputs(running, 0, 2) == OK
            assert do_step(running, 0.005) == OK
            assert read(running) == OK
            assert_array_equal(running.y, called.get(outputs))
        # What the FMU refuses is a status there, and an error here.
        running.u[0] = np.nan
        with pytest.raises(FMUError, match="nan"):
            raise_on_failure(set_inputs(running, 0, 2), compiled)


def test_implicit_step_converges_with_order_one(minimal_path, held_pressure_stop):
    """Halving the step of linearly implicit Euler halves the error (Hairer and Wanner 1996)."""
    times, states = held_pressure_stop
    errors = []
    for parts in (1, 2, 4):
        with FMU(minimal_path) as fmu:
            fmu.start({"omegaW": states[0, 0], "omegaR": states[0, 1]})
            pressure = fmu.variables(["pB"])
            x = states[0]
            for begin in times[:-1]:
                fmu.set(pressure, np.array([brake_input(begin)]))
                for _ in range(parts):
                    x = fmu.step(0.01 / parts)
            errors.append(abs(x[1] - states[-1, 1]))
    # 1.8..2.2: the next term of the expansion still shows at 10 ms.
    assert 1.8 < errors[0] / errors[1] < 2.2
    assert 1.8 < errors[1] / errors[2] < 2.2
    assert errors[0] < 0.01


def test_missing_variable_is_named(minimal):
    with pytest.raises(InputError, match=r"no variable 'omegaX'.*omegaW, omegaR"):
        minimal.variables(["omegaX"])


def test_nan_is_refused_with_a_reason_and_nothing_changes(minimal):
    minimal.start({"omegaW": 60.0, "omegaR": 39.5})
    inputs = minimal.variables(["pB", "tauR"])
    before = minimal.derivatives()
    with pytest.raises(FMUError, match="nan"):
        minimal.set(inputs, np.array([np.nan, 0.0]))
    assert_array_equal(minimal.derivatives(), before)


def test_a_refusal_names_the_model_of_an_fmu_that_is_kept_not_its_file(
    minimal_path, tmp_path, monkeypatch
):
    kept = Path(shutil.copy(minimal_path, tmp_path / "0123.fmu"))
    with FMU(kept) as fmu, pytest.raises(InputError, match=re.escape(str(kept))):
        fmu.variables(["nothing"])
    monkeypatch.setattr(fmu_cache, "folder", lambda: tmp_path)
    with FMU(kept) as fmu, pytest.raises(InputError, match=f"^model {fmu.name}: found no"):
        fmu.variables(["nothing"])


# Folders of FMUs from elsewhere, such as those of docs/foreign-fmus.md, which are not ours to ship.
FOLDERS = os.environ.get("WORKBENCH_FMUS", "").split(os.pathsep)
ELSEWHERE = sorted(path for folder in FOLDERS if folder for path in Path(folder).rglob("*.fmu"))
SLAVE = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Integer, Real


class Spring(Fmi2Slave):
    def __init__(self, **options):
        super().__init__(**options)
        self.x, self.v, self.u, self.steps = 1.0, 0.0, 0.0, 0
        self.register_variable(Real("x", causality=Fmi2Causality.output))
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Integer("steps", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.v += step_size * (self.u - 4.0 * self.x)
        self.x += step_size * self.v
        self.steps += 1
        return True
"""


@pytest.mark.skipif(not ELSEWHERE, reason="WORKBENCH_FMUS names no folder of FMUs")
@pytest.mark.parametrize("path", ELSEWHERE, ids=lambda path: path.name)
def test_an_fmu_from_elsewhere_is_right_or_refused_in_words(path):
    comparison = compare_with_fmpy(path)
    assert comparison.verdict in (RIGHT, REFUSED, NO_REFERENCE), comparison
    if comparison.verdict == RIGHT:
        assert comparison.difference <= LIMIT or "is FMPy's own" in comparison.reason
    else:
        assert (
            "expected" in comparison.reason
            or path.name in comparison.reason
            or "FMPy" in (comparison.reason)
        )


def test_a_force_of_slip_is_compared_as_far_as_fmpy_is_sure_of_it(root, monkeypatch):
    """It is a small difference of two speeds: at 1e-8 CVode makes half of it, at 1e-12 little."""
    path, by_workbench = root / "fmus" / "fmi2" / "MinimalObserver.fmu", _Problem.by_workbench
    comparison = compare_with_fmpy(path)
    assert comparison.verdict == RIGHT
    assert comparison.signal.startswith("Fx")
    assert LIMIT < comparison.difference < 1e-3
    assert "is FMPy's own" in comparison.reason
    # By ten times what FMPy is sure of.
    monkeypatch.setattr(_Problem, "by_workbench", lambda *given: 1.01 * by_workbench(*given))
    assert compare_with_fmpy(path).verdict == OFF


def test_co_simulation_in_python_runs_as_in_fmpy(tmp_path):
    pytest.importorskip("pythonfmu", reason="builds the FMU")
    (tmp_path / "spring.py").write_text(SLAVE)
    build = ["-m", "pythonfmu", "build", "-f", "spring.py", "-d", "."]
    subprocess.run([sys.executable, *build], cwd=tmp_path, check=True, capture_output=True)
    path = tmp_path / "Spring.fmu"
    assert MODEL_EXCHANGE not in read_description(path).interfaces
    assert compare_with_fmpy(path).verdict == RIGHT


def test_another_name_of_an_input_is_read_and_not_set(root, tmp_path):
    """FMI 3.0 declares it beside the first one, as Dymola does for inputs of parts."""

    def change(folder: Path) -> None:
        file = folder / "modelDescription.xml"
        entry = r'(<Float64 name="pB"[^>]*?)/>'
        alias = r'\1><Alias name="cylinder.p" description="Pressure"/></Float64>'
        file.write_text(re.sub(entry, alias, file.read_text()))

    original = root / "fmus/fmi3/MinimalObserver.fmu"
    read = read_description(rewritten(original, tmp_path / "aliased.fmu", change))
    assert read.names("input") == read_description(original).names("input")
    (alias,) = [variable for variable in read.variables if variable.name == "cylinder.p"]
    assert (alias.causality, alias.unit, alias.text) == ("local", "Pa", "Pressure")
