"""Signals that are late by themselves: which are named, and which are none."""

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from workbench.diagnosis.inference import timing
from workbench.diagnosis.inference.quadratic import Quadratic
from workbench.diagnosis.inference.thresholds import thresholds
from workbench.diagnosis.inference.timing import LateSignals, by_themselves

SAMPLE = 1e-3  # [s]


class Clocks:
    """A fit in which clocks are late by given times, each sure to a microsecond, against i."""

    reference = "i"
    decides = thresholds(10)
    least_skew = 0.1 * SAMPLE

    def __init__(self, skews: Mapping[str, float]) -> None:
        self.skews = skews
        self.own_clocks = tuple(
            SimpleNamespace(name=f"TimeSkew[{signal}]", size="skew", late=(signal,))
            for signal in skews
        )

    def beside(self, effects: object) -> "Clocks":
        return self

    def at(self, point: Any) -> Any:
        return point

    def linearise(self, lin: Any, active: Any) -> Any:
        return lin

    def quadratics(self, lin: Any) -> Any:
        shared = tuple((clock.name, clock.size) for clock in lin.active)
        N = 1e12 * np.eye(len(shared))
        total = Quadratic(N, np.zeros(len(shared)), 0.0, 0)
        return SimpleNamespace(shared=shared, total=lambda: total)


def said(skews: Mapping[str, float], monkeypatch: pytest.MonkeyPatch) -> LateSignals | None:
    """What is late, where nothing else was found and much is wrong without clocks."""
    fit = Clocks(skews)

    def model(left: float, active: Any = ()) -> Any:
        sizes = {(c.name, c.size): skews[c.late[0]] for c in active}
        errors = SimpleNamespace(
            variance_factors=np.ones(1), weighed=lambda factors: left, active=active
        )
        return SimpleNamespace(linearised=errors, point=SimpleNamespace(sizes=sizes), active=active)

    monkeypatch.setattr(timing, "fitted", lambda fit, start, active: model(0.0, active))
    monkeypatch.setattr(timing, "replace", lambda point, **changes: point)
    nominal = model(1e6)
    return by_themselves(fit, nominal, nominal, clean=False)  # type: ignore[arg-type]


def test_one_late_signal_is_named_with_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Six microseconds are a hundredth of a sample, however sure they are."""
    found = said({"u": -6e-6, "w": 8e-3}, monkeypatch)
    assert found is not None
    assert found.signals == ("w",)
    assert found.skew == pytest.approx(8e-3)


def test_what_all_others_are_early_against_is_late(monkeypatch: pytest.MonkeyPatch) -> None:
    found = said({"u": -8e-3, "w": -8e-3}, monkeypatch)
    assert found is not None
    assert (found.signals, found.skew) == (("i",), pytest.approx(8e-3))


def test_signals_that_are_late_by_different_times_are_listed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = said({"u": 3e-3, "v": -2e-3, "w": 8e-3, "x": 5e-3}, monkeypatch)
    assert found is not None
    assert found.skews == {"u": 3e-3, "v": -2e-3, "w": 8e-3, "x": 5e-3}
    assert found.signals == ("u", "v", "w", "x")


def test_clocks_that_are_right_are_no_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    assert said({"u": -6e-6, "w": 9e-5}, monkeypatch) is None
