"""Shares and percentages as a summary's answer says them."""

from collections.abc import Mapping
from typing import Any

from workbench.pages.answer import Better, Measure


def percentage(share: float | None, better: Better = "lower") -> Measure:
    """A share as a measure in percent."""
    return Measure(None if share is None else 100.0 * share, "%", better)


def share_measure(share: Mapping[str, Any], better: Better) -> Measure:
    """A share of sets; without any there is nothing to compare."""
    if not share["of"]:
        return Measure(None, "%", better)
    value, low, high = (100.0 * share[key] for key in ("share", "low", "high"))
    return Measure(value, "%", better, low, high)


def share_with_interval(counts: Mapping[str, Any], of: str = "sets") -> str:
    """A share of sets in words, with its 95 % interval."""
    low, high = 100.0 * counts["low"], 100.0 * counts["high"]
    share = whole_percent(counts["share"])
    return f"{counts['hits']} of {counts['of']} {of}, {share} (95 %: {low:.0f} to {high:.0f})"


def unit_suffix(unit: str) -> str:
    """A unit behind a number; nothing where it has none."""
    return "" if unit == "1" else f" {unit}"


def whole_percent(share: float) -> str:
    """A share in whole percent.

    >>> whole_percent(0.906)
    '91 %'
    """
    return f"{100.0 * share:.0f} %"
