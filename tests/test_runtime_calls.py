"""Calls of both standards into the C runtime: equations, derivatives, saved states, library."""

import ctypes
import itertools
import math
import re
import shutil
import subprocess
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.testing import assert_allclose

from .processes import needs_compiler
from .runtime_instances import (
    DX1,
    DX2,
    ENERGY,
    ERROR,
    FORCE,
    HEADERS,
    TIME,
    VERSIONS,
    X1,
    X2,
    D,
    Fmu,
    K,
    U,
    oscillate,
)

pytestmark = needs_compiler

# --- Model Exchange and the extension -------------------------------------------------------------


@VERSIONS
def test_model_exchange_evaluates_the_equations(open_fmu, version):
    fmu = open_fmu("oscillator", version, slave=False).start()
    fmu.fmi.enterContinuousTimeMode()
    fmu.fmi.setTime(3.0)
    fmu.fmi.setContinuousStates((ctypes.c_double * 2)(2.0, 5.0), 2)
    fmu.set([U], [1.0])
    derivatives = (ctypes.c_double * 2)()
    read = "getDerivatives" if version == 2 else "getContinuousStateDerivatives"
    getattr(fmu.fmi, read)(derivatives, 2)
    assert list(derivatives) == [5.0, -8.0 - 2.5 + 1.0]
    assert fmu.get(X1, X2, DX1, DX2, U, K, D, FORCE, ENERGY, TIME) == (
        [2.0, 5.0, 5.0, -9.5, 1.0, 4.0, 0.5, -9.5, 20.5, 3.0]
    )
    assert fmu.fmi.completedIntegratorStep() == (False, False)


@VERSIONS
def test_model_without_events_needs_no_event_iteration(open_fmu, version):
    fmu = open_fmu("oscillator", version, slave=False).start()
    update = fmu.fmi.newDiscreteStates if version == 2 else fmu.fmi.updateDiscreteStates
    assert not any(update())
    fmu.fmi.enterContinuousTimeMode()
    fmu.fmi.enterEventMode()
    fmu.fmi.enterContinuousTimeMode()


@VERSIONS
def test_cached_values_follow_every_change(open_fmu, version):
    fmu = open_fmu("oscillator", version).start()
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
def test_columns_of_the_jacobian_follow_every_change(open_fmu, version, unknowns):
    fmu = open_fmu("oscillator", version, slave=False).start()
    fmu.fmi.enterContinuousTimeMode()

    def check(x1: float, k: float) -> None:
        column = {DX1: 0.0, DX2: -k, FORCE: -k, ENERGY: k * x1}
        found = fmu.fmi.getDirectionalDerivative(unknowns, [X1], [1.0])
        assert found == [column[unknown] for unknown in unknowns]

    check(1.0, 4.0)
    state = fmu.save()
    fmu.fmi.setContinuousStates((ctypes.c_double * 2)(3.0, 0.0), 2)
    check(3.0, 4.0)
    fmu.set([K], [5.0])
    check(3.0, 5.0)
    fmu.set([X1], [2.0])
    check(2.0, 5.0)
    fmu.restore(state)
    check(1.0, 4.0)


@VERSIONS
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


@VERSIONS
def test_directional_derivative_is_the_jacobian(open_fmu, version):
    fmu = open_fmu("oscillator", version).start()
    fmu.set([X1, X2], [2.0, 3.0])
    J = oscillator_jacobian(2.0, 3.0)
    for seed in np.eye(5):
        found = fmu.fmi.getDirectionalDerivative(UNKNOWNS, KNOWNS, list(seed))
        assert found == list(J @ seed)  # products and sums of small integers: exact
    assert fmu.fmi.getDirectionalDerivative([DX2], [U, K], [3.0, 2.0]) == [3.0 - 4.0]


@VERSIONS
@pytest.mark.parametrize("known", [X1, X2, U, K, D])
def test_a_block_of_unknowns_gives_what_single_unknowns_give(open_fmu, version, known):
    """Unknowns that stand one after the other are treated at once; any others one by one."""
    fmu = open_fmu("oscillator", version).start()
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
def test_wrong_unknown_or_known_is_refused(open_fmu, version, unknowns, knowns, match):
    fmu = open_fmu("oscillator", version).start()
    with fmu.refuses(ERROR, match):
        fmu.fmi.getDirectionalDerivative(unknowns, knowns, [1.0])


# --- Saved states ---------------------------------------------------------------------------------


@VERSIONS
def test_restored_state_runs_on_with_identical_bits(open_fmu, version):
    fmu = open_fmu("oscillator", version).start()
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


@VERSIONS
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


@VERSIONS
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


@VERSIONS
def test_state_of_the_other_kind_is_refused(open_fmu, version):
    slave = open_fmu("oscillator", version).start()
    model = open_fmu("oscillator", version, slave=False).start()
    state = slave.deserialize(model.serialize(model.save()))
    with slave.refuses(ERROR, "of a Model Exchange instance"):
        slave.restore(state)


# --- Library --------------------------------------------------------------------------------------


@VERSIONS
def test_information_is_logged_only_on_request(open_fmu, version):
    quiet = open_fmu("oscillator", version).start()
    verbose = open_fmu("oscillator", version, verbose=True).start()
    assert quiet.log == []
    assert verbose.log[-1] == (0, "logAll", "Phase: step mode.")
    count = len(verbose.log)
    verbose.fmi.setDebugLogging(True, ["logStatusError"])
    verbose.fmi.terminate()
    assert len(verbose.log) == count


@VERSIONS
def test_two_threads_give_the_same_as_one(open_fmu, version):
    def simulate(fmu: Fmu) -> list[list[float]]:
        fmu.run(0.0, 2.0, 1e-3)
        return fmu.get(0, 1)

    fmus = [open_fmu("van_der_pol", version).start() for _ in range(3)]
    alone = simulate(fmus[0])
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(simulate, fmus[1:]))
    assert together == [alone, alone]


@VERSIONS
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
