"""What a command found, in one sentence and in the numbers that a second run is compared by."""

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
    """One number of a result.

    Attributes
    ----------
    value : None where it could not be had.
    better : which way is better; empty where neither is.
    low, high : ends of its 95 % interval; None without.
    """

    value: float | None
    unit: str
    better: Better = ""
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Answer:
    """What is read first.

    Attributes
    ----------
    sentence : with its uncertainty.
    headline : numbers that tell the result, by what they are.
    details : those behind them, such as of each recording.
    """

    sentence: str
    headline: Mapping[str, Measure] = field(default_factory=dict)
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
