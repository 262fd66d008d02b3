"""Pages as values: an answer, then parts made of text, tables and figures; one template shows all.

Texts are escaped; one that holds markup is a `markupsafe.Markup`.
"""

import hashlib
import json
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from workbench.pages.figures import DARK, LIGHT, CaseFigure, drawing, ticks_within
from workbench.runtime.files import write_whole


def rendered(summary: Mapping[str, Any], page: object) -> str:
    """A page of a summary."""
    run = summary["provenance"]["run"]
    template = _environment().get_template("page.html")
    return template.render(summary=summary, run=run, report=number_of(summary), page=page)


def number_of(summary: Mapping[str, Any]) -> str:
    """Number of the report on a summary: its date, and the first digits of its SHA-256.

    >>> number_of({"provenance": {"run": {"date": "2026-11-23T04:05:06+00:00"}}})
    '20261123-00e93ccf'
    """
    content = json.dumps(summary, sort_keys=True).encode()
    date = str(summary["provenance"]["run"]["date"])[:10].replace("-", "")
    return f"{date}-{hashlib.sha256(content).hexdigest()[:8]}"


@cache
def _environment() -> Environment:
    environment = Environment(
        autoescape=True,
        loader=PackageLoader("workbench", "pages"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"anchor": anchor, "day": _day}
    environment.filters["form"] = lambda block: type(block).__name__.lower()  # name of its macro
    environment.globals["colours"] = {"light": LIGHT, "dark": DARK}
    return environment


def _day(date: str) -> str:
    """A date for people.

    >>> _day("2026-11-23T04:05:06+00:00")
    '23 November 2026, 04:05 UTC'
    """
    return f"{datetime.fromisoformat(date):%-d %B %Y, %H:%M} UTC"


def anchor(name: str) -> str:
    """Place of a recording on a page."""
    return re.sub(r"\s", "_", name)


_LEFT, _WIDTH, _ROW, _TOP = 250, 620, 24, 34  # of a figure of dots [px]
_CELL, _NAMES = 24, 205  # of a matrix, room for names [px]
_ROOM = 2_600_000  # [byte] of figures on a page, so that it stays below 3 MB and opens at once


@dataclass(frozen=True)
class Text:
    """A paragraph; a plain text is one too. A warning stands out."""

    text: str
    warning: bool = False


@dataclass(frozen=True)
class Cell:
    """One entry of a table; a plain text is one too."""

    text: str
    value: float | None = None  # by which it is sorted; None where there is none, and for words
    heat: float | None = None  # 0 to 1, shade of the cell; None without
    warning: bool = False

    @property
    def order(self) -> str:
        """The value as JavaScript reads it."""
        if self.value is None:
            return ""
        return "Infinity" if self.value == math.inf else str(self.value)


@dataclass(frozen=True)
class Numbers:
    """Heading of a column of numbers; that of a column of words is a plain text."""

    title: str
    meaning: str = ""  # shown where the pointer is on the heading
    sorted: str = ""  # how the rows are ordered by this column, "ascending" or "descending"


@dataclass(frozen=True)
class Table:
    """Rows of cells; the first column holds what a row is of."""

    id: str
    caption: str
    columns: Sequence[object]  # headings, texts and `Numbers`
    rows: Sequence[Sequence[object]]  # texts and `Cell`s
    marked: Sequence[str] = ()  # first cells of rows that stand out
    sortable: bool = True  # whether a click on a heading sorts the rows


@dataclass(frozen=True)
class Definitions:
    """Meanings by what is defined; in two columns where they are short."""

    terms: Mapping[str, str]
    grid: bool = False


@dataclass(frozen=True)
class Source:
    """Text of a program or of a command line."""

    code: str
    label: str = ""


@dataclass(frozen=True)
class Article:
    """A heading and what stands below it."""

    id: str
    title: str
    content: Sequence["Block"]


@dataclass(frozen=True)
class Strip:
    """Things that are alike and stand in a row, as wheels of a vehicle do: which is not well."""

    finding: str  # what it shows, for those who do not see it
    # name of each, and what is wrong with it; empty where nothing is
    entries: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Dot:
    """A number on an axis, with its 95 % interval where there is one."""

    value: float
    style: str
    low: float | None = None
    high: float | None = None
    diamond: bool = False

    @property
    def interval(self) -> tuple[float, float] | None:
        """Both ends, if there are both."""
        return None if self.low is None or self.high is None else (self.low, self.high)


@dataclass(frozen=True)
class Dots:
    """Rows of dots on one axis, from zero, from `low`, or logarithmic."""

    finding: str  # what it shows, for those who do not see it
    axis: str  # what the numbers are, with unit
    rows: Sequence[tuple[str, Sequence[Dot]]]
    mark: tuple[float, str] | None = None  # value and name of a line across all rows; None without
    # low, high: ends of the axis; None: zero, and that of the data
    low: float | None = None
    high: float | None = None
    logarithmic: bool = False
    paired: bool = False  # whether a line joins the two dots of a row
    total: str = ""  # row that stands for all others
    caption: str = ""  # the finding unless given
    legend: Sequence[tuple[str, str]] = ()  # (style, text) of each entry

    def drawn(self) -> dict[str, Any]:
        """Geometry for the template, in pixels."""
        ends = [dot.value if dot.high is None else dot.high for _, row in self.rows for dot in row]
        high = 1.05 * max(ends, default=1.0) if self.high is None else self.high
        low = self.low or 0.0
        if self.logarithmic and self.low is None:
            low = min(ends, default=0.1) / 1.15

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
        bottom = _TOP + _ROW * len(self.rows)
        return {
            "at": at,
            "rows": [
                (name, _TOP + _ROW * (number + 0.5), dots)
                for number, (name, dots) in enumerate(self.rows)
            ],
            "across": [(at(value), text) for value, text in ticks],
            **{"left": _LEFT, "width": _WIDTH, "top": _TOP, "bottom": bottom},
            "total": _LEFT + _WIDTH + 40,
        }


@dataclass(frozen=True)
class Steps:
    """A number that changes from step to step, as the best of a search does."""

    finding: str
    axis: str
    values: Sequence[float]  # after each step, the first before any
    style: str
    mark: tuple[float, str]  # value and name of a line across
    caption: str

    def drawn(self) -> dict[str, Any]:
        """Geometry for the template, in pixels; a value holds until the next one."""
        left, width, height, top = 58, 850, 220, 16
        low, high = min(*self.values, self.mark[0]), max(*self.values, self.mark[0])
        room = 0.08 * (high - low or high)
        low, high = low - room, high + room
        last = max(len(self.values) - 1, 1)

        def across(step: float) -> float:
            return left + width * step / last

        def down(value: float) -> float:
            return top + height * (high - value) / (high - low)

        steps = (f"H{across(k):.1f}V{down(value):.1f}" for k, value in enumerate(self.values))
        whole = ((x, text) for x, text in ticks_within(0.0, last, 10) if x % 1 == 0)
        return {
            **{"left": left, "width": width, "top": top, "bottom": top + height},
            "path": f"M{across(0):.1f} {down(self.values[0]):.1f}" + "".join(steps),
            "end": (across(len(self.values) - 1), down(self.values[-1])),
            "mark": down(self.mark[0]),
            "across": [(across(value), text) for value, text in whole],
            "down": [(down(value), text) for value, text in ticks_within(low, high, 6)],
            "total": left + width + 40,
        }


@dataclass(frozen=True)
class Matrix:
    """Shares of 0 to 1 between things, by row and column."""

    finding: str
    names: Sequence[str]
    shares: Sequence[Sequence[float]]
    least: float  # share from which on it is written
    marked: Sequence[str]  # names that stand out
    caption: str

    def drawn(self) -> dict[str, Any]:
        """Geometry for the template, in pixels."""
        places = list(zip(self.names, count(_NAMES, _CELL)))
        rows = [
            (name, y, [(x, share) for (_, x), share in zip(places, shares, strict=True)])
            for (name, y), shares in zip(places, self.shares, strict=True)
        ]
        size = _NAMES + _CELL * len(places) + 2
        return {"rows": rows, "cell": _CELL, "left": _NAMES, "size": size}


@dataclass(frozen=True)
class Recording:
    """The figure of a recording, which can be zoomed; see `zoomable`."""

    drawing: Mapping[str, Any]  # its geometry
    elsewhere: str = ""  # page of its own; empty where it is on this one
    files: Sequence[str] = ()  # suffixes of its data and pictures beside the page
    headed: bool = True  # whether its name and what it says stand above it


@dataclass(frozen=True)
class Provenance:
    """The provenance of the summary as it is."""


Block = (
    str
    | Text
    | Table
    | Definitions
    | Source
    | Article
    | Strip
    | Dots
    | Steps
    | Matrix
    | Recording
    | Provenance
)


@dataclass(frozen=True)
class Part:
    """A part of a page; the first is open, the others are folded."""

    id: str
    title: str
    content: Sequence[Block]
    printed: bool = False  # whether it is in the printed report though it is folded on the page


@dataclass(frozen=True)
class Page:
    """All of a page but the summary."""

    title: str
    parts: Sequence[Part]
    file: str = "summary.json"  # of the summary, beside the page
    headline: str = ""  # the answer of the summary unless given
    warnings: Sequence[str] = ()
    related: Mapping[str, str] = field(default_factory=dict)  # text of a link by its address
    run: Sequence[Block] = (Provenance(),)  # what was run

    def write(self, summary: Mapping[str, Any], path: Path) -> Path:
        """Write the page of a summary; returns its path."""
        write_whole(path, rendered(summary, self))
        return path


def number(value: float | None, digits: str, heat: float | None = None) -> Cell:
    """A number as a cell, in a format of Python.

    >>> number(0.25, ".0%").text, number(None, ".0%").text
    ('25%', 'n/a')
    """
    return Cell("n/a") if value is None else Cell(format(value, digits), value, heat)


def tabulated(
    id: str,
    caption: str,
    records: Iterable[Mapping[Any, Any]],
    columns: Sequence[tuple[object, str | Callable[[Any], object], str]],
) -> Table:
    """A table with a row for each record.

    Parameters
    ----------
    columns : heading, entry of a record or what makes one of it, and format of its numbers; without
        a format the entry stands as it is.
    """

    def cell(
        record: Mapping[str, Any], entry: str | Callable[[Any], object], digits: str
    ) -> object:
        value: Any = entry(record) if callable(entry) else record[entry]
        return number(value, digits) if digits else value

    rows = [tuple(cell(record, *column[1:]) for column in columns) for record in records]
    return Table(id, caption, [heading for heading, _, _ in columns], rows)


def joined(separator: str, texts: Sequence[str]) -> Markup:
    """Texts with markup, one after the other."""
    return Markup(separator).join(texts)


def term(word: str, meaning: str) -> Markup:
    """A word whose meaning is shown where the pointer is."""
    return Markup('<abbr title="{}">{}</abbr>').format(meaning, word)


def zoomable(
    figures: Sequence[CaseFigure],
    summary: Mapping[str, Any],
    folder: Path,
    *,
    files: Sequence[str] = (),
) -> list[Recording]:
    """Figures for the page of a summary, in their order.

    What does not fit the page any more is written to a page of its own in the folder; the first
    is always here.
    """
    room, blocks = _ROOM, []
    for place, figure in enumerate(figures):
        drawn = drawing(figure)
        room -= drawn["size"]
        elsewhere = f"{figure.name}.html" if place and room < 0 else ""
        if elsewhere:
            Page(
                title=f"{figure.name}: {figure.title}",
                parts=[Part("figure", "The recording", [Recording(drawn)])],
                headline=figure.finding,
                related={"index.html": "All recordings"},
            ).write(summary, folder / elsewhere)
        blocks.append(Recording(drawn, elsewhere, files))
    return blocks
