"""The answer of a command: a sentence, and numbers that a second run is compared by."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

Better = Literal["lower", "higher", ""]

# Files of results that hold an answer and what made them, one in a folder.
SUMMARIES = (
    "summary.json",
    "observability.json",
    "accuracy.json",
    "power.json",
    "thresholds.json",
    "sheet_error.json",
    "left_out.json",
    "plan.json",
    "followed.json",
    "next.json",
    "distance.json",
    "bench.json",
)


@dataclass(frozen=True)
class Measure:
    """One number of a result."""

    value: float | None  # None where it could not be had
    unit: str
    better: Better = ""  # which way is better; empty where neither is
    # low, high: ends of its 95 % interval; None without
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Answer:
    """What is read first."""

    sentence: str  # with its uncertainty
    # numbers that tell the result, by what they are
    headline: Mapping[str, Measure] = field(default_factory=dict)
    # those behind them, such as of each recording
    details: Mapping[str, Measure] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """As it stands in a file of results."""
        return {
            "sentence": self.sentence,
            "headline": {name: asdict(measure) for name, measure in self.headline.items()},
            "details": {name: asdict(detail) for name, detail in self.details.items()},
        }


def with_answer(answer: Answer, summary: Mapping[str, Any]) -> dict[str, Any]:
    """A summary that begins with its answer."""
    return {"answer": answer.to_dict(), **summary}


def recordings(count: int) -> str:
    """A number of recordings in words."""
    return "one recording" if count == 1 else f"{count} recordings"


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


def finite(value: float) -> float | None:
    """A number as JSON has it: None for infinity and NaN."""
    return value if math.isfinite(value) else None


def unit_suffix(unit: str) -> str:
    """A unit behind a number; nothing where it has none."""
    return "" if unit in ("", "1") else f" {unit}"


def whole_percent(share: float) -> str:
    """A share in whole percent.

    >>> whole_percent(0.906)
    '91 %'
    """
    return f"{100.0 * share:.0f} %"
