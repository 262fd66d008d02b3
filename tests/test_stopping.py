"""Distance of a stop: formulas of standards, the loop on the model, recordings, predictions."""

import json
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import stdtr
from scipy.stats import chi2, norm, t

import workbench as wb
from workbench.__main__ import main
from workbench.arrays import Matrix, Vector
from workbench.errors import InputError
from workbench.models.fmu import CoSimulation
from workbench.recordings.case import Case
from workbench.recordings.datasets import write_cases
from workbench.studies.distance import Distance, Effort
from workbench.studies.distance.forecast import (
    Forecaster,
    Question,
    dimension,
    open_forecaster,
    stopping_of,
)
from workbench.studies.distance.outcome import Forecast
from workbench.studies.distance.past import MachineLevels
from workbench.studies.distance.rare_events import Tail, descend, plain_runs, quantile
from workbench.studies.distance.recorded import Stop, asked_stop, read_stop
from workbench.studies.distance.standard import (
    StopConditions,
    equivalent_rate,
    nominal_rate,
    percentage,
    stopping_distance,
)
from workbench.system.reader import read_system
from workbench.system.stopping import Stopping
from workbench.system.system import OBSERVER, System

from .edits import replaced
from .page_rules import check_page
from .schemas import check

RECORDINGS = Path(__file__).parent.parent.parent / "shared" / "recordings" / "train"


@pytest.fixture(scope="module")
def stopping(train) -> Stopping:
    return train.stopping


@pytest.fixture(scope="module")
def forecaster(train) -> Iterator[Forecaster]:
    with open_forecaster(train) as forecaster:
        yield forecaster


# --- formulas of standards ---


def test_a_published_calculation_of_a_wagon_is_reproduced():
    """RailProfAC, RailwayBrakeCalculation, BrakeCalculationAverageValuesWagon, after EN 14531-1.

    Printed there: 478362 N on the blocks, 1412.6 N of resistance, 2.2 s, 0.6 m/s2, 461.7 m.
    """
    speed, response = 80.0 / 3.6, 0.2 + 0.5 * 4.0  # a delay and half of a rise
    rate = (0.12 * 478362.0 - 1412.6) / (90000.0 + 3600.0)
    assert f"{response:.1f} {rate:.1f}" == "2.2 0.6"
    distance = stopping_distance(speed, response, rate)
    assert f"{distance:.1f}" == "461.7"
    assert_allclose(equivalent_rate(speed, response, distance), rate, rtol=1e-12)


def test_a_published_calculation_of_a_multiple_unit_is_reproduced():
    """The same source, BrakeCalculationAverageValues: 1.598264 s, 0.899829 m/s2, 1803.796711 m."""
    distance = stopping_distance(200.0 / 3.6, 1.598264, 0.899829)
    # The sixth digits of both leave 1e-3 m.
    assert_allclose(distance, 1803.796711, atol=1.1e-3)


@pytest.mark.parametrize(
    ("speed", "rate", "distance"),
    [
        *[(20, 0.77, 20), (30, 0.87, 40), (40, 0.95, 65), (50, 1.03, 94), (60, 1.06, 131)],
        *[(70, 1.07, 177), (80, 1.07, 230), (90, 1.08, 290), (100, 1.09, 355)],
    ],
)
def test_the_table_of_a_law_is_reproduced_to_its_digits(speed, rate, distance):
    """Austrian Strassenbahnverordnung, annex 1, table 1: mean deceleration, one unit failed."""
    assert f"{equivalent_rate(speed / 3.6, 0.0, distance):.2f}" == f"{rate:.2f}"


def test_a_percentage_falls_to_nothing_where_its_constants_say():
    assert_allclose(percentage(83634.0 / 119.0, (83634.0, 19.0)), 100.0, rtol=1e-12)


def test_a_correction_undoes_what_gradient_and_mass_do():
    """Force in proportion to mass, m a = F - g m i, with rotating masses that stay."""
    turning, per_mass, slope = 4000.0, 1.1, -0.008

    def rate(mass: float, resistance: float) -> float:
        return (per_mass * mass + 9.81 * resistance * mass) / (mass + turning)

    made = StopConditions(mass=88e3, rotating=turning, resistance=slope)
    assert_allclose(nominal_rate(rate(88e3, slope), made, 96e3), rate(96e3, 0.0), rtol=1e-12)


# --- one stop on the model ---


def test_a_stop_is_that_of_the_models_own_integrator(train, stopping, forecaster):
    """Independent: the FMU's Co-Simulation, whose inputs are set every 20 ms."""
    stop = asked_stop({"speed": "100 km/h", "gradient": -0.005}, train, stopping)
    forecast = forecaster.stop(stop, {})
    path, h = train.model(OBSERVER).path, 0.02
    with CoSimulation(path) as model:
        speed = stop.asked["speed"]
        model.start({"vTrain": speed, **{f"omega{axle}": speed / 0.46 for axle in range(1, 9)}})
        inputs = model.variables([quantity.name for quantity in stopping.driven])
        seen = model.variables(["vTrain"])
        way, t = 0.0, 0.0
        while speed > 0.1:
            for j, quantity in enumerate(stopping.driven):
                risen = t + 0.5 * h - quantity.delay
                share = 1.0 if quantity.lag == 0.0 else -np.expm1(-max(risen, 0.0) / quantity.lag)
                inputs.values[j] = float(quantity.formula(stop.asked)) * share
            model.set(inputs, inputs.values)
            model.step(h)
            before, speed = speed, float(model.get(seen)[0])
            way, t = way + 0.5 * h * (before + speed), t + h
    # Steps of 0.1 s that meet ramps in their middle: a few centimetres in three hundred metres.
    assert_allclose(forecast.distance, way, rtol=3e-4)
    assert_allclose(forecast.time, t, atol=0.15)


def test_more_asked_of_a_stop_makes_it_longer_and_more_force_shorter(train, stopping, forecaster):
    def distance(**asked: object) -> float:
        return forecaster.stop(asked_stop(asked, train, stopping), {}).distance

    usual = distance()
    assert distance(speed="130 km/h") > usual > distance(pressure="4.2 bar")
    assert distance(gradient=-0.01) > usual > distance(gradient=0.01)
    # Force follows the load; what turns does not, and air is shared by more: within a percent.
    assert_allclose(distance(mass1="55 t", mass2="55 t"), usual, rtol=0.01)


def test_a_stop_that_does_not_end_is_told(train, stopping, forecaster):
    stop = asked_stop({"gradient": -0.2}, train, stopping)
    with pytest.raises(wb.FMUError, match="not at rest after 200 s"):
        forecaster.stop(stop, {})


def test_corrected_stops_are_those_under_nominal_conditions(train, stopping, forecaster):
    """Made too fast, downhill and light; pads and air are not corrected for speed."""
    asked = {"speed": "123 km/h", "gradient": -0.006, "mass1": "45 t", "mass2": "46 t"}
    stop, response = asked_stop(asked, train, stopping), stopping.response
    rate = equivalent_rate(stop.asked["speed"], response, forecaster.stop(stop, {}).distance)
    made = StopConditions(mass=91e3, rotating=8.0 * 110.0 / 0.46**2, resistance=-0.006)
    fixed = stopping_distance(120.0 / 3.6, response, nominal_rate(rate, made, 96e3))
    nominal = forecaster.stop(asked_stop({}, train, stopping), {}).distance
    assert_allclose(fixed, nominal, rtol=0.01)
    assert abs(forecaster.stop(stop, {}).distance / nominal - 1.0) > 0.08


# --- what is drawn ---


def question(train: System, stop: Stop, left: float) -> Question:
    """Levels as the sheet says them, each unsure by a percent."""
    keys = tuple((name, "all") for name in train.comparison.levels)
    mean = np.array([train.values[name] for name, _ in keys])
    return Question(stop, MachineLevels(keys, mean, np.diag((0.01 * mean) ** 2)), left, 5)


def test_a_distribution_is_that_of_its_parts(train, stopping, forecaster):
    """Variances of a function that is nearly linear add up: parts by differences, one by one."""
    asked = question(train, asked_stop({}, train, stopping), left=0.01)
    count = dimension(asked, train, stopping)
    steps = np.vstack([np.zeros(count), 0.5 * np.eye(count)])
    logs = np.log(forecaster.distances(replace(asked, left=0.0), steps))
    parts = np.square((logs[1:] - logs[0]) / 0.5).sum()
    points = np.random.default_rng(1).standard_normal((400, count))
    drawn = np.log(forecaster.sample(asked, points)[0])
    # Student's t of five: variance 5/3. Four hundred give a deviation to 3.5 %: three of that.
    assert_allclose(drawn[0].std(), np.sqrt(parts + 0.01**2 * 5.0 / 3.0), rtol=0.11)
    assert drawn[1].std() < drawn[0].std()


def test_a_stop_that_is_drawn_is_the_one_before_the_steps_were_longer(train, stopping, forecaster):
    """Ten centimetres in a kilometre, which is what the step is chosen by."""
    stop = asked_stop({}, train, stopping)
    asked = question(train, stop, left=0.0)
    usual = np.zeros((1, dimension(asked, train, stopping)))
    drawn, simulated = forecaster.distances(asked, usual), forecaster.stop(stop, {}).distance
    assert_allclose(drawn, simulated, rtol=1e-4)
    assert drawn != simulated  # they are longer


def test_a_stop_does_not_depend_on_the_one_before(train, stopping, forecaster):
    """A Jacobian at rest that is kept for the first steps of the next stop moves one of these."""
    asked = question(train, asked_stop({}, train, stopping), left=0.0)
    points = np.random.default_rng(4).standard_normal((510, dimension(asked, train, stopping)))
    there, back = (forecaster.distances(asked, order) for order in (points, points[::-1]))
    np.testing.assert_array_equal(there, back[::-1])


def test_the_safety_level_agrees_with_plain_samples(train, stopping, forecaster):
    asked = question(train, asked_stop({}, train, stopping), left=0.005)
    points = np.random.default_rng(2).standard_normal((1500, dimension(asked, train, stopping)))
    plain = -np.log(forecaster.distances(asked, points))
    runs = tuple(forecaster.descent(asked, 2, 150, seed)[0] for seed in range(4))
    quantile = Tail(runs, asked.addend).quantile(2)
    # The fifteenth of 1500 is known to 26 %; of both, two and a half deviations.
    low, high = np.sort(plain)[[5, 29]]
    assert low < quantile.high
    assert quantile.low < high


def test_ranks_of_a_sample_hold_its_quantile_as_often_as_they_say():
    random = np.random.default_rng(5)
    held = [
        low <= 0.01 <= high
        for _ in range(1000)
        if (limit := quantile(np.sort(random.uniform(size=2000)), 0.01)) is not None
        for _, low, high in [limit]
    ]
    # 95 %, within three deviations of a thousand trials; ranks are whole, so a little more.
    assert 0.93 < np.mean(held) < 0.98
    assert quantile(np.arange(100.0), 0.01) is None  # the first of a hundred has no lower bound


def least(forecaster: Forecaster, asked: Question, points: Matrix, count: int) -> Vector:
    """The least of minus the logarithms of distances, (count,) in order.

    They are nearly linear in what is drawn, but for what is left, whose share is known: a plane
    tells which draws can be among the least, and these alone are simulated.
    """

    def simulated(some: Any) -> Vector:
        values: Vector = -np.log(forecaster.distances(asked, points[some]))
        return values

    left = asked.left * t.ppf(norm.cdf(points[:, -1]), asked.freedom)
    plane = np.column_stack([np.ones(len(points)), points[:, :-1]])
    fitted = slice(1500)
    weights = np.linalg.lstsq(plane[fitted], simulated(fitted) + left[fitted])[0]
    linear, margin = plane @ weights - left, 8e-3
    near = linear < np.partition(linear, count)[count] + 2.0 * margin
    values = simulated(near)
    # To be among the least, what was not simulated would miss the plane by 1.5 margins at least,
    # three times what any of the others does.
    assert np.abs(values - linear[near]).max() < margin / 2.0
    return np.sort(values)[:count]


@pytest.mark.long
def test_the_safety_level_agrees_with_many_plain_samples(train, stopping, forecaster):
    asked = question(train, asked_stop({}, train, stopping), left=0.005)
    points = np.random.default_rng(3).standard_normal((100_000, dimension(asked, train, stopping)))
    plain = least(forecaster, asked, points, 1100)
    runs = tuple(forecaster.descent(asked, 5, 1000, seed)[0] for seed in range(8))
    for decade, rank in ((2, 1000), (3, 100), (4, 10)):
        quantile = Tail(runs, asked.addend).quantile(decade)
        away = 2.5 * np.sqrt(rank)
        low, high = plain[[max(0, round(rank - away)), round(rank + away)]]
        assert low < quantile.high
        assert quantile.low < high


# --- recordings ---


def made(train: System, *, rest: bool = True) -> Case:
    """30 m/s until an equivalent step of 1 m/s2, 0.65 s after the command, on 4 permille uphill."""
    time, command = np.arange(0.0, 60.0, 0.1), 20.02
    speed = 30.0 - np.maximum(0.0, time - command - 0.65)
    speed = np.where(speed > 0.3, speed, 0.0) if rest else np.maximum(speed, 5.0)
    columns = {"time [s]": time, "a [m/s2]": np.gradient(speed, time)}
    for j, delay in enumerate((0.2, 0.2, 0.3, 0.3), 1):
        risen = -np.expm1(-np.maximum(0.0, time - command - delay) / 0.45)
        columns[f"pB{j} [bar]"] = (0.25 + (2.7 - 0.25) * 48.0 / 56.0) * risen
    columns |= {f"omega{axle} [rad/s]": speed / 0.46 for axle in range(1, 9)}
    columns |= {f"mass{k} [t]": np.full(time.size, 48.0) for k in (1, 2)}
    columns |= {f"slope{k} [1]": np.full(time.size, 0.004) for k in (1, 2)}
    columns["curve [1]"] = np.zeros(time.size)
    return wb.case_from_frame(train, pd.DataFrame(columns), {"rail": "dry"})


@pytest.mark.filterwarnings("ignore::UserWarning")  # no noise, which a recorder has
def test_a_recording_tells_its_command_its_distance_and_what_was_asked(train, stopping):
    read = read_stop(made(train), train, stopping)
    # Half the rise is met between two samples in a line, which is 3 ms off a bent curve.
    assert_allclose(read.command, 20.02, atol=0.01)
    assert_allclose(read.distance, 30.0 * 0.65 + 450.0, rtol=1e-3)
    assert_allclose(read.stop.asked["speed"], 30.0, rtol=1e-6)
    # A quarter of a percent has not risen yet when the reading begins; less in the median.
    assert_allclose(read.stop.asked["pressure"], 2.7e5, rtol=1e-3)
    assert_allclose(read.resistance, 0.004, rtol=1e-6)
    assert read.outside == ()


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_recording_without_a_stop_is_refused(train, stopping):
    with pytest.raises(InputError, match="a recording until standstill"):
        read_stop(made(train, rest=False), train, stopping)
    coasting = made(train).with_signals({"pB1": np.zeros(600)})
    with pytest.raises(InputError, match="nothing that rises"):
        read_stop(coasting, train, stopping)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"speeds": "120 km/h"}, r"unknown key 'speeds' \(closest: 'speed'\)"),
        ({"speed": "120 t"}, "a unit of another dimension"),
        ({"rail": "icy"}, "'dry' or 'wet' or 'unknown'"),
        ({"mass1": 48.0}, "a text with a unit"),
    ],
)
def test_what_no_stop_can_be_asked_for_is_refused(asked, message, train, stopping):
    with pytest.raises(InputError, match=message):
        asked_stop(asked, train, stopping)


def test_a_system_that_does_not_say_how_it_stops_is_refused(system, dry_case):
    with pytest.raises(InputError, match=r"no table \[distance\]"):
        wb.distance(system, [dry_case, dry_case], report=lambda line: None)


# --- recordings of an independent simulator ---


@pytest.fixture(scope="module")
def folder(once) -> Path:
    if not RECORDINGS.exists():
        pytest.skip("the recordings are not at hand")

    def write(out: Path) -> Path:
        write_cases("train", RECORDINGS / "healthy", out)
        return out

    return once("healthy stops of a train", write)


@pytest.fixture(scope="module")
def result(folder, once) -> Path:
    options = ["--ask", "speed=140 km/h", "--samples", "400", "--safety", "1", "--plain", "2100"]

    def run(out: Path) -> Path:
        command = ["distance", "--system", "train", str(folder), "--out", str(out), *options]
        assert main([*command, "--workers", "1"]) == 0
        return out

    return once("distances", run)


def test_bands_hold_stops_that_were_not_used(result):
    truth = json.loads((RECORDINGS / "healthy" / "truth.json").read_text())["cases"]
    stops = pd.read_csv(result / "stops.csv", keep_default_na=False).set_index("stop")
    true = pd.Series({name: true_stop["stop_distance"] for name, true_stop in truth.items()})
    claimed = stops.index[stops["outside"] == ""]
    # Slides of more than a second on a wet rail and two patches of leaves are beyond the model.
    assert [name for name in stops.index if name not in claimed] == [
        name for name, true_stop in truth.items() if max(true_stop["slide_seconds"]) > 0.0
    ]
    low, high = stops["low [m]"].astype(float), stops["high [m]"].astype(float)
    assert ((low < true) & (true < high))[claimed].all()
    assert (stops["width"].astype(float)[claimed] < 1.3).all()
    # By its own wheels, which roll 0.1 % less far than the train as they brake; wet 0.4 %.
    assert_allclose(stops["distance [m]"].astype(float)[claimed], true[claimed], rtol=4e-3)


def test_results_say_what_was_asked_and_what_data_do_not_carry(result):
    summary = json.loads((result / "distance.json").read_text())
    check("distance", summary)
    assert_allclose(summary["asked"]["speed"], 140.0 / 3.6)
    assert summary["conditions"] == {"rail": "dry"}
    low, middle, high = (summary["distance"][share] for share in ("0.025", "0.5", "0.975"))
    assert low < middle < high
    assert_allclose(summary["response"], 0.7)  # the sheet's tE
    assert "5 stops show what happens once in 6" in summary["warnings"][0]
    (level,) = summary["safety"]
    assert level["low"] < level["ratio"] < level["high"] < 1.0
    # Of 2100 the 210th; both intervals are of 95 %.
    (plain,) = summary["plain"]["levels"]
    assert summary["plain"]["samples"] == 2100
    assert plain["low"] < level["high"]
    assert level["low"] < plain["high"]
    assert {path.name for path in result.iterdir()} == {
        *("distance.json", "distance.png", "distance.svg", "index.html"),
        *("stops.csv", "quantiles.csv", "safety.csv", "plain.csv"),
    }


def test_the_page_shows_the_distance_and_each_stop_beside_what_the_others_say(result):
    summary = json.loads((result / "distance.json").read_text())
    page = check_page(result / "index.html", summary)
    assert page.xpath("//svg[@data-axis='distance' and @data-unit='m']")
    (dots,) = page.xpath("//section[@aria-labelledby='shown']//svg[@class='dots']")
    of, held = summary["held"]["of"], summary["held"]["stops"]
    assert f"{held} of {of} past stops" in dots.get("aria-label")
    assert len(dots.xpath(".//circle")) == len(summary["stops"])
    # What the model does not claim is set apart.
    assert len(dots.xpath(".//circle[@class='style-7']")) == len(summary["stops"]) - of
    for table, rows in (("stop-table", "stops"), ("quantile-table", "distance")):
        assert len(page.get_element_by_id(table).xpath("tbody/tr")) == len(summary[rows])
    (ratio,) = page.get_element_by_id("safety-table").xpath("tbody/tr/td[1]/@data-value")
    assert float(ratio) == summary["safety"][0]["ratio"]


@pytest.mark.long
def test_bands_hold_forty_stops_of_months(train, tmp_path):
    """One axle loses 12 % of its friction on the way; each stop by the others."""
    if not RECORDINGS.exists():
        pytest.skip("the recordings are not at hand")
    write_cases("train", RECORDINGS / "history", tmp_path)
    prediction: Distance = wb.distance(
        train,
        wb.read_cases(tmp_path, train),
        effort=Effort(800, decades=0),
        report=lambda line: None,
    )
    truth = json.loads((RECORDINGS / "history" / "truth.json").read_text())["cases"]
    held = []
    for stop in prediction.valid:
        low, high = stop.forecast.band
        held.append(low < truth[stop.recorded.stop.name]["stop_distance"] < high)
        assert stop.forecast.width < 1.3
    assert len(held) == 40
    assert np.mean(held) >= 0.93


def test_the_old_name_of_valid_stops_warns(train):
    forecast = Forecast(np.ones(2), np.ones(2), 0.0)
    stop = asked_stop({}, train, stopping_of(train))
    empty = Distance(train, stop, forecast, 1.0, (), None, None, interrupted=False)
    with pytest.warns(DeprecationWarning, match="now called valid"):
        assert empty.claimed == empty.valid == []


# --- what a system file says of stops ---

OWN = Path(__file__).parent.parent / "modelica" / "TrainRig" / "system.toml"
MISTAKES = tomllib.loads((Path(__file__).parent / "wrong" / "stops.toml").read_text())


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_what_is_said_of_stops_is_refused(mistake, tmp_path):
    old, new, message = MISTAKES[mistake].values()
    text = OWN.read_text().replace("../../fmus", str(OWN.parents[2] / "fmus"))
    path = tmp_path / "system.toml"
    path.write_text(replaced(text, (old, new)))
    with pytest.raises(InputError, match=message):
        read_system(path)


# --- subset simulation: quantiles of closed forms, down to one in 1e9 ---


DECADES = range(1, 10)
PROBABILITIES = 10.0 ** -np.arange(1.0, 10.0)


def tail(
    evaluate: Callable[[Matrix], Vector],
    dimension: int,
    first: int,
    addend: Callable[[Vector], Vector] | None = None,
) -> Tail:
    seeds = range(first, first + 8)
    return Tail(tuple(descend(evaluate, dimension, 9, 500, seed) for seed in seeds), addend)


def summed(points: Matrix) -> Vector:
    return points.sum(axis=1) / np.sqrt(points.shape[1])


def negative_square(points: Matrix) -> Vector:
    return -np.square(points).sum(axis=1)


def largest(points: Matrix) -> Vector:
    return -points.max(axis=1)


@pytest.mark.parametrize(
    ("evaluate", "dimension", "exact"),
    [
        (summed, 30, norm.ppf(PROBABILITIES)),
        (negative_square, 10, -chi2.isf(PROBABILITIES, 10)),
        # The largest of 20: 1 - (1 - sf)^20 = p, in 20 directions of failure.
        (largest, 20, -norm.isf(-np.expm1(np.log1p(-PROBABILITIES) / 20.0))),
    ],
)
def test_quantiles_are_those_of_closed_forms_down_to_one_in_1e9(evaluate, dimension, exact):
    """Of 95 % intervals nine in ten hold: what runs miss together, they do not show."""
    tails = [tail(evaluate, dimension, 100 * k) for k in range(10)]
    quantiles = [[tail.quantile(decade) for decade in DECADES] for tail in tails]
    held = [
        row.low <= value <= row.high
        for tail_quantiles in quantiles
        for row, value in zip(tail_quantiles, exact, strict=True)
    ]
    # 90 intervals, those of one tail alike; of ten tails, two and a half deviations are 0.24.
    assert np.mean(held) > 0.66
    mean = np.mean([[row.value for row in tail_quantiles] for tail_quantiles in quantiles], axis=0)
    # Ten tails leave half a percent at 1e-9; 500 samples of a decade bias it by as much.
    assert_allclose(mean, exact, rtol=0.01)


def test_a_probability_scatters_as_it_says():
    """Coefficient of variation at 1e-6, over 25 tails whose quantiles have known probability."""
    quantiles = [tail(summed, 10, 100 * k).quantile(6) for k in range(25)]
    scatter = np.std(np.log(norm.cdf([quantile.value for quantile in quantiles])), ddof=1)
    stated = np.sqrt(np.mean(np.square([quantile.variation for quantile in quantiles])))
    # 25 give a deviation to 14 %, eight runs theirs to 27 %, 25 times: two and a half of both.
    assert 0.6 < scatter / stated < 1.4


def test_what_is_added_with_a_heavy_tail_is_not_missed():
    """Reference: the sum of a normal variable and one of Student's t, by numerical integration."""
    spread, left, freedom = 0.021, 0.003, 5

    def beyond(value: float) -> float:
        def density(z: float) -> float:
            return float(norm.cdf((value - left * z) / spread) * t.pdf(z, freedom))

        edges = [-np.inf, 2.0 * value / left - 50.0, value / left, 0.0, np.inf]
        return sum(quad(density, low, high, limit=400)[0] for low, high in pairwise(edges))

    def addend(x: Vector) -> Vector:
        quantile: Vector = stdtr(freedom, x / left)
        return quantile

    heavy = tail(lambda points: spread * summed(points), 30, 1, addend)
    for decade in (4, 9):
        exact = brentq(lambda x, p=10.0**-decade: np.log(beyond(x) / p), -2.0, 0.0)
        quantile = heavy.quantile(decade)
        # Three times the half of its interval, which is 1 % at 1e-6 where the tail turns.
        assert abs(quantile.value - exact) < 1.5 * (quantile.high - quantile.low)
        assert_allclose(quantile.value, exact, rtol=0.03)


def test_it_agrees_with_plain_sampling_of_a_function_that_bends():
    def bent(points: Matrix) -> Vector:
        return points[:, 0] + 0.3 * points[:, 1] ** 2 - 0.2 * np.exp(points[:, 2])

    plain = bent(np.random.default_rng(1).standard_normal((1_000_000, 3)))
    quantile = tail(bent, 3, 1).quantile(4)
    # The hundredth of a million: its probability is known to 10 %, as is the other's.
    low, high = np.sort(plain)[[70, 130]]
    assert low < quantile.high
    assert quantile.low < high


def test_the_same_seed_gives_the_same_samples():
    first, other = (descend(summed, 5, 4, 100, seed=3) for _ in range(2))
    assert_allclose(first.values, other.values, rtol=0.0)
    assert_allclose(first.weights.sum(), 1.0, rtol=1e-12)  # of all that there is
    assert first.evaluations == 100 + 3 * 90


def test_plain_sampling_takes_a_hundred_times_the_inverse_for_a_tenth():
    """Variance of a share: p (1 - p)/n."""
    assert_allclose(plain_runs(1e-5, 0.1), 99.999e5, rtol=1e-12)
