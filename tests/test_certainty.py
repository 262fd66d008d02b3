"""How sure a size is, by other ways to the same: no derivatives, closed forms.

A gauge whose law is known in closed form: a curve that bends, and a ripple that fits data in many
places.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import curve_fit, minimize_scalar

from workbench import case_from_frame
from workbench.diagnosis import build_everything, read_effects
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.inference.causes import Interval
from workbench.diagnosis.inference.certainty import assess
from workbench.diagnosis.inference.crossvalidation import CrossValidation
from workbench.diagnosis.inference.discrepancy import autocovariance, share_by_form
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.search import FittedModel, fitted
from workbench.diagnosis.inference.selection import anew
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.models.modelica import read_library

from .built import declare, machine

SCALE, BEND, TEETH, NOISE = 2.1, 0.3, 3.0, 0.1


@pytest.fixture(scope="module")
def fits(tmp_path_factory) -> Iterator[dict[str, Fit]]:
    """Two pulls of a gauge with each of the effects."""
    folder = tmp_path_factory.mktemp("gauge")
    system, rng = declare(folder, *machine("gauge")), np.random.default_rng(1)
    library = read_library(system.library)
    effects = read_effects(library, "Observer")
    path = folder / "AllEffects.fmu"
    build_everything(system, library, effects, path)
    laws = {"Bend": lambda u: np.expm1(BEND * u), "Ripple": lambda u: np.sin(TEETH * u)}
    fits, opened = {}, []
    for name, law in laws.items():
        cases = []
        for period in (4.0, 5.0):
            t = 0.01 * np.arange(1500)
            u = 1.0 - np.cos(2.0 * np.pi / period * t)
            y = SCALE * u + law(u) + NOISE * rng.standard_normal(t.size)
            columns = {"time [s]": t, "u [m]": u, "y [N]": y}
            cases.append(case_from_frame(system, pd.DataFrame(columns), name=f"{period:g} s"))
        opened.append(ResidualModel(ModelSource(path, system, {}), cases))
        fits[name] = Fit(opened[-1], effects)
    yield fits
    for model in opened:
        model.__exit__(None, None, None)


def begun(fit: Fit, name: str, size: float) -> FittedModel:
    """A fit with one effect that begins at a size."""
    effect = fit.unknowns.effects[name]
    return anew(fit, replace(fit.unknowns.start(), sizes={(name, effect.label): size}), (effect,))


def least(fit: Fit, best: FittedModel, size: float) -> float:
    """Chi-squared with the size held, as a search over the scale finds it without derivatives."""
    (key,), (level,) = best.point.sizes, best.point.levels

    def deviance(scale: float) -> float:
        return fit.at(replace(best.point, sizes={key: size}, levels={level: scale})).deviance

    # Some hundred times the tolerance of the search is the standard deviation of the scale.
    return float(minimize_scalar(deviance, bounds=(1.0, 3.0), options={"xatol": 1e-5}).fun)


def test_at_the_ends_by_noise_alone_the_least_chi_squared_has_risen_by_3_84(fits):
    fit = fits["Bend"]
    best = begun(fit, "Bend", BEND)
    ((key, (low, high)),) = assess(fit, best, lambda _: None).ends.items()
    bottom = least(fit, best, best.point.sizes[key])
    rises = [least(fit, best, end) - bottom for end in (low, high)]
    # Ends are found along a parabola through one point of each side: 5 % is its third order.
    assert_allclose(rises, 3.84, rtol=0.05)
    # The bend shows by its square: to the side of zero there is more room.
    assert 1.02 < (best.point.sizes[key] - low) / (high - best.point.sizes[key]) < 2.0


def test_errors_go_together_as_the_inverse_of_all_products_of_derivatives_says(fits):
    """Closed form: the bend has the derivative u exp(b u), the scale u, in means of blocks."""
    fit = fits["Bend"]
    certainty = assess(fit, begun(fit, "Bend", BEND), lambda _: None)
    u = np.concatenate([1.0 - np.cos(2.0 * np.pi / p * 0.01 * np.arange(1500)) for p in (4.0, 5.0)])
    J = np.column_stack([u * np.exp(BEND * u), u])
    inverse = np.linalg.inv(J.T @ J)
    expected = inverse[0, 1] / np.sqrt(inverse[0, 0] * inverse[1, 1])
    assert certainty.unknowns == (("Bend", "b"), ("c", "all"))
    assert_allclose(certainty.correlations, [[1.0, expected], [expected, 1.0]], atol=2e-3)


def test_a_law_with_one_minimum_is_found_from_everywhere(fits):
    fit = fits["Bend"]
    certainty = assess(fit, begun(fit, "Bend", BEND), lambda _: None)
    assert certainty.same == len(certainty.behind) == 4
    assert certainty.lower == 0.0


def test_of_a_law_with_many_minima_some_starts_end_elsewhere_and_none_lower(fits):
    fit = fits["Ripple"]
    certainty = assess(fit, begun(fit, "Ripple", TEETH), lambda _: None)
    assert 0 < certainty.same < 4
    assert certainty.lower == 0.0
    assert "none lower" in certainty.sentence


def test_a_fit_that_sits_in_a_wrong_minimum_is_told(fits):
    fit = fits["Ripple"]
    wrong = begun(fit, "Ripple", 0.4 * TEETH)
    assert abs(wrong.point.sizes["Ripple", "k"] - TEETH) > 1.0
    certainty = assess(fit, wrong, lambda _: None)
    assert certainty.lower > 100.0
    assert "sizes may be others" in certainty.sentence


def test_a_fit_to_others_leaves_open_what_the_derivatives_say(fits):
    """Closed form for each pull, by the other one alone: m N^-1 m' of the means m of a block."""
    fit = fits["Bend"]
    best = begun(fit, "Bend", BEND)
    left_open = CrossValidation(fit).left_open(best, fast=True)
    pulls = [1.0 - np.cos(2.0 * np.pi / p * 0.01 * np.arange(1500)) for p in (4.0, 5.0)]
    means = [
        np.column_stack([u * np.exp(BEND * u), u]).reshape(-1, 1500 // len(own), 2).mean(axis=1)
        for u, own in zip(pulls, left_open, strict=True)
    ]
    for m, other, own in zip(means, means[::-1], left_open, strict=True):
        expected = np.einsum("gp,pq,gq->g", m, np.linalg.inv(other.T @ other), m)
        expected *= best.linearised.variance_factors[0]  # what is wrong with the noise
        # Noise is told from each pull, to a few parts of a hundred.
        assert_allclose(own[:, 0], expected, rtol=0.1, atol=1e-3 * expected.max())


def test_a_fit_ends_at_the_least_squares_of_an_independent_solver(fits):
    """Begun at half of the size, with the scale of a straight gauge."""
    fit = fits["Bend"]
    best = begun(fit, "Bend", 0.5 * BEND)
    t, rng = 0.01 * np.arange(1500), np.random.default_rng(1)
    u = np.concatenate([1.0 - np.cos(2.0 * np.pi / period * t) for period in (4.0, 5.0)])
    y = SCALE * u + np.expm1(BEND * u) + NOISE * rng.standard_normal(u.size)
    size = u.size // sum(len(own.errors) for own in best.linearised.residuals)

    def law(u: np.ndarray, b: float, c: float) -> np.ndarray:
        return (c * u + np.expm1(b * u)).reshape(-1, size).mean(axis=1)

    (b, c), spread = curve_fit(law, u, y.reshape(-1, size).mean(axis=1), (BEND, SCALE))
    (bend,), (scale,) = best.point.sizes.values(), best.point.levels.values()
    # Both pulls weigh what their own noise says, which differs by a few parts of a hundred.
    assert abs(bend - b) < 0.1 * np.sqrt(spread[0, 0])
    assert abs(scale - c) < 0.1 * np.sqrt(spread[1, 1])


def test_a_fit_ends_where_it_cannot_come_near_what_is_sought(fits):
    """A bend fits the data of a ripple, and leaves many times what the ripple does."""
    fit = fits["Ripple"]
    right = begun(fit, "Ripple", TEETH)
    bend, sought = fit.unknowns.effects["Bend"], right.linearised.deviance
    start = fit.at(replace(right.point, sizes={("Bend", bend.label): 0.1}))
    whole = fitted(fit, start, (bend,)).linearised
    assert whole.settled
    assert whole.deviance > sought + 100.0
    ended = fitted(fit, start, (bend,), sought=sought).linearised
    assert not ended.settled
    # What can be reached is.
    reached = fitted(fit, start, (bend,), sought=whole.deviance).linearised
    assert reached.deviance == pytest.approx(whole.deviance)


# --- errors that go on in time, against closed forms ---


def test_autocovariance_is_that_of_a_process_of_first_order():
    """Reference: a^k/(1 - a^2) at lag k. Of 1e5 samples it is known to some 2 %."""
    rng, a = np.random.default_rng(3), 0.8
    errors = [np.zeros(2000) for _ in range(50)]
    for own in errors:
        for k, noise in enumerate(rng.standard_normal(own.size - 1), start=1):
            own[k] = a * own[k - 1] + noise
    assert_allclose(autocovariance(errors)[:5], a ** np.arange(5) / (1.0 - a**2), rtol=0.06)


def test_a_size_is_as_unsure_as_what_remains_of_its_effect():
    """Student's t of two degrees of freedom: 4.303, over 1.96 of the band."""
    assert share_by_form(4.0, 400.0) == pytest.approx(0.1 * 4.303 / 1.96, rel=1e-3)
    assert share_by_form(-0.1, 400.0) == 0.0


# --- sizes at their bounds ---


ESTIMATE = Interval(0.01, 0.009, 0.011, "N.m")
GREATEST = Interval(0.0133, 0.012, math.inf, "N.m", "greatest")
BETTER = Interval(0.0133, 0.012, math.inf, "N.m", "greatest", beyond=0.015)
ALONE = Interval(0.0133, 0.012, math.inf, "N.m", "greatest", beyond=0.015, alone=True)
LEAST = Interval(-0.2, -math.inf, -0.18, "1", "least")


@pytest.mark.parametrize(
    ("size", "text"),
    [
        (ESTIMATE, "0.01 N.m (95 %: 0.009 to 0.011)"),
        (GREATEST, "at its limit of 0.0133 N.m, which is no estimate: larger may fit better"),
        (replace(ESTIMATE, unit="1"), "1 % (95 %: 0.9 to 1.1)"),
        (replace(ESTIMATE, unit="1", plain=True), "0.01 (95 %: 0.009 to 0.011)"),
        (LEAST, "at its limit of -20 %, which is no estimate: smaller may fit better"),
        (BETTER, "no estimate: 0.015 N.m, beyond it, fits better"),
        (ALONE, "no estimate: 0.015 N.m, beyond it, fits better, alone"),
    ],
)
def test_a_size_at_its_bound_is_no_estimate(size, text):
    assert size.text.endswith(text)


def test_an_interval_is_open_to_the_side_of_a_bound():
    """JSON has no infinity."""
    assert (GREATEST.to_dict()["low"], GREATEST.to_dict()["high"]) == (0.012, None)
    assert (LEAST.to_dict()["low"], LEAST.to_dict()["high"]) == (None, -0.18)
    assert GREATEST.to_dict()["limit"] == "greatest"
    assert ESTIMATE.to_dict()["high"] == 0.011
