"""An input that is held between samples acts as it was at the beginning of each step."""

from collections.abc import Iterator

import fmpy
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from workbench import case_from_frame
from workbench.models.compiler import native
from workbench.models.fmu import FMU
from workbench.observers import estimators_of
from workbench.observers.export import build_observer
from workbench.observers.replay import replay
from workbench.recordings.case import Case
from workbench.system.registry import open_model
from workbench.system.system import System

from .built import declare, machine

VESSEL, SYSTEM = machine("vessel")
ESTIMATORS = [
    "open_loop",
    "disturbance_observer",
    "parameter_estimator",
    "ekf",
    "arrow",
    "ukf",
    "mhe",
    "imm",
    "smoother",
]


@pytest.fixture(scope="module")
def vessel(tmp_path_factory) -> System:
    folder = tmp_path_factory.mktemp("vessel")
    return declare(folder, VESSEL, SYSTEM)


@pytest.fixture(scope="module")
def fmu(vessel) -> Iterator[FMU]:
    with open_model(vessel) as model:
        yield model


@pytest.fixture(scope="module")
def filled(vessel) -> Case:
    """A litre in a second for ten seconds, switched at samples: ten litres, without any noise."""
    time = np.arange(31.0)
    flow = np.where(time < 10.0, 1e-3, 0.0)
    volume = np.minimum(time, 10.0) * 1e-3
    columns = {"q [m3/s]": flow, "V [m3]": volume, "through [m3/s]": flow}
    return case_from_frame(vessel, pd.DataFrame({"time [s]": time, **columns}))


@pytest.mark.parametrize("name", ESTIMATORS)
def test_a_switched_pump_is_integrated_exactly_and_nothing_is_made_of_the_switch(
    vessel, fmu, filled, name
):
    kind = estimators_of(vessel)[name]
    run = replay(filled, kind(fmu, vessel, kind.default_gains(fmu, vessel)))
    assert_allclose(run.signal("V"), filled["V"], rtol=0.0, atol=1e-12)
    assert_allclose(run.signal("leak"), 0.0, atol=1e-12)
    # What a sensor sees at a sample is the input from there on.
    assert_allclose(run.signal("through"), filled["through"], rtol=0.0, atol=1e-12)


def test_an_exported_observer_holds_the_input_too(vessel, fmu, filled, tmp_path):
    kind = estimators_of(vessel)["disturbance_observer"]
    estimator = kind(fmu, vessel, kind.default_gains(fmu, vessel))
    path = tmp_path / "observer.fmu"
    build_observer(estimator, path, 2, platforms=[native()])
    names = [signal.name for signal in (*vessel.inputs, *vessel.outputs)]
    recorded = np.array(
        list(zip(filled.time, *(filled[name] for name in names), strict=True)),
        [(name, float) for name in ("time", *names)],
    )
    shown = fmpy.simulate_fmu(str(path), input=recorded, output=["VEstimate"], output_interval=1.0)
    # A tool shows each estimate one step later.
    assert_allclose(shown["VEstimate"][1:], filled["V"][: len(shown) - 1], rtol=0.0, atol=1e-12)
