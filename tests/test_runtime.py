"""The C runtime by calls of both standards: what it computes and refuses, how it integrates."""

import ctypes
import itertools
import math
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from .edits import edit
from .processes import COMPILER, needs_compiler
from .runtime_instances import (
    DISCARD,
    DX1,
    DX2,
    ENERGY,
    ERROR,
    FORCE,
    HEADERS,
    TIME,
    X1,
    X2,
    D,
    Fmu,
    K,
    U,
    compile_model,
    oscillate,
)

pytestmark = needs_compiler


VERSIONS = pytest.mark.parametrize("version", [2, 3])  # last in the names of tests


@pytest.fixture(params=[2, 3])
def version(request) -> int:
    return request.param


@pytest.fixture
def fmu(open_fmu, version) -> Fmu:
    """The oscillator in Co-Simulation, initialised."""
    return open_fmu("oscillator", version).start()


@pytest.fixture
def model(open_fmu, version) -> Fmu:
    """The oscillator in Model Exchange, in continuous time."""
    model = open_fmu("oscillator", version, slave=False).start()
    model.fmi.enterContinuousTimeMode()
    return model


# --- Model Exchange and the extension -------------------------------------------------------------


def test_model_exchange_evaluates_the_equations(model, version):
    model.fmi.setTime(3.0)
    model.fmi.setContinuousStates((ctypes.c_double * 2)(2.0, 5.0), 2)
    model.set([U], [1.0])
    derivatives = (ctypes.c_double * 2)()
    read = "getDerivatives" if version == 2 else "getContinuousStateDerivatives"
    getattr(model.fmi, read)(derivatives, 2)
    assert list(derivatives) == [5.0, -8.0 - 2.5 + 1.0]
    assert model.get(X1, X2, DX1, DX2, U, K, D, FORCE, ENERGY, TIME) == (
        [2.0, 5.0, 5.0, -9.5, 1.0, 4.0, 0.5, -9.5, 20.5, 3.0]
    )
    assert model.fmi.completedIntegratorStep() == (False, False)


def test_model_without_events_needs_no_event_iteration(open_fmu, version):
    fmu = open_fmu("oscillator", version, slave=False).start()
    update = fmu.fmi.newDiscreteStates if version == 2 else fmu.fmi.updateDiscreteStates
    assert not any(update())
    fmu.fmi.enterContinuousTimeMode()
    fmu.fmi.enterEventMode()
    fmu.fmi.enterContinuousTimeMode()


def test_cached_values_follow_every_change(fmu):
    assert fmu.get(DX2, FORCE, FORCE) == [-4.0, -4.0, -4.0]
    for reference, value, force in [(U, 1.0, -3.0), (K, 5.0, -4.0), (X1, 2.0, -9.0)]:
        fmu.set([reference], [value])
        assert fmu.get(DX2, FORCE) == [force, force]
    state = fmu.save()
    fmu.fmi.doStep(0.0, 0.1)
    x1, x2, *forces = fmu.get(X1, X2, DX2, FORCE)
    assert forces == [-5.0 * x1 - 0.5 * x2 + 1.0] * 2
    fmu.restore(state)
    assert fmu.get(DX2, FORCE) == [-9.0, -9.0]


@VERSIONS
@pytest.mark.parametrize("unknowns", [[DX1, DX2], [FORCE, ENERGY], [DX1, DX2, FORCE, ENERGY]])
def test_columns_of_the_jacobian_follow_every_change(model, unknowns):

    def check(x1: float, k: float) -> None:
        column = {DX1: 0.0, DX2: -k, FORCE: -k, ENERGY: k * x1}
        derivatives = model.fmi.getDirectionalDerivative(unknowns, [X1], [1.0])
        assert derivatives == [column[unknown] for unknown in unknowns]

    check(1.0, 4.0)
    state = model.save()
    model.fmi.setContinuousStates((ctypes.c_double * 2)(3.0, 0.0), 2)
    check(3.0, 4.0)
    model.set([K], [5.0])
    check(3.0, 5.0)
    model.set([X1], [2.0])
    check(2.0, 5.0)
    model.restore(state)
    check(1.0, 4.0)


def test_reset_instance_repeats_a_new_one_with_identical_bits(open_fmu, version):
    results = []
    fmu = open_fmu("oscillator", version)
    for _ in range(2):
        fmu.start(1e-4)
        fmu.set([U, K], [1.0, 5.0])
        fmu.run(0.0, 1.0, 0.1)
        results.append(fmu.get(X1, X2, DX2, FORCE, TIME))
        fmu.fmi.reset()
    assert results[0] == results[1]


def test_states_of_a_slave_can_be_corrected_between_steps(open_fmu):
    """The extension: after a correction the instance runs on from the new state."""
    fmu = open_fmu("oscillator", 2).start()
    fmu.run(0.0, 1.0, 0.1)
    library, instance = fmu.fmi.dll, ctypes.c_void_p(fmu.fmi.component)
    x, xdot = (ctypes.c_double * 2)(3.0, -1.0), (ctypes.c_double * 2)()
    flags = [ctypes.byref(ctypes.c_int()) for _ in range(2)]
    two = ctypes.c_size_t(2)
    assert library.fmi2SetContinuousStates(instance, x, two) == 0
    assert library.fmi2GetDerivatives(instance, xdot, two) == 0
    assert library.fmi2CompletedIntegratorStep(instance, 1, *flags) == 0
    assert list(xdot) == [-1.0, -12.0 + 0.5]
    fmu.run(1.0, 2.0, 0.1)
    assert_allclose(fmu.get(X1, X2), oscillate([3.0, -1.0], 0.0, 1.0), atol=1e-6)  # = tolerance
    fmu.set([X1, X2], [1.0, 0.0])
    assert library.fmi2SetTime(instance, ctypes.c_double(7.0)) == 0
    fmu.run(7.0, 8.0, 0.1)
    assert_allclose(fmu.get(X1, X2), oscillate([1.0, 0.0], 0.0, 1.0), atol=1e-6)  # = tolerance


# --- Partial derivatives --------------------------------------------------------------------------

UNKNOWNS = [DX1, DX2, FORCE, ENERGY, X1, X2]
KNOWNS = [X1, X2, U, K, D]


def oscillator_jacobian(x1: float, x2: float, k: float = 4.0, d: float = 0.5) -> np.ndarray:
    """Rows UNKNOWNS, columns KNOWNS, by hand."""
    return np.array(
        [
            [0.0, 1.0, 0.0, 0.0, 0.0],
            [-k, -d, 1.0, -x1, -x2],
            [-k, -d, 1.0, -x1, -x2],
            [k * x1, x2, 0.0, 0.5 * x1**2, 0.0],
            [1.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0, 0.0],
        ]
    )


def test_directional_derivative_is_the_jacobian(fmu):
    fmu.set([X1, X2], [2.0, 3.0])
    J = oscillator_jacobian(2.0, 3.0)
    for seed in np.eye(5):
        column = fmu.fmi.getDirectionalDerivative(UNKNOWNS, KNOWNS, list(seed))
        assert column == list(J @ seed)  # products and sums of small integers: exact
    assert fmu.fmi.getDirectionalDerivative([DX2], [U, K], [3.0, 2.0]) == [3.0 - 4.0]


@VERSIONS
@pytest.mark.parametrize("known", [X1, X2, U, K, D])
def test_a_block_of_unknowns_gives_what_single_unknowns_give(fmu, known):
    """Unknowns that stand one after the other are treated at once; any others one by one."""
    fmu.set([X1, X2], [2.0, 3.0])
    unknowns = [X1, X2, DX1, DX2, FORCE, ENERGY]

    def derivative(asked: Sequence[int]) -> list[float]:
        return list(fmu.fmi.getDirectionalDerivative(asked, [known], [3.0]))

    expected = {unknown: derivative([unknown])[0] for unknown in unknowns}
    assert set(expected.values()) != {0.0}
    for first, last in itertools.combinations(range(7), 2):
        block = unknowns[first:last]
        assert derivative(block) == [expected[unknown] for unknown in block]
        assert derivative(block[::-1]) == [expected[unknown] for unknown in block[::-1]]
    with fmu.refuses(ERROR, "value reference 4 is no unknown"):
        derivative([DX1, DX2, U])


def test_adjoint_is_the_transpose_of_directional(open_fmu):
    fmu = open_fmu("oscillator", 3).start()
    rng = np.random.default_rng(1)
    for _ in range(20):
        fmu.set([X1, X2], list(rng.normal(size=2)))
        forward, backward = rng.normal(size=5), rng.normal(size=6)
        y = fmu.fmi.getDirectionalDerivative(UNKNOWNS, KNOWNS, list(forward))
        z = fmu.fmi.getAdjointDerivative(UNKNOWNS, KNOWNS, list(backward), 5)
        # Both are sums of at most 30 products of order one: rounding is below 1e-13.
        assert_allclose(np.dot(backward, y), np.dot(z, forward), atol=1e-13)


def test_dependencies_are_the_pattern_of_the_jacobian(open_fmu):
    fmu = open_fmu("oscillator", 3).start()
    expected = {DX1: [X2], DX2: [X1, X2, U], FORCE: [X1, X2, U], ENERGY: [X1, X2], X1: [X1]}
    for unknown, knowns in expected.items():
        instance, count = fmu.fmi.component, ctypes.c_size_t()
        fmu.fmi.fmi3GetNumberOfVariableDependencies(instance, unknown, ctypes.byref(count))
        elements, independents = (ctypes.c_size_t * 3)(9, 9, 9), (ctypes.c_uint * 3)()
        kinds = (ctypes.c_int * 3)()
        fmu.fmi.fmi3GetVariableDependencies(
            instance, unknown, elements, independents, elements, kinds, count.value
        )
        assert list(independents[: count.value]) == knowns
        assert list(elements[: count.value]) == [0] * len(knowns)
        assert list(kinds[: count.value]) == [5] * len(knowns)  # fmi3Dependent


@VERSIONS
@pytest.mark.parametrize(
    ("unknowns", "knowns", "match"),
    [
        ([U], [X1], "4 is no unknown"),
        ([DX1], [FORCE], "7 is no known"),
        ([DX1, DX2], [DX1], "2 is no known"),
        ([99], [X1], "99 is no"),
    ],
)
def test_wrong_unknown_or_known_is_refused(fmu, unknowns, knowns, match):
    with fmu.refuses(ERROR, match):
        fmu.fmi.getDirectionalDerivative(unknowns, knowns, [1.0])


# --- Saved states ---------------------------------------------------------------------------------


def test_restored_state_runs_on_with_identical_bits(fmu):
    fmu.run(0.0, 1.0, 0.03)
    state = fmu.save()
    start = fmu.get(TIME)[0]
    trajectories = []
    for _ in range(2):
        fmu.restore(state)
        trajectory = []
        for k in range(50):
            fmu.set([U], [math.sin(k)])
            fmu.fmi.doStep(fmu.get(TIME)[0], 0.07)
            trajectory.append(fmu.get(TIME, X1, X2, FORCE))
        trajectories.append(trajectory)
        fmu.fmi.terminate()  # the phase is part of the state
    assert trajectories[0] == trajectories[1]
    assert trajectories[0][-1][0] > start
    fmu.free(state)


def test_state_serialized_in_one_instance_runs_on_in_another(open_fmu, version):
    first, second = (open_fmu("oscillator", version).start(1e-8) for _ in range(2))
    first.set([K, U], [9.0, 2.0])
    first.run(0.0, 1.0, 0.1)
    data = first.serialize(first.save())
    second.restore(second.deserialize(data))
    assert second.serialize(second.save()) == data
    results = []
    for fmu in (first, second):
        fmu.run(1.0, 3.0, 0.1)
        results.append(fmu.get(X1, X2, K, U, TIME))
    assert results[0] == results[1]


def test_foreign_short_and_damaged_states_are_refused(open_fmu, version):
    fmu = open_fmu("oscillator", version).start()
    other = open_fmu("van_der_pol", version).start()
    data = fmu.serialize(fmu.save())
    foreign = other.serialize(other.save())
    damaged = data[:-20] + bytes([data[-20] ^ 1]) + data[-19:]
    for wrong, match in [
        (foreign.ljust(len(data), b"\0"), "another model"),
        (data[:-1], "cut off"),
        (damaged, "damaged"),
        (b"\0" * len(data), "no serialized FMU state"),
    ]:
        with fmu.refuses(ERROR, match):
            fmu.deserialize(wrong)


def test_state_of_the_other_kind_is_refused(open_fmu, version):
    slave = open_fmu("oscillator", version).start()
    model = open_fmu("oscillator", version, slave=False).start()
    state = slave.deserialize(model.serialize(model.save()))
    with slave.refuses(ERROR, "of a Model Exchange instance"):
        slave.restore(state)


# --- Library --------------------------------------------------------------------------------------


def test_information_is_logged_only_on_request(open_fmu, version):
    quiet = open_fmu("oscillator", version).start()
    verbose = open_fmu("oscillator", version, verbose=True).start()
    assert quiet.log == []
    assert verbose.log[-1] == (0, "logAll", "Phase: step mode.")
    count = len(verbose.log)
    verbose.fmi.setDebugLogging(True, ["logStatusError"])
    verbose.fmi.terminate()
    assert len(verbose.log) == count


def test_two_threads_give_the_same_as_one(open_fmu, version):
    def simulate(fmu: Fmu) -> list[list[float]]:
        fmu.run(0.0, 2.0, 1e-3)
        return fmu.get(0, 1)

    fmus = [open_fmu("van_der_pol", version).start() for _ in range(3)]
    alone = simulate(fmus[0])
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(simulate, fmus[1:]))
    assert together == [alone, alone]


@pytest.mark.skipif(shutil.which("nm") is None, reason="needs nm")
def test_library_exports_the_functions_of_the_standard_and_nothing_else(open_fmu, version):
    fmu = open_fmu("oscillator", version)
    table = subprocess.run(
        ["nm", "-D", "--defined-only", fmu.fmi.dll._name], check=True, capture_output=True
    ).stdout.decode()
    exported = {line.split()[-1] for line in table.splitlines()}
    header = (HEADERS / f"fmi{version}Functions.h").read_text()
    standard = set(re.findall(rf"^#define (fmi{version}\w+)\s+fmi{version}FullName", header, re.M))
    assert len(standard) > 40  # the expression has found the list
    assert exported == standard


# --- Refusals -------------------------------------------------------------------------------------


@VERSIONS
@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"token": "{other}"}, r"is '\{other\}', but .* for '\{oscillator\}'"),
        ({"name": ""}, "empty"),
    ],
)
def test_wrong_token_and_empty_name_are_refused(open_fmu, version, options, match, monkeypatch):
    messages = []
    monkeypatch.setattr(Fmu, "note", lambda self, status, category, text: messages.append(text))
    with pytest.raises(Exception, match="Failed to instantiate"):
        open_fmu("oscillator", version, **options)
    assert re.search(match, messages[-1].decode())


@VERSIONS
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_values_that_are_not_finite_are_refused(fmu, value):
    with fmu.refuses(ERROR, "value reference 0, expected a finite"):
        fmu.set([U, X1], [7.0, value])
    assert fmu.get(U) == [0.0]
    with fmu.refuses(ERROR, "value reference 4, expected a finite"):
        fmu.set([U], [value])


def test_states_that_are_not_finite_are_refused_but_large_ones_are_not(model):
    large = sys.float_info.max  # two of them overflow a sum
    model.fmi.setContinuousStates((ctypes.c_double * 2)(large, large), 2)
    assert model.get(X1, X2) == [large, large]
    with model.refuses(ERROR, "value reference 1, expected a finite"):
        model.fmi.setContinuousStates((ctypes.c_double * 2)(1.0, math.nan), 2)
    assert model.get(X1, X2) == [large, large]


@VERSIONS
@pytest.mark.parametrize(
    ("reference", "match"),
    [
        (DX1, "2 is a derivative"),
        (D, "6 is a fixed parameter"),
        (FORCE, "7 is an output or local"),
        (TIME, "9 is the time"),
        (TIME + 1, "10 is no variable"),
        (2**32 - 1, "4294967295 is no variable"),
    ],
)
def test_what_cannot_be_set_is_refused(fmu, reference, match):
    with fmu.refuses(ERROR, match):
        fmu.set([U, reference], [7.0, 1.0])


def test_states_and_tunable_parameters_can_be_set_while_running_but_fixed_ones_cannot(
    open_fmu, version
):
    fmu = open_fmu("oscillator", version, slave=False)
    fmu.set([X1, D], [2.0, 0.1])
    fmu.initialize().set([X1, D], [3.0, 0.2])
    fmu.fmi.exitInitializationMode()
    fmu.set([K], [5.0])
    fmu.fmi.enterContinuousTimeMode()
    fmu.set([X1, U, K], [4.0, 1.0, 6.0])
    with fmu.refuses(ERROR, "fixed parameter, set in phase 'continuous-time mode'"):
        fmu.set([D], [0.3])
    assert fmu.get(X1, U, K, D) == [4.0, 1.0, 6.0, 0.2]


def test_calls_in_the_wrong_phase_are_refused(open_fmu, version):
    fmu = open_fmu("oscillator", version)
    with fmu.refuses(ERROR, r"DoStep: called in phase 'instantiated', allowed in: step mode"):
        fmu.fmi.doStep(0.0, 0.1)
    with fmu.refuses(ERROR, r"ExitInitializationMode: called in phase 'instantiated'"):
        fmu.fmi.exitInitializationMode()
    fmu.start()
    with fmu.refuses(ERROR, r"EnterInitializationMode: called in phase 'step mode'"):
        fmu.fmi.enterInitializationMode()
    fmu.fmi.terminate()
    with fmu.refuses(ERROR, r"'terminated'"):
        fmu.set([U], [1.0])
    assert fmu.get(X1) == [1.0]


@VERSIONS
@pytest.mark.parametrize(
    ("start", "size", "match"),
    [
        (0.5, 0.1, "stands at 0"),
        (0.0, 0.0, "positive size"),
        (0.0, -0.1, "positive size"),
        (math.nan, 0.1, "finite time"),
        (0.0, 1.1, "stop time is 1"),
    ],
)
def test_wrong_steps_are_refused(open_fmu, version, start, size, match):
    fmu = open_fmu("oscillator", version).start(stop=1.0)
    with fmu.refuses(ERROR, match):
        fmu.fmi.doStep(start, size)


@VERSIONS
@pytest.mark.parametrize("tolerance", [0.0, 1.0, -1e-6, math.nan])
def test_impossible_tolerance_is_refused(open_fmu, version, tolerance):
    fmu = open_fmu("oscillator", version)
    with fmu.refuses(ERROR, "tolerance is"):
        fmu.initialize(tolerance)


def test_wrong_array_length_is_refused(model):
    with model.refuses(ERROR, "3 values, expected 2"):
        model.fmi.setContinuousStates((ctypes.c_double * 3)(), 3)
    with model.refuses(ERROR, "NULL"):
        model.fmi.setContinuousStates(None, 2)
    with model.refuses(ERROR, "event indicators"):
        model.fmi.getEventIndicators((ctypes.c_double * 1)(), 1)


def test_no_instance_is_an_error_and_nothing_to_free(open_fmu, version):
    library = open_fmu("oscillator", version).fmi.dll
    assert getattr(library, f"fmi{version}Reset")(None) == ERROR
    getattr(library, f"fmi{version}FreeInstance")(None)


def test_variables_of_other_types_are_refused(open_fmu):
    two, three = (open_fmu("oscillator", version).start() for version in (2, 3))
    assert two.fmi.getInteger([]) == []
    with two.refuses(ERROR, "no Integer variables"):
        two.fmi.getInteger([0])
    with two.refuses(ERROR, "not interpolated"):
        two.fmi.setRealInputDerivatives([U], [1], [0.0])
    assert three.fmi.getInt32([]) == []
    with three.refuses(ERROR, "no Boolean variables"):
        three.fmi.setBoolean([0], [True])
    with three.refuses(ERROR, "no clocks"):
        three.fmi.getClock([0])


# --- Failures of the model ------------------------------------------------------------------------


def test_overflow_discards_the_derivative(open_fmu, version):
    fmu = open_fmu("overflow", version, slave=False).start()
    fmu.fmi.enterContinuousTimeMode()
    fmu.fmi.setContinuousStates((ctypes.c_double * 1)(1e3), 1)
    with fmu.refuses(DISCARD, "reference 1 is not finite at time 0"):
        fmu.get(1)
    with fmu.refuses(DISCARD, "for value reference 1 is not finite"):
        fmu.fmi.getDirectionalDerivative([1], [0], [1.0])
    assert fmu.fmi.getDirectionalDerivative([1], [0], [0.0]) == [0.0]
    fmu.fmi.setContinuousStates((ctypes.c_double * 1)(-2.0), 1)
    assert fmu.get(1) == [math.exp(-2.0)]
    with fmu.refuses(DISCARD, "reference 2 is not finite at time 0"):
        fmu.get(2)


def test_step_into_a_singularity_stops_before_it(open_fmu, version):
    """x = -log(1 - t) ends at t = 1; the instance stands at its last accepted step."""
    fmu = open_fmu("overflow", version).start()
    with pytest.raises(FMICallException, match="DoStep") as caught:
        fmu.fmi.doStep(0.0, 2.0)
    assert caught.value.status == DISCARD
    assert "stopped at time" in fmu.log[-1][2]
    x, t = fmu.get(0, 3)
    assert 0.99 < t < 1.01  # the tolerance moves the singularity of the numerical solution
    assert math.isfinite(x)
    if version == 2:
        assert fmu.fmi.getRealStatus(2) == t
        with fmu.refuses(ERROR, "phase 'step failed'"):
            fmu.fmi.doStep(t, 0.1)


def test_too_many_internal_steps_discard_the_step(open_fmu):
    """An undamped oscillation over some 300000 periods at a fine tolerance."""
    fmu = open_fmu("oscillator", 2)
    fmu.set([D], [0.0])
    fmu.start(1e-8)
    with pytest.raises(FMICallException, match="discard"):
        fmu.fmi.doStep(0.0, 1e6)
    assert "after 100000 internal steps, expected to reach 1000000" in fmu.log[-1][2]
    assert 0.0 < fmu.fmi.getRealStatus(2) < 1e6


def test_discarded_step_can_be_repeated_from_a_saved_state(open_fmu):
    fmu = open_fmu("overflow", 2).start()
    state = fmu.save()
    with pytest.raises(FMICallException, match="discard"):
        fmu.fmi.doStep(0.0, 2.0)
    fmu.restore(state)
    fmu.fmi.doStep(0.0, 0.5)
    assert_allclose(fmu.get(0), -math.log(0.5), rtol=1e-5)  # ten times the tolerance


def test_violated_assertion_stops_the_step_with_its_text(open_fmu, version):
    fmu = open_fmu("tank", version).start()
    fmu.fmi.doStep(0.0, 0.9)
    with pytest.raises(FMICallException, match="DoStep") as caught:
        fmu.fmi.doStep(0.9, 0.9)
    assert caught.value.status == ERROR
    percent = "%%" if version == 2 else "%"  # a printf format in FMI 2
    assert f"The tank is more than 100{percent} full" in fmu.log[-1][2]
    level, t = fmu.get(0, 3)
    assert level <= 1.0
    assert_allclose(level, t, rtol=1e-12)  # level' = 1: exact but for rounding


def test_violated_assertion_stops_initialization_and_model_exchange(open_fmu, version):
    fmu = open_fmu("tank", version, slave=False)
    fmu.set([0], [2.0])
    fmu.initialize()
    with fmu.refuses(ERROR, "violated at time 0: The tank"):
        fmu.fmi.exitInitializationMode()
    fmu.set([0], [0.0])
    fmu.fmi.exitInitializationMode()
    fmu.fmi.enterContinuousTimeMode()
    fmu.fmi.setTime(3.0)
    fmu.fmi.setContinuousStates((ctypes.c_double * 1)(2.0), 1)
    with fmu.refuses(ERROR, "violated at time 3: The tank"):
        fmu.fmi.completedIntegratorStep()


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


def test_communication_points_are_hit_exactly(fmu):
    fmu.run(0.0, 1.0, 0.1)
    assert fmu.get(TIME) == [0.9 + 0.1]


def test_steps_that_add_up_with_rounding_are_accepted(open_fmu, version):
    fmu = open_fmu("oscillator", version).start(stop=10.0)
    t = 0.0
    for k in range(10000):
        fmu.fmi.doStep(t if k % 2 else k * 1e-3, 1e-3)
        t += 1e-3
    assert_allclose(fmu.get(X1, X2), oscillate([1.0, 0.0], 0.0, 10.0), atol=1e-6)  # = tolerance


def test_model_without_states_steps(open_fmu, version):
    fmu = open_fmu("gain", version).start()
    fmu.set([0], [3.0])
    fmu.run(0.0, 1.0, 0.1)
    assert fmu.get(1) == [6.0]


ROOT = Path(__file__).parent.parent
PROGRAMS = Path(__file__).parent / "runtime"
SANITIZE = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@pytest.fixture(scope="module", autouse=True)
def sanitizers(tmp_path_factory) -> None:
    """Skip where a program with sanitizers does not build or run."""
    if COMPILER is None:
        pytest.skip("needs a C compiler")
    folder = tmp_path_factory.mktemp("sanitizers")
    (folder / "empty.c").write_text("int main(void) { return 0; }\n")
    build = subprocess.run([COMPILER, *SANITIZE, "empty.c", "-o", "empty"], cwd=folder, check=False)
    if build.returncode != 0 or subprocess.run([folder / "empty"], check=False).returncode != 0:
        pytest.skip("needs the runtime of the sanitizers")


def unpack_sources(fmi: int, model: str, folder: Path) -> Path:
    with zipfile.ZipFile(ROOT / "fmus" / f"fmi{fmi}" / f"{model}.fmu") as archive:
        archive.extractall(folder, [n for n in archive.namelist() if n.startswith("sources/")])
    return folder / "sources"


def run_life(fmi: int, sources: Path) -> subprocess.CompletedProcess[str]:
    """Compile the sources with `life_fmi<n>.c` and run it; warnings are errors."""
    # -O1: unoptimised, the reference model's long functions fill the stack.
    command = [COMPILER, "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O1", *SANITIZE]
    command += ["-I.", *sorted(p.name for p in sources.glob("*.c"))]
    command += [PROGRAMS / f"life_fmi{fmi}.c", "-o", "life", "-lm"]
    subprocess.run(command, cwd=sources, check=True)
    return subprocess.run([sources / "life"], capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("fmi", "model"),
    [
        (2, "MinimalObserver"),
        (3, "MinimalObserver"),
        *(pytest.param(fmi, "Reference", marks=pytest.mark.long) for fmi in (2, 3)),
    ],
)
def test_a_life_with_right_and_wrong_calls_is_clean(fmi, model, tmp_path):
    run = run_life(fmi, unpack_sources(fmi, model, tmp_path))
    assert (run.returncode, run.stderr) == (0, "")


@pytest.mark.parametrize(
    ("right", "wrong", "report"),
    [
        ("sizeof *i + length + 1", "sizeof *i + length", "heap-buffer-overflow"),
        ("i->importer.release(*saved)", "(void)i", "detected memory leaks"),
        ("i->work[NX + column.row[n]]", "i->work[NX + NW + column.row[n]]", "out of bounds"),
    ],
)
def test_a_planted_fault_is_found(right, wrong, report, tmp_path):
    """The counterexamples: without them a clean run might mean that nothing was looked at."""
    sources = unpack_sources(2, "MinimalObserver", tmp_path)
    edit(sources / "instance.c", (right, wrong))
    run = run_life(2, sources)
    assert run.returncode != 0
    assert report in run.stderr
