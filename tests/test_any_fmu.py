"""Models that are not smooth, autonomous and all Real: estimates are right, or refused in words."""

import re
import subprocess
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest

from workbench.__main__ import main
from workbench.errors import FMUError, InputError
from workbench.models.fmu import FMU, EventError
from workbench.observers import estimators_of
from workbench.observers.contract import Estimator
from workbench.observers.gains_file import usual_gains
from workbench.system.registry import load_system

from .hostile_fmus import COMPILER, needs_compiler

pytestmark = needs_compiler

VARIABLES = """
<ScalarVariable name="T" valueReference="0" causality="output" initial="exact"><Real start="291"/></ScalarVariable>
<ScalarVariable name="der(T)" valueReference="1"><Real derivative="1"/></ScalarVariable>
<ScalarVariable name="Ta" valueReference="2" causality="input"><Real start="280"/></ScalarVariable>
<ScalarVariable name="G" valueReference="3" causality="parameter" variability="tunable"><Real start="50"/></ScalarVariable>
<ScalarVariable name="dG" valueReference="4" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="C" valueReference="5" causality="parameter" variability="fixed"><Real start="1e5"/></ScalarVariable>
<ScalarVariable name="P" valueReference="6" causality="output" variability="discrete"><Real/></ScalarVariable>
<ScalarVariable name="mode" valueReference="0" causality="parameter" variability="fixed"><Integer start="0"/></ScalarVariable>
<ScalarVariable name="flag" valueReference="1" causality="parameter" variability="fixed"><Boolean start="false"/></ScalarVariable>
"""  # noqa: E501
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Room" guid="{{room}}" numberOfEventIndicators="{count}">
<ModelExchange modelIdentifier="Room"/>
<DefaultExperiment startTime="{start}" stopTime="3600"/>
<ModelVariables>{variables}</ModelVariables>
<ModelStructure><Outputs><Unknown index="1"/><Unknown index="7"/></Outputs>
<Derivatives><Unknown index="2"/></Derivatives></ModelStructure>
</fmiModelDescription>
"""  # noqa: E501
SYSTEM = """
title = "Room"
sample_time = "10 s"
models.observer = {{ class = "Room", fmu = "Room.fmu" }}
inputs.Ta = {{ unit = "K", noise = "0.05 K", scale = "10 K" }}
outputs.T = {{ unit = "K", noise = "0.05 K", scale = "10 K" }}
[estimated.G]
correction = "{correction}"
unit = "W/K"
range = ["10 W/K", "200 W/K"]
walk = "0.1 W/K"
spread = "10 W/K"
acts_on = "T"
"""

Build = Callable[..., Path]


@pytest.fixture
def build(tmp_path: Path) -> Build:
    """Builds the room in a folder with its system file; returns the FMU."""

    def make(what: str, start: float = 0.0, correction: str = "dG") -> Path:
        library = tmp_path / f"Room{fmpy.sharedLibraryExtension}"
        headers = Path(fmpy.__file__).parent / "c-code"
        source = Path(__file__).with_name("events.c")
        flags = ["-shared", "-fPIC", "-w", f"-DWHAT={what}", "-I", headers]
        subprocess.run([str(COMPILER), *flags, source, "-o", library, "-lm"], check=True)
        description = DESCRIPTION.format(
            count=int(what == "THERMOSTAT"), start=start, variables=VARIABLES
        )
        with zipfile.ZipFile(tmp_path / "Room.fmu", "w") as archive:
            archive.writestr("modelDescription.xml", description)
            archive.write(library, f"binaries/{fmpy.platform}/{library.name}")
        (tmp_path / "system.toml").write_text(SYSTEM.format(correction=correction))
        return tmp_path / "Room.fmu"

    return make


def estimator(fmu: FMU, name: str) -> Estimator:
    system = load_system(fmu.path.parent)
    chosen = estimators_of(system)[name]
    return chosen(fmu, system, usual_gains(chosen, fmu, system))


def run(fmu: FMU, name: str, end: float) -> np.ndarray:
    """Estimates of T along a recording at 280 K outside, in which T stays at 291 K."""
    time = np.arange(0.0, end + 5.0, 10.0)
    u, y = np.full((time.size, 1), 280.0), np.full((time.size, 1), 291.0)
    return np.asarray(estimator(fmu, name).run(time, u, y).values)[:, 0]


def exact(power: float, t: float, begin: float = 291.0) -> float:
    """Solution of C der(T) = P - G (T - Ta)."""
    end = 280.0 + power / 50.0
    return float(end + (begin - end) * np.exp(-t * 50.0 / 1e5))


def test_discrete_states_are_iterated_until_they_are_stable(build: Build) -> None:
    """One iteration would leave the heating off."""
    with FMU(build("RELAYS")) as fmu:
        fmu.start({})
        assert fmu.get(fmu.variables(["P"]))[0] == 1500.0
        # Linearly implicit Euler errs by h/2 * der2(T) t, 0.02 K here.
        assert run(fmu, "open_loop", 600.0)[-1] == pytest.approx(exact(1500.0, 600.0), abs=0.03)


def along(what: str, times: np.ndarray) -> np.ndarray:
    """Temperature of the room at 280 K outside, by the closed form from event to event."""
    values, t, T, power = [], 0.0, 291.0, 1500.0
    for sample in times:
        while True:
            steady = 280.0 + power / 50.0
            if what == "TIMETABLE":
                event = 600.0 * (np.floor(t / 600.0 + 1e-9) + 1.0)
            elif what == "FUSE" and power == 0.0:
                event = np.inf
            else:
                edge = 295.0 if power else 293.0
                event = t + 2000.0 * np.log((T - steady) / (edge - steady))
            if event > sample:
                break
            T, t, power = (
                steady + (T - steady) * np.exp(-(event - t) / 2000.0),
                event,
                1500.0 - power,
            )
        T, t = steady + (T - steady) * np.exp(-(sample - t) / 2000.0), sample
        values.append(T)
    return np.array(values)


@pytest.mark.parametrize("what", ["THERMOSTAT", "TIMETABLE"])
def test_the_open_loop_goes_through_events(what: str, build: Build) -> None:
    """The room is between 293 K and 295 K, or heated from 0 to 600 s, from 1200 s to 1800 s.

    Six events of a thermostat in an hour; the tolerance of the integration is 1e-8 of 300 K.
    """
    with FMU(build(what)) as fmu:
        estimated = run(fmu, "open_loop", 3600.0)
    assert estimated == pytest.approx(along(what, 10.0 * np.arange(estimated.size)), abs=1e-4)


def test_a_jump_of_an_input_is_an_event_where_it_happens(build: Build) -> None:
    """Outside, it falls from 280 K to 270 K at 100 s: held inputs jump there, and not before."""
    with FMU(build("TIMETABLE")) as fmu:
        loop = estimator(fmu, "open_loop")
        held = replace(loop.system.inputs[0], held=True)
        loop = type(loop)(fmu, replace(loop.system, inputs=(held,)), loop.gains)
        time = np.arange(0.0, 205.0, 10.0)
        u = np.where(time < 100.0, 280.0, 270.0)[:, None]
        estimated = np.asarray(loop.run(time, u, np.full((time.size, 1), 291.0)).values)[:, 0]
    at_jump = exact(1500.0, 100.0)
    after = 300.0 + (at_jump - 300.0) * np.exp(-100.0 / 2000.0)
    assert estimated[[10, 20]] == pytest.approx([at_jump, after], abs=1e-4)


def test_the_open_loop_agrees_with_fmpy_through_events(
    build: Build, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of the timetable: FMPy ends a step before the thermostat compares T with 295 K."""
    path = build("TIMETABLE")
    assert main(["fmu", "compare", str(path), str(path.parent / "none.fmu")]) == 0
    rows = capsys.readouterr().out.splitlines()
    assert rows[0].startswith("| FMU | FMI | largest difference | verdict |")
    assert re.match(r"\| Room.fmu \| 2.0 \| \d.\de-0[678] of `[TP]` \| right \|", rows[2])
    assert "| refused: none.fmu: found no such file" in rows[3]


@pytest.mark.parametrize("name", ["ekf", "ukf", "mhe"])
@pytest.mark.parametrize("what", ["THERMOSTAT", "TIMETABLE", "FUSE"])
def test_other_estimators_refuse_a_run_with_an_event(what: str, name: str, build: Build) -> None:
    """They are fed 291 K: the thermostat of a filter does not switch, which it may not pretend."""
    with FMU(build(what)) as fmu:
        assert np.isfinite(run(fmu, name, 100.0)).all()
        if what == "TIMETABLE":
            with pytest.raises(EventError, match=r"an event of the model by .* s of its time"):
                run(fmu, name, 900.0)
            return
        fmu.start({})
        fmu.set_states(np.array([296.0]))
        with pytest.raises(EventError, match="or the model asks for Event Mode"):
            fmu.check_event()


def test_the_open_loop_stops_where_a_model_asks_for_event_mode_that_has_no_indicators(
    build: Build,
) -> None:
    """The fuse blows at 295 K, after 470 s, which only the end of a step tells."""
    with FMU(build("FUSE")) as fmu:
        assert run(fmu, "open_loop", 460.0)[-1] == pytest.approx(exact(1500.0, 460.0), abs=0.03)
        with pytest.raises(EventError, match="the model asks for Event Mode"):
            run(fmu, "open_loop", 600.0)


def test_the_last_sample_may_not_be_beyond_an_event(build: Build) -> None:
    with FMU(build("THERMOSTAT")) as fmu:
        fmu.start({})
        fmu.set_states(np.array([296.0]))
        with pytest.raises(FMUError, match="an event of the model"):
            fmu.check_event()


def test_time_begins_where_the_model_says_and_is_set_at_each_sample(build: Build) -> None:
    with FMU(build("TIMETABLE", start=550.0)) as fmu:
        fmu.start({})
        assert fmu.next_event[0] == 600.0
        run(fmu, "open_loop", 50.0)
        assert fmu.time[0] == 600.0
        with pytest.raises(FMUError, match="an event of the model by 600 s"):
            run(fmu, "ekf", 60.0)


def test_parameters_are_set_by_their_type_where_references_repeat(build: Build) -> None:
    with FMU(build("RELAYS"), parameters={"mode": 1.0, "flag": 1.0}) as fmu:
        fmu.start({})
        assert fmu.get_states()[0] == 291.0
        assert fmu.derivatives()[0] == pytest.approx((3000.0 - 50.0 * 11.0) / 1e5 + 1.0)
        for name, value in (("mode", 0.5), ("flag", 2.0)):
            with pytest.raises(InputError, match=f"variable '{name}'.*found the value"):
                fmu.start({}, {name: value})
        with pytest.raises(InputError, match="found a variable of type Integer"):
            fmu.variables(["mode"])


@pytest.mark.parametrize(
    ("correction", "found"),
    [
        ("C", "'C', which is a fixed variable of causality parameter"),
        ("G", "'G', which is an estimated quantity"),
        ("P", "'P', which is a discrete variable of causality output"),
        ("Ta", "'Ta', which is a measured input"),
        ("T", "'T', which is a measured output"),
    ],
)
def test_a_correction_is_an_input_of_its_own(correction: str, found: str, build: Build) -> None:
    path = build("RELAYS", correction=correction)
    with FMU(path) as fmu, pytest.raises(InputError, match=f"correction: found {found}"):
        estimator(fmu, "ekf")


def test_compiled_code_gets_samples_of_the_size_that_it_needs(build: Build) -> None:
    with FMU(build("RELAYS")) as fmu:
        filter_ = estimator(fmu, "ekf")
        time, one, two = np.arange(5.0), np.zeros((5, 1)), np.zeros((5, 2))
        for u, y in ((two, one), (one[:4], one), (one, one[:4])):
            with pytest.raises(ValueError, match="samples of shape"):
                filter_.run(time, u, y)
