"""Sizes of causes at their bounds, and what is said of them."""

from collections import defaultdict
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.inference import verdict
from workbench.diagnosis.inference.verdict import Interval

BOUNDS = {"friction": (0.0, 0.0133)}
KEY = ("Dry", "friction")


def estimated(value: float) -> Interval:
    """What a cause says of its size, which may go from zero to a bound."""
    effect = Effect("Dry", "Dry", ("bearing",), "friction", 1e-3, "dry friction", "a slow turn")
    unknowns = SimpleNamespace(bounds=lambda effect, name: BOUNDS[name], unit=lambda *_: "N.m")
    trial = SimpleNamespace(
        covariance=lambda: np.full((1, 1), 1e-8), joint=SimpleNamespace(known=(KEY,))
    )
    chosen: Any = SimpleNamespace(
        best=SimpleNamespace(point=SimpleNamespace(sizes={KEY: value}, phases={})),
        trial=trial,
        twins=defaultdict(dict),
        less=defaultdict(dict),
        validation=SimpleNamespace(explained=lambda *_, fast: (1.0, 1.0)),
    )
    fit: Any = SimpleNamespace(unknowns=unknowns)
    return verdict._cause(fit, chosen, effect).parameters["friction"]


@pytest.mark.parametrize(
    ("value", "limit", "said"),
    [
        (0.0133, "greatest", "at its limit of 0.0133 N.m, which is no estimate: larger may fit"),
        (0.0, "least", "smaller may fit better"),
        (0.01, "", "95 %: "),
    ],
)
def test_a_size_at_its_bound_is_no_estimate(value: float, limit: str, said: str) -> None:
    size = estimated(value)
    assert size.limit == limit
    assert said in size.text
