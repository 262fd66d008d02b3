"""What the C runtime of the FMUs refuses, and how it stops where a model fails."""

import ctypes
import math
import re
import sys

import pytest
from fmpy.fmi1 import FMICallException
from numpy.testing import assert_allclose

from .processes import needs_compiler
from .runtime_instances import (
    DISCARD,
    DX1,
    ERROR,
    FORCE,
    TIME,
    VERSIONS,
    X1,
    X2,
    D,
    Fmu,
    K,
    U,
)

pytestmark = needs_compiler

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
def test_values_that_are_not_finite_are_refused(open_fmu, version, value):
    fmu = open_fmu("oscillator", version).start()
    with fmu.refuses(ERROR, "value reference 0, expected a finite"):
        fmu.set([U, X1], [7.0, value])
    assert fmu.get(U) == [0.0]
    with fmu.refuses(ERROR, "value reference 4, expected a finite"):
        fmu.set([U], [value])


@VERSIONS
def test_states_that_are_not_finite_are_refused_but_large_ones_are_not(open_fmu, version):
    fmu = open_fmu("oscillator", version, slave=False).start()
    fmu.fmi.enterContinuousTimeMode()
    large = sys.float_info.max  # two of them overflow a sum
    fmu.fmi.setContinuousStates((ctypes.c_double * 2)(large, large), 2)
    assert fmu.get(X1, X2) == [large, large]
    with fmu.refuses(ERROR, "value reference 1, expected a finite"):
        fmu.fmi.setContinuousStates((ctypes.c_double * 2)(1.0, math.nan), 2)
    assert fmu.get(X1, X2) == [large, large]


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
def test_what_cannot_be_set_is_refused(open_fmu, version, reference, match):
    fmu = open_fmu("oscillator", version).start()
    with fmu.refuses(ERROR, match):
        fmu.set([U, reference], [7.0, 1.0])


@VERSIONS
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


@VERSIONS
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


@VERSIONS
def test_wrong_array_length_is_refused(open_fmu, version):
    fmu = open_fmu("oscillator", version, slave=False).start()
    fmu.fmi.enterContinuousTimeMode()
    with fmu.refuses(ERROR, "3 values, expected 2"):
        fmu.fmi.setContinuousStates((ctypes.c_double * 3)(), 3)
    with fmu.refuses(ERROR, "NULL"):
        fmu.fmi.setContinuousStates(None, 2)
    with fmu.refuses(ERROR, "event indicators"):
        fmu.fmi.getEventIndicators((ctypes.c_double * 1)(), 1)


@VERSIONS
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


@VERSIONS
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


@VERSIONS
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


@VERSIONS
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


@VERSIONS
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
