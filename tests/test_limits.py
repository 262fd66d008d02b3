"""Sizes of causes at their bounds, and what is said of them."""

import math

import pytest

from workbench.diagnosis.inference.verdict import Interval

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
