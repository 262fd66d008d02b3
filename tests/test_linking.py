"""Laws that are translated with the loop that takes them up."""

import numpy as np
import pytest

from workbench.models.native import compiled


@compiled
def root(x: float) -> float:
    if x < 0.0:
        raise ValueError("no root")
    return float(np.sqrt(x))


@compiled
def total(x: np.ndarray) -> float:
    found = 0.0
    for one in x:
        found += root(one)
    return found


def test_a_loop_does_what_its_law_does_and_refuses_what_it_refuses():
    assert total(np.array([1.0, 4.0])) == 3.0
    with pytest.raises(ValueError, match="no root"):
        total(np.array([1.0, -4.0]))


def test_what_a_loop_took_up_may_be_called_alone_too():
    assert total(np.array([9.0])) == root(9.0) == 3.0
