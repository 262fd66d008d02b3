"""Shares and percentages as a summary's answer says them."""

from collections.abc import Mapping
from typing import Any

from workbench.pages.answer import Better, Measure


def percentage(share: float | None, better: Better = "lower") -> Measure:
    """A share as a measure in percent."""
    return Measure(None if share is None else 100.0 * share, "%", better)


def share_measure(one: Mapping[str, Any], better: Better) -> Measure:
    """A share of sets; without any there is nothing to compare."""
    if not one["of"]:
        return Measure(None, "%", better)
    value, low, high = (100.0 * one[key] for key in ("share", "low", "high"))
    return Measure(value, "%", better, low, high)


def share_with_interval(one: Mapping[str, Any], of: str = "sets") -> str:
    """A share of sets in words, with its 95 % interval."""
    low, high = 100.0 * one["low"], 100.0 * one["high"]
    share = whole_percent(one["share"])
    return f"{one['hits']} of {one['of']} {of}, {share} (95 %: {low:.0f} to {high:.0f})"


def unit_suffix(unit: str) -> str:
    """A unit behind a number; nothing where it has none."""
    return "" if unit == "1" else f" {unit}"


def whole_percent(share: float) -> str:
    """A share in whole percent.

    >>> whole_percent(0.906)
    '91 %'
    """
    return f"{100.0 * share:.0f} %"
