"""Three independent FMI clients run every FMU: FMPy, CasADi's DaeBuilder and ecos.

The manoeuvre: rolling at 21 m/s, 2 bar from 0.5 s on. The reference is Model Exchange of FMI 2.0
under FMPy, integrated by CVODE, so that it owes nothing to the FMUs' own integrator.
"""

import ctypes
import functools
import importlib.metadata
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import casadi
import fmpy
import numpy as np
import pytest
from numpy.testing import assert_allclose

from workbench.__main__ import main
from workbench.errors import InputError
from workbench.models.compiler.openmodelica import Message, build_with_omc, errors_in
from workbench.models.fmu import FMU

ROOT = Path(__file__).parent.parent
STEP, DURATION, BRAKE, PRESSURE = 0.01, 1.5, 0.5, 2e5  # s, s, s, Pa
START = {"omegaW": 30.0 * 0.70 / 0.46, "omegaR": 30.0}
OUTPUTS = ["omegaW", "omegaR", "Fx"]
TIMES = np.linspace(0.0, DURATION, 16)
TOLERANCE = 1e-9  # of every integrator that a client can set

MODELS = pytest.mark.parametrize("model", ["MinimalObserver", "FullObserver", "Reference"])
VERSIONS = pytest.mark.parametrize("fmi", [2, 3])


def fmu_path(fmi: int, model: str) -> Path:
    return ROOT / "fmus" / f"fmi{fmi}" / f"{model}.fmu"


@functools.cache
def run_fmpy(path: Path, interface: str) -> np.ndarray:
    """Outputs at `TIMES`, (16, 3), by FMPy; its CVODE integrates Model Exchange."""
    # FMPy interpolates: a jump for Model Exchange, the sample at 0.5 s for Co-Simulation.
    before = BRAKE if interface == "ModelExchange" else BRAKE - STEP / 2
    signal = [(0.0, 0.0), (before, 0.0), (BRAKE, PRESSURE), (DURATION, PRESSURE)]
    result = fmpy.simulate_fmu(
        str(path),
        fmi_type=interface,
        start_time=0.0,
        stop_time=DURATION,
        output_interval=STEP,
        relative_tolerance=TOLERANCE,
        start_values=START,
        input=np.array(signal, dtype=[("time", float), ("pB", float)]),
        output=OUTPUTS,
    )
    rows = [np.argmin(abs(result["time"] - t)) for t in TIMES]
    return np.column_stack([result[name][rows] for name in OUTPUTS])


@VERSIONS
def test_model_exchange_under_fmpy_follows_a_ramp_whose_rows_stand_twice(fmi):
    """FMPy sets inputs where its solver has returned, which may have stepped far past that.

    At a time that stands twice it starts anew. Against Co-Simulation with the same inputs, held
    over each step: the L-stable integrator of the FMU and CVODE owe nothing to each other.
    """
    time = np.arange(0.0, 6.0, 0.005)
    pressure = 3.6e5 * np.clip((time - 4.03) / 0.5, 0.0, 1.0)
    table = np.array(list(zip(time, pressure, strict=True)), [("time", float), ("pB", float)])
    forces = [
        fmpy.simulate_fmu(
            str(fmu_path(fmi, "MinimalObserver")),
            fmi_type=interface,
            stop_time=time[-1],
            output_interval=0.005,
            relative_tolerance=1e-8,
            input=rows,
            start_values=START,
            output=["Fx"],
            record_events=False,
        )["Fx"]
        for interface, rows in (("ModelExchange", np.repeat(table, 2)), ("CoSimulation", table))
    ]
    assert forces[1].max() > 5e3
    # A relative tolerance of 1e-8 of 46 rad/s is 2e-7 m/s of slip: 0.04 N, in each of its steps.
    assert abs(forces[0] - forces[1]).max() < 1.0


def run_casadi(path: Path) -> np.ndarray:
    """Outputs at `TIMES`, (16, 3), by CasADi's own FMI import and its CVODES."""
    builder = casadi.DaeBuilder("rig", str(path))
    states, inputs, outputs = builder.x(), builder.u(), builder.y()
    variables = fmpy.read_model_description(str(path)).modelVariables
    assert sorted(inputs) == sorted(v.name for v in variables if v.causality == "input")
    model = builder.create("model", ["x", "u"], ["ode", "y"])
    x, u = casadi.MX.sym("x", len(states)), casadi.MX.sym("u", len(inputs))
    integrate = casadi.integrator(
        "stop",
        "cvodes",
        {"x": x, "u": u, "ode": model(x, u)[0]},
        0.0,
        TIMES[1],
        {"reltol": TOLERANCE, "abstol": TOLERANCE, "max_num_steps": 100_000},
    )
    state = np.array([START.get(name, 0.0) for name in states])
    rows = []
    for t in TIMES:
        braking = t > BRAKE - STEP / 2
        held = [PRESSURE if name == "pB" and braking else 0.0 for name in inputs]
        values = dict(zip(outputs, np.array(model(state, held)[1]).ravel(), strict=True))
        rows.append([values[name] for name in OUTPUTS])
        state = np.array(integrate(x0=state, u=held)["xf"]).ravel()
    return np.array(rows)


def load_ecos() -> object:
    """The module `ecospy`; its library names libtbb without saying where it is."""
    try:
        files = importlib.metadata.files("tbb") or []
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("needs the packages ecospy and tbb of the extra [dev]")
    (library,) = (file for file in files if file.name == "libtbb.so.12")
    ctypes.CDLL(str(library.locate()), mode=ctypes.RTLD_GLOBAL)
    return pytest.importorskip("ecospy")


def run_ecos(path: Path) -> np.ndarray:
    """Outputs at `TIMES`, (16, 3), by ecos, a co-simulation engine in C++."""
    ecos = load_ecos()
    every = round(TIMES[1] / STEP)
    rows = []
    with ecos.EcosSimulationStructure() as structure:
        structure.add_model("rig", path)
        structure.add_parameter_set("start", {f"rig::{k}": v for k, v in START.items()})
        with ecos.EcosSimulation(STEP, structure=structure) as simulation:
            assert simulation.init(parameter_set="start"), ecos.EcosLib.get_last_error()
            for k in range(TIMES.size * every):
                if k % every == 0:
                    rows.append([simulation.get_real(f"rig::{name}") for name in OUTPUTS])
                if k == round(BRAKE / STEP):
                    simulation.set_real("rig::pB", PRESSURE)
                simulation.step()
            simulation.terminate()
    return np.array(rows)


CLIENTS: dict[str, Callable[[Path], np.ndarray]] = {
    "FMPy, Model Exchange": lambda path: run_fmpy(path, "ModelExchange"),
    "FMPy, Co-Simulation": lambda path: run_fmpy(path, "CoSimulation"),
    "CasADi, Model Exchange": run_casadi,
    "ecos, Co-Simulation": run_ecos,
}


@MODELS
@VERSIONS
@pytest.mark.parametrize("client", CLIENTS)
def test_every_client_computes_the_same_stop(model, fmi, client):
    reference = run_fmpy(fmu_path(2, model), "ModelExchange")
    result = CLIENTS[client](fmu_path(fmi, model))
    # At the jump itself a client may show the force before or after it.
    compared = abs(TIMES - BRAKE) > STEP / 2
    speeds, force = abs(reference[:, :2]).max(), abs(reference[:, 2]).max()
    # ecos sets no tolerance, so the FMU's own holds: 1e-6 of each state, in each of few steps.
    assert_allclose(result[compared, :2], reference[compared, :2], rtol=0, atol=2e-6 * speeds)
    # The slip, 1e-3 of the speeds at this force, enlarges a relative error of speeds by 1e3.
    assert_allclose(result[compared, 2], reference[compared, 2], rtol=0, atol=1e-4 * force)


@MODELS
def test_the_stop_brakes(model):
    """What the clients agree on is a stop: coasting, then the brake's deceleration."""
    omegaW, omegaR, Fx = run_fmpy(fmu_path(2, model), "ModelExchange").T
    # Three discs at 0.30*10.86 kN/bar*(2 - 0.25) bar and 0.300 m, less the share that slows the
    # wheelset itself; bearing losses are 1 %, 3 % is slack.
    brake = 3 * 0.30 * 10.86e3 * 1.75 * 0.300 / 0.46
    assert Fx[-1] == pytest.approx(brake / (1 + 110 / 0.46**2 * 0.49 / 1500), rel=0.03)
    assert abs(omegaR[4] - 30.0) < 0.1  # 0.4 s under losses alone, 0.1 rad/s2
    assert 0.46 * omegaW[-1] == pytest.approx(0.70 * omegaR[-1], rel=5e-3)  # it rolls


def they_are_one_system(theirs: FMU, ours: FMU) -> None:
    """What is set and read by our names is the same, and so are rates and linearisations.

    A position has aliases, and either may be the state. Values that differ tell the states apart.
    """
    given = {name: 1e-6 + 1e-8 * k for k, name in enumerate(ours.states)} | START
    jacobians = []
    for fmu in (theirs, ours):
        fmu.start(given)
        assert dict(zip(given, fmu.get(fmu.variables(list(given))), strict=True)) == given
        x, rates = fmu.get_states(), fmu.derivatives()
        order = np.argsort(x)
        assert x[order].tolist() == sorted(given.values())
        linear = fmu.linearise(fmu.variables(ours.inputs), fmu.variables(ours.outputs))
        jacobians.append((rates[order], linear.C[:, order], linear.D))
    (rates, C, D), (our_rates, our_C, our_D) = jacobians
    # Rounding of sums whose terms are up to a thousand times their value.
    assert_allclose(rates, our_rates, rtol=1e-12, atol=1e-12 * abs(our_rates).max())
    for jacobian, exact in ((C, our_C), (D, our_D)):
        # Differences where derivatives are not offered, off by 3e-4 where the law bends (slip of
        # 1 mm/s); those of another output are off by all of it. 1e-6: rounding of forces of 1e5 N.
        rows = abs(exact).max(axis=1, keepdims=True)
        assert (abs(jacobian - exact) <= 1e-3 * rows + 1e-6).all()


@MODELS
@pytest.mark.parametrize("interface", ["ModelExchange", "CoSimulation"])
def test_openmodelica_builds_the_same_stop(model, interface, tmp_path):
    """The second compiler, from the same sources; only where it is installed."""
    if shutil.which("omc") is None:
        pytest.skip("needs OpenModelica's omc")
    openmodelica = pytest.importorskip("workbench.models.compiler.openmodelica")
    package = ROOT / "modelica" / "WheelsetRig" / "package.mo"
    (path,) = openmodelica.build_with_omc(package, [f"WheelsetRig.{model}"], tmp_path)
    with FMU(path) as theirs, FMU(fmu_path(2, model)) as ours:
        they_are_one_system(theirs, ours)
    reference, result = run_fmpy(fmu_path(2, model), "ModelExchange"), run_fmpy(path, interface)
    compared = abs(TIMES - BRAKE) > STEP / 2
    # As above: CVODE on both sides, each with 1e-9.
    for column, tolerance in ((0, 2e-6), (1, 2e-6), (2, 1e-4)):
        atol = tolerance * abs(reference[:, column]).max()
        assert_allclose(result[compared, column], reference[compared, column], rtol=0, atol=atol)


CHECKED = (
    '"Check of Rig.M completed successfully.\nClass Rig.M has {} equation(s) and {} variable(s)."'
)

OFFERS = 'providesDirectionalDerivative="true"'


@pytest.fixture
def package(tmp_path) -> Path:
    path = tmp_path / 'a "quoted" folder' / "Rig" / "package.mo"
    path.parent.mkdir(parents=True)
    path.write_text("package Rig model M end M; end Rig;")
    return path


def stand_in(folder: Path, monkeypatch: pytest.MonkeyPatch, prints: str, *, builds: bool) -> Path:
    """Put a program 'omc' on the PATH; returns the file in which it notes its call."""
    calls, output, built = folder / "calls", folder / "said", folder / "built"
    output.write_text(prints)
    with zipfile.ZipFile(built, "w") as archive:
        archive.writestr("modelDescription.xml", OFFERS)
        archive.writestr("binaries/linux64/M.so", OFFERS)
    program = folder / "bin" / "omc"
    program.parent.mkdir()
    leave = f"cp {built} M.fmu" if builds else ":"
    program.write_text(
        f'#!/bin/sh\necho "$@" > {calls}\ncat build.mos >> {calls}\n{leave}\ncat {output}\n'
    )
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}:/bin:/usr/bin")
    return calls


def test_omc_is_asked_for_an_fmu_that_observers_can_use(tmp_path, package, monkeypatch):
    calls = stand_in(tmp_path, monkeypatch, CHECKED.format(7, 7), builds=True)
    out = tmp_path / "out" / "omc"
    assert build_with_omc(package, ["Rig.M"], out) == [out / "M.fmu"]
    with zipfile.ZipFile(out / "M.fmu") as archive:
        # Wrong without aliases: the workbench would believe them, and wreck the gains.
        assert b'"true"' not in archive.read("modelDescription.xml")
        assert archive.read("binaries/linux64/M.so") == OFFERS.encode()
    assert [p.name for p in out.iterdir()] == ["M.fmu"]
    options, load, _, tolerance, build, _ = calls.read_text().splitlines()
    assert set(options.split()) == {
        "--fmiFlags=s:cvode",
        "-d=-disableDirectionalDerivatives",  # or each state is named twice
        "--preOptModules-=introduceOutputAliases",  # or an alias is the state
        "build.mos",
    }
    assert "addClassAnnotation(Rig.M, annotate=experiment(Tolerance=1e-09));" in tolerance
    assert 'a \\"quoted\\" folder/Rig/package.mo"); getErrorString();' in load
    assert build.startswith('buildModelFMU(Rig.M, version="2.0", fmuType="me_cs"')


@pytest.mark.parametrize(
    ("prints", "match"),
    [
        (
            'true\n"[/lib/Rig/Part.mo:12:3-12:20:writable] Error: Class Foo not found.\n'
            'Error: Error occurred while flattening model Rig.M"\n',
            r"^/lib/Rig/Part.mo:12: found Class Foo not found\.",
        ),
        ('"Error: Failed to load package Rig"', "model Rig.M: found Failed to load package Rig"),
        (CHECKED.format(6, 7), "found 6 equations, 7 unknowns"),
        ("Killed", "found Killed"),
        ("", "found nothing printed"),
    ],
)
def test_what_omc_refuses_is_reported_and_nothing_is_written(
    prints, match, tmp_path, package, monkeypatch
):
    # An FMU with a missing equation may be left behind, and must not be taken.
    stand_in(tmp_path, monkeypatch, prints, builds="equation" in prints)
    with pytest.raises(InputError, match=match):
        build_with_omc(package, ["Rig.M"], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_warnings_and_notifications_are_no_errors():
    output = (
        "[/lib/A.mo:1:2-3:4:readonly] Warning: Parameter k has no value.\n"
        "[/lib/B.mo:5:6-7:8:writable] Notification: From here:\n"
        r"[C:\lib\C.mo:9:1-9:2:writable] Error: No viable alternative near token: end"
    )
    assert errors_in(output) == [Message(r"C:\lib\C.mo:9", "No viable alternative near token: end")]


def test_without_omc_the_command_says_what_is_missing(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    assert main(["fmu", "build", "--all", "--compiler", "omc"]) == 2
    assert "no program 'omc' on the PATH" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_fmi_3_is_not_asked_of_omc(capsys):
    assert main(["fmu", "build", "--all", "--compiler", "omc", "--fmi", "3"]) == 2
    assert "--compiler omc: found --fmi 3" in capsys.readouterr().err
