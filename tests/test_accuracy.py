"""Accuracy of the estimators as they come: against the truth of the virtual rig, and on recordings
made by an independent simulator."""

import json
import math
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from workbench.__main__ import main
from workbench.arrays import Vector
from workbench.machines.wheelset.accuracy import (
    COVERED,
    ROWS,
    Accuracy,
    BandCoverage,
    KnownStop,
    StopAccuracy,
    accuracy,
    contact_errors,
    covered,
    fall_delay,
    force_error,
    friction_error,
    held_by_bands,
    minimum_error,
    needed,
    observe_stop,
    rise_delay,
    slide_error,
    stop_accuracy,
    worst,
)
from workbench.machines.wheelset.accuracy_report import format_accuracy
from workbench.machines.wheelset.rig import ORDINARY_PADS, Effects, select
from workbench.machines.wheelset.truth import Truth, read_truth
from workbench.machines.wheelset.validity import PeakForce
from workbench.observers import Estimator
from workbench.observers import estimators_of as all_estimators
from workbench.observers.estimators.kalman import ExtendedKalmanFilter
from workbench.observers.gains import usual_gains
from workbench.observers.replay import replay
from workbench.observers.run import Ending, Run
from workbench.observers.score import score
from workbench.recordings.case import Case, read_case, read_cases
from workbench.recordings.csv import read_columns
from workbench.system.registry import open_model

from .edits import edit
from .page_rules import check_page
from .recordings import record
from .schemas import check
from .systems import WHEELSET as SYSTEM

ROOT = Path(__file__).parent.parent
RECORDINGS = ROOT.parent / "shared" / "recordings"
# Of a wheelset, which has no like parts, the block filter is the extended one.
KINDS = {name: cls for name, cls in all_estimators(SYSTEM).items() if name != "arrow"}
OBSERVERS = tuple(KINDS)[2:]  # the others are baselines
PLANTS = ("clean", "cylinder_lag", "fade", "pole_ring", "radius", "speed_friction")

STOPS = tuple(sorted(folder.name for folder in (ROOT / "cases").iterdir()))
DRY = tuple(name for name in STOPS if "_dry_" in name)
WET = tuple(name for name in STOPS if name not in DRY)
SLIDE = "09_wet_160_4.2_wsp"


@pytest.fixture(scope="module")
def estimators() -> Iterator[dict[str, Estimator]]:
    with open_model(SYSTEM) as minimal, open_model(SYSTEM, "full") as full:
        models = {"observer": minimal, "full": full}
        yield {
            name: cls(fmu, SYSTEM, usual_gains(cls, fmu, SYSTEM))
            for name, cls in KINDS.items()
            if (fmu := models[cls.role])
        }


# --- against the truth of the virtual rig ---


@pytest.fixture(scope="module")
def stops(once, estimators) -> dict[str, KnownStop]:
    made = list(estimators.values())
    return once(
        "stops of known truth",
        lambda _: {
            case.name: observe_stop(case, read_truth(case, SYSTEM), made, SYSTEM)
            for case in read_cases([ROOT / "cases"], SYSTEM)
        },
    )


@pytest.mark.parametrize("observer", OBSERVERS)
@pytest.mark.parametrize(
    ("names", "limit"),
    [(DRY, 0.006), ([name for name in WET if name != SLIDE], 0.015), ([SLIDE], 0.025)],
    ids=["dry", "wet", "slide"],
)
def test_force_error_is_small(stops, observer, names, limit):
    """Error of the contact force itself, which no sensor reads: rms over mean, below 5 Hz."""
    for name in names:
        assert force_error(stops[name], observer) < limit, name


@pytest.mark.parametrize("observer", OBSERVERS)
@pytest.mark.parametrize(("names", "limit"), [(DRY, 0.01), (WET, 0.02)], ids=["dry", "wet"])
def test_friction_of_the_pads_is_recovered(stops, observer, names, limit):
    """From 1 s after the first contact to 1 m/s, below 5 Hz, at every time."""
    for name in names:
        assert friction_error(stops[name], observer) < limit, name


@pytest.mark.parametrize("filter_", ["ekf", "ukf", "mhe", "imm", "smoother"])
def test_the_band_of_a_filter_holds_what_it_says(stops, filter_):
    """Stops of seeds 8 to 14 say how wide they are; these are of seed 1."""
    shares = [held_by_bands(stop, filter_) for stop in stops.values()]
    for quantity in COVERED:
        known = [share[quantity].share for share in shares if quantity in share]
        if quantity != "muWR":  # which is claimed in the few stops that use much of the adhesion
            # Of single seeds the slip asks for bands 9 % narrower to 9 % wider, 2 % more or less.
            assert 0.93 < np.mean(known) < 0.97, quantity
    # Noise of the pressure sensor moves the force and no speed: without it one held 58 %. A
    # roller's inertia three tolerances off, which no band holds, takes one of other seeds to 82 %.
    for name, share in zip(stops, shares, strict=True):
        assert share["Fx"].share > 0.85, name


@pytest.mark.parametrize("observer", OBSERVERS)
def test_force_is_followed_within_half_a_second(stops, observer):
    """Nine tenths of what is reached 2 s after the first contact, and of the fall in the slide.

    The answer to a step proper is in `test_observers`.
    """
    for name, stop in stops.items():
        assert rise_delay(stop, observer) < 0.5, name
    assert fall_delay(stops[SLIDE], observer) < 0.5


# Stops in which an observer oscillates at the first contact of the pads, all of them with wet
# discs: the parameter estimator is a PI controller and swings through, the disturbance observer a
# little where the brake is light. Filters begin with friction that is free within its range.
OSCILLATING = {
    "parameter_estimator": set(WET) - {"13_onedisc_100_2.7"},
    "disturbance_observer": {"07_wet_80_1.5"},
    "disturbance_observer_disc": {"07_wet_80_1.5"},
}


@pytest.mark.parametrize("observer", OBSERVERS)
def test_no_oscillation_at_the_first_contact_of_the_pads(stops, observer):
    """The error swings to both sides by less than 3 % of the force that is being built up.

    3 % is twice what noise of the sensors makes of an estimate below 5 Hz. An error to one side
    is no oscillation: of wet discs an observer learns only as they are pressed.
    """
    oscillating = {
        name for name, stop in stops.items() if min(contact_errors(stop, observer)) > 0.03
    }
    assert oscillating == OSCILLATING.get(observer, set())


@pytest.mark.parametrize("observer", OBSERVERS)
def test_dry_pads_are_followed_from_the_first_contact_on(stops, observer):
    for name in DRY:
        assert max(contact_errors(stops[name], observer)) < 0.03, name  # 3 % as above


@pytest.mark.parametrize("observer", OBSERVERS)
def test_the_slide_is_followed_to_its_minimum(stops, observer):
    """The paper's disturbance observer misses the minimum."""
    stop = stops[SLIDE]
    # 15 % is what is asked inside a slide.
    assert slide_error(stop, observer) < 0.15
    # A tenth of the 15 %: the minimum is a matter of a quarter of a second.
    assert abs(minimum_error(stop, observer)) < 0.015


@pytest.fixture(scope="module")
def slippery(tmp_path_factory) -> list[Case]:
    """Stops near the limit of adhesion of a contact that has the law of a dry one."""
    folder = tmp_path_factory.mktemp("slippery")
    for name in ("03_dry_120_3.6", "04_dry_160_4.2", "06_dry_160_3.6_rev"):
        for muWR in (0.19, 0.22, 0.25):
            (scenario,) = select([name])
            record(replace(scenario, muWR=muWR), 1, Effects(), folder / f"{name}_{muWR}", every=1)
    return read_cases([folder], SYSTEM)


@pytest.mark.long
@pytest.mark.parametrize("observer", OBSERVERS)
def test_friction_of_the_rail_is_recovered_near_the_limit_of_adhesion(
    estimators, slippery, observer
):
    """Within a tenth from 70 % of the adhesion on, where the law of the contact is right.

    Braking presses the wheels of the multibody model down by 4 to 5 %, in reverse it lifts them;
    the observers' models hold the wheel load, and take that for 6 to 7 % of muWR.
    """
    estimator, near = estimators[observer], []
    for case in slippery:
        run = replay(case, estimator)
        used = PeakForce(estimator.fmu, SYSTEM).utilisation(run.estimate)
        error = run.signal("muWR") / read_truth(case, SYSTEM).muWR - 1.0
        near.append(error[run.claimed["muWR"] & (used > 0.7)])
    errors = np.abs(np.concatenate(near))
    assert errors.size > 10_000
    # What is measured, with a margin: 99.8 % of the Kalman filters, 91.5 to 96 % of the others.
    assert np.mean(errors < 0.1) > (0.99 if observer in ("ekf", "ukf") else 0.90)


@pytest.mark.parametrize(("name", "low"), [("07", 0.79), ("08", 0.41), ("09", 0.14), ("10", 0.58)])
def test_a_model_of_the_dry_contact_finds_too_little_friction_on_wet_rails(estimators, name, low):
    """Median of the EKF where a dry contact would be claimed; the share is of the README."""
    (stop,) = (ROOT / "cases").glob(f"{name}_*")
    (case,) = read_cases([stop], SYSTEM)
    as_dry = replace(case, conditions={**case.conditions, "wheel_rail": "dry"})
    run = replay(as_dry, estimators["ekf"])
    truth = read_columns(stop / "truth.csv", ["time", "muWR"])
    true = np.interp(case.time, truth["time"].values, truth["muWR"].values)
    error = (run.signal("muWR") / true - 1.0)[run.claimed["muWR"]]
    assert np.median(error) == pytest.approx(-low, abs=0.02)


@pytest.mark.parametrize("observer", ["ekf", "ukf", "mhe"])
def test_friction_that_a_filter_passes_through_is_not_claimed(estimators, tmp_path, observer):
    """A dry rail, 0.40, that noise makes slippery for 0.04 to 0.2 s as the force builds up."""
    (scenario,) = select(["06_dry_160_3.6_rev"])
    record(scenario, 7, ORDINARY_PADS, tmp_path / scenario.name)
    (case,), estimator = read_cases([tmp_path], SYSTEM), estimators[observer]
    run = replay(case, estimator)
    passed = PeakForce(estimator.fmu, SYSTEM).valid(run.estimate)  # the rule alone claims it
    assert 0.03 < passed.sum() * 0.005 < 0.25
    assert run.signal("muWR")[passed].max() < 0.14
    assert not run.claimed["muWR"].any()


# --- on recordings of an independent simulator, whose truth is not known here ---


@cache
def recorded(folder: Path) -> list[Case]:
    """The cases of a folder, read once for all estimators."""
    return read_cases([folder], SYSTEM)


def largest_error(estimator: Estimator, folder: Path, pattern: str = "") -> float:
    """Largest error of Fx, rms over mean, over the cases whose name holds the pattern."""
    errors = []
    for case in recorded(folder):
        if pattern in case.name:
            error = score(case, replay(case, estimator), SYSTEM).nrmse
            assert error is not None, case.name
            errors.append(error)
    return max(errors)


# A wrong radius and an eccentric pole ring look like slip, which fast gains follow.
MISLED = {
    ("pole_ring", "parameter_estimator"): 0.03,
    ("radius", "parameter_estimator"): 0.035,
    ("radius", "disturbance_observer_disc"): 0.022,
}


@pytest.mark.parametrize(
    ("recordings", "name"),
    [
        # The smoother takes as long as all others together.
        pytest.param(
            recordings,
            name,
            marks=[pytest.mark.long] * (name == "smoother" and recordings != "fade"),
        )
        for recordings in PLANTS
        for name in OBSERVERS
    ],
)
def test_force_is_followed_whatever_is_wrong_with_the_plant(estimators, name, recordings):
    """Dry stops of a rig that lags, fades, or has a wrong radius or an eccentric pole ring."""
    folder = RECORDINGS / "labelled" / recordings
    if not folder.is_dir():
        pytest.skip("the recordings are not at hand")
    assert largest_error(estimators[name], folder) < MISLED.get((recordings, name), 0.02)


@pytest.mark.parametrize(
    ("pattern", "limit", "name"),
    [
        *(("_dry_", 0.02, name) for name in OBSERVERS),
        *(("wet", 0.04, name) for name in OBSERVERS if name != "smoother"),
        pytest.param("wet", 0.04, "smoother", marks=pytest.mark.long),  # as above
    ],
)
def test_force_on_the_standard_recordings(estimators, name, pattern, limit):
    folder = RECORDINGS / "standard"
    if not folder.is_dir():
        pytest.skip("the recordings are not at hand")
    assert largest_error(estimators[name], folder, pattern) < limit


WITHOUT_SLIDE = "02_dry_100_2.7"
RW, RR = 0.46, 0.70  # [m]

# --- definitions, on a stop in reverse from 30 m/s, with a slide from 10 to 11.5 s ---

TIME = 0.005 * np.arange(4000)
SPEED = 30.0 - 28.0 * TIME / TIME[-1]
FORCE = 20e3 * np.clip(TIME - 4.0, 0.0, 1.0)
SLIDING = (TIME >= 10.0) & (TIME < 11.5)
FORCE[SLIDING] -= 6e3 * (1.0 - np.cos(2 * np.pi * (TIME[SLIDING] - 10.0) / 1.5))
CASE = Case(
    name="hand",
    title="by hand",
    conditions={
        "initial_speed": 30.0,
        "brake_pressure": 3e5,
        "wheel_rail": "wet",
        "discs": ("dry", "dry", "wet"),
        "direction": -1,
    },
    time=TIME,
    signals={
        "pB": np.where(TIME > 4.0, 3e5, 0.0),
        "tauR": np.zeros(TIME.size),
        "omegaW": -SPEED / RW,
        "omegaR": -SPEED / RR,
    },
    inputs=("pB", "tauR"),
    outputs=("omegaW", "omegaR"),
    source=Path("hand/measured.csv"),
)
TRUTH = Truth(
    Fx=-FORCE,
    slip=-SPEED * np.where(SLIDING, 0.05, 0.005),
    omegaW=-SPEED / RW,
    omegaR=-SPEED / RR,
    muWR=np.full(TIME.size, 0.3),
    muDC=np.full(TIME.size, 0.3),
    contact=4.0,
)


def estimated(force: Vector, muDC: Vector, ending: Ending = Ending.OK) -> KnownStop:
    """The stop with one run, whose force brakes if it is positive."""
    estimate = np.full((TIME.size, len(SYSTEM.columns)), np.nan)
    estimate[:, list(SYSTEM.columns).index("Fx")] = -force
    estimate[:, list(SYSTEM.columns).index("muDC")] = muDC
    blank = np.full(TIME.size, np.nan)
    run = Run("hand", "one", SYSTEM.columns, TIME, estimate, estimate, blank, ending, "", 0.0, {})
    return KnownStop(CASE, TRUTH, {"one": run}, SYSTEM)


def test_a_force_that_is_too_large_by_a_constant():
    stop = estimated(FORCE + 100.0, TRUTH.muDC)
    braking = TIME > 4.0
    assert force_error(stop, "one") == pytest.approx(100.0 / FORCE[braking].mean())
    # The low-pass rounds the slide, by little of its mean and of its minimum of 8 kN.
    assert slide_error(stop, "one") == pytest.approx(100.0 / FORCE[SLIDING].mean(), rel=0.01)
    assert minimum_error(stop, "one") == pytest.approx(100.0 / 8e3, rel=0.01)
    # An error to one side is no oscillation.
    assert contact_errors(stop, "one") == pytest.approx((100.0 / 20e3, -100.0 / 20e3))
    assert accuracy(stop, "one").oscillation == 0.0


def test_a_force_that_is_late():
    late = np.interp(TIME - 0.1, TIME, FORCE)
    errors = accuracy(estimated(late, TRUTH.muDC), "one")
    assert errors.rise_delay == pytest.approx(0.1)
    assert errors.fall_delay == pytest.approx(0.1)
    never = estimated(0.5 * FORCE, TRUTH.muDC)
    assert rise_delay(never, "one") == math.inf


def test_a_force_that_oscillates_at_the_first_contact():
    swing = np.where(TIME < 6.0, 500.0 * np.sin(2 * np.pi * TIME), 0.0)
    errors = accuracy(estimated(FORCE + swing, TRUTH.muDC), "one")
    assert errors.oscillation == pytest.approx(500.0 / 20e3, rel=0.01)


def test_friction_is_judged_from_a_second_after_the_first_contact():
    error = np.where(TIME < 4.5, 0.1, 0.003)
    stop = estimated(FORCE, TRUTH.muDC + error)
    assert friction_error(stop, "one") == pytest.approx(0.003, rel=0.01)
    # The friction of the nominal model does not move: it is no estimate.
    assert accuracy(estimated(FORCE, TRUTH.muDC), "one").muDC is None


def test_friction_of_the_rail_is_judged_where_it_is_claimed():
    stop = estimated(FORCE, TRUTH.muDC)
    run, wrong = stop.runs["one"], np.where(TIME < 12.0, 0.1, 0.318)
    run.estimate[:, list(SYSTEM.columns).index("muWR")] = wrong
    assert accuracy(stop, "one").muWR is None
    claiming = replace(stop, runs={"one": replace(run, claimed={"muWR": TIME > 12.0})})
    assert accuracy(claiming, "one").muWR == pytest.approx(0.06)


def test_only_the_first_slide_counts_and_creep_is_none():
    stop = estimated(FORCE, TRUTH.muDC)
    assert np.array_equal(stop.slide, SLIDING)
    later = replace(TRUTH, slip=np.where(TIME > 15.0, -0.05 * SPEED, TRUTH.slip))
    assert np.array_equal(replace(stop, truth=later).slide, SLIDING)
    rolling = replace(stop, truth=replace(TRUTH, slip=-0.015 * SPEED))
    accuracies = stop_accuracy(rolling)
    assert not accuracies.slides
    assert accuracies.wet  # one disc of three
    assert accuracies.estimators["one"].force_in_slide is None


# --- the worst ---


def stop_of(name: str, wet: bool, slides: bool, result: Accuracy) -> StopAccuracy:
    return StopAccuracy(name, name, wet, slides, {"one": result})


def test_the_worst_is_taken_over_the_stops_that_a_row_concerns():
    stops = [
        stop_of("dry", False, False, Accuracy(force=0.01, rise_delay=-0.3, muDC=0.002)),
        stop_of("wet", True, False, Accuracy(force=0.03, rise_delay=0.1, muDC=0.004)),
        stop_of("deep", True, True, Accuracy(force=0.02, minimum_in_slide=-0.2, muDC=0.003)),
        stop_of("high", True, True, Accuracy(force=0.01, minimum_in_slide=0.1)),
    ]
    extremes = [worst(row, stops, "one") for row in ROWS]
    values = [extreme and (extreme.stop, extreme.value) for extreme in extremes]
    assert values == [
        ("dry", 0.01),
        ("wet", 0.03),
        ("deep", 0.02),
        None,
        ("deep", -0.2),
        ("wet", 0.1),
        None,
        ("dry", 0.002),
        ("wet", 0.004),
        None,
    ]


def test_an_estimator_that_failed_or_never_arrived_is_not_left_out_of_the_worst():
    never = Accuracy(force=0.01, rise_delay=math.inf)
    failed = accuracy(estimated(FORCE, TRUTH.muDC, Ending.NOT_FINITE), "one")
    stops = [stop_of("a", False, False, never), stop_of("b", True, False, failed)]
    cells = {line[:30].strip(): line[34:].split() for line in format_accuracy(stops).splitlines()}
    assert cells["force, dry discs"] == ["1.00", "%"]
    assert cells["force, wet discs"] == ["failed"]
    assert "never" in format_accuracy(stops[:1])
    assert f"b, one: {Ending.NOT_FINITE.value}" in format_accuracy(stops)


def test_a_band_that_holds_little_in_one_stop_is_not_hidden_by_the_mean():
    stops = [
        stop_of(
            name, False, False, Accuracy(force=0.01, bands={"Fx": BandCoverage(share, np.ones(2))})
        )
        for name, share in (("a", 0.98), ("b", 0.7))
    ]
    mean, least = (line.split() for line in format_accuracy(stops).splitlines() if line[:2] == "Fx")
    assert (mean, least) == (["Fx", "84.0", "%"], ["Fx", "70.0", "%"])


@pytest.mark.parametrize("scale", [0.4, 1.7])
def test_bands_that_are_multiplied_by_what_they_need_hold_95_percent(scale):
    """Of stops alike whose errors have heavier tails than any normal distribution."""
    rng, sigma = np.random.default_rng(3), 80.0

    def stops(multiplied: float) -> list[StopAccuracy]:
        stops = []
        for name in ("a", "b", "c", "d", "e", "f"):
            wrong = FORCE + scale * sigma * rng.standard_t(4, TIME.size)
            stop = estimated(wrong, TRUTH.muDC)
            sigmas = np.full_like(stop.runs["one"].sigma, multiplied * sigma)
            run = replace(stop.runs["one"], sigma=sigmas)
            held_in = accuracy(replace(stop, runs={"one": run}), "one")
            stops.append(stop_of(name, False, False, held_in))
        return stops

    factor = needed(stops(1.0), "one", "Fx")
    # 1.96 standard deviations are the reach of a band, 2.776 that of Student's t with 4 degrees.
    assert factor == pytest.approx(scale * 2.776 / 1.96, rel=0.03)
    # Six stops of 3200 samples: a share of 95 % is known to 0.16 %.
    assert covered(stops(factor), "one", "Fx") == pytest.approx(0.95, abs=0.005)


# --- the command ---


def test_command_writes_every_stop_and_the_worst(system, root, tmp_path, monkeypatch, capsys):
    """On cases that keep the truth of every fourth sample."""
    monkeypatch.chdir(root)
    cases = [f"cases/{name}" for name in (WITHOUT_SLIDE, SLIDE)]
    options = ["--estimator", "ekf", "--estimator", "open_loop", "--out", str(tmp_path)]
    assert main(["accuracy", *cases, *options]) == 0
    printed = capsys.readouterr().out
    assert all(row.text in printed for row in ROWS)

    with open_model(system) as fmu:
        ekf = ExtendedKalmanFilter.untuned(fmu, system)
        read = (read_case(root / case, system) for case in cases)
        stops = {
            case.name: observe_stop(case, read_truth(case, system), [ekf], system) for case in read
        }
    summary = json.loads((tmp_path / "accuracy.json").read_text())
    check("accuracy", summary)
    page = check_page(tmp_path / "index.html", summary)
    assert len(page.get_element_by_id("stop-table").xpath("tbody/tr")) == len(cases)
    assert len(page.get_element_by_id("worst-table").xpath("tbody/tr")) == len(ROWS)
    table = pd.read_csv(tmp_path / "accuracy.csv").set_index(["case", "estimator"])
    for name, stop in stops.items():
        expected = {
            "force": force_error(stop, "ekf"),
            "rise_delay": rise_delay(stop, "ekf"),
            "muDC": friction_error(stop, "ekf"),
        }
        errors = summary["stops"][name]["estimators"]["ekf"]
        assert {quantity: errors[quantity] for quantity in expected} == pytest.approx(expected)
        for quantity, value in expected.items():
            unit = summary["quantities"][quantity]["unit"]
            # Six digits are written.
            cell = table.loc[(name, "ekf"), f"{quantity} [{unit}]"]
            assert cell == pytest.approx(value, rel=1e-5, abs=1e-9)

    assert set(table.index.get_level_values("estimator")) == {"open_loop", "ekf"}
    assert summary["stops"][SLIDE]["slides"]
    assert not summary["stops"][WITHOUT_SLIDE]["slides"]
    assert "force_in_slide" not in summary["stops"][WITHOUT_SLIDE]["estimators"]["ekf"]
    last = summary["worst"]["ekf"]
    assert last["force, dry discs"]["stop"] == WITHOUT_SLIDE
    inside = slide_error(stops[SLIDE], "ekf")
    assert last["force, inside the slide"] == {
        "quantity": "force_in_slide",
        "value": pytest.approx(inside),
        "stop": SLIDE,
    }
    assert f"{100 * inside:.1f} %" in printed
    assert "muDC, dry discs" not in summary["worst"]["open_loop"]


def test_command_refuses_recordings_without_truth(root, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(root)
    shutil.copytree(root / "cases" / WITHOUT_SLIDE, tmp_path / "measured")
    (tmp_path / "measured" / "truth.csv").unlink()
    out = tmp_path / "out"
    assert main(["accuracy", str(tmp_path / "measured"), "--out", str(out)]) == 2
    message = capsys.readouterr().err
    for part in ("measured: found no truth.csv", "expected a case of the simulated rig", "To do: "):
        assert part in message
    assert not out.exists()


def test_command_refuses_a_truth_in_other_units(root, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(root)
    folder = tmp_path / "case"
    shutil.copytree(root / "cases" / WITHOUT_SLIDE, folder)
    truth = folder / "truth.csv"
    edit(truth, ("pads [Pa]", "pads [bar]"), count=1)
    assert main(["accuracy", str(folder), "--out", str(tmp_path / "out")]) == 2
    assert "column 'pads': found unit [bar]; expected [Pa]" in capsys.readouterr().err


def test_command_refuses_a_stop_in_which_no_force_is_built_up(root, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(root)
    folder = tmp_path / "coasting"
    shutil.copytree(root / "cases" / WITHOUT_SLIDE, folder)
    for file in ("measured.csv", "truth.csv"):
        lines = (folder / file).read_text().splitlines()
        kept = [lines[0], *(line for line in lines[1:] if float(line.split(",")[0]) < 3.0)]
        (folder / file).write_text("\n".join(kept) + "\n")
    about = folder / "case.toml"  # which would speak of a pressure that the recording never has
    text = about.read_text()
    about.write_text(re.sub("brake_pressure = .*", 'brake_pressure = "0.01 bar"', text))
    assert main(["accuracy", str(folder), "--out", str(tmp_path / "out")]) == 2
    assert "ends before its force is built up" in capsys.readouterr().err


def test_stops_of_several_rigs_are_told_apart_by_their_folders(root, tmp_path, capsys):
    for rig in ("one", "two"):
        shutil.copytree(root / "cases" / WITHOUT_SLIDE, tmp_path / rig / WITHOUT_SLIDE)
    rigs = [str(tmp_path / rig) for rig in ("one", "two")]
    options = ["--estimator", "ekf", "--out", str(tmp_path / "out")]
    assert main(["accuracy", *rigs, *options]) == 0
    summary = json.loads((tmp_path / "out" / "accuracy.json").read_text())
    assert set(summary["stops"]) == {f"one/{WITHOUT_SLIDE}", f"two/{WITHOUT_SLIDE}"}
    # Of the same stop twice, what bands need is what they need of it once: not the system's own.
    assert main(["accuracy", rigs[0], *options]) == 0
    once = json.loads((tmp_path / "out" / "accuracy.json").read_text())
    assert summary["bands"]["ekf"] == pytest.approx(once["bands"]["ekf"], rel=0.01)
    capsys.readouterr()
    assert main(["accuracy", rigs[0], rigs[0], *options]) == 2
    assert f"found a second stop 'one/{WITHOUT_SLIDE}'" in capsys.readouterr().err
