"""Observers as products: the FMU against the Python observer, and the package in an SSP tool."""

import json
import zipfile
from collections.abc import Iterator
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssd, read_ssv

from workbench.__main__ import main
from workbench.cli.parser import command_line
from workbench.errors import InputError
from workbench.models.compiler.assembly import PLATFORMS
from workbench.models.compiler.flat import flatten
from workbench.observers import Estimator, Gains, choose
from workbench.observers.export import build_observer, write_package
from workbench.observers.gains import format_gains
from workbench.system.registry import open_model

from .exported import Exported, run_fmu, with_all_gains, write_fmu
from .systems import WHEELSET as SYSTEM

KINDS = choose(SYSTEM, list(SYSTEM.export.classes))
NAMES = tuple(KINDS)
INPUTS = ("pB", "tauR", "omegaW", "omegaR")
# Outputs of the FMU and the columns of a Python estimate that they are.
OUTPUTS = {
    "omegaWEstimate": "omegaW",
    "omegaREstimate": "omegaR",
    "muWR": "muWR",
    "muDC": "muDC",
    "Fx": "Fx",
    "slip": "slip",
}
# Of the largest value in a stop. Measured: equal to the bit; elementary functions of another
# library may differ in their last bit.
AGREEMENT = 1e-6


def default_gains(name: str) -> Gains:
    with open_model(SYSTEM, KINDS[name].role) as fmu:
        return KINDS[name].default_gains(fmu, SYSTEM)


@pytest.fixture(scope="module", params=NAMES)
def exported(request, tmp_path_factory) -> Iterator[Exported]:
    cls = KINDS[request.param]
    with open_model(SYSTEM, cls.role) as fmu:
        python = cls(fmu, SYSTEM, with_all_gains(cls.default_gains(fmu, SYSTEM)))
        yield Exported(write_fmu(tmp_path_factory.mktemp(cls.name) / "law.fmu", python), python)


def run_python(estimator: Estimator, time: np.ndarray, u: np.ndarray, y: np.ndarray) -> np.ndarray:
    columns = [list(SYSTEM.columns).index(name) for name in OUTPUTS.values()]
    return estimator.run(time, u, y).values[:, columns]


def disagreement(values: np.ndarray, expected: np.ndarray) -> float:
    """Largest deviation of any output, of its largest value in the stop."""
    return float((abs(values - expected).max(axis=0) / abs(expected).max(axis=0)).max())


def test_limits_of_friction_are_kept_and_reached(exported, dry_case):
    """A pressure sensor that reads 0.4 of the pressure wants more friction than pads have."""
    recording = dry_case.time, dry_case.u * [0.4, 1.0], dry_case.y
    estimate = run_fmu(exported.path, *recording, list(OUTPUTS))
    assert estimate[:, list(OUTPUTS).index("muDC")].max() == 0.45
    assert disagreement(estimate, run_python(exported.python, *recording)) < AGREEMENT


def test_gains_are_parameters_that_another_tool_may_set(exported, tmp_path, dry_case):
    """Built with the default gains, set to those of the estimator in Python."""
    python = exported.python
    gains = default_gains(python.name)
    with open_model(SYSTEM, python.role) as fmu:
        path = write_fmu(tmp_path / "law.fmu", type(python)(fmu, SYSTEM, gains))
    own = {variable.name: variable for variable in fmpy.read_model_description(path).modelVariables}
    meanings = type(python).meanings(python.fmu, SYSTEM, gains)
    assert all(own[name].unit == unit for name, (_, unit) in meanings.items())
    samples = np.hstack([dry_case.u, dry_case.y])
    recorded = np.array(
        [(0.005 * k, *sample) for k, sample in enumerate(samples)],
        [(name, float) for name in ("time", *INPUTS)],
    )
    estimate = fmpy.simulate_fmu(
        str(path),
        start_values=dict(zip(gains.names, python.gains.values.tolist(), strict=True)),
        input=recorded,
        stop_time=recorded["time"][-1],
        output=[*OUTPUTS],
        output_interval=0.005,
    )
    estimates = np.column_stack([estimate[output] for output in OUTPUTS])
    expected = run_python(python, recorded["time"], dry_case.u, dry_case.y)
    assert disagreement(estimates[1:], expected[:-1]) < AGREEMENT


def test_default_gains_of_the_modelica_classes_are_the_reasoned_ones():
    for name in NAMES:
        gains = default_gains(name)
        flat = flatten(
            SYSTEM.library, f"{SYSTEM.library.parent.name}.{SYSTEM.export.classes[name]}"
        )
        defaults = {v.name: v.start for v in flat.parameters}
        values = dict(zip(gains.names, gains.values, strict=True))
        for constant, effects in gains.design.items():
            names = [f"{constant}_{quantity.name}" for quantity in SYSTEM.estimated]
            values |= dict(zip(names, effects, strict=True))
        for parameter, value in values.items():
            # The classes give nine digits.
            assert defaults[parameter] == pytest.approx(value, rel=1e-8, abs=1e-9), parameter


@pytest.fixture(scope="module")
def package(root, once) -> Path:
    """The folder that the command writes, with gains from a file."""

    def export(folder: Path) -> Path:
        gains = default_gains("disturbance_observer")
        values = gains.values.copy()
        values[:16] *= 0.5
        (folder / "gains.toml").write_text(format_gains(gains.with_values(values), "", {"z": 0.3}))
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(root)
            assert main(exporting(folder / "gains.toml", folder / "out")) == 0
        return folder

    return once("export", export)


def exporting(gains: Path, out: Path) -> list[str]:
    """The command; for this machine alone, as what others need is compiled for a minute."""
    return ["export", "--gains", str(gains), "--platforms", "native", "--out", str(out)]


def test_the_command_writes_the_gains_of_the_file(package):
    out = package / "out"
    names = ["DisturbanceObserver.fmu", "DisturbanceObserver.ssp", "summary.json"]
    assert sorted(file.name for file in out.iterdir()) == names
    summary = json.loads((out / "summary.json").read_text())
    description = fmpy.read_model_description(str(out / names[0]))
    start = {v.name: v.start for v in description.modelVariables}
    assert {n: float(start[n]) for n in summary["gains"]} == summary["gains"]
    assert float(start["L42"]) == pytest.approx(-0.5 * 228.993134)
    assert description.coSimulation is not None
    assert description.modelExchange is None
    with zipfile.ZipFile(out / names[0]) as archive:
        held = archive.read("resources/gains.toml")
        libraries = [n for n in archive.namelist() if n.startswith("binaries/")]
    assert held == (package / "gains.toml").read_bytes()
    assert len(libraries) == 1


@pytest.mark.long
def test_an_observer_is_for_all_platforms_unless_others_are_asked_for(tmp_path):
    gains = default_gains("disturbance_observer")
    with open_model(SYSTEM, KINDS[gains.estimator].role) as fmu:
        build_observer(KINDS[gains.estimator](fmu, SYSTEM, gains), tmp_path / "observer.fmu", 2)
    with zipfile.ZipFile(tmp_path / "observer.fmu") as archive:
        folders = {Path(n).parts[1] for n in archive.namelist() if n.startswith("binaries/")}
    assert folders == {fmi2_name for fmi2_name, *_ in PLATFORMS.values()}


def test_the_command_asks_for_all_platforms_unless_told_otherwise():
    assert command_line("0", "export").parse_args(["export"]).platforms == "all"


def test_the_same_gains_give_the_same_bytes(root, package, tmp_path):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(root)
        assert main(exporting(package / "gains.toml", tmp_path)) == 0
    for file in tmp_path.iterdir():
        assert file.read_bytes() == (package / "out" / file.name).read_bytes(), file.name


def test_the_package_follows_the_schemas_and_names_what_its_fmus_have(package, tmp_path):
    ssp = package / "out" / "DisturbanceObserver.ssp"
    system = read_ssd(str(ssp), validate=True).system
    start = read_ssv(str(ssp), resource="resources/start.ssv", validate=True)
    variables = {}
    with zipfile.ZipFile(ssp) as archive:
        for component in system.elements:
            file = archive.extract(component.source, tmp_path)
            described = fmpy.read_model_description(file).modelVariables
            variables[component.name] = {v.name: v for v in described}
            for connector in component.connectors:
                assert variables[component.name][connector.name].causality == connector.kind
    for parameter in start.parameters:
        component, _, name = parameter.name.partition(".")
        assert variables[component][name].start is not None
        assert variables[component][name].unit == parameter.unit


def test_in_an_ssp_tool_the_estimate_follows_the_reference(package):
    """A stop at 2.7 bar; the pads of the rig have 0.33, of the observer's model nominally 0.30."""
    ssp = str(package / "out" / "DisturbanceObserver.ssp")
    result = simulate_ssp(
        ssp,
        stop_time=6.0,
        step_size=0.005,
        parameter_set=read_ssv(ssp, resource="resources/start.ssv"),
        input={
            "pB": lambda t: 2.7e5 * np.clip((t - 1.0) / 0.5, 0.0, 1.0),
            "tauR": lambda t: 8000.0 * (t > 1.2),
        },
    )
    late = result["time"] > 4.0
    assert result["Fx"][late].min() > 16e3
    # Once settled, wheel load and vibration of the reference leave 1e-3, as in a recorded stop.
    error = abs(result["FxEstimate"] - result["Fx"])[late]
    assert error.max() < 1e-3 * result["Fx"][late].mean()
    assert result["muDCEstimate"][late] == pytest.approx(0.33, abs=1e-3)


@pytest.mark.parametrize("parameters", [True, False], ids=["start.ssv", "from rest"])
@pytest.mark.parametrize("pressure", [0.5e5, 2e5, 4.2e5])
@pytest.mark.parametrize("step", [0.001, 0.005, 0.02])
def test_in_an_ssp_tool_frictions_are_right_at_any_step(package, step, pressure, parameters):
    """FMPy steps both FMUs once before it connects them: the observer's first inputs are zero.

    It takes the start values from its caller and not from the package; without them the machine is
    driven up from rest, and has pads of 0.30.
    """
    ssp = str(package / "out" / "DisturbanceObserver.ssp")
    start = read_ssv(ssp, resource="resources/start.ssv") if parameters else None
    begin = 1.0 if parameters else 4.0  # of braking

    def drive(t: float) -> float:
        return 0.045 * pressure if t > begin + 0.2 else 0.0 if parameters else 15e3

    result = simulate_ssp(
        ssp,
        stop_time=begin + 3.0,
        step_size=step,
        parameter_set=start,
        input={"pB": lambda t: pressure * np.clip((t - begin) / 0.5, 0.0, 1.0), "tauR": drive},
    )
    time, error = result["time"], abs(result["FxEstimate"] - result["Fx"])
    late = time > begin + 2.0
    # 0.1 % of the force of a hard stop; before the pads touch, and while friction acts.
    for part in ((time > begin - 0.5) & (time < begin), late):
        assert error[part].max() < 30.0
    # Half a bar is a quarter above where the pads touch: their friction is looked for longest.
    within = 0.03 if pressure < 1e5 else 3e-3
    assert result["muDCEstimate"][late] == pytest.approx(0.33 if parameters else 0.30, abs=within)


def test_gains_of_an_estimator_that_is_none_are_refused(root, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(root)
    (tmp_path / "gains.toml").write_text('estimator = "oracle"\n')
    command = ["export", "--gains", str(tmp_path / "gains.toml"), "--out", str(tmp_path / "out")]
    assert main(command) == 2
    assert "found estimator = 'oracle'; expected one of open_loop" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["nothing.toml", "cases"])
def test_a_file_of_gains_that_cannot_be_read_is_refused(root, tmp_path, monkeypatch, name):
    monkeypatch.chdir(root)
    assert main(["export", "--gains", name, "--out", str(tmp_path / "out")]) == 2
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("fmu", "match"),
    [
        ("fmi3/Reference.fmu", "found FMI 3.0, .*; expected FMI 2.0"),
        ("fmi2/Missing.fmu", "found no such file"),
    ],
)
def test_only_a_reference_with_the_connectors_goes_into_a_package(
    root, package, tmp_path, fmu, match
):
    ssp = tmp_path / "out.ssp"
    observer_fmu = package / "out" / "DisturbanceObserver.fmu"
    with pytest.raises(InputError, match=match):
        write_package(SYSTEM, observer_fmu, root / "fmus" / fmu, ssp)
    assert not ssp.exists()


def test_a_model_without_the_readings_is_refused(package, tmp_path):
    fmu = package / "out" / "DisturbanceObserver.fmu"
    with pytest.raises(InputError, match="no output 'omegaWReading'"):
        write_package(SYSTEM, fmu, fmu, tmp_path / "out.ssp")
