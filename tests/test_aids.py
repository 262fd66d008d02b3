"""Aids are measured at times: they correct Kalman filters where they are, and nothing elsewhere."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from workbench.__main__ import main
from workbench.api import observe
from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.errors import InputError
from workbench.machines.train.planting import virtual_rig
from workbench.machines.train.rig import points
from workbench.machines.train.stops import SimulatedStop
from workbench.models.fmu import FMU
from workbench.observers import estimators_of
from workbench.observers.estimators.kalman import ExtendedKalmanFilter
from workbench.recordings.case import Case, Value, read_case, read_cases
from workbench.studies.monitoring.estimate import watched
from workbench.system.registry import load_system, open_model
from workbench.system.system import System

from .built import build_text, declare, diagnosed, lagged, machine, machine_file, write_case
from .systems import TRAIN


@pytest.fixture(scope="module")
def still(tmp_path_factory) -> System:
    return declare(tmp_path_factory.mktemp("still"), *machine("still"), Level="Still.Level")


@pytest.fixture(scope="module")
def level(still) -> Iterator[FMU]:
    with open_model(still) as fmu:
        yield fmu


def samples(count: int) -> tuple[Vector, Matrix, Matrix]:
    """A level of 1.5 m, whose fine sensor is silent at first, in the middle and at last."""
    random = np.random.default_rng(2)
    t = np.arange(count, dtype=np.float64)
    y = 1.5 + random.standard_normal((count, 2)) * [0.2, 0.05]
    y[:3, 1] = y[10:20, 1] = y[-4:, 1] = np.nan
    return t, np.zeros((count, 1)), y


# --- filters ---


@pytest.mark.parametrize("name", ["ekf", "arrow", "ukf", "mhe"])
def test_a_constant_is_the_weighted_mean_of_what_was_measured(name, still, level):
    """In closed form: of n readings of variance R and k of variance r, (n/R + k/r)^-1."""
    cls = estimators_of(still)[name]
    t, u, y = samples(40)
    estimate = cls.untuned(level, still).run(t, u, y)
    weights = np.isfinite(y) / np.array([0.2, 0.05]) ** 2
    information = weights.cumsum(axis=0).sum(axis=1)
    mean = (weights * np.nan_to_num(y)).cumsum(axis=0).sum(axis=1) / information
    assert list(cls.fed(still).columns) == ["coarse", "fine"]
    # Points of the unscented filter and nodes of a window are rounded by themselves.
    assert_allclose(estimate.values[:, 0], mean, rtol=1e-6)
    assert_allclose(estimate.values[:, 1], mean, rtol=1e-6)
    assert_allclose(estimate.sigma[:, 0], information**-0.5, rtol=1e-6)


def test_innovations_are_those_of_what_was_measured(still, level):
    t, u, y = samples(2000)
    nis = ExtendedKalmanFilter.untuned(level, still).run(t, u, y).nis[1:]
    fed = np.isfinite(y[1:]).sum(axis=1)
    # Each is chi-squared of so many outputs: the mean of n of them scatters by sqrt(2 k/n).
    for k in (1, 2):
        some = nis[fed == k]
        assert abs(some.mean() - k) < 4.0 * np.sqrt(2.0 * k / some.size)


@pytest.mark.parametrize("name", ["ekf", "ukf", "mhe", "smoother", "imm"])
def test_an_aid_that_is_never_there_changes_nothing(name, stop):
    short = stop[0].part(slice(0, 120))
    runs = [
        observe(system, case, name)
        for system, case in (
            (TRAIN, replace(short.without(["vGNSS"]))),
            (replace(TRAIN, intermittent=()), replace(short, aids=())),
        )
    ]
    for column in runs[1].columns:
        # Of an output more, whose rows of matrices are zero, sums are taken in another order.
        assert_allclose(
            runs[0].signal(column), runs[1].signal(column), rtol=1e-6, atol=1e-9, err_msg=column
        )


def test_estimators_with_fixed_gains_do_without_aids(still, level):
    t, u, y = samples(40)
    for name in ("open_loop", "parameter_estimator"):
        cls = estimators_of(still)[name]
        assert list(cls.fed(still).columns) == ["coarse"]
    cls = estimators_of(still)["open_loop"]
    estimate = cls.untuned(level, still).run(t, u, y)
    assert_array_equal(estimate.values[:, 0], np.full(40, y[0, 0]))


# --- recordings ---


def recorded(folder: Path, rows: str, header: str = "time [s],filling [m/s],coarse [m]") -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "case.toml").write_text('title = "a level"\n[measurement]\nfile = "measured.csv"\n')
    (folder / "measured.csv").write_text(f"{header}\n{rows}")
    return folder


def test_an_empty_field_of_an_aid_is_a_sample_that_is_missing(still, tmp_path):
    header = "time [s],filling [m/s],coarse [m],fine [cm]"
    fields = ["" if k % 3 else f"{150 + k}" for k in range(30)]
    rows = "\n".join(f"{k},0,1.{k:02d},{field}" for k, field in enumerate(fields))
    case = read_case(recorded(tmp_path, rows, header), still)
    there = np.arange(30) % 3 == 0
    assert_array_equal(np.isfinite(case["fine"]), there)
    assert_allclose(case["fine"][there], 1.5 + 0.01 * np.arange(0, 30, 3), rtol=1e-12)
    assert case.y.shape == (30, 2)


def test_a_recording_may_have_no_aid_at_all(still, tmp_path):
    case = read_case(recorded(tmp_path, "\n".join(f"{k},0,1.{k:02d}" for k in range(30))), still)
    assert "fine" not in case
    assert np.isnan(case.y[:, 1]).all()


@pytest.mark.parametrize(("row", "where"), [("7,0,,1.5", "coarse"), ("7,0,1.5,nan", "fine")])
def test_other_fields_are_not_empty_and_gaps_are_no_words(row, where, still, tmp_path):
    rows = [f"{k},0,1.{k:02d},1.5" for k in range(30)]
    rows[7] = row
    folder = recorded(tmp_path, "\n".join(rows), "time [s],filling [m/s],coarse [m],fine [m]")
    with pytest.raises(InputError, match=f"line 9, column '{where}'.*expected a finite number"):
        read_case(folder, still)


def test_what_a_recorder_lacks_of_an_aid_holds_up_nothing_else(still, tmp_path):
    """It has none at first, nor at last; and a fine sensor that is slower is in lines between."""
    fields = ["" if k < 5 or k > 90 or k % 2 else f"{1.5 + 0.01 * k:.3f}" for k in range(100)]
    rows = [f"{k};0.0;1.{k:02d};{field}" for k, field in enumerate(fields)]
    table = "\n".join(["t [s];filling [m/s];coarse [m];fine [m]", *rows])
    (tmp_path / "logged.csv").write_text(table + "\n")
    command = ["import", str(tmp_path / "logged.csv"), "--system", str(still.source)]
    assert main([*command, "--yes", "--quiet", "--out", str(tmp_path / "cases")]) == 0
    (case,) = read_cases([tmp_path / "cases"], still)
    assert case.time.size == 100
    assert_array_equal(np.flatnonzero(np.isfinite(case["fine"])), np.arange(6, 91))
    assert_allclose(case["fine"][6:91], 1.5 + 0.01 * np.arange(6, 91), rtol=1e-9)


# --- conditions that estimators are told ---


def test_what_the_crew_says_is_a_model_with_those_parameters(stop):
    case, _ = stop
    cls, part = ExtendedKalmanFilter, slice(0, 150)
    wet = {"muWR": 0.275, "polach.kA": 0.3, "polach.kS": 0.1, "polach.B": 0.2}
    with open_model(TRAIN) as model:
        own = cls.untuned(model, TRAIN)
        values = []
        for rail in ("wet", "dry"):
            own.set_conditions({"rail": rail})
            values.append(own.run(case.time[part], case.u[part], case.y[part]).values)
        variant = model.variant(wet)
        plain = cls.untuned(variant, TRAIN)
        plain.set_conditions({"rail": "unknown"})
        expected = plain.run(case.time[part], case.u[part], case.y[part]).values
    corrections = [list(own.system.columns).index(correction) for correction in TRAIN.corrections]
    # The friction that is estimated is a deviation from another nominal value.
    same = np.delete(np.arange(expected.shape[1]), corrections)
    assert_allclose(values[0][:, same], expected[:, same], rtol=1e-7, atol=1e-9)
    assert np.abs(values[1] - values[0]).max() > 0.01


def test_who_finds_a_condition_is_not_told(stop):
    case, _ = stop
    cls, part = estimators_of(TRAIN)["imm"], slice(0, 20)
    with open_model(TRAIN) as model:
        bank = cls.untuned(model, TRAIN)
        runs = []
        conditions: list[dict[str, Value]] = [{"rail": "dry"}, {"rail": "wet"}]
        for condition in conditions:
            bank.set_conditions(condition)
            runs.append(bank.run(case.time[part], case.u[part], case.y[part]).values)
    assert_array_equal(runs[0], runs[1])


# --- the train ---


@pytest.fixture(scope="module")
def stop(tmp_path_factory) -> tuple[Case, SimulatedStop]:
    (recorded,) = simulated("01_120_service_dry", 1, tmp_path_factory.mktemp("stop"))
    return recorded


def simulated(name: str, seed: int, folder: Path) -> list[tuple[Case, SimulatedStop]]:
    """A stop of a virtual train, and what happened."""
    rig = virtual_rig([name], None)
    ((made, number),) = rig.simulate(seed, {})
    rig.write([(made, number)], {}, folder)
    return [(case, made) for case in read_cases([folder], TRAIN)]


def test_satellites_tell_the_speed_at_ten_hertz_but_not_in_tunnels(tmp_path):
    rig = virtual_rig(["02_160_service_dry"], None)
    errors, gaps = [], []
    for seed in range(24):
        simulated = rig.simulate(seed, {})
        (made, _) = simulated[0]
        rig.write(simulated, {}, tmp_path / str(seed))
        (case,) = read_cases([tmp_path / str(seed)], TRAIN)
        missing = np.isnan(case["vGNSS"])
        gaps.append(np.flatnonzero(np.diff(missing.astype(int))).size if missing.any() else 0)
        v = np.interp(case.time, made.result.time, made.result.v)
        errors.append((case["vGNSS"] - v)[~missing & (v > 1.0)])
    assert 0 < np.count_nonzero(gaps) < 12  # one stop in eight: 4 or more in a thousandth, 12 never
    assert max(gaps) <= 2  # one tunnel: it begins and ends
    together = np.concatenate(errors)
    # Between two readings in a line, 0.4 and 0.6 of each.
    assert_allclose(together.std(), 0.06 / 3.6 * np.hypot(0.4, 0.6), rtol=0.05)
    assert abs(together.mean()) < 4.0 * together.std() / np.sqrt(together.size)


def test_satellites_tell_radii_that_axles_alone_do_not(tmp_path):
    """What all radii of a train have in common, no axle tells from the speed of the train."""
    common: dict[str, list[float]] = {"with": [], "without": []}
    apart: dict[str, list[Vector]] = {"with": [], "without": []}
    for seed in range(6):
        ((case, made),) = simulated("02_160_service_dry", seed, tmp_path / str(seed))
        true = 0.46 + made.tolerances.radius
        at = int(np.searchsorted(case.time, made.command))
        for label, system in (("with", TRAIN), ("without", replace(TRAIN, intermittent=()))):
            run = observe(
                system, replace(case, aids=tuple(s.name for s in system.intermittent)), "ekf"
            )
            radii = np.array([run.signal(f"r[{i}]")[at] for i in range(1, 9)])
            apart[label].append(1e3 * (radii - true))
            common[label].append(float(apart[label][-1].mean()))
    # 250 readings while it coasts, of 0.017 m/s at 45 m/s: 0.011 mm, and as much of the way's.
    assert np.abs(common["with"]).max() < 0.04
    assert np.sqrt(np.mean(np.square(apart["with"]))) < 0.02
    # Eight radii of up to 0.4 mm are known to that over sqrt(3*8), 0.08 mm.
    assert np.sqrt(np.mean(np.square(common["without"]))) > 0.04


def test_mass_and_gradient_are_estimated_within_their_bands(tmp_path):
    """Of sound trains they are hardly better known than before, and the bands say so."""
    within: dict[str, list[float]] = {"mass": [], "gradient": []}
    bands: dict[str, list[float]] = {"mass": [], "gradient": []}
    for name in ("01_120_service_dry", "02_160_service_dry", "04_120_service_wet"):
        for seed in range(10, 16):
            ((case, made),) = simulated(name, seed, tmp_path / f"{name}{seed}")
            run = observe(TRAIN, case, "ekf")
            at = (case.time > made.command + 3.0) & (case.time < made.result.standstill - 4.0)
            for k in (1, 2):
                apart = run.signal(f"mass[{k}]") - made.mass[k - 1] / made.weighed[k - 1]
                within["mass"].append(covered(apart, run.deviation(f"mass[{k}]"), at))
            bands["mass"].append(float(run.deviation("mass[1]")[at].mean()))
            bands["gradient"].append(float(run.deviation("gradientError")[at].mean()))
            apart = run.signal("gradientError") - gradient_error(case, made)
            within["gradient"].append(covered(apart, run.deviation("gradientError"), at))
    # 18 stops: a share of 0.95 by each scatters by 0.05, by two vehicles less.
    assert {name: np.mean(some) > 0.85 for name, some in within.items()} == {
        "mass": True,
        "gradient": True,
    }
    # Before the stop they are 2 % and half a permille.
    assert 0.015 < np.mean(bands["mass"]) < 0.018
    assert 4e-4 < np.mean(bands["gradient"]) < 5.5e-4


def covered(apart: Vector, sigma: Vector, at: Vector) -> float:
    """Share of samples whose band of 95 % holds the truth."""
    return float(np.mean(np.abs(apart[at]) < 1.96 * sigma[at]))


def gradient_error(case: Case, made: SimulatedStop) -> Vector:
    """True mean gradient under the train less that of its track file, (n,)."""
    s = np.interp(case.time, made.result.time, made.result.s)
    true = [np.interp(s - place, points(), made.gradient) for place in (10.75, 37.15)]
    filed = [case["slope1"], case["slope2"]]
    mean: Vector = np.average(true, axis=0, weights=made.mass) - np.average(
        filed, axis=0, weights=made.weighed
    )
    return mean


def test_what_is_of_a_recording_is_not_watched_over_many():
    names = {quantity.name for quantity in watched(TRAIN)}
    kinds = [f"{quantity}[{i}]" for quantity in ("muDC", "r") for i in range(1, 9)]
    assert names == {*kinds, "bias"}


def test_a_constant_is_refused_by_who_could_not_find_it():
    cls = estimators_of(TRAIN)["disturbance_observer"]
    with open_model(TRAIN) as model, pytest.raises(InputError, match="found 0: a constant"):
        cls.default_gains(model, TRAIN)


# --- diagnosis ---


def test_a_diagnosis_counts_the_samples_that_an_aid_has(tmp_path):
    """Of c der(x) = u - k x beside a coarse sensor; the fine one reads at times.

    It is there in each third sample of two thirds of the recording. Means of so many samples are
    white, of variance one, and of weight elsewhere is none.
    """
    build_text(tmp_path, machine_file("lag_alone/Lag.mo", outputs="coarse = x, fine"))
    (tmp_path / "system.toml").write_text(
        'title = "Lag"\nsample_time = "0.2 s"\nmodels.observer = { fmu = "Lag.fmu" }\n'
        'inputs.u = { unit = "1", noise = 0.0, scale = 2.0, held = true }\n'
        'outputs.coarse = { unit = "1", noise = 1.0, scale = 2.0 }\n'
        'aids.fine = { unit = "1", noise = 0.01, scale = 2.0 }\n'
        '[states]\nx = { spread = 0 }\n[candidates]\nonly = ["k"]\n'
    )
    system, time = load_system(tmp_path), np.arange(0.0, 120.1, 0.2)
    u = 1.0 + np.floor(time / 8.0 + 1e-9) % 2
    true, rng = 0.51, np.random.default_rng(1)
    there = (np.arange(time.size) % 3 == 0) & ((time < 40.0) | (time > 80.0))
    fine = np.where(
        there, lagged(u, 0.2, true, 2.0) + 0.01 * rng.standard_normal(time.size), np.nan
    )
    columns = {"time [s]": time, "u [1]": u}
    columns["coarse [1]"] = lagged(u, 0.2, true, 2.0) + rng.standard_normal(time.size)
    write_case(tmp_path / "without", columns, "Steps")
    write_case(tmp_path / "with", {**columns, "fine [1]": fine}, "Steps")
    cases = read_cases([tmp_path / "without", tmp_path / "with"], system)
    without, outcome = (diagnosed(system, [case], tmp_path / "out") for case in cases)
    assert without.diagnosis.causes == ()
    (cause,) = outcome.diagnosis.causes
    change = cause.parameters[cause.effect.size]
    assert (cause.effect.name, change.low < true - 0.5 < change.high) == ("k", True)
    shown = {error.channel: (error.samples, error.rms[0]) for error in outcome.errors}
    away = np.sqrt(np.nanmean(np.square(fine - lagged(u, 0.2, 0.5, 2.0))))
    assert shown["fine"] == (there.sum(), pytest.approx(away, rel=1e-3))
    source = ModelSource(tmp_path / "Lag.fmu", system, {})
    with ResidualModel(source, cases[1:]) as simulations:
        (recording,), (right,) = simulations.recordings, simulations.at([{"k": true}])
    has = np.array([there[first:end].any() for first, end in recording.blocks])
    assert right.blocks.tolist() == [has.size, has.sum()]
    assert np.square(right.errors[~has, 1]).sum() < 1e-9
    squares = np.square(right.errors[has, 1]).mean()
    assert abs(squares - 1.0) < 4.0 * np.sqrt(2.0 / has.sum())
