"""What decides in a diagnosis, and what is said of a rig that differs from its data sheet."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, chi2, norm

from workbench.__main__ import main
from workbench.diagnosis import problem_of
from workbench.diagnosis.inference.thresholds import thresholds
from workbench.diagnosis.run import with_effects
from workbench.machines.wheelset.planting import SHEET_ERRORS, PlantedStops
from workbench.machines.wheelset.rig import SCENARIOS
from workbench.runtime.engine import Engine, silent
from workbench.studies.power import (
    NamedCause,
    Planting,
    SetVerdict,
    diagnose_sets,
    open_virtual_rig,
)
from workbench.studies.power.planting import draw_sets, plan_sheet_errors
from workbench.studies.power.report import sheet_check, thresholds_check
from workbench.studies.power.run import PowerStudy, Setup, diagnose_set
from workbench.studies.power.sensitivity import (
    FACTORS,
    ThresholdSensitivity,
    scaled,
    threshold_values,
    vary,
)
from workbench.studies.power.statistics import named_wrong, summarise_sheet
from workbench.system.comparison import RATE

from .scenarios import REFERENCE, short
from .systems import WHEELSET as SYSTEM

ROOT = Path(__file__).parents[1]
PROBLEM = problem_of(SYSTEM)
EFFECTS = PROBLEM.effects
DERIVED = ("significant", "fall", "immaterial", "tied")

rates = st.floats(1e-6, 0.2)
counts = st.integers(1, 500)

# --- from one rate of false alarms ---


@given(rates, counts)
def test_thresholds_are_the_quantiles_of_their_statistics(rate, candidates):
    limits = thresholds(candidates, rate)
    # To rounding: inverse functions of double precision.
    assert 2.0 * candidates * norm.sf(limits.significant) == pytest.approx(rate, rel=1e-9)
    assert candidates * chi2.sf(limits.fall, 1) == pytest.approx(rate, rel=1e-9)
    assert 2.0 * norm.sf(limits.immaterial) == pytest.approx(rate, rel=1e-9)
    assert np.exp(-0.5 * limits.tied) == pytest.approx(rate, rel=1e-9)


@given(rates, st.floats(1.01, 4.0), counts)
def test_fewer_false_alarms_ask_for_more(rate, times, candidates):
    rare, usual = (threshold_values(thresholds(candidates, r)) for r in (rate, times * rate))
    for name in DERIVED:
        assert rare[name] > usual[name], name
    assert {n: v for n, v in rare.items() if n not in DERIVED} == {
        n: v for n, v in usual.items() if n not in DERIVED
    }


@given(rates, counts)
def test_more_candidates_ask_for_more(rate, candidates):
    few, many = thresholds(candidates, rate), thresholds(candidates + 1, rate)
    assert many.significant > few.significant
    assert many.fall > few.fall


def test_the_largest_of_all_candidates_is_significant_at_the_stated_rate():
    """By chance: sizes over their deviations, of 28 candidates in 50 000 clean sets."""
    sets = 50_000
    sizes = np.random.default_rng(1).standard_normal((sets, 28))
    alarms = int((abs(sizes).max(axis=1) > thresholds(28).significant).sum())
    low, high = binom.interval(0.999, sets, RATE)
    assert low <= alarms <= high


# --- half and twice ---


@pytest.mark.parametrize("factor", FACTORS)
@pytest.mark.parametrize("name", threshold_values(thresholds(28)))
def test_one_threshold_is_changed_and_no_other(name, factor):
    usual = threshold_values(thresholds(28))
    scaled_values = threshold_values(scaled(thresholds(28), name, factor))
    # What is counted stays a whole number.
    assert scaled_values.pop(name) == pytest.approx(
        factor * usual[name], abs=0.5 * (name == "rivals")
    )
    assert scaled_values == {other: value for other, value in usual.items() if other != name}


@pytest.mark.long
def test_what_is_clear_is_said_by_half_and_by_twice_of_a_threshold(tmp_path):
    """Two short stops, a load cell's gain of 1.6 %; simulations that are kept change nothing."""
    rig = PlantedStops((short("01_dry_80_1.5", 30.0), short("03_dry_120_3.6", 40.0)), REFERENCE)
    problem, everything = with_effects(PROBLEM, tmp_path, silent)
    setup = Setup(problem, rig, everything)
    planting = Planting("single", 12, 8.0, {"fx_gain": 0.016}, ("FxGain",))
    effect = vary(setup, planting, ["fall"])
    cases = setup.record(planting, rig.simulate(planting.seed, planting.gains))
    plain = diagnose_set(setup.problem_of(cases), setup.everything)
    assert effect.said == (plain.verdict, *(cause.effect.name for cause in plain.causes))
    assert (effect.said[0], effect.changed) == ("found", ())


def test_sets_are_of_all_kinds_alike():
    groups = [
        (Planting(kind, seed, 1.0, {}, ()),)
        for kind, count in (("clean", 9), ("single", 90), ("pair", 2))
        for seed in range(count)
    ]
    kinds = [draw_set.kind for draw_set in draw_sets(groups, 9, 1)]
    assert [kinds.count(kind) for kind in ("clean", "single", "pair")] == [4, 3, 2] or [
        kinds.count(kind) for kind in ("clean", "single", "pair")
    ] == [3, 4, 2]


def test_what_changes_is_told_and_what_does_not_is_listed():
    varied = ThresholdSensitivity(Planting("clean", 5, 0.0, {}, ()), ("nothing",), ())
    assert (
        "nothing changes by: significant" in thresholds_check([varied], {"significant": 4.0}).text
    )


# --- a data sheet that is wrong ---


def test_sheet_errors_are_those_that_the_rig_knows_and_the_library_may_name():
    names = {effect.name for effect in EFFECTS}
    assert {sheet_error.effect for sheet_error in SHEET_ERRORS} - {""} <= names
    (rig,) = {type(open_virtual_rig(SYSTEM, [], REFERENCE))}
    assert rig is PlantedStops
    groups = plan_sheet_errors(SHEET_ERRORS, 3, 1)
    assert len({group[0].seed for group in groups}) == len(groups) == 3 * len(SHEET_ERRORS)


def set_verdict(effect: str, *causes: tuple[str, ...]) -> SetVerdict:
    planting = Planting("sheet", 1, 1.0, {"roller_inertia": 0.015}, (effect,))
    named = tuple(NamedCause(first, {}, tuple(twins)) for first, *twins in causes)
    return SetVerdict(planting, "found" if named else "nothing", named, None, None, 1.0)


def test_only_the_error_itself_or_its_stated_twin_may_be_named():
    twins = ("DriveTorqueGain", "RollerInertia")
    assert not named_wrong(set_verdict("RollerInertia"))
    assert not named_wrong(set_verdict("RollerInertia", ("RollerInertia",)))
    assert not named_wrong(set_verdict("RollerInertia", twins))
    assert named_wrong(set_verdict("RollerInertia", ("DriveTorqueGain",)))
    assert named_wrong(set_verdict("RollerInertia", twins, ("BrakeFade",)))
    assert named_wrong(set_verdict("", ("BrakeFade",)))  # noise has no name
    rows = summarise_sheet([set_verdict("RollerInertia", twins), set_verdict("", ("BrakeFade",))])
    table = sheet_check(rows).text
    assert "DriveTorqueGain or RollerInertia" in table
    assert "1 of 2 sets have a wrong name" in table


@pytest.mark.long
@pytest.mark.parametrize("gain", [0.015, -0.015])
def test_a_wrong_inertia_of_the_roller_never_gets_a_wrong_name(gain, tmp_path):
    """Of three stops: two directions, three speeds."""
    names = ("01_dry_80_1.5", "03_dry_120_3.6", "05_dry_120_2.7_rev")
    rig = PlantedStops(tuple(SCENARIOS[name] for name in names), REFERENCE)
    planting = Planting("sheet", 41, 1.0, {"roller_inertia": gain}, ("RollerInertia",))
    (verdict,), _ = diagnose_sets(
        [(planting,)], PowerStudy(PROBLEM, rig), Engine(out=tmp_path), seed=1, resume=False
    )
    assert verdict.verdict in ("found", "nothing", "unexplained")
    assert not named_wrong(verdict)


def test_command_makes_one_check_at_a_time(capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["power", "--thresholds", "--sheet-error"])
    assert "not allowed with" in capsys.readouterr().err
