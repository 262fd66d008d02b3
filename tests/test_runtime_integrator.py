"""The integrator in the C runtime of the FMUs: its order, stability, accuracy and steps."""

import ctypes
import math
from collections.abc import Callable

import fmpy
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from .processes import needs_compiler
from .runtime_instances import (
    TIME,
    VERSIONS,
    X1,
    X2,
    Fmu,
    U,
    compile_model,
    oscillate,
)

pytestmark = needs_compiler

Step = Callable[[list[float], list[float], float, float], list[float]]


@pytest.fixture(scope="session")
def fixed_step(tmp_path_factory) -> Callable[[str], Step]:
    """Gives `step(x, p, t, h)` of a model: one step of the method without error control."""
    root = tmp_path_factory.mktemp("integrator")

    def load(model: str) -> Step:
        library = root / f"{model}{fmpy.sharedLibraryExtension}"
        compile_model(model, 2, library, visibility="default")
        integrate = ctypes.CDLL(str(library)).rosenbrock_integrate
        work = ctypes.create_string_buffer(1 << 16)

        def step(x: list[float], p: list[float], t: float, h: float) -> list[float]:
            u = (ctypes.c_double * 1)(0.0)
            x_ = (ctypes.c_double * len(x))(*x)
            p_ = (ctypes.c_double * len(p))(*p)
            time, size, tolerance = ctypes.c_double(t), ctypes.c_double(h), ctypes.c_double(1e9)
            end, where, memory = ctypes.c_double(t + h), ctypes.byref(time), ctypes.byref(size)
            assert integrate(work, u, p_, tolerance, end, where, x_, memory) == 0
            assert time.value == t + h
            return list(x_)

        return step

    return load


@pytest.mark.parametrize(
    ("model", "p"), [("van_der_pol", [1.0]), ("prothero_robinson", [1.0, 2.0])]
)
def test_method_has_order_four(fixed_step, model, p):
    """A nonlinear model and one with explicit time: the error falls by 2^4 as the step halves."""
    step = fixed_step(model)
    x_0 = {"van_der_pol": [2.0, -0.66], "prothero_robinson": [1.0]}[model]
    if model == "van_der_pol":

        def f(t, x):
            return [x[1], (1.0 - x[0] ** 2) * x[1] - x[0]]

        exact = solve_ivp(f, (0.0, 2.0), x_0, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    else:
        exact = np.array([math.cos(4.0)])
    errors = []
    for n in (40, 80, 160):
        x = x_0
        for k in range(n):
            x = step(x, p, 2.0 * k / n, 2.0 / n)
        errors.append(np.max(np.abs(x - exact)))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert_allclose(orders, 4.0, atol=0.3)  # terms of order 5 at these steps; order 3 gives 3.0


def test_one_large_step_kills_a_stiff_transient(fixed_step):
    """L-stability: x' = -lambda*(x - 1) from x = 2. |R(z)| falls as 1/|z|, here z = -1e6."""
    x = fixed_step("prothero_robinson")([2.0], [1e6, 0.0], 0.0, 1.0)
    assert abs(x[0] - 1.0) < 1e-4  # 100/|z|; an A-stable method with |R(oo)| = 1 leaves 1


@VERSIONS
def test_error_falls_with_tolerance(open_fmu, version):
    """Forced oscillation, input jumps included, against the matrix exponential."""
    errors = {}
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10):
        fmu = open_fmu("oscillator", version).start(tolerance)
        x = np.array([1.0, 0.0])
        errors[tolerance] = 0.0
        for k in range(20):
            u = (-1.0) ** k
            fmu.set([U], [u])
            fmu.run(k, k + 1, 1.0)
            x = oscillate(x, u, 1.0)
            errors[tolerance] = max(errors[tolerance], np.max(np.abs(fmu.get(X1, X2) - x)))
    for tolerance, error in errors.items():
        assert error < 3.0 * tolerance  # a few local errors add up before damping forgets them
    assert errors[1e-10] < 1e-5 * errors[1e-4]  # tolerance has fallen by 1e-6


@pytest.mark.parametrize("jump", [0.001, 0.01, 0.1, 1.0])
def test_input_jump_after_rest_is_resolved(open_fmu, jump):
    """At rest the step grows to the communication step; the jump makes it shrink again."""
    fmu = open_fmu("oscillator", 2)
    fmu.set([X1, X2], [0.0, 0.0])
    fmu.start(1e-6)
    fmu.run(0.0, 10.0, 1.0)
    assert step_memory(fmu) >= 1.0
    fmu.set([U], [jump])
    fmu.fmi.doStep(10.0, 1.0)
    assert_allclose(fmu.get(X1, X2), oscillate([0.0, 0.0], jump, 1.0), atol=3e-6)  # as above


def test_dense_stiff_system_follows_the_matrix_exponential(open_fmu):
    """Eight states, time constants from 0.1 ms on; the factorisation exchanges rows."""
    i, j = np.meshgrid(range(8), range(8), indexing="ij")
    V = (i + 1) * ((i * i + 3 * i * j + 5 * j) % 13 - 6)
    fmu = open_fmu("dense", 2).start(1e-8)
    fmu.run(0.0, 1.0, 0.1)
    exact = expm(-1.0 * V @ V.T) @ np.arange(1.0, 9.0)
    assert_allclose(fmu.get(*range(8)), exact, atol=1e-6)  # local errors of some 100 steps of 1e-8


def test_default_tolerance_is_one_millionth(open_fmu):
    default, explicit = (open_fmu("oscillator", 2).start(tol) for tol in (None, 1e-6))
    for fmu in (default, explicit):
        fmu.run(0.0, 1.0, 0.1)
    assert default.get(X1, X2) == explicit.get(X1, X2)


def test_trajectory_does_not_depend_on_communication_step(open_fmu):
    """Stiff van der Pol oscillator at t = 2, two fast transitions included.

    Reference: E. Hairer's test set, solution of VDPOL with epsilon = 1e-6.
    """
    for size in (1e-4, 1e-3, 1e-2, 1e-1, 2.0):
        fmu = open_fmu("van_der_pol", 2).start(1e-6)
        fmu.run(0.0, 2.0, size)
        # The phase error of the transitions multiplies the tolerance, by less than 100.
        assert_allclose(fmu.get(0, 1), [1.706167732170483, -0.8928097010247975], rtol=1e-4)


def test_small_communication_steps_leave_the_step_size_in_memory(open_fmu):
    """After many steps of 0.1 ms a step of 100 ms takes as few evaluations as without them."""
    fmu = open_fmu("prothero_robinson", 2)
    fmu.set([2, 3], [1e6, 1.0])
    fmu.start(1e-6)
    fmu.run(0.0, 1.0, 0.1)
    large = step_memory(fmu)
    for k in range(100):
        fmu.fmi.doStep(1.0 + k * 1e-4, 1e-4)
    assert step_memory(fmu) >= large > 1e-2


def step_memory(fmu: Fmu) -> float:
    """Size of the integrator's next step: the fourth number of the saved state."""
    header = 32  # bytes: magic, token, size, checksum
    return float(np.frombuffer(fmu.serialize(fmu.save()), offset=header, count=4)[3])


@VERSIONS
def test_communication_points_are_hit_exactly(open_fmu, version):
    fmu = open_fmu("oscillator", version).start()
    fmu.run(0.0, 1.0, 0.1)
    assert fmu.get(TIME) == [0.9 + 0.1]


@VERSIONS
def test_steps_that_add_up_with_rounding_are_accepted(open_fmu, version):
    fmu = open_fmu("oscillator", version).start(stop=10.0)
    t = 0.0
    for k in range(10000):
        fmu.fmi.doStep(t if k % 2 else k * 1e-3, 1e-3)
        t += 1e-3
    assert_allclose(fmu.get(X1, X2), oscillate([1.0, 0.0], 0.0, 10.0), atol=1e-6)  # = tolerance


@VERSIONS
def test_model_without_states_steps(open_fmu, version):
    fmu = open_fmu("gain", version).start()
    fmu.set([0], [3.0])
    fmu.run(0.0, 1.0, 0.1)
    assert fmu.get(1) == [6.0]
