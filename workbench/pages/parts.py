"""Pages that consist of an answer, figures and tables alone: of what they are made, and one writer.

A page is described in values; where they stand and how they look is the template's affair.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from workbench.pages.drawing import ticks_within
from workbench.pages.templates import rendered
from workbench.runtime.files import write_whole

_LEFT, _WIDTH, _ROW, _TOP = 250, 620, 24, 34  # of a figure of dots [px]


@dataclass(frozen=True)
class Cell:
    """One entry of a table.

    Attributes
    ----------
    value : by which it is sorted; None where there is none, and for words.
    heat : 0 to 1, shade of the cell; None without.
    """

    text: str
    value: float | None = None
    heat: float | None = None


@dataclass(frozen=True)
class Heading:
    """Heading of a column; `meaning` is told where the heading stands."""

    title: str
    number: bool = True
    meaning: str = ""


@dataclass(frozen=True)
class Rows:
    """Rows of cells; the first column holds what a row is of."""

    id: str
    caption: str
    columns: tuple[Heading, ...]
    rows: tuple[tuple[str, tuple[Cell, ...]], ...]


@dataclass(frozen=True)
class Dot:
    """A number on an axis, with its 95 % interval where there is one."""

    value: float
    style: str
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Dots:
    """Rows of dots on one axis, from zero, from `low`, or logarithmic.

    Attributes
    ----------
    finding : what it shows, for those who do not see it.
    axis : what the numbers are, with unit.
    mark : value and name of a line across all rows; None without.
    low, high : ends of the axis; None: zero, and that of the data.
    """

    finding: str
    axis: str
    rows: tuple[tuple[str, tuple[Dot, ...]], ...]
    mark: tuple[float, str] | None = None
    low: float | None = None
    high: float | None = None
    logarithmic: bool = False

    def drawn(self) -> dict[str, Any]:
        """Geometry for the template, in pixels."""
        ends = [one.value if one.high is None else one.high for _, row in self.rows for one in row]
        high = 1.05 * max(ends, default=1.0) if self.high is None else self.high
        low = min(ends, default=0.1) / 1.15 if self.logarithmic else self.low or 0.0

        def at(value: float) -> float:
            inside = max(min(value, high), low)
            if self.logarithmic:
                return _LEFT + _WIDTH * (1.0 - math.log(inside / high) / math.log(low / high))
            return _LEFT + _WIDTH * (inside - low) / ((high - low) or 1.0)

        ticks = ticks_within(low, high, 8)
        if self.logarithmic:
            decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
            marks = [digit * 10.0**decade for decade in decades for digit in (1, 2, 5)]
            ticks = [(mark, f"{mark:g}") for mark in marks if low <= mark <= high]

        rows = [
            {
                "name": name,
                "y": _TOP + _ROW * (number + 0.5),
                "dots": [
                    {
                        "x": at(dot.value),
                        "style": dot.style,
                        "interval": None
                        if dot.low is None or dot.high is None
                        else (at(dot.low), at(dot.high)),
                    }
                    for dot in dots
                ],
            }
            for number, (name, dots) in enumerate(self.rows)
        ]
        bottom = _TOP + _ROW * len(rows)
        return {
            "finding": self.finding,
            "axis": self.axis,
            "rows": rows,
            "mark": None if self.mark is None else (at(self.mark[0]), self.mark[1]),
            "ticks": [(at(value), text) for value, text in ticks],
            **{"left": _LEFT, "width": _WIDTH, "top": _TOP, "bottom": bottom},
            "total": _LEFT + _WIDTH + 40,
        }


@dataclass(frozen=True)
class Strip:
    """Things that are alike and stand in a row, as wheels of a vehicle do: which one is not well.

    Attributes
    ----------
    finding : what it shows, for those who do not see it.
    entries : name of each, and what is wrong with it; empty where nothing is.
    """

    finding: str
    entries: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Part:
    """A part of a page; the first is open, the others are folded.

    Attributes
    ----------
    printed : whether it is in the printed report though it is folded on the page.
    text : paragraphs.
    recordings : geometry of figures, see `recordings.placed`.
    terms : definitions by what is defined.
    """

    id: str
    title: str
    text: tuple[str, ...] = ()
    strips: tuple[Strip, ...] = ()
    dots: tuple[Dots, ...] = ()
    recordings: tuple[Mapping[str, Any], ...] = ()
    tables: tuple[Rows, ...] = ()
    terms: Mapping[str, str] = field(default_factory=dict)
    printed: bool = False


def number(value: float | None, text: Callable[[float], str], heat: float | None = None) -> Cell:
    """A number as a cell.

    >>> number(0.25, "{:.0%}".format), number(None, "{:.0%}".format)
    (Cell(text='25%', value=0.25, heat=None), Cell(text='n/a', value=None, heat=None))
    """
    return Cell("n/a") if value is None else Cell(text(value), value, heat)


def write_parts(
    title: str,
    summary: Mapping[str, Any],
    parts: Sequence[Part],
    path: Path,
    *,
    file: str,
    warnings: Sequence[str] = (),
) -> None:
    """Write a page.

    Parameters
    ----------
    summary : of which the page is; its answer stands at the top.
    file : of the summary, beside the page.
    """
    text = rendered(
        "parts.html", summary, title=title, parts=parts, file=file, warnings=list(warnings)
    )
    write_whole(path, text)
