"""Estimators as FMUs: the law in C against the law in Python."""

import importlib.util
import json
import re
import subprocess
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.ssp.ssd import read_ssd
from fmpy.validation import validate_fmu
from numpy.testing import assert_array_equal

from workbench.__main__ import main
from workbench.errors import InputError
from workbench.models.compiler import native
from workbench.models.fmu import FMU
from workbench.observers import Estimator, choose
from workbench.observers.estimators.kalman import ExtendedKalmanFilter
from workbench.observers.export import build_observer
from workbench.observers.gains import format_gains
from workbench.recordings.case import Case, read_case, read_cases
from workbench.system.registry import load_system, open_model
from workbench.system.system import System

from . import heater
from .exported import Exported, instance, run_fmu, run_python, with_all_gains, write_fmu
from .processes import COMPILER
from .systems import WHEELSET as SYSTEM

ROOT = Path(__file__).parent.parent
NAMES = ("ekf", "ukf", "mhe", "imm", "disturbance_observer", "parameter_estimator")
# Of the largest value of an output. Found here: equal to the bit, as the order of operations is the
# same; elementary functions of another library may differ in their last bit.
AGREEMENT = 1e-6


@contextmanager
def opened(system: System, name: str) -> Iterator[Estimator]:
    cls = choose(system, [name])[name]
    with open_model(system, cls.role) as fmu:
        yield cls(fmu, system, with_all_gains(cls.default_gains(fmu, system)))


@pytest.fixture(scope="module", params=NAMES)
def exported(request, tmp_path_factory) -> Iterator[Exported]:
    with opened(SYSTEM, request.param) as estimator:
        path = tmp_path_factory.mktemp(request.param) / "estimator.fmu"
        yield Exported(write_fmu(path, estimator), estimator)


@pytest.fixture(scope="module")
def horizon(tmp_path_factory) -> Iterator[Exported]:
    """The moving horizon estimator in FMI 3.0."""
    with opened(SYSTEM, "mhe") as estimator:
        path = tmp_path_factory.mktemp("horizon") / "estimator.fmu"
        yield Exported(write_fmu(path, estimator, fmi=3), estimator)


@pytest.fixture(scope="module")
def slide(root) -> Case:
    """A wet stop in which the wheel slides."""
    return read_case(root / "cases" / "09_wet_160_4.2_wsp", SYSTEM)


def assert_same(values: np.ndarray, expected: np.ndarray) -> None:
    """Equal where there is a number, to a share of the largest value of each output."""
    assert values.shape == expected.shape
    assert_array_equal(np.isnan(values), np.isnan(expected))
    largest = np.nan_to_num(abs(expected)).max(axis=0)
    assert (np.nan_to_num(abs(values - expected)) <= AGREEMENT * largest).all()


def test_fmu_reproduces_python_over_first_contact_and_slide(exported, dry_case, slide):
    for case in (dry_case, slide):
        recording = case.time, case.u, case.y
        assert_same(run_fmu(exported.path, *recording), run_python(exported.python, *recording))


@pytest.mark.long
def test_fmu_reproduces_python_on_all_recorded_stops(exported, root):
    for case in read_cases([root / "cases"], SYSTEM):
        recording = case.time, case.u, case.y
        assert_same(run_fmu(exported.path, *recording), run_python(exported.python, *recording))


def test_fmu_reproduces_python_on_samples_that_are_not_even(exported, slide):
    keep = np.flatnonzero(np.random.default_rng(1).random(3000) < 0.7)
    recording = slide.time[keep], slide.u[keep], slide.y[keep]
    assert_same(run_fmu(exported.path, *recording), run_python(exported.python, *recording))


def test_fmi_3_gives_the_same(horizon, slide):
    recording = slide.time[:2500], slide.u[:2500], slide.y[:2500]
    assert_same(run_fmu(horizon.path, *recording), run_python(horizon.python, *recording))


def test_samples_that_are_missing_are_left_out(horizon, slide):
    """One speed is sampled at a quarter of the rate, the other fails for a second of the slide."""
    y = slide.y[:3000].copy()
    y[np.arange(3000) % 4 != 0, 0] = np.nan
    y[1500:1700, 1] = np.nan
    recording = slide.time[:3000], slide.u[:3000], y
    expected = run_python(horizon.python, *recording)
    assert np.isfinite(expected[:, 0]).all()
    assert_same(run_fmu(horizon.path, *recording), expected)


def test_only_measured_outputs_may_be_missing(horizon, slide):
    sample = np.append(slide.u[0], slide.y[0])
    sample[0] = np.nan
    with (
        instance(horizon.path) as fmu,
        pytest.raises(FMICallException, match="fmi3SetFloat64 failed with status 3"),
    ):
        fmu.step(sample, 0.0, 0.005)


@pytest.mark.parametrize("gap", [0.0, np.nan])
def test_the_first_whole_sample_that_is_connected_starts_it(exported, dry_case, gap):
    time, u, y = dry_case.time[:500], dry_case.u[:500], dry_case.y[:500]
    before = y[:3].copy()
    before[:, 1 if np.isnan(gap) else slice(None)] = gap
    earlier = np.append(time[0] - 0.005 * np.arange(3, 0, -1), time)
    estimate = run_fmu(exported.path, earlier, np.vstack([u[:3], u]), np.vstack([before, y]))
    # Rounding of the times; without it, to the bit.
    assert_same(estimate[3:], run_python(exported.python, time, u, y))
    assert (estimate[:3] == estimate[0]).all()


def test_a_restored_state_repeats_the_steps(exported, slide):
    samples = np.hstack([slide.u, slide.y])
    with instance(exported.path) as fmu:

        def steps(numbers: range) -> np.ndarray:
            return np.array([fmu.step(samples[k], 0.005 * k, 0.005) for k in numbers])

        steps(range(900))
        state = fmu.fmi.getFMUstate()
        kept = fmu.fmi.serializeFMUstate(state)
        first = steps(range(900, 1000))
        fmu.fmi.setFMUstate(state)
        assert_array_equal(steps(range(900, 1000)), first)
        fmu.fmi.setFMUstate(fmu.fmi.deSerializeFMUstate(kept))
        assert_array_equal(steps(range(900, 1000)), first)


def test_a_sample_that_fails_is_as_if_it_had_not_been(horizon, slide):
    samples = np.hstack([slide.u, slide.y])[:60]
    wrong = samples[40].copy()
    wrong[:2] = 1e308  # where the model has no finite derivative
    with instance(horizon.path) as fmu:
        for k in range(40):
            fmu.step(samples[k], 0.005 * k, 0.005)
        state = fmu.fmi.getFMUState()
        expected = [fmu.step(samples[k], 0.005 * k, 0.005) for k in range(40, 60)]
        fmu.fmi.setFMUState(state)
        with pytest.raises(FMICallException, match="fmi3DoStep failed with status 2"):
            fmu.step(wrong, 0.2, 0.005)
        assert [fmu.step(samples[k], 0.005 * k, 0.005) for k in range(40, 60)] == expected


def test_description_is_valid_and_has_units_and_columns(exported):
    assert_described(exported)


def test_description_of_fmi_3_is_so_too(horizon):
    assert_described(horizon)


def assert_described(own: Exported) -> None:
    assert validate_fmu(str(own.path)) == []
    description = fmpy.read_model_description(str(own.path))
    assert description.modelExchange is None
    assert description.coSimulation.canHandleVariableCommunicationStepSize
    assert description.coSimulation.canGetAndSetFMUstate
    variables = {v.name: (v.causality, v.unit) for v in description.modelVariables}
    gains = {name for name, (causality, _) in variables.items() if causality == "parameter"}
    assert gains <= set(own.python.gains.names)
    shown = {
        f"{n}Estimate" if n in ("omegaW", "omegaR") else n: unit
        for n, unit in SYSTEM.columns.items()
    }
    expected = {signal.name: ("input", signal.unit) for signal in (*SYSTEM.inputs, *SYSTEM.outputs)}
    expected |= {name: ("output", unit) for name, unit in shown.items()}
    expected |= {f"sigma_{name}": ("output", unit) for name, unit in SYSTEM.columns.items()}
    expected |= {f"probability_{name}": ("output", "1") for name in own.python.modes}
    for name in ("time", *gains):
        variables.pop(name, None)
    assert variables == expected | {"nis": ("output", "1")}


def test_a_tool_without_python_of_ours_gets_the_same(exported, dry_case):
    """FMPy's own simulation, which sees the estimate at the end of a step, one sample later."""
    time = np.arange(1500) * 0.005
    names = ("time", *(signal.name for signal in (*SYSTEM.inputs, *SYSTEM.outputs)))
    signals = np.column_stack([time, dry_case.u[:1500], dry_case.y[:1500]])
    recorded = np.array([tuple(row) for row in signals], [(n, float) for n in names])
    result = fmpy.simulate_fmu(
        str(exported.path), input=recorded, stop_time=time[-1], output=["Fx"], output_interval=0.005
    )
    expected = run_python(exported.python, time, dry_case.u[:1500], dry_case.y[:1500])
    force = expected[:, list(SYSTEM.columns).index("Fx")]
    assert abs(result["Fx"][1:] - force[:-1]).max() < AGREEMENT * abs(force).max()


# --- fixed memory ---


def test_sources_of_the_law_ask_for_no_memory(exported):
    own = ("integrator.c", "memory.h", "law_code.h", "law_data.h", "plant.h", "plant_code.h")
    with zipfile.ZipFile(exported.path) as archive:
        text = "\n".join(archive.read(f"sources/{name}").decode() for name in own)
    assert not re.search(r"\b(malloc|calloc|realloc|alloca|free)\b", text)


def test_under_the_sanitizers_samples_are_clean_and_nothing_is_allocated(tmp_path, slide):
    """Over the slide; what is printed are the same numbers, and those of restored steps again."""
    if COMPILER is None:
        pytest.skip("needs a C compiler")
    count, path = 600, tmp_path / "estimator.fmu"
    part = slice(1200, 1200 + count)
    u, y = slide.u[part], slide.y[part].copy()
    y[100:120, 1] = np.nan
    with opened(SYSTEM, "mhe") as estimator:
        write_fmu(path, estimator)
        expected = run_python(estimator, 0.005 * np.arange(count), u, y)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path, [n for n in archive.namelist() if n.startswith("sources/")])
    command = [COMPILER, "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O1"]
    command += ["-ffp-contract=off", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    command += ["-I.", "model.c", "instance.c", "integrator.c", "fmi2.c"]
    command += [str(Path(__file__).parent / "runtime" / "samples_fmi2.c"), "-o", "samples", "-lm"]
    build = subprocess.run(
        command, cwd=tmp_path / "sources", capture_output=True, text=True, check=False
    )
    if "cannot find -lasan" in build.stderr or "libasan" in build.stderr:
        pytest.skip("needs the runtime of the sanitizers")
    assert (build.returncode, build.stderr) == (0, "")
    with instance(path) as fmu:
        references = [*fmu.inputs, *fmu.outputs]
        head = [count, len(fmu.inputs), len(fmu.outputs), *references]
    rows = np.column_stack([np.full(count, 0.005), u, y])
    given = (
        " ".join(map(str, head))
        + "\n"
        + "\n".join(" ".join(map(repr, row)) for row in rows.tolist())
    )
    run = subprocess.run(
        [tmp_path / "sources" / "samples"], input=given, capture_output=True, text=True, check=False
    )
    assert (run.returncode, run.stderr) == (0, "")
    samples = np.array([line.split() for line in run.stdout.splitlines()], float)
    half, again = count // 2, 10
    assert_same(np.vstack([samples[: half + again], samples[half + 2 * again :]]), expected)
    assert_array_equal(samples[half : half + again], samples[half + again : half + 2 * again])


# --- other machines ---


def test_a_machine_with_a_state_that_is_not_measured_exports(tmp_path):
    system = heater.system(tmp_path / "heater")
    time = np.arange(200.0)
    power = np.where(time % 60.0 < 30.0, 40.0, 5.0)
    rng = np.random.default_rng(2)
    warm = 10.0 + np.cumsum(0.002 * power) + 0.05 * rng.standard_normal(time.size)
    recording = time, power[:, None], warm[:, None]
    with opened(system, "mhe") as estimator:
        path = write_fmu(tmp_path / "estimator.fmu", estimator)
        assert_same(run_fmu(path, *recording), run_python(estimator, *recording))


def test_a_machine_whose_output_is_no_state_exports(tmp_path):
    """Friction of a seal, a model without states at all."""
    system = load_system("seal_friction")
    rng = np.random.default_rng(5)
    time = np.arange(300) * system.sample_time
    u = np.array([quantity.scale for quantity in system.inputs]) * rng.standard_normal(
        (300, len(system.inputs))
    )
    y = np.array([output.scale for output in system.outputs]) * rng.standard_normal(
        (300, len(system.outputs))
    )
    with opened(system, "ekf") as estimator:
        assert not estimator.fmu.states
        path = write_fmu(tmp_path / "estimator.fmu", estimator)
        assert_same(run_fmu(path, time, u, y), run_python(estimator, time, u, y))


# --- what cannot be exported ---

OWN = """
from workbench.models.native import compiled
from workbench.observers.estimators.kalman import ExtendedKalmanFilter, ekf_step


@compiled
def step(model, settings, state, h, u, y, estimate):
    total = 0.0
    for value in y:
        total += value
    return ekf_step(model, settings, state, h, u, y, estimate)


class Own(ExtendedKalmanFilter):
    name = "own"
    _step = staticmethod(step)


class Curved(ExtendedKalmanFilter):
    name = "curved"

    def _begin(self, u, y):
        super()._begin(u, y)
        self._state.z[-1] = y[0] ** 2


class Shared(ExtendedKalmanFilter):
    name = "shared"

    def __init__(self, fmu, system, gains):
        super().__init__(fmu, system, gains)
        self._state = self._state._replace(change=self._state.z)
"""


@pytest.mark.parametrize(
    ("name", "match"),
    [
        ("Own", r"own\.py, line 9: found a loop that is not over a range: for value in y"),
        ("Curved", r"estimator curved: found .*z\[3\], which is not linear in the first sample"),
        ("Shared", "estimator shared: found an array that stands in two places of its memory"),
    ],
)
def test_what_does_not_become_c_is_refused_in_words(tmp_path, minimal, name, match):
    (tmp_path / "own.py").write_text(OWN)
    spec = importlib.util.spec_from_file_location("own", tmp_path / "own.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    estimator = getattr(module, name).untuned(minimal, SYSTEM)
    with pytest.raises(InputError, match=match):
        build_observer(estimator, tmp_path / "own.fmu", 2, platforms=[native()])
    assert not (tmp_path / "own.fmu").exists()


def test_a_model_that_is_not_of_the_library_is_refused(tmp_path, reference_path):
    with FMU(reference_path) as fmu:
        gains = ExtendedKalmanFilter.default_gains(fmu, SYSTEM)
        estimator = ExtendedKalmanFilter(fmu, SYSTEM, gains)
        with pytest.raises(InputError, match=r"expected what WheelsetRig\.MinimalObserver has"):
            build_observer(estimator, tmp_path / "own.fmu", 2, platforms=[native()])


# --- the command ---


@pytest.fixture
def command(root, tmp_path, monkeypatch) -> Callable[..., int]:
    """Runs `export` into tmp_path / "out"."""
    monkeypatch.chdir(root)
    return lambda *options: main(["export", *options, "--out", str(tmp_path / "out")])


def test_the_command_writes_a_bank_with_gains_of_its_filters(command, tmp_path):
    with opened(SYSTEM, "ekf") as estimator:
        gains = estimator.gains.with_values(0.5 * estimator.gains.values)
    (tmp_path / "gains.toml").write_text(format_gains(gains, "", {"z": 0.3}))
    options = "--gains", str(tmp_path / "gains.toml"), "--platforms", "native"
    assert command("--estimator", "imm", *options) == 0
    names = {file.name for file in (tmp_path / "out").iterdir()}
    model = "InteractingMultipleModel"
    assert names == {f"{model}.fmu", f"{model}.ssp", "summary.json"}
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["estimator"] == "imm"
    assert summary["gains"] == dict(zip(gains.names, gains.values.tolist(), strict=True))
    with zipfile.ZipFile(tmp_path / "out" / f"{model}.fmu") as archive:
        assert archive.read("resources/gains.toml") == (tmp_path / "gains.toml").read_bytes()
        libraries = [n for n in archive.namelist() if n.startswith("binaries/")]
    assert len(libraries) == 1
    elements = read_ssd(str(tmp_path / "out" / f"{model}.ssp"), validate=True).system.elements
    assert [element.source for element in elements][1] == f"resources/{model}.fmu"


def test_gains_of_another_estimator_are_refused(command, tmp_path, capsys):
    with opened(SYSTEM, "ekf") as estimator:
        (tmp_path / "gains.toml").write_text(format_gains(estimator.gains, "", {}))
    assert command("--estimator", "mhe", "--gains", str(tmp_path / "gains.toml")) == 2
    assert "found estimator = 'ekf'; expected one of mhe" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
