"""Models that are not smooth, autonomous and all Real: estimates are right, or refused in words."""

import json
import re
import subprocess
import zipfile
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pandas as pd
import pytest

import workbench as wb
from workbench.__main__ import main
from workbench.diagnosis import Outcome
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.effects.candidates import candidates, rate_terms
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.errors import FMUError, InputError
from workbench.models.added import CONSTANT, RateTerm, write_extended
from workbench.models.checks import check
from workbench.models.fmu import FMU, CoSimulation
from workbench.models.instance import TOLERANCE, EventError, NoFunctionError
from workbench.models.native import OK, instance, linearise, place, read
from workbench.models.simulation import Drive, Simulation
from workbench.observers import choose, estimators_of
from workbench.observers.contract import Estimator
from workbench.observers.fmpy_comparison import NO_REFERENCE, REFUSED, RIGHT, compare_with_fmpy
from workbench.observers.gains import usual_gains
from workbench.observers.operating import DesignPointError, linearised, start_spreads, walks
from workbench.observers.replay import replay
from workbench.observers.simulation import prepare
from workbench.observers.trajectory import check_along, size_doubt
from workbench.observers.trust import sampling_doubt
from workbench.recordings.case import make_case, read_case
from workbench.studies.distance.forecast import stopping_of
from workbench.studies.distance.simulation import DrivingInputs, StopSimulation
from workbench.system.parts import OperatingPoint
from workbench.system.registry import load_system, open_model

from .built import diagnosed, machine_file, write_case
from .edits import edit, edits
from .hostile_fmus import XML, rewritten
from .processes import COMPILER, needs_compiler
from .systems import TRAIN

pytestmark = needs_compiler

VARIABLES = machine_file("room_fmu/variables.xml")

Build = Callable[..., Path]
BINARY = f"binaries/{fmpy.platform}"


@pytest.fixture(scope="module")
def compiled(once) -> Callable[..., Path]:
    """Compiles a source into a library that exports FMI, once for each set of flags."""

    def make(source: str, *flags: str) -> Path:
        def build(folder: Path) -> Path:
            library, headers = folder / "model.so", Path(fmpy.__file__).parent / "c-code"
            given = ["-shared", "-fPIC", "-w", "-I", headers, *flags]
            file = Path(__file__).with_name(source)
            subprocess.run([str(COMPILER), *given, file, "-o", library, "-lm"], check=True)
            return library

        return once(" ".join([source, *flags]), build)

    return make


@pytest.fixture
def build(tmp_path, compiled) -> Build:
    """Builds the room in a folder with its system file; returns the FMU."""

    def make(
        events: str,
        start: float = 0.0,
        correction: str = "dG",
        variables: str = VARIABLES,
        flags: Sequence[str] = (),
        saves: bool = False,
    ) -> Path:
        library = compiled("events.c", f"-DWHAT={events}", *flags)
        description = machine_file(
            "room_fmu/modelDescription.xml",
            count=int(events == "THERMOSTAT"),
            start=start,
            variables=variables,
        )
        if saves:
            offered = 'modelIdentifier="Room" canGetAndSetFMUstate="true"/>'
            description = description.replace('modelIdentifier="Room"/>', offered)
        with zipfile.ZipFile(tmp_path / "Room.fmu", "w") as archive:
            archive.writestr(XML, description)
            archive.write(library, f"{BINARY}/Room{fmpy.sharedLibraryExtension}")
        (tmp_path / "system.toml").write_text(
            machine_file("room_fmu/system.toml", correction=correction)
        )
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


def exact(power: float, t: Any, begin: float = 291.0) -> Any:
    """Solution of C der(T) = P - G (T - Ta)."""
    end = 280.0 + power / 50.0
    return end + (begin - end) * np.exp(-t * 50.0 / 1e5)


def test_discrete_states_are_iterated_until_they_are_stable(build):
    """One iteration would leave the heating off."""
    with FMU(build("RELAYS")) as fmu:
        fmu.start({})
        assert fmu.get(fmu.variables(["P"]))[0] == 1500.0
        # Linearly implicit Euler errs by h/2 * der2(T) t, 0.02 K here.
        assert run(fmu, "open_loop", 600.0)[-1] == pytest.approx(exact(1500.0, 600.0), abs=0.03)


def test_a_model_exchange_is_told_no_tolerance_since_it_does_not_integrate(build):
    """Dymola's warns of one: a doubt on every result, which said nothing of the model."""
    with FMU(build("RELAYS", flags=["-DUNTOLD"])) as fmu:
        fmu.start({})
        assert fmu.take_warning() == ""


@pytest.mark.parametrize("begin", [294.0, 297.0])
def test_a_calculated_start_beyond_a_switch_is_in_the_mode_of_there(begin, build):
    """At 291 K the thermostat heats, up to 295 K: above, it does not."""
    exact_start = 'initial="exact"><Real start="291"/>'
    calculated = VARIABLES.replace(exact_start, 'initial="calculated"><Real/>')
    assert calculated != VARIABLES
    with FMU(build("THERMOSTAT", variables=calculated)) as fmu:
        fmu.start({"T": begin})
        assert fmu.get_states()[0] == begin
        assert fmu.get(fmu.variables(["P"]))[0] == (1500.0 if begin < 295.0 else 0.0)


def along(events: str, times: np.ndarray, G: float = 50.0, T: float = 291.0) -> np.ndarray:
    """Temperature of the room at 280 K outside, by the closed form from event to event."""
    values, t, power, slowness = [], 0.0, 1500.0, 1e5 / G
    for sample in times:
        while True:
            steady = 280.0 + power / G
            if events == "TIMETABLE":
                event = 600.0 * (np.floor(t / 600.0 + 1e-9) + 1.0)
            elif events == "FUSE" and power == 0.0:
                event = np.inf
            else:
                edge = 295.0 if power else 293.0
                event = t + slowness * np.log((T - steady) / (edge - steady))
            if event > sample:
                break
            T, t, power = (
                steady + (T - steady) * np.exp(-(event - t) / slowness),
                event,
                1500.0 - power,
            )
        T, t = steady + (T - steady) * np.exp(-(sample - t) / slowness), sample
        values.append(T)
    return np.array(values)


@pytest.mark.parametrize("events", ["THERMOSTAT", "TIMETABLE"])
def test_the_open_loop_goes_through_events(events, build):
    """The room is between 293 K and 295 K, or heated from 0 to 600 s, from 1200 s to 1800 s.

    Six events of a thermostat in an hour; the tolerance of the integration is 1e-8 of 300 K.
    """
    with FMU(build(events)) as fmu:
        estimated = run(fmu, "open_loop", 3600.0)
    assert estimated == pytest.approx(along(events, 10.0 * np.arange(estimated.size)), abs=1e-4)


def test_a_model_without_derivatives_at_the_design_point_is_told(build):
    """A traceback came of it."""
    system = load_system(build("RELAYS", flags=["-DLOST=0.0"]).parent)
    text = r"a derivative of 'T' that is nan; at 0 s of its time, at the design point, .*: T = 291"
    with open_model(system) as fmu, pytest.raises(DesignPointError, match=text):
        linearised(fmu, system)


def test_a_model_that_discards_calls_beyond_its_table_works_within_it(build):
    """At rest at inputs of zero it is beyond, which left no estimator, and no diagnosis."""
    system = load_system(build("RELAYS", flags=["-DDISCARDS=290.5"]).parent)
    kinds = {name: estimators_of(system)[name] for name in ("open_loop", "parameter_estimator")}
    assert prepare(system, kinds).gains.keys() == kinds.keys()  # at rest as its inputs start
    left_out, cold = {}, replace(system, design=OperatingPoint({"Ta": 0.0}, {}, {}))
    assert list(prepare(cold, kinds, leave_out=left_out.__setitem__).gains) == ["open_loop"]
    message = "fmi2GetDerivatives returned discard"
    assert re.search(rf"{message}.* at the design point, .*: T = ", str(left_out.popitem()[1]))
    time = 10.0 * np.arange(60.0)
    with open_model(system) as fmu:
        terms = rate_terms(fmu, system)
        assert terms
        assert all(np.isfinite(term.typical) for term in terms)
        within, beyond = np.full((60, 1), 280.0), np.full((60, 1), 200.0)
        warm = np.asarray(estimator(fmu, "open_loop").run(time, within, beyond + 91.0).values)
        assert warm[-1, 0] == pytest.approx(exact(1500.0, 590.0), abs=0.03)
        with pytest.raises(FMUError, match=message):
            estimator(fmu, "open_loop").run(time, beyond, beyond + 91.0)


@pytest.mark.parametrize(
    ("attributes", "size", "stated"),
    [
        ('start="1e-9"', 1e-9, True),
        ('start="2e5"', 2e5, True),
        ('start="0" nominal="300"', 300.0, False),
        ('start="20"', 1.0, False),
    ],
)
def test_the_size_of_a_state_follows_what_the_fmu_tells(attributes, size, stated, build):
    """A charge of 1e-9 C had a walk of 2e-4 C, and differences by six times of what it is."""
    folder = build("RELAYS", variables=VARIABLES.replace('start="291"', attributes)).parent
    system = load_system(folder)
    with FMU(folder / "Room.fmu") as fmu:
        assert walks(fmu, system) == pytest.approx([2e-4 * size])
        assert start_spreads(fmu, system) == pytest.approx([20.0 if "20" in attributes else size])
        assert fmu.difference_steps(["T"], np.zeros(1)) < 1e-8 * size
        doubt = size_doubt(fmu, system, np.full((2, 1), 291.0))
    assert ("T is up to 291, taken for 1e-09" in doubt) == (size == 1e-9)
    with open_model(system) as fmu:  # whose scale of 10 K says more than a start
        assert (walks(fmu, system) == pytest.approx([2e-4 * size])) != stated


def test_a_time_event_that_stays_due_is_told(build):
    """At a sample, where no time is left for it to pass: the open loop did not end."""
    with (
        FMU(build("STUCK")) as fmu,
        pytest.raises(
            FMUError, match=r"more than 500 events at one time at 30 s of .*: time events"
        ),
    ):
        run(fmu, "open_loop", 100.0)


def test_a_derivative_that_is_lost_on_the_way_is_named_with_its_time(build):
    """The room is at 295 K after 473 s; it said that a step has no solution, or is too small."""
    drive = Drive(10.0 * np.arange(60.0), np.full((60, 1), 280.0))
    with FMU(build("RELAYS", flags=["-DLOST=295.0"])) as fmu:
        with pytest.raises(FMUError, match=r"came to a derivative of 'T' that is nan; at 47\d"):
            Simulation(fmu, ["Ta"], ["T"], [0.0]).run(drive, {})
        with pytest.raises(FMUError, match=r"no solution, with a derivative of 'T' that is nan"):
            run(fmu, "open_loop", 600.0)


def test_a_relay_that_chatters_is_told_with_what_switches_it(build):
    """At 295 K it heats and cools without end: from 291 K after 2000 s ln(19 / 15) = 472.8 s."""
    text = r"events between two samples at 472\.7.*: its event indicator 1 of 1 changes sign again"
    with FMU(build("THERMOSTAT", flags=["-DCHATTERS"])) as fmu, pytest.raises(FMUError, match=text):
        run(fmu, "open_loop", 600.0)


def test_an_fmu_of_neither_interface_is_refused_by_a_comparison(build, tmp_path):
    """As of scheduled execution alone; it was a traceback."""

    change = edits(XML, ('<ModelExchange modelIdentifier="Room"/>', ""))
    comparison = compare_with_fmpy(rewritten(build("RELAYS"), tmp_path / "None.fmu", change))
    assert (comparison.verdict, comparison.difference) == (REFUSED, None)
    assert "neither Model Exchange nor Co-Simulation" in comparison.reason


def test_a_jump_of_an_input_is_an_event_where_it_happens(build):
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


def test_whole_simulations_say_derivatives_through_events(build):
    """Of a thermostat, whose switching moves with the heat loss, against the closed form.

    The limit is that of their disagreement; single samples are on corners of T.
    """
    time = 10.0 * np.arange(361.0)
    with FMU(build("THERMOSTAT")) as fmu:
        simulation = Simulation(fmu, ["Ta"], ["T"], [False])
        drive, values = Drive(time, np.full((time.size, 1), 280.0)), {"G": 52.0, "T": 290.5}
        simulated = simulation.run(drive, values)[:, 0]
        by = simulation.derivatives(drive, values, [("G",), ("T",)], {"T": 1.0})
    assert simulated == pytest.approx(along("THERMOSTAT", time, 52.0, 290.5), abs=1e-4)
    for q, (G, T) in enumerate([(1e-3, 0.0), (0.0, 1e-3)]):
        up, down = (along("THERMOSTAT", time, 52.0 + s * G, 290.5 + s * T) for s in (1.0, -1.0))
        exact = (up - down) / 2e-3
        assert np.linalg.norm(by.values[:, 0, q] - exact) < 0.01 * np.linalg.norm(exact)
    assert (by.unsure == 0.0).all()


def test_whole_simulations_switch_at_the_sample_at_which_a_time_event_is(build):
    """Every tenth sample is one: the heating has switched there, as in the samples after it."""
    time = 60.0 * np.arange(41.0)
    with FMU(build("TIMETABLE")) as fmu:
        simulation = Simulation(fmu, ["Ta"], ["T", "P"], [False])
        simulated = simulation.run(Drive(time, np.full((time.size, 1), 280.0)), {})
    assert simulated[:, 0] == pytest.approx(along("TIMETABLE", time), abs=1e-4)
    assert (simulated[:, 1] == np.where(np.arange(41) // 10 % 2 == 0, 1500.0, 0.0)).all()


def test_a_parameter_is_fitted_through_events(build):
    """The heat loss of a room whose thermostat switches, from the closed form with noise."""
    folder = build("THERMOSTAT").parent
    text = machine_file("room_fmu/system.toml", correction="dG")
    noisy = 'Ta = { unit = "K", noise = "0.05 K"'
    (folder / "system.toml").write_text(text.replace(noisy, noisy.replace("0.05", "0")))
    system = load_system(folder)
    time = 20.0 * np.arange(60.0)
    noise = 0.05 * np.random.default_rng(1).standard_normal(time.size)
    columns = {"time [s]": time, "Ta [K]": np.full(time.size, 280.0)}
    columns["T [K]"] = along("THERMOSTAT", time, 60.0) + noise
    case = wb.case_from_frame(system, pd.DataFrame(columns))
    settings = wb.FitSettings(starts=1, profiles=False)
    outcome = wb.fit(system, [case], ["G"], settings=settings, workers=1, report=lambda line: None)
    low, high = outcome["G"].low, outcome["G"].high
    assert low is not None
    assert high is not None
    assert low < 60.0 < high
    assert high - low < 2.0


@pytest.mark.parametrize(
    ("warns", "message"),
    [(1, "T is above its table"), (2, "no message, but the status"), (3, "T is above its table")],
)
def test_what_the_fmu_warns_of_stands_at_the_top_of_each_answer(
    warns: int, message: str, build: Build
) -> None:
    """In compiled loops (ekf), in a loop in Python (open loop, with events), and in a fit."""
    system = load_system(build("THERMOSTAT", flags=[f"-DWARNS={warns}"]).parent)
    for estimator, step in (("ekf", 10.0), ("open_loop", 10.0), ("open_loop", 2.0)):
        time = step * np.arange(25.0)
        noise = 0.05 * np.random.default_rng(1).standard_normal((2, time.size))
        columns = {"time [s]": time, "Ta [K]": 280.0 + noise[0]}
        columns["T [K]"] = along("THERMOSTAT", time) + noise[1]
        if estimator == "ekf":
            columns["T [K]"] = 292.5 + noise[1]
        case = wb.case_from_frame(system, pd.DataFrame(columns))
        simulation = prepare(system, {estimator: estimators_of(system)[estimator]})
        result = simulation.run(case)
        first = result.warnings()[:1]
        if step == 2.0:  # not warm yet
            assert not any("warned" in text for text in first)
        else:
            assert re.fullmatch(rf"the FMU Room.fmu warned \d+ times, first: {message}.*", first[0])
    settings = wb.FitSettings(starts=1, profiles=False)
    case = wb.case_from_frame(system, pd.DataFrame(columns | {"T [K]": 293.0 + noise[1]}))
    outcome = wb.fit(system, [case], ["T"], settings=settings, workers=1, report=lambda line: None)
    assert re.search(rf"warned \d+ times, first: {message}", outcome.doubts[0])
    # A diagnosis runs an FMU around this one.
    around = system.source.parent / "Around.fmu"
    term = RateTerm("added", 0, CONSTANT, 1.0, "", 1.0, "", "a constant")
    write_extended(system.source.parent / "Room.fmu", around, [term], {}, {})
    with FMU(around) as fmu:
        fmu.start({"T": 293.0})
        fmu.derivatives()
        assert re.search(f"Around.fmu warned once: {message}", fmu.take_warning())


def test_an_fmu_that_bears_one_instance_alone_is_refused_with_that_word(build):
    """FMUs of Dymola 2016 crash in a second one; the first is as any, and FMPy runs it."""
    said = r"crashed with SIGABRT in fmi2Instantiate of a second instance, the first freed, after"
    with pytest.raises(FMUError, match=said):
        FMU(build("RELAYS", flags=["-DSINGLE"]))


def test_libraries_beside_the_binary_go_along_into_an_extended_fmu(tmp_path, build, monkeypatch):
    """As those of the solver that OpenModelica brings: a diagnosis ended where it needed them."""
    beside = tmp_path / "libbeside.so"
    linked = ["-shared", "-fPIC", f"-Wl,-soname,{beside.name}", "-x", "c", "/dev/null"]
    subprocess.run([str(COMPILER), *linked, "-o", beside], check=True)
    monkeypatch.setenv("LIBRARY_PATH", str(tmp_path))
    room = build("RELAYS", flags=["-Wl,--no-as-needed,-rpath,$ORIGIN", "-lbeside"])
    lacking = r"needs libbeside\.so, which this machine does not have.* install that library"
    with pytest.raises(InputError, match=lacking):
        FMU(room)
    with zipfile.ZipFile(room, "a") as archive:
        archive.write(beside, f"{BINARY}/{beside.name}")
    around = tmp_path / "Around.fmu"
    term = RateTerm("added", 0, CONSTANT, 1.0, "", 1.0, "", "a constant")
    write_extended(room, around, [term], {"added": 0.5}, {})
    with FMU(around) as fmu:  # alone: a library that is loaded is found by its name
        fmu.start({"T": 293.0})
        # It heats by 1500 W and loses 650 W, of 1e5 J/K; the term is added.
        assert fmu.derivatives()[0] == pytest.approx(850.0 / 1e5 + 0.5)


def test_a_stop_says_what_the_fmu_warns_of(build):
    """What falls to rest from 296 K is above its table at first, from 291.5 K it is not."""
    system = load_system(build("TIMETABLE", start=600.0, flags=["-DWARNS=1"]).parent)
    stopping = replace(stopping_of(TRAIN), state="T", longest=600.0)
    drive = DrivingInputs(np.zeros(1), np.zeros(1), np.zeros(1), np.full((1, 2), 280.0))
    with open_model(system) as fmu:
        for speed, begin, warns in ((293.0, 296.0, True), (290.0, 291.5, False)):
            simulation = StopSimulation(fmu, system, replace(stopping, rest=speed))
            stop = simulation.run(drive, {"T": begin})
            assert ("T is above its table" in stop.warned) == warns


@pytest.mark.parametrize(
    ("events", "recorded", "doubt"),
    [
        ("RELAYS", lambda T: 1000.0 * T, "T is about 1000 times what the model says, which runs"),
        ("THERMOSTAT", lambda T: 1000.0 * T, "T is about 1000 times what the model says"),
        ("RELAYS", lambda T: T - 273.15, "T is about 273.15 K below what the model says"),
        ("RELAYS", lambda T: T + 5.0, ""),
    ],
)
def test_another_unit_is_asked_about_where_the_model_says_no_start(events, recorded, doubt, build):
    """Of a heated room, through events or without. The scale is as wrong as the recording."""
    unsaid = VARIABLES.replace(' initial="exact"><Real start="291"/>', "><Real/>")
    file = build(events, variables=unsaid).parent / "system.toml"
    line = 'outputs.T = { unit = "K", noise = "0.05 K", scale = "'
    edit(file, (f"{line}10 K", f"{line}100000 K"))
    system, time = load_system(file), 10.0 * np.arange(60.0)
    noise = 0.05 * np.random.default_rng(1).standard_normal((2, time.size))
    columns = {"time [s]": time, "Ta [K]": 280.0 + noise[0]}
    columns["T [K]"] = recorded(exact(1500.0, time)) + noise[1]
    case = wb.case_from_frame(system, pd.DataFrame(columns))
    simulation = prepare(system, {"open_loop": estimators_of(system)["open_loop"]})
    warnings = [text for text in simulation.warnings(case) if "what the model says" in text]
    assert [text[: len(doubt)] for text in warnings] == [doubt] * bool(doubt)


def test_a_boolean_input_that_starts_as_a_word_is_0_and_1(build):
    """The recording of a system with one ended in a traceback; 1 K/s come with it for 10 s."""
    command = VARIABLES.replace(
        'name="flag" valueReference="1" causality="parameter" variability="fixed"',
        'name="flag" valueReference="1" causality="input" variability="discrete"',
    )
    file = build("RELAYS", variables=command).parent / "system.toml"
    line = 'inputs.flag = { unit = "1", noise = 0.0, scale = 1.0, held = true }'
    edit(file, ("outputs.T", f"{line}\noutputs.T"))
    system, time = load_system(file), 10.0 * np.arange(30.0)
    noise = 1e-4 * np.random.default_rng(1).standard_normal((2, time.size))
    columns = {"time [s]": time, "Ta [K]": 280.0 + noise[0], "flag [1]": 1.0 * (time == 30.0)}
    case = wb.case_from_frame(system, pd.DataFrame(columns | {"T [K]": 291.0 + noise[1]}))
    simulation = prepare(system, {"open_loop": estimators_of(system)["open_loop"]})
    heated = simulation.run(case).runs["open_loop"].signal("T")
    begun = exact(1500.0, 30.0)
    more = exact(1500.0, 10.0, begun) + 2000.0 * (1.0 - np.exp(-10.0 / 2000.0))
    assert heated[[3, 4]] == pytest.approx([begun, more], abs=0.01)
    with open_model(system) as fmu:  # it cannot read a little more than 1, which a diagnosis tried
        assert {e.sensor for e in candidates(fmu, system) if e.sensor} == {"Ta", "T"}


def test_derivatives_stop_at_limits_and_say_where_steps_disagree(build):
    """G may not fall below 50; a heating that jumps has no derivative by a start."""
    limited = VARIABLES.replace('<Real start="50"/>', '<Real start="50" min="50"/>')
    time = 10.0 * np.arange(361.0)
    drive = Drive(time, np.full((time.size, 1), 280.0))
    with FMU(build("THERMOSTAT", variables=limited)) as fmu:
        by = Simulation(fmu, ["Ta"], ["T"], [False]).derivatives(drive, {}, [("G",)])
        exact = (along("THERMOSTAT", time, 50.001) - along("THERMOSTAT", time)) / 1e-3
        assert np.linalg.norm(by.values[:, 0, 0] - exact) < 0.01 * np.linalg.norm(exact)
        heating = Simulation(fmu, ["Ta"], ["P"], [False]).derivatives(drive, {}, [("T",)])
        assert heating.unsure[0] > 0.5


def test_an_fmu_that_a_reset_does_not_reset_is_made_anew_for_each_run(build):
    time = 10.0 * np.arange(61.0)
    drive = Drive(time, np.full((time.size, 1), 280.0))
    with FMU(build("TIMETABLE", flags=["-DKEEPS"])) as fmu:
        simulation = Simulation(fmu, ["Ta"], ["T"], [False])
        for values in ({}, {"G": 60.0}, {}):
            expected = along("TIMETABLE", time, values.get("G", 50.0))
            assert simulation.run(drive, values)[:, 0] == pytest.approx(expected, abs=1e-4)


def test_the_open_loop_agrees_with_fmpy_through_events(build, capsys):
    """Of the timetable: FMPy ends a step before the thermostat compares T with 295 K."""
    path = build("TIMETABLE")
    assert main(["fmu", "compare", str(path), str(path.parent / "none.fmu")]) == 0
    rows = capsys.readouterr().out.splitlines()
    assert rows[0].startswith("| FMU | FMI | largest difference | verdict |")
    assert re.match(r"\| Room.fmu \| 2.0 \| \d.\de-0[678] of `[TP]` \| right \|", rows[2])
    assert "| refused: none.fmu: found no such file" in rows[3]


@pytest.mark.parametrize("limit", [291.10, 291.11, 291.12])
def test_the_open_loop_sees_rates_that_switch_without_an_indicator(limit, build):
    """At another share of a step each; a switch after the last evaluation was passed over."""
    assert compare_with_fmpy(build("RELAYS", flags=[f"-DBENDS={limit}"])).verdict == RIGHT


@pytest.mark.parametrize("name", ["ekf", "ukf", "mhe"])
def test_other_estimators_refuse_a_run_with_an_event(name, build):
    """At any sample; see also the last one, and a thermostat that is fed 291 K goes on."""
    with FMU(build("THERMOSTAT")) as fmu:
        assert np.isfinite(run(fmu, name, 100.0)).all()
    with FMU(build("TIMETABLE")) as fmu:
        assert np.isfinite(run(fmu, name, 100.0)).all()
        with pytest.raises(EventError, match=r"an event of the model by .* s of its time"):
            run(fmu, name, 900.0)


def consistency(law: Estimator, time: np.ndarray, truth: dict[str, np.ndarray], y: str) -> tuple:
    """Of four runs with noise: mean of normalised innovations squared, shares in 95 % bands."""
    noise, squares, inside = law.system.signals[y].noise, [], []
    at = [list(law.system.columns).index(name) for name in truth]
    for seed in range(4):
        noisy = truth[y] + noise * np.random.default_rng(seed).standard_normal(time.size)
        u = np.full((time.size, len(law.system.inputs)), 280.0)
        estimate = law.run(time, u, noisy[:, None])
        error = np.asarray(estimate.values)[1:, at] - np.column_stack(list(truth.values()))[1:]
        inside.append(np.abs(error) < 1.96 * np.asarray(estimate.sigma)[1:, at])
        squares.append(np.asarray(estimate.nis)[1:])
    return np.mean(squares), np.mean(inside, axis=(0, 1))


@pytest.mark.parametrize("name", ["ekf", "ukf"])
@pytest.mark.parametrize("events", ["THERMOSTAT", "TIMETABLE"])
def test_kalman_filters_go_through_events(events, name, build):
    """A heat loss of 60 W/K in place of 50, by the closed form; six events in an hour.

    Chi-squared of 1440 innovations to five standard deviations. Walks are declared, of which the
    room has none, so that bands are somewhat wide.
    """
    time = 10.0 * np.arange(361.0)
    truth = {"T": along(events, time, 60.0), "G": np.full(time.size, 60.0)}
    with FMU(build(events, saves=True)) as fmu:
        law = estimator(fmu, name)
        square, inside = consistency(law, time, truth, "T")
        assert not law.doubt
    assert square == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / 1440.0))
    assert (inside > 0.93).all()


@pytest.mark.parametrize("name", ["ekf", "mhe"])
def test_innovations_are_those_of_the_estimate_without_derivatives_of_the_fmu(name, build):
    """A thermometer of 1 mK that reads a state: 6e-6 of 291 K, a step of differences, is 1.7 mK.

    Outputs were read a step off, and so were estimates. What 50 samples tell is sure to 0.14 mK;
    the walk leaves less than as much again.
    """
    reading = 'name="reading" valueReference="0" causality="output"><Real/></ScalarVariable>'
    path = build("RELAYS", variables=f"{VARIABLES}<ScalarVariable {reading}")
    (path.parent / "system.toml").write_text(
        'title = "Room"\nsample_time = "10 s"\nmodels.observer = { fmu = "Room.fmu" }\n'
        'inputs.Ta = { unit = "K", noise = "0 K", scale = "10 K" }\n'
        'outputs.reading = { unit = "K", noise = "0.001 K", scale = "10 K" }\n'
        "states.T = { walk = 1e-6, spread = 0.01 }\n"
    )
    time = 10.0 * np.arange(201.0)
    noise = 1e-3 * np.random.default_rng(2).standard_normal(201)
    with FMU(path) as fmu:
        law = estimator(fmu, name)
        measured = (exact(1500.0, time) + noise)[:, None]
        estimate = law.run(time, np.full((201, 1), 280.0), measured)
    error = np.asarray(estimate.values)[50:, 0] - exact(1500.0, time)[50:]
    assert np.abs(error).max() < 5e-4


def fall(times: np.ndarray, g: float) -> np.ndarray:
    """Height and speed of a ball from 1 m that keeps 0.8 of its speed, from impact to impact."""
    rows, h, v, t = [], 1.0, 0.0, 0.0
    for sample in times:
        while (impact := t + (v + np.sqrt(v * v + 2.0 * g * h)) / g) <= sample:
            h, v, t = 0.0, 0.8 * np.sqrt(v * v + 2.0 * g * h), impact
        d = sample - t
        h, v, t = h + v * d - 0.5 * g * d * d, v - g * d, sample
        rows.append((h, v))
    return np.array(rows).T


@pytest.mark.parametrize("name", ["ekf", "ukf"])
def test_kalman_filters_go_through_impacts_that_reverse_a_speed(name, tmp_path, compiled):
    """Three impacts in two seconds; neither the speed nor gravity, 9.5 m/s2, is measured."""
    time = 0.01 * np.arange(200.0)
    h, v = fall(time, 9.5)
    with FMU(bouncing(tmp_path, compiled("ball.c"))) as fmu:
        law = estimator(fmu, name)
        truth = {"h": h, "v": v, "g": np.full(time.size, 9.5)}
        square, inside = consistency(law, time, truth, "h")
        assert not law.doubt
    assert square == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / 796.0))
    assert (inside > 0.93).all()


def test_states_that_change_at_an_event_without_a_word_are_read(tmp_path, compiled):
    """Some tools do not raise valuesOfContinuousStatesChanged: a ball fell through the ground."""
    time = 0.01 * np.arange(100.0)
    with FMU(bouncing(tmp_path, compiled("ball.c", "-DSAYS=fmi2False"))) as fmu:
        simulated = Simulation(fmu, [], ["h"], []).run(Drive(time, np.zeros((100, 0))), {})
    assert simulated[:, 0] == pytest.approx(fall(time, 9.81)[0], abs=1e-6)


def test_a_ball_that_jumps_ever_lower_comes_to_rest_on_the_ground(tmp_path, compiled):
    """It jumps up and is back between two looks at it: it fell through the ground, 172 m deep.

    Jumps are 20 cm/s and less from the 14th on, and over within 40 ms, the time between samples.
    """
    time = 0.04 * np.arange(250.0)
    with FMU(bouncing(tmp_path, compiled("ball.c", "-DRESTS=1e-3"))) as fmu:
        simulated = Simulation(fmu, [], ["h"], []).run(Drive(time, np.zeros((250, 0))), {})
    exact = np.maximum(thrown(time, 0.8)[0], 0.0)  # which ends with its 60th jump
    assert simulated[:, 0] == pytest.approx(exact, abs=1e-6)


def test_samples_too_far_apart_are_said_so_without_a_time_constant_where_there_is_none(
    tmp_path, compiled
):
    """A ball falls for 4 s from 100 m: of height and speed none follows from itself.

    The fastest time constant was said to be 4.5e+307 s.
    """
    path, time = bouncing(tmp_path, compiled("ball.c")), 0.2 * np.arange(21.0)
    text = machine_file("ball/system.toml").replace('spread = "0.5 m/s"', 'spread = "1 mm/s"')
    (tmp_path / "system.toml").write_text(text.replace('spread = "1 m/s2"', 'spread = "1 mm/s2"'))
    system, rng = load_system(tmp_path), np.random.default_rng(1)
    h = 100.0 - 0.5 * 9.81 * time**2 + 0.01 * rng.standard_normal(time.size)
    case = make_case("fallen", (time, {"h": h}), {}, system)
    with FMU(path) as fmu:
        doubt, _ = sampling_doubt(fmu, system, case)
    assert re.match(r"samples 0\.2 s apart do not resolve the model: with \d+ steps", doubt)


def test_what_derivatives_leave_in_an_fmu_is_not_read(tmp_path, compiled):
    """Dymola leaves its directions in variables: a spring constant had a slope of 1e4 times."""
    path = bouncing(tmp_path, compiled("ball.c"), ' providesDirectionalDerivative="true"')
    with FMU(path) as fmu:
        fmu.start({})
        model = instance(fmu, ["dg"], [], ["h", "v"])
        model.x[:] = 0.5, -3.0
        assert model.directional_fmi[0] == 2
        assert place(model) == linearise(model, 4) == read(model) == OK
        assert model.y.tolist() == [0.5, -3.0]
        assert model.jacobian.tolist() == [[0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 1.0]]


@pytest.mark.parametrize("moved", [[], ["G", "C"]])
def test_derivatives_are_compared_where_a_fit_may_move_parameters(moved, build):
    """Code may have its start values as numbers: only elsewhere they are wrong."""
    path = build("TIMETABLE", flags=["-DSTALE"])
    with zipfile.ZipFile(path) as archive:
        library = archive.read(f"{BINARY}/Room{fmpy.sharedLibraryExtension}")
        text = archive.read(XML).decode()
    offered = 'modelIdentifier="Room" providesDirectionalDerivative="true"/>'
    with zipfile.ZipFile(path, "w") as archive:
        comment = f"<!-- {moved} --></fmiModelDescription>"  # what is found is remembered by bytes
        text = text.replace("</fmiModelDescription>", comment)
        archive.writestr(XML, text.replace('modelIdentifier="Room"/>', offered))
        archive.writestr(f"{BINARY}/Room{fmpy.sharedLibraryExtension}", library)
    system, time = load_system(path.parent), 20.0 * np.arange(60.0)
    noise = 0.05 * np.random.default_rng(1).standard_normal((2, time.size))
    columns = {"time [s]": time, "Ta [K]": 280.0 + noise[0], "T [K]": 291.0 + noise[1]}
    case = wb.case_from_frame(system, pd.DataFrame(columns))
    with open_model(system) as fmu:
        check_along(fmu, system, case, moved=moved)
        assert fmu.has_directional_derivatives == (not moved)


def test_states_that_change_without_an_event_are_refused(build):
    """At the end of a step, where an integrator goes on with its own."""
    with FMU(build("RELAYS", flags=["-DMOVES"])) as fmu:
        with pytest.raises(FMUError, match=r"changes 'T' at the end of a step without an event"):
            run(fmu, "open_loop", 900.0)
        law, warm = estimator(fmu, "ekf"), np.full((9, 1), 296.0)
        with pytest.raises(FMUError, match=r"changes 'T' at the end of a step without an event"):
            law.run(10.0 * np.arange(9.0), warm - 16.0, warm)


def test_what_an_fmu_does_once_at_the_end_of_a_step_is_not_passed_over(build):
    """Compiled steps told it that the step was over; a second way through it had no jump, or event.

    From 291 K the room heats towards 310 K, and is at 295 K after 473 s.
    """
    drive = Drive(10.0 * np.arange(100.0), np.full((100, 1), 280.0))
    with (
        FMU(build("TIMETABLE", flags=["-DMOVES=2"])) as fmu,
        pytest.raises(FMUError, match=r"changes 'T' at the end of .* by 480 s of its time"),
    ):
        Simulation(fmu, ["Ta"], ["T"], [0.0]).run(drive, {})
    with FMU(build("FUSE", flags=["-DONCE"])) as fmu:
        simulated = Simulation(fmu, ["Ta"], ["T"], [0.0]).run(drive, {})[:, 0]
    hot = exact(1500.0, 480.0)
    right = np.where(
        drive.time <= 480.0, exact(1500.0, drive.time), exact(0.0, drive.time - 480.0, hot)
    )
    np.testing.assert_allclose(simulated, right, atol=1e-5)


def test_a_live_filter_hears_of_an_event_that_is_told_once(build):
    """A fuse that tells of itself at the end of one step alone: the room cools from there on."""
    time = 10.0 * np.arange(100.0)
    hot = exact(1500.0, 480.0)
    T = np.where(time <= 480.0, exact(1500.0, time), exact(0.0, time - 480.0, hot))
    y, u = T[:, None], np.full((time.size, 1), 280.0)
    with FMU(build("FUSE", flags=["-DONCE"], saves=True)) as fmu:
        law = estimator(fmu, "ekf")
        whole = law.run(time, u, y)
        estimate = law.init(0.0, u[0], y[0])
        for k in range(1, time.size):
            estimate = law.step(time[k], u[k], y[k])
        assert fmu.get(fmu.variables(["P"]))[0] == 0.0
    off = np.asarray(estimate.values) - np.asarray(whole.values)[-1]
    assert (np.abs(off) < 0.1 * np.asarray(estimate.sigma)).all()


@pytest.mark.parametrize("name", ["ekf", "ukf"])
@pytest.mark.parametrize(
    ("events", "flag", "text"),
    [
        ("THERMOSTAT", "-DFORGETS", "keeps more than its saved state holds"),
        ("TIMETABLE", "-DCONTROLS=2000.0", "what an event sets follows from states"),
    ],
)
def test_filters_refuse_discrete_states_that_they_do_not_know(events, flag, text, name, build):
    """A mode that a saved state has not, and a power that a sampled controller sets by states.

    Bands of 0.0016 about what was off by 0.02, and such that held the truth in 3 of 100 samples.
    """
    time = 10.0 * np.arange(181.0)
    y, u = along("THERMOSTAT", time, 55.0)[:, None], np.full((time.size, 1), 280.0)
    with FMU(build(events, flags=[flag], saves=True)) as fmu, pytest.raises(FMUError, match=text):
        estimator(fmu, name).run(time, u, y)


CONTINUOUS_POWER = VARIABLES.replace('variability="discrete"><Real/>', "><Real/>")


@pytest.mark.parametrize(
    ("flag", "message"),
    [
        ("-DLATE", "once a step is said to be over, without an event"),
        ("-DUNREAD", "before derivatives are read"),
    ],
)
def test_outputs_that_follow_other_calls_alone_are_refused(flag, message, build):
    """They were those of the sample before, or of a point within the step."""
    x, u = 291.0 + np.arange(3.0)[:, None], np.full((3, 1), 280.0)
    with FMU(build("TIMETABLE", variables=CONTINUOUS_POWER, flags=[flag])) as fmu:
        fmu.start({})
        with pytest.raises(NoFunctionError, match=rf"' is .* {message}"):
            fmu.require_function(["Ta"], ["P"], np.arange(3.0), x, u)


@pytest.mark.parametrize("saves", [False, True])
def test_a_model_that_remembers_steps_is_led_step_by_step_alone(saves, build):
    """A delay of 100 s in the heat loss: T = T0 + v t, from 100 s on less v G (t - 100 s)^2 / 2 C.

    Steps of a filter were told at times of other states: the open loop was off by 1.4 % of the
    range. A straight line between steps is exact for what is a straight line.
    """
    time = 10.0 * np.arange(20.0)
    speed = (1500.0 - 50.0 * 11.0) / 1e5
    exact = 291.0 + speed * time - 0.5 * speed * 5e-4 * np.maximum(time - 100.0, 0.0) ** 2
    u, y = np.full((20, 1), 280.0), exact[:, None]
    with FMU(build("RELAYS", flags=["-DDELAY=100.0"], saves=saves)) as fmu:
        assert fmu.remembers_steps
        loop = estimator(fmu, "open_loop").run(time, u, y)
        simulated = Simulation(fmu, ["Ta"], ["T"], [0.0]).run(Drive(time, u), {})
        with (
            pytest.raises(EventError, match="follow from earlier steps")
            if not saves
            else (nullcontext())
        ):
            filtered = np.asarray(estimator(fmu, "ekf").run(time, u, y).values)[:, 0]
            np.testing.assert_allclose(filtered, exact, atol=1e-3)
    np.testing.assert_allclose(np.asarray(loop.values)[:, 0], exact, atol=1e-6)
    np.testing.assert_allclose(simulated[:, 0], exact, atol=1e-6)


def test_rates_that_the_end_of_a_later_step_changes_are_refused(build):
    with (
        FMU(build("RELAYS", flags=["-DLATER"])) as fmu,
        pytest.raises(FMUError, match=r"changes the derivative of 'T' without an event at 60 s"),
    ):
        run(fmu, "open_loop", 100.0)


def test_a_run_that_draws_random_numbers_is_refused(build):
    with FMU(build("RELAYS", flags=["-DRANDOM"])) as fmu:
        with pytest.raises(FMUError, match="gives other results when it is repeated"):
            run(fmu, "open_loop", 100.0)
        with pytest.raises(EventError, match="follow from earlier steps"):
            run(fmu, "ukf", 100.0)


def test_an_output_that_is_no_number_at_the_start_is_named(build):
    """A fit ended with a traceback of its linear algebra."""
    folder = build("FUSE", flags=["-DUNKNOWN"]).parent
    own = 'outputs.P = { unit = "W", noise = "5 W", scale = "500 W" }\n[estimated'
    text = (folder / "system.toml").read_text().replace("[estimated", own)
    (folder / "system.toml").write_text(text)
    system, time = load_system(folder), 10.0 * np.arange(361.0)
    noise = np.random.default_rng(1).standard_normal((2, 361))
    frame = {"time [s]": time, "Ta [K]": 280.0 + 0.05 * noise[0]}
    frame |= {"T [K]": exact(0.0, time) + 0.05 * noise[1]}
    frame |= {"P [W]": 50.0 * (280.0 - exact(0.0, time)) + 5.0 * noise[0]}
    case = wb.case_from_frame(system, pd.DataFrame(frame))
    settings = wb.FitSettings(starts=1, profiles=False)
    with pytest.raises(InputError, match=r"'P' is no finite number \(nan\) at 0 s of"):
        wb.fit(system, [case], ["G"], settings=settings, workers=1, report=lambda line: None)


def test_a_switch_in_code_that_remembers_is_refused_along_a_recording(build):
    """A thermostat that no event tells: filters and simulations would switch it off their way."""
    folder = build("FUSE", flags=["-DHIDDEN"]).parent
    system, time = load_system(folder), 10.0 * np.arange(361.0)
    noise = 0.05 * np.random.default_rng(1).standard_normal((2, 361))
    inside = along("THERMOSTAT", time) + noise[1]
    frame = {"time [s]": time, "Ta [K]": 280.0 + noise[0], "T [K]": inside}
    case = wb.case_from_frame(system, pd.DataFrame(frame))
    settings = wb.FitSettings(starts=1, profiles=False)
    message = r"'der\(T\)' is .* the model remembers calls, and no event tells it"
    with pytest.raises(FMUError, match=message):
        wb.fit(system, [case], ["G"], settings=settings, workers=1, report=lambda line: None)
    with pytest.raises(FMUError, match=message):
        wb.diagnose(system, [case, case], effects=["G"], workers=1, report=lambda line: None)
    with pytest.raises(FMUError, match=message):
        wb.tune(system, "ekf", [case], workers=1, report=lambda line: None)
    for name in ("open_loop", "ekf"):
        run = wb.observe(system, case, name)
        assert re.search(message, run.message)
        assert np.isnan(run.estimate).all()


def test_inputs_of_whole_numbers_act_in_whole_simulations(build):
    """Without discrete variables too: compiled steps passed over 1 K/s from 20 s to 40 s."""
    command = VARIABLES.replace(
        'name="flag" valueReference="1" causality="parameter" variability="fixed"',
        'name="flag" valueReference="1" causality="input"',
    ).replace('variability="discrete"><Real/>', "><Real/>")
    time = 10.0 * np.arange(7.0)
    u = np.column_stack([np.full(7, 280.0), (time >= 20.0) & (time < 40.0)])
    with FMU(build("RELAYS", variables=command)) as fmu:
        simulated = Simulation(fmu, ["Ta", "flag"], ["T"], [0.0, 0.0]).run(Drive(time, u), {})
    heated = exact(1500.0 + 1e5, 20.0, begin=exact(1500.0, 20.0))
    assert simulated[4, 0] == pytest.approx(heated, abs=1e-4)


@pytest.mark.parametrize("saves", [True, False])
@pytest.mark.parametrize("model", ["THERMOSTAT", "DELAY", "arrays"])
def test_the_check_says_of_each_use_what_commands_do(model, saves, build, arrays, capsys):
    """Events, a delay, states that are arrays; whatever has no Co-Simulation has no solver."""
    if model == "arrays":
        path, u, y = arrays(), "u[2]", "y[2]"
    else:
        flags = ["-DDELAY=100.0"] * (model == "DELAY")
        events = "RELAYS" if flags else model
        path, u, y = build(events, saves=saves, flags=flags), "Ta", "T"
    assert main(["fmu", "check", str(path), "--instantiations", "3", "--json"]) == 1
    possible = json.loads(capsys.readouterr().out)["result"]["uses"]
    assert not possible["fit and diagnosis"]
    assert possible["tools that use its own solver"] == ["Co-Simulation"]
    assert bool(possible["tools that roll back"]) != (saves and model != "arrays")
    system = load_system(path.parent)
    time = system.sample_time * np.arange(200.0)
    measured = along("THERMOSTAT", time) if model == "THERMOSTAT" else 291.0 + 0.0 * time
    uses = {
        "open_loop": "open loop",
        "ekf": "ekf and ukf on recordings",
        "mhe": "other observers on recordings",
    }
    with FMU(path) as fmu:
        assert Simulation(fmu, [u], [y], [1.0]).run(Drive(time, np.zeros((200, 1))), {}).size
        for name, use in uses.items():
            try:
                estimator(fmu, name).run(time, np.full((200, 1), 280.0), measured[:, None])
                runs = True
            except (FMUError, InputError):
                runs = False
            assert runs != bool(possible[use]), use


@pytest.mark.parametrize("flag", ["-DFULL=291.0", "-DINTEGRATES"])
def test_the_check_bears_a_full_vessel_and_one_that_integrates_alone(flag, build):
    """It starts at the end of its table; or nothing follows from its state, and nobody says so."""
    findings = check(build("RELAYS", flags=[flag]), 3)
    assert [f.name for f in findings if f.passed is False] == []


def bouncing(folder: Path, library: Path, able: str = "") -> Path:
    """The FMU of a ball, with more that it is able to, and its system file beside it."""
    described = machine_file("ball/modelDescription.xml").replace(
        "<ModelExchange", f"<ModelExchange{able}"
    )
    with zipfile.ZipFile(folder / "Ball.fmu", "w") as archive:
        archive.writestr(XML, described)
        archive.write(library, f"{BINARY}/Ball{fmpy.sharedLibraryExtension}")
    (folder / "system.toml").write_text(machine_file("ball/system.toml"))
    return folder / "Ball.fmu"


def thrown(time: np.ndarray, restitution: float) -> tuple[np.ndarray, np.ndarray]:
    """Height and speed of the ball from 1 m, by its parabolas, (n,) each."""
    first = np.sqrt(2.0 / 9.81)
    flights = 2.0 * first * restitution ** np.arange(1.0, 60.0)
    begins = first + np.append(0.0, np.cumsum(flights))
    number = np.searchsorted(begins, time, side="right")  # of throws before
    since = time - np.append(-first, begins)[number]
    speed = 9.81 * first * restitution**number
    return speed * since - 0.5 * 9.81 * since**2, speed - 9.81 * since


def test_a_fit_of_what_jumps_reaches_the_noise_and_its_interval_holds_the_truth(tmp_path, compiled):
    """A throw at the sample before is off by 100 deviations: squares alone kept it there."""
    bouncing(tmp_path, compiled("ball.c"))
    read = 'outputs.v = { unit = "m/s", noise = "5 cm/s", scale = "5 m/s" }'
    text = machine_file("ball/system.toml").replace('reported = ["v"]', read)
    (tmp_path / "system.toml").write_text(text.replace("1 cm", "3 mm"))
    system, rng, time = wb.load_system(tmp_path), np.random.default_rng(1), 0.005 * np.arange(481)
    h, v = thrown(time, 0.72)
    read_ = {"h": h + 3e-3 * rng.standard_normal(481), "v": v + 0.05 * rng.standard_normal(481)}
    case = make_case("thrown", (time, read_), {}, system)
    outcome = wb.fit(system, [case], ["e"], settings=wb.FitSettings(starts=1, profiles=False))
    restitution = outcome.values[0]
    assert outcome.doubts == ()
    assert restitution.low < 0.72 < restitution.high
    assert restitution.high - restitution.low < 1e-3


@pytest.mark.parametrize("name", ["ekf", "ukf"])
def test_a_filter_that_does_not_know_when_a_thermostat_switches_says_so(name, build):
    """A sensor of 0.3 K: the room takes three samples or more to change by what is not known."""
    folder = build("THERMOSTAT", saves=True).parent
    system = load_system(folder)
    (outside,), (inside,) = system.inputs, system.outputs
    exact, poor = replace(outside, noise=0.0, held=True), replace(inside, noise=0.3)
    system = replace(system, inputs=(exact,), outputs=(poor,))
    time = 10.0 * np.arange(361.0)
    noisy = along("THERMOSTAT", time, 60.0) + 0.3 * np.random.default_rng(1).standard_normal(361)
    # A command that jumps at each sample, and is no event of the model.
    jumps = 280.0 + 1e-3 * (-1.0) ** np.arange(361)
    columns = {"time [s]": time, "Ta [K]": jumps, "T [K]": noisy}
    result = prepare(system, choose(system, [name])).run(
        wb.case_from_frame(system, pd.DataFrame(columns))
    )
    assert any(f"{name} does not know at which sample" in warning for warning in result.warnings())


def test_a_filter_beside_a_running_machine_goes_on_through_events(build):
    """Sample by sample, a model without events until the first one, then as over a recording."""
    time = 10.0 * np.arange(361.0)
    y, u = along("THERMOSTAT", time, 60.0)[:, None], np.full((time.size, 1), 280.0)
    with FMU(build("THERMOSTAT", saves=True)) as fmu:
        law = estimator(fmu, "ekf")
        whole = law.run(time, u, y)
        estimate = law.init(0.0, u[0], y[0])
        for k in range(1, time.size):
            estimate = law.step(time[k], u[k], y[k])
    off = np.asarray(estimate.values) - np.asarray(whole.values)[-1]
    assert (np.abs(off) < 0.1 * np.asarray(estimate.sigma)).all()


@pytest.mark.parametrize("name", ["disturbance_observer", "mhe", "smoother"])
def test_what_does_not_go_through_events_says_so_of_an_fmu_that_saves_its_state_too(name, build):
    wrong = "results of other estimators would be wrong"
    with FMU(build("TIMETABLE", saves=True)) as fmu, pytest.raises(EventError, match=wrong):
        run(fmu, name, 900.0)


@pytest.mark.parametrize(
    ("events", "flags", "status", "message"),
    [
        ("TIMETABLE", [], 1, "it has events, which disturbance_observer does not go through"),
        ("RELAYS", ["-DWARNS=1"], 0, "day: the FMU Room.fmu warned "),
    ],
)
def test_a_tuning_tells_events_that_it_does_not_go_through_and_what_the_fmu_warns_of(
    events, flags, status, message, build, tmp_path, capsys
):
    folder = build(events, saves=True, flags=flags).parent
    (folder / "day").mkdir()
    time = 10.0 * np.arange(91.0)
    columns = {"time [s]": time, "Ta [K]": 280.0 + 0.0 * time, "T [K]": along("TIMETABLE", time)}
    if events == "RELAYS":
        columns["T [K]"] = exact(1500.0, time)
    columns["G [W/K]"] = 50.0 + 0.0 * time
    pd.DataFrame(columns).to_csv(folder / "day" / "measured.csv", index=False)
    (folder / "day" / "case.toml").write_text('title = "day"\nmeasurement.file = "measured.csv"\n')
    file, line = folder / "system.toml", 'G = { unit = "W/K", noise = "1 W/K", scale = "50 W/K" }'
    edit(file, ("[est", f"reference_signals.{line}\n[est"))
    options = ["--system", folder, "--cases", folder / "day", "--workers", "1", "--quiet"]
    out = ["--out", tmp_path / "tuned", "--budget", "2"]
    assert main(["tune", "disturbance_observer", *map(str, [*options, *out])]) == status
    printed = capsys.readouterr()
    assert message in printed.out + printed.err


def test_the_open_loop_goes_on_where_a_model_asks_for_event_mode_that_has_no_indicators(build):
    """The fuse blows after 470 s, at 295 K, which only the end of a step of 10 s tells."""
    with FMU(build("FUSE")) as fmu:
        estimated = run(fmu, "open_loop", 1000.0)
    late = np.abs(exact(0.0, 10.0, begin=295.0) - exact(1500.0, 10.0, begin=295.0))
    expected = along("FUSE", 10.0 * np.arange(estimated.size))
    assert estimated == pytest.approx(expected, abs=late)
    assert estimated[-1] < 293.0


@pytest.mark.parametrize("events", ["THERMOSTAT", "FUSE"])
def test_the_last_sample_may_not_be_beyond_an_event(events, build):
    with FMU(build(events)) as fmu:
        fmu.start({})
        fmu.set_states(np.array([296.0]))
        with pytest.raises(EventError, match=r"an event of the model.*asks for Event Mode"):
            fmu.check_event()


def test_time_begins_where_the_model_says_and_is_set_at_each_sample(build):
    with FMU(build("TIMETABLE", start=550.0)) as fmu:
        fmu.start({})
        assert fmu.next_event[0] == 600.0
        run(fmu, "open_loop", 50.0)
        assert fmu.time[0] == 600.0
        with pytest.raises(FMUError, match="an event of the model by 600 s"):
            run(fmu, "ekf", 60.0)


def test_parameters_are_set_by_their_type_where_references_repeat(build):
    with FMU(build("RELAYS"), parameters={"mode": 1.0, "flag": 1.0}) as fmu:
        fmu.start({})
        assert fmu.get_states()[0] == 291.0
        assert fmu.derivatives()[0] == pytest.approx((3000.0 - 50.0 * 11.0) / 1e5 + 1.0)
        # 2^32 + 1 would be 1 in 32 bits.
        for name, value in (
            ("mode", 0.5),
            ("flag", 2.0),
            ("mode", 2.0**32 + 1.0),
            ("mode", np.nan),
        ):
            with pytest.raises(InputError, match=f"variable '{name}'.*found the value"):
                fmu.start({}, {name: value})
        with pytest.raises(InputError, match="found a variable of type Integer"):
            fmu.variables(["mode"])


def test_an_enumeration_takes_its_items_alone(build):
    """It has holes: of `off`, 0, and `boost`, 2, the value 1 is none, and was set all the same."""
    mode = '<Enumeration declaredType="Mode" start="0"/>'
    with FMU(build("RELAYS", variables=VARIABLES.replace('<Integer start="0"/>', mode))) as fmu:
        fmu.start({}, {"mode": 2.0})
        with pytest.raises(InputError, match="found the value 1; expected 0, 2, an item"):
            fmu.start({}, {"mode": 1.0})


SWITCHED = VARIABLES.replace(
    'name="flag" valueReference="1" causality="parameter" variability="fixed"',
    'name="flag" valueReference="1" causality="input" variability="discrete"',
).replace(
    'name="mode" valueReference="0" causality="parameter" variability="fixed"><Integer start="0"/>',
    'name="mode" valueReference="0" causality="output" variability="discrete"><Integer/>',
)


def test_the_open_loop_sets_discrete_inputs_at_events_and_reads_whole_numbers(build):
    """A Boolean input that adds 1 K/s from 20 s to 40 s; an Integer output that says 10 or 11."""
    file = build("RELAYS", variables=SWITCHED).parent / "system.toml"
    text = file.read_text().partition("[estimated.G]")[0]
    text += 'inputs.flag = { unit = "1", noise = 0.0, scale = 1.0 }\n'
    file.write_text(text + 'outputs.mode = { unit = "1", noise = 0.5, scale = 1.0 }\n')
    system = load_system(file)
    time = np.arange(0.0, 65.0, 10.0)
    on = (time >= 20.0) & (time < 40.0)
    u, y = np.column_stack([np.full(time.size, 280.0), on]), np.full((time.size, 2), np.nan)
    with open_model(system) as fmu:
        kinds = estimators_of(system)
        loop = kinds["open_loop"](fmu, system, usual_gains(kinds["open_loop"], fmu, system))
        values = np.asarray(loop.run(time, u, y).values)
        with pytest.raises(InputError, match=r"a discrete input|of type (Boolean|Integer)"):
            kinds["ukf"](fmu, system, usual_gains(kinds["ukf"], fmu, system))
    assert list(system.columns) == ["T", "mode"]
    before = exact(1500.0, 20.0)
    heated = exact(1500.0 + 1e5, 20.0, begin=before)
    after = exact(1500.0, 20.0, begin=heated)
    assert values[[2, 4, 6], 0] == pytest.approx([before, heated, after], abs=1e-4)
    assert values[:, 1].tolist() == [10, 10, 11, 11, 10, 10, 10]


def test_filters_are_not_offered_for_a_model_with_a_switch_as_input(build, tmp_path, capsys):
    """`fmu check` found it fit for them, and `new` recommended what refused it."""
    path = build("RELAYS", variables=SWITCHED)
    assert main(["fmu", "check", str(path), "--instantiations", "5"]) == 1
    shown = capsys.readouterr().out
    assert "ekf and ukf on recordings: no, for real inputs" in shown
    assert "fit and diagnosis: it would do" in shown
    log = tmp_path / "log.csv"
    rows = [f"{10 * k},{280 + k % 2},{290 + 0.1 * k:.3f},{k % 3 > 1:d}" for k in range(60)]
    log.write_text("\n".join(["time [s],Ta [K],T [K],flag", *rows]))
    folder = tmp_path / "new"
    assert main(["new", str(folder), "--fmu", str(path), "--recordings", str(log), "--yes"]) == 0
    (following,) = re.findall(r"next: (.*)", capsys.readouterr().out)
    assert following.endswith("--estimator open_loop")
    assert main([*following.split()[1:], "--out", str(tmp_path / "out")]) in (0, 1)


@pytest.mark.parametrize(
    ("correction", "message"),
    [
        ("C", "'C', which is a fixed variable of causality parameter"),
        ("G", "'G', which is an estimated quantity"),
        ("P", "'P', which is a discrete variable of causality output"),
        ("Ta", "'Ta', which is a measured input"),
        ("T", "'T', which is a measured output"),
    ],
)
def test_a_correction_is_an_input_of_its_own(correction, message, build):
    path = build("RELAYS", correction=correction)
    with FMU(path) as fmu, pytest.raises(InputError, match=f"correction: found {message}"):
        estimator(fmu, "ekf")


def test_compiled_code_gets_samples_of_the_size_that_it_needs(build):
    with FMU(build("RELAYS")) as fmu:
        filter_ = estimator(fmu, "ekf")
        time, single, double = np.arange(5.0), np.zeros((5, 1)), np.zeros((5, 2))
        for u, y in ((double, single), (single[:4], single), (single, single[:4])):
            with pytest.raises(ValueError, match="samples of shape"):
                filter_.run(time, u, y)


@pytest.mark.parametrize("reference", [2, 3])
def test_a_correction_that_is_another_variable_by_its_reference_is_refused(reference, build):
    """That of Ta, and of G: the estimate would add what overwrote G."""
    shared = VARIABLES.replace(
        'name="dG" valueReference="4"', f'name="dG" valueReference="{reference}"'
    )
    file = build("RELAYS", variables=shared).parent / "system.toml"
    with pytest.raises(InputError, match=f"another name of '(Ta|G)'.*reference {reference}"):
        load_system(file)


def test_values_outside_of_the_ranges_of_the_model_are_refused(build):
    limited = VARIABLES.replace('<Integer start="0"/>', '<Integer start="0" max="3"/>')
    file = build("RELAYS", variables=limited).parent / "system.toml"
    text = file.read_text()
    for value, refused in ((3, False), (4, True), (-1, False)):
        file.write_text(f"{text}[parameters]\nmode = {value}.0\n")
        with (
            pytest.raises(InputError, match="mode = 4; expected -inf to 3")
            if refused
            else nullcontext()
        ):
            load_system(file)


@pytest.mark.parametrize(
    ("causality", "interval", "message"),
    [
        ("input", "constant", "input clocks, tick"),
        ("input", "triggered", "input clocks, tick"),
        ("local", "countdown", "a clock 'tick' that follows time and is no input"),
    ],
)
def test_a_model_with_clocks_is_refused(causality, interval, message, tmp_path):
    """Equations that wait for them would stand still; those of time FMI has as inputs alone."""
    clock = f'<Clock name="tick" valueReference="5" causality="{causality}" '
    clock += f'intervalVariability="{interval}"/></ModelVariables>'
    text = machine_file("arrays_fmu/modelDescription.xml").replace("</ModelVariables>", clock)
    with zipfile.ZipFile(tmp_path / "Clocked.fmu", "w") as archive:
        archive.writestr(XML, text)
    with pytest.raises(InputError, match=f"found {message}"):
        FMU(tmp_path / "Clocked.fmu")


def recorded(folder: Path, outside: str = "Ta", inside: str = "T") -> Path:
    """A recording of ten minutes at 280 K outside; returns its folder."""
    case = folder / "cases" / "one"
    case.mkdir(parents=True)
    (case / "case.toml").write_text('title = "x"\n[measurement]\nfile = "measured.csv"\n')
    rows = "".join(f"{10 * k},280,{291 + 0.05 * (-1) ** k:.2f}\n" for k in range(61))
    (case / "measured.csv").write_text(f"time [s],{outside} [K],{inside} [K]\n{rows}")
    return case


def renamed_system(path: Path) -> Path:
    """The system of the room with names of its own, no class; returns the file."""
    file = path.parent / "system.toml"
    text = machine_file("room_fmu/system.toml", correction="more").replace('class = "Room", ', "")
    text = text.replace("inputs.Ta = {", 'inputs.outside = { variable = "Ta",')
    text = text.replace("outputs.T = {", "outputs.inside = { variable = 'T',")
    text = text.replace(
        "[estimated.G]", '[variables]\nmore = "dG"\n[estimated.loss]\nvariable = "G"'
    )
    file.write_text(text.replace('acts_on = "T"', 'acts_on = "inside"'))
    return file


def test_a_system_file_gives_variables_names_of_its_own(build):
    path = build("RELAYS")
    time, u, y = np.arange(0.0, 605.0, 10.0), np.full((61, 1), 280.0), np.full((61, 1), 291.0)
    with FMU(path) as fmu:
        plain = estimator(fmu, "ekf").run(time, u, y).values
    system = load_system(renamed_system(path))
    assert list(system.columns) == ["inside", "more", "loss"]
    with open_model(system) as fmu:
        chosen = estimators_of(system)["ekf"]
        renamed = chosen(fmu, system, usual_gains(chosen, fmu, system)).run(time, u, y).values
    np.testing.assert_array_equal(plain, renamed)


@pytest.mark.parametrize(
    ("line", "match"),
    [
        ('variable = "Tx"', r"no variable 'Tx'.*'inside'"),
        ('variable = "Ta"', r"\[outputs.inside\] variable: found 'Ta' for 'inside', after"),
    ],
)
def test_a_name_that_the_fmu_has_not_or_that_is_taken_is_refused(line, match, build):
    file = renamed_system(build("RELAYS"))
    edit(file, ("variable = 'T'", line))
    with pytest.raises(InputError, match=match):
        load_system(file)


def test_a_variable_with_a_name_of_its_own_is_not_called_as_the_fmu_calls_it_too(build):
    """The FMU was said to have no such variable."""
    file = renamed_system(build("RELAYS"))
    again = 'outputs.T = { unit = "K", noise = "0.05 K", scale = "10 K" }\noutputs.inside = {'
    edit(file, ("outputs.inside = {", again))
    with pytest.raises(InputError, match=r"'T', a variable .* called 'inside' there as well"):
        open_model(load_system(file)).__enter__()


def test_names_of_a_system_file_may_come_from_the_command_line(build, capsys):
    """The file has none of the FMU's names: they are known before its variables are looked up."""
    file = renamed_system(build("RELAYS"))
    text = file.read_text().replace('variable = "Ta",', "").replace("variable = 'T',", "")
    file.write_text(text.replace('variable = "G"', "").replace('[variables]\nmore = "dG"\n', ""))
    with pytest.raises(InputError, match=r"write variable = 'NAME' in the table of 'outside'"):
        load_system(file)
    case = recorded(file.parent, "outside", "inside")
    names = {"outside": "Ta", "inside": "T", "loss": "G", "more": "dG"}
    options = [part for name in names.items() for part in ("--map", "=".join(name))]
    arguments = ["simulate", "--system", file, case, "--estimator", "open_loop", "--workers", "1"]
    out = file.parent / "out"
    assert main([*map(str, arguments), *options, "--out", str(out)]) == 0
    assert "open_loop.inside [K]" in (out / "one.csv").read_text()
    capsys.readouterr()


@pytest.mark.parametrize(
    ("flag", "message"),
    [
        ("-DWARNS=1", r"one: the FMU Room.fmu warned \d+ times, first: T is"),
        ("-DLOST=292.0", r"no solution, with a derivative of 'T' that is nan; at 10 s"),
    ],
)
def test_observability_says_where_the_fmu_leaves_its_table(flag, message, build, capsys):
    path = build("RELAYS", flags=[flag])
    file = recorded(path.parent) / "measured.csv"
    edit(file, (",291.", ",293."))  # K: half are above its table
    given = ["--system", path.parent / "system.toml", "--out", path.parent / "out"]
    status = main(["observability", *map(str, [file.parent, *given])])
    printed = capsys.readouterr()
    assert status == int("LOST" in flag)
    assert re.search(message, printed.out + printed.err)


def test_an_estimator_that_meets_an_event_at_once_leaves_the_others(build, capsys):
    """The heating goes off 5 s after the first sample."""
    path = build("TIMETABLE", start=595.0)
    out, names = path.parent / "out", ("open_loop", "disturbance_observer")
    given = ["--system", path.parent / "system.toml", recorded(path.parent), "--out", out]
    chosen = [part for name in names for part in ("--estimator", name)]
    assert main(["simulate", *map(str, given), *chosen, "--workers", "1"]) == 1
    assert "open_loop.T [K]" in (out / "one.csv").read_text()
    assert "disturbance_observer estimated nothing" in capsys.readouterr().err


def test_a_recording_says_where_its_time_begins_for_the_model(build):
    """From 550 s of the timetable on, the heating goes off after 50 s, else after 600 s."""
    path = build("TIMETABLE")
    case = recorded(path.parent)
    system = load_system(path.parent)
    with open_model(system) as fmu:
        loop = estimators_of(system)["open_loop"]
        values = {}
        for begin in ("", 'model_time = "550 s"\n', ""):
            text = (case / "case.toml").read_text().partition("model_time")[0]
            (case / "case.toml").write_text(text + begin)
            run = replay(read_case(case, system), loop(fmu, system, usual_gains(loop, fmu, system)))
            values[begin] = run.signal("T")[[5, 20]]
    heated = exact(1500.0, 50.0, begin=291.05)
    assert values[""] == pytest.approx([heated, exact(1500.0, 200.0, begin=291.05)], abs=1e-4)
    off = exact(0.0, 150.0, begin=heated)
    assert values['model_time = "550 s"\n'] == pytest.approx([heated, off], abs=1e-4)


def test_a_new_system_file_quotes_names_with_other_letters(build, tmp_path):
    """The file that `new` had written was no TOML, and the command ended with that."""
    path = build("RELAYS", variables=VARIABLES.replace('name="T"', 'name="Fühler T"'))
    log = recorded(tmp_path, inside="Fühler T") / "measured.csv"
    options = ["new", path.parent / "new", "--fmu", path, "--recordings", log, "--yes", "--quiet"]
    assert main([*map(str, options)]) == 0
    assert [output.name for output in load_system(path.parent / "new").outputs] == ["Fühler_T"]


@pytest.mark.parametrize(
    ("header", "asked"),
    [
        ("T rel [Pa]", "is a pressure above that of the air"),
        ("T [Paa]", "is a pressure above a vacuum"),
        ("T [0.1 Pa]", "may be a unit of 0.1 Pa"),
        ("T [Pa]", ""),
    ],
)
def test_a_new_system_asks_what_a_channel_leaves_open(header, asked, build, tmp_path, capsys):
    pressure = VARIABLES.replace('<Real start="291"/>', '<Real start="291" unit="Pa"/>')
    path, log = build("RELAYS", variables=pressure), recorded(tmp_path) / "measured.csv"
    edit(log, ("T [K]", header))
    options = ["new", path.parent / "new", "--fmu", path, "--recordings", log, "--yes", "--quiet"]
    assert main([*map(str, options)]) == 0
    text = (path.parent / "new" / "system.toml").read_text()
    questions = re.findall("QUESTION: T: (.*)", text)
    assert [asked in question for question in questions] == [True] * bool(asked)


UNITS = "<UnitDefinitions>{}</UnitDefinitions><TypeDefinitions>"
RISE = '<SimpleType name="Rise"><Real relativeQuantity="true" unit="K"/></SimpleType>'


@pytest.mark.parametrize(
    ("attributes", "units", "size"),
    [
        ('unit="K"', "", 273.15),
        ('unit="K" relativeQuantity="true"', "", 0.0),
        ('declaredType="Rise"', "", 0.0),
        ('declaredType="Rise" relativeQuantity="false"', "", 273.15),
        (
            'unit="m"',
            '<Unit name="m"><BaseUnit m="1" factor="0.001"/></Unit>',
            "defines as 0.001 m",
        ),
        (
            'unit="K"',
            '<Unit name="K"><BaseUnit K="1" offset="273.15"/></Unit>',
            "zero the model defines at 273.15 K",
        ),
        ('unit="N"', '<Unit name="N"><BaseUnit kg="1" m="1" s="-2" factor="1000"/></Unit>', "1000"),
        ('unit="rpm"', '<Unit name="rpm"><BaseUnit s="-1" factor="0.016667"/></Unit>', 0.0),
    ],
)
def test_units_are_what_the_model_says_of_them(attributes, units, size, build, tmp_path, capsys):
    """A difference of 6 degC is one of 6 K; millimetres that are called m are none."""
    variables = VARIABLES.replace('<Real start="291"/>', f'<Real start="291" {attributes}/>')
    template = machine_file(
        "room_fmu/modelDescription.xml", count=0, start=0.0, variables=variables
    )
    described = template.replace("<TypeDefinitions>", UNITS.format(units) + RISE)

    def change(folder: Path) -> None:
        (folder / XML).write_text(described)

    path = rewritten(build("RELAYS"), tmp_path / "Other.fmu", change)
    log = recorded(tmp_path) / "measured.csv"
    header = f"T [{attributes[6:-1]}]" if units else "T [degC]"
    edit(log, ("T [K]", header))
    options = ["new", tmp_path / "new", "--fmu", path, "--recordings", log, "--yes", "--quiet"]
    assert main([*map(str, options)]) == (2 if isinstance(size, str) else 0)
    if isinstance(size, str):
        assert size in capsys.readouterr().err
    else:
        (output,) = load_system(tmp_path / "new").outputs
        largest = pd.read_csv(log)[header].max()
        assert output.scale == pytest.approx(largest + size, rel=1e-3)


@pytest.mark.parametrize(
    ("declared", "unit", "remedy"),
    [("%", "1", "unit = '%'"), ("degC", "K", "unit = '1'"), ("bar", "Pa", "unit = 'bar'")],
)
def test_a_unit_that_is_another_than_the_models_is_refused_with_what_to_write(
    declared: str, unit: str, remedy: str, build: Build
) -> None:
    """A share of 0.3 was compared with 30 %, without a word."""
    variables = VARIABLES.replace('<Real start="291"/>', f'<Real start="291" unit="{declared}"/>')
    path = build("RELAYS", variables=variables).with_name("system.toml")
    noise, scale = ("0.05", "10") if unit == "1" else (f'"0.05 {unit}"', f'"10 {unit}"')
    line = f'outputs.T = {{ unit = "{unit}", noise = {noise}, scale = {scale} }}'
    path.write_text(re.sub("(?m)^outputs.T = .*$", line, path.read_text()))
    with pytest.raises(InputError, match=re.escape(f"[{declared}]") + f".*write {remedy}"):
        load_system(path)


def test_a_unit_whose_definition_contradicts_its_name_is_refused_or_taken_as_it_is(build):
    """A supplier's L/min was defined as 6e-4 m3/s, and nobody else can export it again."""
    wrong = '<Unit name="L/min"><BaseUnit m="3" s="-1" factor="6e-4"/></Unit>'
    unit = 'start="291" unit="L/min"'
    path = build("RELAYS", variables=VARIABLES.replace('start="291"', unit))
    defined = f"<UnitDefinitions>{wrong}</UnitDefinitions><ModelVariables>"
    rewritten(path, path, edits(XML, ("<ModelVariables>", defined)))
    system = path.with_name("system.toml")

    def declare(unit: str, noise: str, scale: str) -> None:
        line = f'outputs.T = {{ unit = "{unit}", noise = {noise}, scale = {scale} }}'
        system.write_text(re.sub("(?m)^outputs.T = .*$", line, system.read_text()))

    declare("L/min", '"0.05 L/min"', '"10 L/min"')
    with pytest.raises(InputError, match=r"defines as 0\.0006 m.*or write unit = '1'"):
        load_system(system)
    declare("1", "0.05", "10")
    load_system(system)


def test_an_fmu_of_one_instance_in_a_process_has_no_variant(build, tmp_path):
    """A second one has the values of the first in FMUs that keep them in globals."""
    once = 'modelIdentifier="Room" canBeInstantiatedOnlyOncePerProcess="true"/>'
    change = edits(XML, ('modelIdentifier="Room"/>', once))
    path = rewritten(build("RELAYS"), tmp_path / "Once.fmu", change)
    with FMU(path) as fmu, pytest.raises(InputError, match="two instances are needed here"):
        fmu.variant({"G": 40.0})


def test_what_needs_modelica_asks_for_the_class(build):
    system = load_system(renamed_system(build("RELAYS")))
    with pytest.raises(InputError, match=r"found the FMU Room.fmu, and no 'class'"):
        system.models["observer"].name  # noqa: B018


ALONE = 'CoSimulation modelIdentifier="Alone"'
ANY_STEP = (ALONE, f'{ALONE} canHandleVariableCommunicationStepSize="true"')
ONES = np.ones((4, 1))
COASTING = """
<ScalarVariable name="x" valueReference="0" causality="output" initial="exact"><Real start="1"/></ScalarVariable>
<ScalarVariable name="u" valueReference="1" causality="input"><Real start="0"/></ScalarVariable>
"""  # noqa: E501


@pytest.fixture
def integrator(tmp_path, compiled) -> Path:
    """A system on a Co-Simulation alone: der(x) = u from 1, each step exact."""
    return build_integrator(tmp_path, compiled("co_simulation.c"))


def build_integrator(tmp_path: Path, library: Path) -> Path:
    """The system of `integrator`, of a library that was built otherwise."""
    description = machine_file(
        "room_fmu/modelDescription.xml", count=0, start=0.0, variables=COASTING
    )
    description = description.replace('ModelExchange modelIdentifier="Room"', ALONE)
    structure = description[description.index("<Outputs>") : description.index("</ModelStruct")]
    description = description.replace(structure, "<Outputs><Unknown index='1'/></Outputs>")
    with zipfile.ZipFile(tmp_path / "Alone.fmu", "w") as archive:
        archive.writestr(XML, description)
        archive.write(library, f"{BINARY}/Alone{fmpy.sharedLibraryExtension}")
    (tmp_path / "system.toml").write_text(
        'title = "Alone"\nsample_time = "1 s"\nmodels.observer = { fmu = "Alone.fmu" }\n'
        'inputs.u = { unit = "1", noise = 0.0, scale = 1.0, held = true }\n'
        'outputs.x = { unit = "1", noise = 0.1, scale = 1.0 }\n'
    )
    return tmp_path


def test_the_open_loop_runs_on_co_simulation_alone(integrator):
    """An input that is held: 3 s of 1 and 3 s of 0 make 3."""
    system = load_system(integrator)
    time, u = np.arange(7.0), np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0])[:, None]
    with open_model(system) as fmu:
        loop = estimators_of(system)["open_loop"]
        estimate = loop(fmu, system, usual_gains(loop, fmu, system)).run(time, u, u + np.nan)
    np.testing.assert_allclose(np.asarray(estimate.values)[:, 0], [1, 2, 3, 4, 4, 4, 4])
    assert compare_with_fmpy(integrator / "Alone.fmu").verdict == RIGHT


def straight_lines(folder: Path, x: Callable[[np.ndarray], np.ndarray]) -> Outcome:
    """Diagnose `integrator` by recordings of x(u), of which u is said to go in straight lines."""
    system, rng = load_system(folder), np.random.default_rng(8)
    system = replace(system, inputs=(replace(system.inputs[0], held=False),))
    for k in range(3):
        time = np.arange(200.0)
        u = 0.3 * np.sin(0.5 * time) + 0.2 * np.sin((0.9 + 0.1 * k) * time)
        columns = {"time [s]": time, "u [1]": u, "x [1]": x(u) + rng.normal(0.0, 0.1, 200)}
        write_case(folder / "recordings" / f"{k}", columns, f"Run {k}")
    effects = ("InputDelay[u]", "SensorGain[u]")
    return diagnosed(system, folder / "recordings", folder / "out", *effects)


def test_what_a_co_simulation_makes_of_its_inputs_is_no_cause(tmp_path, compiled):
    """u stays for a sample in the machine: half a sample on straight lines, InputDelay 'found'."""
    folder = build_integrator(tmp_path, compiled("co_simulation.c"))
    outcome = straight_lines(folder, lambda u: 1.0 + np.append(0.0, np.cumsum(u[:-1])))
    assert outcome.diagnosis.verdict == "unexplained"
    assert "no more than this FMU makes of its inputs" in outcome.sentence
    assert "write held = true in [inputs.u], and diagnose again" in outcome.sentence


def test_outputs_of_a_co_simulation_that_are_a_step_late_are_no_cause(tmp_path, compiled):
    """x = 1 + 2 u + the integral of u: of u, the FMU's output has the mean of the step before."""
    folder = build_integrator(tmp_path, compiled("co_simulation.c", "-DFEEDS"))
    outcome = straight_lines(
        folder, lambda u: 1.0 + 2.0 * u + np.append(0.0, np.cumsum(0.5 * (u[1:] + u[:-1])))
    )
    assert outcome.diagnosis.verdict == "unexplained"
    assert "no more than this FMU makes of its inputs" in outcome.sentence
    assert "held =" not in outcome.sentence  # neither way to hold it leaves noise


def test_a_co_simulation_that_refuses_a_reset_has_its_library_loaded_anew(tmp_path, compiled):
    """AMESim's does, and keeps what its fluids are beyond an instance: no fit ran."""
    folder = build_integrator(tmp_path, compiled("co_simulation.c", "-DONCE"))
    with CoSimulation(folder / "Alone.fmu") as fmu:
        simulation, drive = Simulation(fmu, ["u"], ["x"], [True]), Drive(np.arange(4.0), ONES)
        for begin in (1.0, 2.0):
            simulated = simulation.run(drive, {"x": begin})[:, 0]
            np.testing.assert_allclose(simulated, begin + np.arange(4.0))


@pytest.mark.parametrize("flag", ["-DSTAYS=1", "-DSTAYS=2"])
def test_a_co_simulation_that_a_reset_leaves_where_it_is_starts_anew(flag, tmp_path, compiled):
    """Three recordings with one FMU, as 'simulate' runs them: a second one began at the end.

    20-sim keeps the steps of a robot in its library: another instance goes on there.
    """
    folder = build_integrator(tmp_path, compiled("co_simulation.c", flag))
    system, u = load_system(folder), ONES
    with open_model(system) as fmu:
        loop = estimators_of(system)["open_loop"]
        along = loop(fmu, system, usual_gains(loop, fmu, system))
        for _ in range(3):
            estimate = along.run(np.arange(4.0), u, u + np.nan)
            np.testing.assert_allclose(np.asarray(estimate.values)[:, 0], [1, 2, 3, 4])
    with CoSimulation(folder / "Alone.fmu") as fmu:
        for _ in range(2):  # each the first of its command
            simulation = Simulation(fmu, ["u"], ["x"], [True])
            for _ in range(2):
                simulated = simulation.run(Drive(np.arange(4.0), u), {})[:, 0]
                np.testing.assert_allclose(simulated, [1, 2, 3, 4])


def test_a_co_simulation_that_draws_random_numbers_is_refused(tmp_path, compiled):
    """20-sim draws noise of its sensors: the open loop was another one at each call."""
    folder = build_integrator(tmp_path, compiled("co_simulation.c", "-DRANDOM=X"))
    system, u = load_system(folder), ONES
    with open_model(system) as fmu:
        loop = estimators_of(system)["open_loop"]
        with pytest.raises(FMUError, match=r"gives other results .* without random numbers"):
            loop(fmu, system, usual_gains(loop, fmu, system)).run(np.arange(4.0), u, u + np.nan)
    comparison = compare_with_fmpy(folder / "Alone.fmu")
    assert (comparison.verdict, comparison.reason[-3:]) == (NO_REFERENCE, "`x`")


def test_the_comparison_leaves_out_and_names_what_each_run_has_otherwise(tmp_path, compiled):
    """As the time of the processor, which Dymola exports: that was OFF."""
    folder = build_integrator(tmp_path, compiled("co_simulation.c", "-DRANDOM=LOOSE"))
    end = "</ModelVariables>"
    drawn = '<ScalarVariable name="drawn" valueReference="5" causality="output"><Real/>'
    change = edits(XML, (end, f"{drawn}</ScalarVariable>{end}"))
    comparison = compare_with_fmpy(rewritten(folder / "Alone.fmu", tmp_path / "Draws.fmu", change))
    assert (comparison.verdict, comparison.signal) == (RIGHT, "x")
    assert "but for `drawn`" in comparison.reason


def test_the_comparison_takes_local_variables_where_nothing_else_is_shown(integrator):
    """Those of AMESim are all local; it was said to show nothing that can be measured."""
    unsaid = ('causality="output" ', 'causality="local" variability="continuous" ')
    change = edits(XML, unsaid, ("<Outputs><Unknown index='1'/></Outputs>", ""))
    path = rewritten(integrator / "Alone.fmu", integrator / "Local.fmu", change)
    comparison = compare_with_fmpy(path)
    assert (comparison.verdict, comparison.signal) == (RIGHT, "x")


def test_a_co_simulation_is_told_its_tolerance_and_that_no_step_is_undone(tmp_path, compiled):
    """From 1 by 1 a second. Some integrate at 1e-2 unless told, or begin anew what may be undone.

    FMUs of fmiCpp stayed at their first step; those of Dymola were off by 6e-5 of the range.
    """
    folder = build_integrator(tmp_path, compiled("co_simulation.c", "-DROUGH"))
    with CoSimulation(folder / "Alone.fmu") as fmu:
        simulated = Simulation(fmu, ["u"], ["x"], [True]).run(
            Drive(np.arange(4.0), np.ones((4, 1))), {}
        )
    np.testing.assert_allclose(simulated[:, 0], [1, 2, 3, 4], rtol=TOLERANCE)
    assert compare_with_fmpy(folder / "Alone.fmu").verdict == RIGHT


def test_co_simulation_alone_takes_means_of_the_time_before(integrator):
    """From 1: three seconds whose means are 1, 0 and 0."""
    drive = Drive(np.arange(4.0), np.array([[0.0], [1.0], [0.0], [0.0]]))
    with CoSimulation(integrator / "Alone.fmu") as fmu:
        simulated = Simulation(fmu, ["u"], ["x"], [-1.0]).run(drive, {})
    np.testing.assert_allclose(simulated[:, 0], [1, 2, 2, 2])


def test_whole_simulations_of_co_simulation_alone_have_derivatives(integrator):
    """x = x0 + 3 s of an input of 1: each output moves as its start does."""
    drive = Drive(np.arange(4.0), np.ones((4, 1)))
    with CoSimulation(integrator / "Alone.fmu") as fmu:
        simulation = Simulation(fmu, ["u"], ["x"], [True])
        np.testing.assert_allclose(simulation.run(drive, {"x": 2.0})[:, 0], [2, 3, 4, 5])
        by = simulation.derivatives(drive, {"x": 2.0}, [("x",)])
    np.testing.assert_allclose(by.values[:, 0, 0], 1.0)


@pytest.mark.parametrize("able", [True, False])
def test_co_simulation_that_takes_slopes_of_inputs_follows_straight_lines(able, tmp_path, compiled):
    """der(x) = u - x, u = t, from x = 1: x = t - 1 + 2 exp(-t). Means of 1 s are off by 0.08."""
    folder = build_integrator(tmp_path, compiled("co_simulation.c", "-DLAGS"))
    stated = f'modelIdentifier="Alone" canInterpolateInputs="{str(able).lower()}"'
    change = edits(XML, ('modelIdentifier="Alone"', stated))
    time = np.arange(5.0)
    with CoSimulation(rewritten(folder / "Alone.fmu", tmp_path / "Lines.fmu", change)) as fmu:
        simulated = Simulation(fmu, ["u"], ["x"], [0.0]).run(Drive(time, time[:, None]), {})[:, 0]
    off = np.abs(simulated - (time - 1.0 + 2.0 * np.exp(-time))).max()
    assert off < 1e-12 if able else 0.05 < off < 0.1


def test_a_co_simulation_that_does_not_reach_its_samples_by_its_own_time_is_refused(
    tmp_path, compiled
):
    """Its solver makes steps of 0.4 s; FMI 2.0 has no other word for how far a step came."""
    shown = '<ScalarVariable name="time" valueReference="3" causality="independent"><Real/>'
    folder = build_integrator(tmp_path, compiled("co_simulation.c", "-DSOLVES=0.4"))
    end = "</ModelVariables>"
    change = edits(XML, (end, f"{shown}</ScalarVariable>{end}"), ANY_STEP)
    with CoSimulation(rewritten(folder / "Alone.fmu", tmp_path / "Solver.fmu", change)) as fmu:
        simulation, u = Simulation(fmu, ["u"], ["x"], [True]), np.ones((4, 1))
        reached = simulation.run(Drive(0.8 * np.arange(4.0), u), {})[:, 0]
        np.testing.assert_allclose(reached, [1.0, 1.8, 2.6, 3.4])
        with pytest.raises(FMUError, match=r"ends the step at 0\.8 s.* record at multiples"):
            simulation.run(Drive(np.arange(4.0), u), {})


def test_a_co_simulation_whose_own_steps_are_longer_than_samples_is_doubted(tmp_path, compiled):
    """Its solver makes steps of 10 s: x of u = 0.01 is late by 0 to 9 s, 0.053 root mean square."""
    folder = build_integrator(tmp_path, compiled("co_simulation.c", "-DSOLVES=10.0"))
    rewritten(folder / "Alone.fmu", folder / "Alone.fmu", edits(XML, ANY_STEP))
    time, rng = np.arange(200.0), np.random.default_rng(5)
    columns = {"time [s]": time, "u [1]": np.full(200, 0.01), "x [1]": 1.0 + 0.01 * time}
    columns["x [1]"] += rng.normal(0.0, 0.1, time.size)
    system = load_system(folder)
    case = read_case(write_case(folder / "recordings" / "0", columns, "Rise"), system)
    with open_model(system) as fmu:
        doubt = check_along(fmu, system, case)
    assert "steps of 10 s of its own, where samples are 1 s apart" in doubt
    assert "x by 0.05" in doubt
    loose = replace(system, outputs=(replace(system.outputs[0], noise=1.0),))
    with open_model(loose) as fmu:
        assert check_along(fmu, loose, case) == ""  # no sensor shows it
    coarse = replace(case, time=10.0 * time)
    with open_model(system) as fmu:
        assert check_along(fmu, system, coarse) == ""  # it steps as samples do


def test_a_co_simulation_that_asks_to_end_says_so(tmp_path, compiled):
    """FMI 2.0 calls that a step that was discarded."""
    path = build_integrator(tmp_path, compiled("co_simulation.c", "-DENDS=2.5")) / "Alone.fmu"
    with CoSimulation(path) as fmu:
        unmoved = Simulation(fmu, [], ["x"], []).run(Drive(np.arange(3.0), np.empty((3, 0))), {})
        np.testing.assert_array_equal(unmoved[:, 0], 1.0)
        simulation = Simulation(fmu, ["u"], ["x"], [True])
        with pytest.raises(FMUError, match=r"asks to end .* from 2 s of"):
            simulation.run(Drive(np.arange(4.0), np.ones((4, 1))), {})


def test_co_simulation_with_steps_of_one_size_goes_in_those_or_is_refused(tmp_path, compiled):
    """Four steps of 0.25 s fit into a sample; after samples of 1 s, one of 0.5 s does not."""
    folder = build_integrator(tmp_path, compiled("co_simulation.c", "-DONLY=0.25"))
    change = edits(XML, ('startTime="0.0"', 'startTime="0.0" stepSize="0.25"'))
    path = rewritten(folder / "Alone.fmu", tmp_path / "Stepping.fmu", change)
    with CoSimulation(path) as fmu:
        simulation = Simulation(fmu, ["u"], ["x"], [True])
        even = simulation.run(Drive(np.arange(4.0), np.ones((4, 1))), {})
        np.testing.assert_allclose(even[:, 0], [1, 2, 3, 4])
        with pytest.raises(
            FMUError, match=r"steps of one size only.*of 0\.25 s, and samples are 0\.3 s apart"
        ):
            simulation.run(Drive(np.array([0.0, 1.0, 1.3]), np.ones((3, 1))), {})


def test_co_simulation_with_steps_of_a_size_that_nothing_says_goes_in_those(tmp_path, compiled):
    """Its trial, in steps of 1 ms, refused it for all samples."""
    path = build_integrator(tmp_path, compiled("co_simulation.c", "-DONLY=0.25")) / "Alone.fmu"
    with CoSimulation(path) as fmu:
        simulation = Simulation(fmu, ["u"], ["x"], [True])
        right = simulation.run(Drive(0.25 * np.arange(4.0), np.ones((4, 1))), {})
        np.testing.assert_allclose(right[:, 0], [1, 1.25, 1.5, 1.75])
        with pytest.raises(FMUError, match=r"its description does not say of which: record at"):
            simulation.run(Drive(np.arange(4.0), np.ones((4, 1))), {})


def test_a_step_that_a_co_simulation_discards_says_how_far_it_came(tmp_path, compiled):
    folder = build_integrator(tmp_path, compiled("co_simulation.c", "-DLONGEST=0.25"))
    path = rewritten(folder / "Alone.fmu", tmp_path / "Short.fmu", edits(XML, ANY_STEP))
    message = r"step of 1 s from 0 s of its time, of which it made 0\.25 s\. Record at steps"
    with CoSimulation(path) as fmu, pytest.raises(FMUError, match=message):
        Simulation(fmu, ["u"], ["x"], [True]).run(Drive(np.arange(4.0), np.ones((4, 1))), {})


@pytest.mark.parametrize("name", ["ekf", "mhe", "smoother"])
def test_what_co_simulation_alone_cannot_do_is_said_with_what_would_make_it_possible(
    name, integrator
):
    system = load_system(integrator)
    with open_model(system) as fmu:
        chosen = estimators_of(system)[name]
        with pytest.raises(InputError, match=r"Co-Simulation, without .*export the model for Mod"):
            chosen(fmu, system, usual_gains(chosen, fmu, system))
        with pytest.raises(InputError, match="without derivatives"):
            fmu.state_jacobian()


@pytest.fixture
def arrays(tmp_path) -> Callable[..., Path]:
    """Builds the arrays for an interface of FMI 3.0, with their system file; returns the FMU."""

    def make(interface: str = "ModelExchange", *flags: str) -> Path:
        headers = Path(fmpy.__file__).parent / "c-code"
        source = Path(__file__).with_name("arrays.c").read_text()
        types = (headers / "fmi3FunctionTypes.h").read_text()
        # FMPy looks for all functions of FMI.
        others = sorted(
            set(re.findall(r"(fmi3\w+)TYPE\b", types)) - set(re.findall(r"fmi3\w+", source))
        )
        source += "".join(f"int {name}(void) {{ return 3; }}\n" for name in others)
        (tmp_path / "model.c").write_text(source)
        library = tmp_path / f"Arrays{fmpy.sharedLibraryExtension}"
        given = ["-shared", "-fPIC", "-w", "-I", headers, *flags, tmp_path / "model.c", "-o"]
        subprocess.run([str(COMPILER), *given, library, "-lm"], check=True)
        description = machine_file("arrays_fmu/modelDescription.xml")
        with zipfile.ZipFile(tmp_path / "Arrays.fmu", "w") as archive:
            described = description.replace("ModelExchange", interface)
            archive.writestr(XML, described)
            archive.write(library, f"binaries/{fmpy.platform_tuple}/{library.name}")
        (tmp_path / "system.toml").write_text(
            'title = "Arrays"\nsample_time = "0.05 s"\nmodels.observer = { fmu = "Arrays.fmu" }\n'
            'inputs."u[2]" = { unit = "1", noise = 0.0, scale = 1.0, held = true }\n'
            'outputs."y[2]" = { unit = "1", noise = 0.001, scale = 1.0 }\n'
            '[parameters]\n"k[2]" = 3.0\n'
        )
        return tmp_path / "Arrays.fmu"

    return make


def test_elements_of_arrays_move_in_a_straight_line_between_samples(arrays):
    """der(x) = t - x from 1, so that x = t - 1 + 2 exp(-t); held inputs lag by half a step."""
    time = 0.5 * np.arange(9.0)
    with FMU(arrays()) as fmu:
        simulated = Simulation(fmu, ["u[1]"], ["y[1]"], [0.0]).run(Drive(time, time[:, None]), {})
    np.testing.assert_allclose(simulated[:, 0], time - 1.0 + 2.0 * np.exp(-time), atol=1e-6)


def test_the_open_loop_and_a_diagnosis_read_and_set_elements_of_arrays(arrays):
    """der(x[i]) = u[i] - k[i] x[i]: the second element with k[2] = 3 instead of 2, u[2] = 6.

    A diagnosis began with states of zero.
    """
    path = arrays()
    assert compare_with_fmpy(path).verdict == RIGHT
    system = load_system(path.parent)
    time = 0.05 * np.arange(301.0)
    u = 6.0 * (time >= 1.0)[:, None]
    exact = np.where(time < 1.0, 2.0 * np.exp(-3.0 * time), 0.0)
    after = time >= 1.0
    exact[after] = 2.0 + (2.0 * np.exp(-3.0) - 2.0) * np.exp(-3.0 * (time[after] - 1.0))
    with open_model(system) as fmu:
        kinds = estimators_of(system)
        loop = kinds["open_loop"](fmu, system, usual_gains(kinds["open_loop"], fmu, system))
        values = np.asarray(loop.run(time, u, np.full((301, 1), np.nan)).values)[:, 0]
        with pytest.raises(InputError, match=r"an element of .x.|Float64"):
            kinds["ukf"](fmu, system, usual_gains(kinds["ukf"], fmu, system))
    np.testing.assert_allclose(values, exact, atol=1e-6)
    noise = 0.001 * np.random.default_rng(1).standard_normal(301)
    columns = {"time [s]": time, "u[2] [1]": u[:, 0], "y[2] [1]": exact + noise}
    case = wb.case_from_frame(system, pd.DataFrame(columns))
    assert wb.diagnose(system, [case], workers=1).diagnosis.verdict == "nothing"
    with ResidualModel(ModelSource(path, system, {}, free=True), [case]) as simulations:
        assert simulations.nominal["x[2]"] == 2.0
    settings = wb.FitSettings(starts=1, profiles=False)
    outcome = wb.fit(system, [case], ["g"], settings=settings, workers=1, report=lambda line: None)
    assert outcome["g"].value == pytest.approx(1.0, abs=1e-3)  # of Float32


@pytest.mark.parametrize(
    ("interface", "flag", "message"),
    [
        ("ModelExchange", "-DINDICATORS=1", "EventIndicators says 1, and the model structure"),
        ("CoSimulation", "-DSHARE=0.5", "ends the step at 0.25 s, where it was told that steps"),
        ("CoSimulation", "-DSHARE=1.0", ""),
    ],
)
def test_what_an_fmu_does_otherwise_than_it_says_is_refused(interface, flag, message, arrays):
    """More events than it describes, which were passed over; half of each step."""
    path = arrays(interface, flag)
    fmu_class = FMU if interface == "ModelExchange" else CoSimulation
    drive = Drive(0.5 * np.arange(3.0), np.zeros((3, 0)))
    with pytest.raises(FMUError, match=message) if message else nullcontext():  # noqa: SIM117
        with fmu_class(path) as fmu:
            values = Simulation(fmu, [], ["y[2]"], []).run(drive, {})
            np.testing.assert_allclose(values[:, 0], 2.0 * np.exp(-2.0 * drive.time))
