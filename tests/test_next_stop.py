"""The next experiment: criteria against closed forms, predictions against what is then recorded."""

import json
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.stats import chi2

import workbench as wb
from workbench.__main__ import main
from workbench.diagnosis import Outcome
from workbench.diagnosis.inference.quadratic import Joint, Quadratic, RecordingSystem
from workbench.diagnosis.inference.rivals import read_rivals
from workbench.diagnosis.inference.thresholds import thresholds
from workbench.errors import InputError
from workbench.recordings.case import Case
from workbench.runtime.engine import ALONE
from workbench.studies.design import (
    NextStop,
    RankedExperiment,
    candidates,
    next_stop,
    predict_experiments,
)
from workbench.studies.design.candidates import (
    Profile,
    all_settings,
    draw_experiment,
    other_profiles,
    other_settings,
    settings_fraction,
)
from workbench.studies.design.prediction import discrimination_chance, precision, refitted
from workbench.studies.power.run import distance
from workbench.system.experiments import (
    RELEASE,
    SINE,
    STAIRCASE,
    STEP,
    Cost,
    Experiments,
    FurtherSetting,
    Setting,
    VariedInput,
)
from workbench.system.expression import Expression
from workbench.system.registry import load_system
from workbench.system.system import System

from .distances import parted
from .heater import NOISE, cases, diagnosed
from .heater import system as heater
from .page_rules import check_page
from .schemas import check

# --- criteria ---


def test_what_is_left_is_the_criterion_of_buzzi_ferraris_and_forzatti():
    """Reference: d' (I + J N^-1 J')^-1 d, with the covariance of the rival's prediction."""
    rng = np.random.default_rng(1)
    d, J = rng.standard_normal(12), rng.standard_normal((12, 3))
    root = rng.standard_normal((3, 3))
    N = root @ root.T + np.eye(3)
    covariance = np.eye(12) + J @ np.linalg.inv(N) @ J.T
    left, z = refitted(Quadratic(J.T @ J, J.T @ d, float(d @ d), 12), N)
    # Both are double precision on well-conditioned matrices.
    assert_allclose(left, d @ np.linalg.solve(covariance, d), rtol=1e-9)
    assert_allclose(left, np.sum((d + J @ z) ** 2) + z @ N @ z, rtol=1e-9)


# discopt 0.5.0 (`discopt.doe.discrimination`): Hunter and Reiner's criterion, that of Buzzi-
# Ferraris and Forzatti, logarithm of the determinant of the information of the line.
_DISCOPT = {
    0.5: (0.8056640624569831, 43.795008527838725, 4.877103901471733),
    1.0: (4.640624999768022, 287.4425701439068, 6.263398262591624),
    1.5: (56.82128905962882, 2405.0666133902146, 7.074328478807952),
}


@pytest.mark.parametrize("x", _DISCOPT)
def test_criteria_are_those_of_an_independent_package(x):
    """Responses 2 s x and 1.5 (s x)^2, of one unknown factor each, in s = 0.5, 1, 2; noise 0.1.

    discopt takes both models for uncertain, where here one is true: the unknowns are those of both.
    """
    noise = 0.1
    line, curve = (np.array([0.5, 1.0, 2.0]) * x) ** np.array([[1], [2]])
    d = (2.0 * line - 1.5 * curve) / noise
    hunter, buzzi, information = _DISCOPT[x]
    nothing = Quadratic(np.zeros((0, 0)), np.zeros(0), float(d @ d), 3)
    # Its solver leaves 1e-10 of the unknowns, of which responses are differences.
    assert_allclose(refitted(nothing, np.zeros((0, 0)))[0], hunter / noise**2, rtol=1e-7)
    J = np.column_stack([line, -curve]) / noise
    N = np.diag(np.diag(J.T @ J))
    assert_allclose(refitted(Quadratic(J.T @ J, J.T @ d, float(d @ d), 3), N)[0], buzzi, rtol=1e-7)
    before, _ = precision(np.zeros((1, 1)), N[:1, :1], [0])
    assert_allclose(-2.0 * np.log(before), information, rtol=1e-7)


def test_a_line_and_a_parabola_part_where_their_best_fits_do():
    """T-optimality by hand: x^2 less its best line in -1, 0, 0, 1 is 1/2 in size everywhere."""
    x = np.array([-1.0, 0.0, 0.0, 1.0])
    J, d = np.column_stack([np.ones(4), x]), 6.0 * x**2
    left, _ = refitted(Quadratic(J.T @ J, J.T @ d, float(d @ d), 4), np.zeros((2, 2)))
    assert_allclose(left, 4 * 3.0**2, rtol=1e-9)


def test_what_belongs_to_one_recording_counts_as_noise_that_it_shares():
    """Reference: d' (I + P P')^-1 d, the covariance of noise and of a tolerance of one sigma."""
    rng = np.random.default_rng(2)
    d, P = rng.standard_normal(9), rng.standard_normal((9, 2))
    system = RecordingSystem(d, np.zeros((9, 0)), P, np.zeros(2), np.full(2, np.inf), 1)
    left, _ = refitted(system.eliminated(), np.zeros((0, 0)))
    # The elimination adds 1e-9 to what is known of each, so that unknown ones can be solved for.
    assert_allclose(left, d @ np.linalg.solve(np.eye(9) + P @ P.T, d), rtol=1e-7)


def test_chi_squared_counts_errors_tolerances_and_what_is_known():
    """Reference: eliminating what is at its best already changes nothing."""
    rng = np.random.default_rng(4)
    r, P = rng.standard_normal(9), rng.standard_normal((9, 2))
    system = RecordingSystem(r, np.zeros((9, 0)), P, -P.T @ r, np.full(2, np.inf), 1)
    joint = Joint((), (), (), (system,), Quadratic(np.zeros((0, 0)), np.zeros(0), 5.0, 0))
    assert_allclose(joint.chi_squared, joint.total().c, rtol=1e-9)


def test_what_is_nearer_than_the_true_cause_has_a_negative_distance():
    assert [distance(apart) for apart in (9.0, 0.0, -4.0)] == [3.0, 0.0, -2.0]


def test_the_chance_is_the_share_of_simulated_decisions():
    """Two directions in noise, nearly alike: what the wrong one leaves beyond the right one."""
    rng, decides, count = np.random.default_rng(3), thresholds(28), 4000
    cosine, apart = 0.98, 49.0
    right = np.array([1.0, 0.0])
    wrong = np.array([cosine, np.sqrt(1.0 - cosine**2)])
    y = np.sqrt(apart / (1.0 - cosine**2)) * right + rng.standard_normal((count, 2))
    left = [np.sum(y**2, axis=1) - (y @ direction) ** 2 for direction in (wrong, right)]
    share = np.mean(left[0] - left[1] > decides.form)
    # Four standard deviations of a share of 4000, and 0.01 for the noise that the right one leaves.
    expected = discrimination_chance(apart, 0.0, decides)
    assert abs(share - expected) < 4.0 * np.sqrt(expected * (1.0 - expected) / count) + 0.01
    assert 0.6 < expected < 0.9


def test_precision_of_one_unknown_is_its_standard_deviation():
    """Reference: information adds up, 1/9 and 1/16 make 1/5.76, whatever another unknown does."""
    known, new = np.diag([1.0 / 9.0, 5.0]), np.diag([1.0 / 16.0, 2.0])
    assert_allclose(precision(new, known, [0]), (3.0, 2.4), rtol=1e-12)


# --- experiments ---


@pytest.mark.parametrize("shape", [STEP, STAIRCASE, SINE])
def test_a_demand_stays_in_its_range_and_begins_when_it_says(shape):
    varied = VariedInput("u", (2.0, 5.0), (shape,), 3.0, 4.0, ())
    time = np.arange(0.0, 60.0, 0.1)
    levels = {STEP: (5.0,), STAIRCASE: (2.0, 3.5, 5.0), SINE: (2.0, 5.0)}[shape]
    demand = Profile(varied, shape, levels, 4.0).demand(time)
    assert not demand[time < 3.0].any()
    begun = demand[time >= 3.0]
    # Sampled each 0.1 s, a sine of 4 s misses its ends by up to 0.05 rad: 0.1 % of its amplitude.
    assert begun.max() == pytest.approx(5.0, abs=0.01)
    assert begun.min() >= 2.0


def test_a_lag_is_of_first_order():
    varied = VariedInput("u", (0.5, 1.0), (STEP,), 1.0, 4.0, (0.7,))
    time = np.arange(0.0, 6.0, 0.01)
    expected = np.where(time >= 1.0, 1.0 - np.exp(-(time - 1.0) / 0.7), 0.0)
    # The filter is exact at samples, one of which the demand may come earlier.
    signal = Profile(varied, STEP, (1.0,), 4.0).signal(time)
    assert np.abs(signal - expected).max() < 0.01 / 0.7 + 1e-9


def a_grid(counts: list[int]) -> Experiments:
    """Settings with so many values each."""
    settings = {
        f"s{k}": tuple(Setting(float(value), f"{value}") for value in range(count))
        for k, count in enumerate(counts)
    }
    return Experiments(
        lasts=60.0,
        ends=None,
        conditions=settings,
        further=(),
        start={},
        inputs=(),
        cost=Cost(Expression("duration", "a test"), "s"),
        sensors=(),
    )


def test_what_is_released_is_so_after_its_time_where_a_machine_allows_it():
    varied = VariedInput("u", (2.0, 5.0), (RELEASE,), 3.0, 4.0, ())
    asked = replace(a_grid([1]), inputs=(varied,))
    (first,) = all_settings(asked)
    (half,), (full,) = (
        other_profile.profiles for other_profile in (first, *other_profiles(asked, first))
    )
    time = np.arange(0.0, 60.0, 0.1)
    assert_allclose(full.demand(time), np.where((time >= 3.0) & (time < 7.0), 5.0, 0.0))
    assert_allclose(half.demand(time), 0.7 * full.demand(time))


@pytest.mark.parametrize(
    ("counts", "parts"), [([4, 12], 1), ([3, 2, 2, 2, 2, 2], 2), ([6, 6, 6], 5)]
)
def test_of_a_large_grid_a_fraction_is_tried_with_every_value(counts, parts):
    asked = a_grid(counts)
    grid, fraction = all_settings(asked), settings_fraction(asked)
    assert len(fraction) <= 48
    assert len(fraction) == pytest.approx(len(grid) / parts, abs=1.0)
    for name, values in asked.settings.items():
        often = [sum(trial.settings[name] == value for trial in fraction) for value in values]
        assert min(often) > 0
        assert np.ptp(often) <= 2
    # What is left out differs from something that is tried in one setting.
    near = [other for setting in fraction for other in other_settings(asked, setting)]
    assert len(other_settings(asked, grid[0])) == sum(counts) - len(counts)
    assert all(experiment in near for experiment in grid if experiment not in fraction)


# --- a heated block, whose recordings solve the equations by SciPy ---

NEXT = """
[next]
lasts = "300 s"
cost = { is = "0.5*duration/60", unit = "Euro" }

[next.start]
T = "42.9"
Tc = "34.3"

[next.inputs.P]
range = ["25 W", "35 W"]
every = "60 s"
"""
SETTING = "[next.settings.{}]\nvalues = [{}]\nunit = '{}'\n[next.start]"
G = 0.3  # planted [W/K]
WARM = 30.0 / (G + 0.4)  # [K] at 30 W, the casing at four fifths of it


def heated(seed: int, power: np.ndarray, begin: float) -> pd.DataFrame:
    """Temperature of a block that loses heat to a draught, at one power each second."""
    rng = np.random.default_rng(seed)

    def rates(t: float, x: np.ndarray) -> list[float]:
        into = 2.0 * (x[0] - x[1])
        given = power[min(int(t), power.size - 1)]
        return [(given - into - G * x[0]) / 100.0, (into - 0.5 * x[1]) / 200.0]

    time = np.arange(power.size, dtype=float)
    # A step of a second meets each change of the power.
    run = solve_ivp(rates, (0.0, time[-1]), [begin, 0.8 * begin], t_eval=time, max_step=1.0)
    measured = run.y[0] + NOISE * rng.standard_normal(time.size)
    return pd.DataFrame({"time [s]": time, "P [W]": power, "T [K]": measured})


@pytest.fixture(scope="module")
def block(tmp_path_factory) -> System:
    folder = tmp_path_factory.mktemp("heater") / "block"
    heater(folder)
    file = folder / "system.toml"
    file.write_text(file.read_text() + NEXT)
    return load_system(folder)


@pytest.fixture(scope="module")
def mild(block) -> list[Case]:
    """Powers so near each other that heat lost by temperature and by its square look alike."""
    rng = np.random.default_rng(0)
    powers = [np.repeat(rng.uniform(29.0, 31.0, 4), 50) for _ in range(3)]
    return cases(block, [heated(k, power, WARM) for k, power in enumerate(powers)])


@pytest.fixture(scope="module")
def undecided(block, mild, once) -> Outcome:
    return once("undecided", lambda out: diagnosed(block, mild, out))


@pytest.fixture(scope="module")
def proposed(undecided, once) -> NextStop:
    quiet = {"workers": 1, "report": lambda _: None}
    return once("next experiment", lambda _: wb.next_stop(undecided, **quiet))


def made(block: System, experiment: RankedExperiment) -> list[Case]:
    """A recording of an experiment, by SciPy."""
    power = experiment.prediction.candidate.profiles[0].demand(experiment.prediction.case.time)
    return cases(block, [heated(9, power, WARM)])


def test_the_first_proposal_parts_what_the_recordings_before_did_not(
    block, mild, undecided, proposed, tmp_path
):
    (cause,) = undecided.diagnosis.causes
    assert cause.confusable_with == ("Radiation",)
    assert proposed.parts
    assert "discriminates Draught from Radiation" in proposed.sentence
    new = named_anew(made(block, proposed.tried[0]))
    (cause,) = diagnosed(block, [*mild, *new], tmp_path).diagnosis.causes
    assert (cause.effect.name, cause.confusable_with) == ("Draught", ())


def test_a_difference_that_the_models_own_error_drowns_is_told_so(proposed):
    """By 20 times the noise; a separation of 0.0 would say that they are the same."""
    best = proposed.tried[0]
    nothing = np.zeros_like(best.prediction.pairwise)
    lost = replace(best, prediction=replace(best.prediction, pairwise=nothing, chance=nothing))
    rivals = replace(proposed.rivals, variance_factors=np.full(len(proposed.channels), 400.0))
    proposal = replace(proposed, tried=(lost,), rivals=rivals)
    assert "20 times the noise, drowns their difference" in proposal.sentence
    assert "0.0" not in lost.measures


def test_what_is_beside_the_best_of_a_fraction_is_tried_too(block, undecided, monkeypatch):
    monkeypatch.setattr(candidates, "_GRID", 1)
    knob = FurtherSetting("knob", "a knob", "1", (Setting(0.0, "0"), Setting(1.0, "1")))
    asked = replace(block.experiments, further=(*block.experiments.further, knob))
    assert len(settings_fraction(asked)) == 1
    proposal = next_stop(replace(block, experiments=asked), undecided.rivals, ALONE)
    assert {row.prediction.candidate.settings["knob"].value for row in proposal.tried} == {0.0, 1.0}


def test_an_experiment_drawn_at_random_parts_half_as_often_at_most(proposed):
    likely = [row.prediction.right > 0.5 for row in proposed.tried]
    assert likely[0]
    assert np.mean(likely) <= 0.5


def test_the_last_experiment_of_the_list_leaves_them_together(block, mild, proposed, tmp_path):
    assert proposed.tried[-1].prediction.right < 0.01
    new = named_anew(made(block, proposed.tried[-1]))
    (cause,) = diagnosed(block, [*mild, *new], tmp_path).diagnosis.causes
    assert "Radiation" in (cause.effect.name, *cause.confusable_with)


def test_the_separation_is_what_recordings_then_show(block, mild, proposed):
    """Of every experiment, within 20 %: noise moves it by one standard deviation."""
    for row in proposed.tried:
        expected = np.sqrt(row.prediction.pairwise[0, 1])
        shown = parted(block, [*mild, *named_anew(made(block, row))], "Draught", "Radiation")
        assert shown == pytest.approx(expected, rel=0.2, abs=1.0), row.text


def test_a_rival_cannot_use_what_its_recordings_so_far_hold(block, undecided, proposed):
    """States at the start of recordings that are made: free, as sure as they were, and known."""
    rivals = undecided.rivals
    apart = []
    for furthest in (np.inf, rivals.models[0].recordings[0].furthest[0], 0.0):
        models = [
            replace(
                model,
                recordings=tuple(
                    replace(recording, furthest=np.full(recording.P.shape[1], furthest))
                    for recording in model.recordings
                ),
            )
            for model in rivals.models
        ]
        plan = [proposed.tried[0].prediction.candidate]
        (proposal,) = predict_experiments(block, replace(rivals, models=tuple(models)), plan, 1)
        apart.append(proposal.prediction.pairwise[0, 1])
    # Within five standard deviations nothing is held here, and what is held parts more.
    assert_allclose(apart[1], apart[0], rtol=1e-6)
    assert apart[2] > 1.1 * apart[1]


def test_each_experiment_is_drawn_as_often(block):
    """Seven profiles in 7000 draws: chi-squared of six degrees of freedom, one in a thousand."""
    rng = np.random.default_rng(8)
    (first,) = all_settings(block.experiments)
    every = [first, *other_profiles(block.experiments, first)]
    drawn = [every.index(draw_experiment(block.experiments, rng)) for _ in range(7000)]
    counts = np.bincount(drawn, minlength=len(every))
    assert len(every) == 7
    assert np.sum((counts - 1000.0) ** 2 / 1000.0) < chi2.isf(1e-3, 6)


def test_the_cost_is_what_the_file_says(proposed):
    """Half a Euro a minute, five minutes."""
    assert {row.cost for row in proposed.tried} == {2.5}
    assert proposed.to_dict()["tried"][0]["cost"] == {"value": 2.5, "unit": "Euro"}


def test_of_a_single_cause_the_deviation_of_its_size_falls_as_predicted(
    block, mild, undecided, tmp_path
):
    alone = replace(undecided.rivals, models=undecided.rivals.models[:1])
    proposal = next_stop(block, alone, ALONE)
    deviations = [row.prediction.precision[1] for row in proposal.tried]
    assert deviations == sorted(deviations)
    assert "narrows the interval of" in proposal.sentence
    both = [*mild, *named_anew(made(block, proposal.tried[0]))]
    shown = diagnosed(block, both, tmp_path).rivals.models[0].information[0, 0] ** -0.5
    # Of information that adds up, the draw of noise moves the derivatives by little.
    assert shown == pytest.approx(deviations[0], rel=0.2)


def test_tolerances_of_recordings_so_far_are_where_they_do_best(undecided):
    for model in undecided.rivals.models:
        still = np.zeros(len(model.sizes) + len(model.levels))
        for recording in model.recordings:
            assert_allclose(recording.moved(still).deviations, recording.deviations, atol=1e-6)


def test_rivals_are_read_as_they_were_written(undecided):
    written = json.loads(json.dumps(undecided.rivals.to_dict()))
    assert read_rivals(written).to_dict() == undecided.rivals.to_dict()


IMPOSSIBLE = {
    "infinity": ("prior", "constant", math.inf),
    "text": ("explained", "much"),
    "one row": ("prior", "matrix", [[1.0, 2.0, 3.0]]),
    "negative": (
        "prior",
        "matrix",
        lambda N: (np.array(N) - (1.0 + 2.0 * np.max(N)) * np.eye(len(N))).tolist(),
    ),
    "no recording": ("recordings", []),
    "shorter": ("recordings", 0, "errors", lambda errors: errors[1:]),
    "nan": ("recordings", 0, "common", lambda rows: [[math.nan] * len(rows[0]), *rows[1:]]),
    "another's": ("sizes", [["Nobody", "size", 1.0]]),
    "a number": ("effects", [1]),
}


@pytest.mark.parametrize("case", IMPOSSIBLE)
def test_a_summary_with_what_cannot_be_is_refused(case, block, undecided, tmp_path, capsys):
    summary = {**undecided.to_dict(), "provenance": {"system": block.name}}
    summary = json.loads(json.dumps(summary))
    *path, key, value = IMPOSSIBLE[case]
    place = summary["rivals"]["models"][0]
    for step in path:
        place = place[step]
    place[key] = value(place[key]) if callable(value) else value
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    assert main(["next", str(tmp_path), "--system", str(block.source)]) == 2
    assert "no summary of a diagnosis with its candidates" in capsys.readouterr().err


def test_the_command_writes_what_it_prints(block, mild, undecided, tmp_path, capsys):
    summary = {**undecided.to_dict(), "provenance": {"system": block.name}}
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    out = tmp_path / "next"
    options = ["--system", str(block.source), "--out", str(out), "--workers", "1"]
    assert main(["next", str(tmp_path), *options]) == 0
    summary = json.loads((out / "next.json").read_text())
    check("next", summary)
    page = check_page(out / "index.html", summary)
    assert len(page.get_element_by_id("tried-table").xpath("tbody/tr")) == len(summary["tried"])
    assert summary["sentence"] in capsys.readouterr().out
    assert summary["rivals"] == ["Draught", "Radiation"]
    assert len(pd.read_csv(out / "experiments.csv")) == len(summary["tried"])
    assert (out / "responses.png").stat().st_size > 0


# --- what is refused ---


@pytest.mark.parametrize(
    ("summary", "message"),
    [
        ("nonsense", "no summary of a diagnosis"),
        (
            {"verdict": "found", "provenance": {"system": "wheelset"}},
            "diagnose the recordings anew",
        ),
        ({"verdict": "nothing", "provenance": {"system": "wheelset"}}, "diagnose more recordings"),
    ],
)
def test_what_is_no_undecided_diagnosis_is_refused(summary, message, tmp_path, capsys):
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    assert main(["next", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err


def test_an_fmu_alone_is_refused_before_its_owner_writes_what_may_be_varied(block, undecided):
    """The remedy was a table [next], then an option that the command has not."""
    alone = replace(block, library=block.library.parent / "none.mo", experiments=None)
    with pytest.raises(InputError, match=r"an FMU alone, without none\.mo.*the diagnosis says"):
        next_stop(alone, undecided.rivals, ALONE)


def test_a_system_that_does_not_say_what_may_be_varied_is_refused(block, undecided):
    silent = replace(block, experiments=None)
    with pytest.raises(InputError, match=r"no table \[next\]"):
        next_stop(silent, undecided.rivals, ALONE)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('range = ["25 W", "35 W"]', 'range = ["35 W", "25 W"]', r"\[low, high\]"),
        ('every = "60 s"', 'every = "0 s"', "a time above 0"),
        ('every = "60 s"', 'every = "60 s"\nprofiles = ["ramp"]', "step, staircase, sine"),
        ("[next.inputs.P]", "[next.inputs.Q]", "unknown key 'Q'"),
        ('T = "42.9"', 'T = "42.9 + begin"', "'begin'"),
        ('T = "42.9"', 'Tx = "42.9"', "a continuous state of the model"),
        ("[next.start]", SETTING.format("K", "'2 m'", "m"), "no signal, parameter or condition"),
        ("[next.start]", SETTING.format("share", "", "1"), "one value or more"),
        ("[next.start]", SETTING.format("share", "'2 m'", "s"), "a unit of another dimension"),
    ],
)
def test_a_mistake_in_what_may_be_varied_is_refused(block, old, new, message, tmp_path):
    for name in ("package.mo", "system.toml"):
        (tmp_path / name).write_text((block.source.parent / name).read_text().replace(old, new))
    with pytest.raises(InputError, match=message):
        load_system(tmp_path)


def named_anew(recordings: Sequence[Case]) -> list[Case]:
    """Under other names than those before."""
    return [replace(recording, name=f"new {recording.name}") for recording in recordings]
