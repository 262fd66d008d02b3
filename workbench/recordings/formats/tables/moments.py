"""Moments that several columns hold: date and time of day, year and hour, parts of a second."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from itertools import pairwise

from workbench.recordings.formats.stamps import has_day, has_day_alone, has_fraction, is_stamp
from workbench.recordings.formats.tables.cells import Label, mostly

# Columns that hold parts of a second beside time stamps, and digits of these.
PARTS_OF_SECOND = {
    **dict.fromkeys(
        ("ms", "msec", "millisecond", "milliseconds", "millisekunden", "millis", "millitm"), 3
    ),
    **dict.fromkeys(("us", "\u00b5s", "usec", "microseconds", "mikrosekunden", "micros"), 6),
    **dict.fromkeys(("ns", "nsec", "nsecs", "nanosec", "nanoseconds"), 9),
    **dict.fromkeys(("fraction", "frac", "subsec", "subseconds"), 0),
}
# Columns that hold parts of a date, by their names in small letters.
PARTS_OF_TIME = {
    **dict.fromkeys(("year", "yr", "yyyy", "yy", "jahr"), "year"),
    **dict.fromkeys(("month", "mon", "mo", "mm", "monat"), "month"),
    **dict.fromkeys(("day", "dd", "dy", "tag"), "day"),
    **dict.fromkeys(("doy", "yday", "jday", "day of year", "julian day", "day_rtm"), "yday"),
    **dict.fromkeys(("hour", "hours", "hr", "hh", "stunde"), "hour"),
    **dict.fromkeys(("minute", "minutes", "min", "mi", "mn"), "minute"),
    **dict.fromkeys(("second", "seconds", "sec", "ss", "sekunde"), "second"),
    **dict.fromkeys(("hhmm", "hhmmss", "hour_minute_rtm", "time", "zeit", "uhrzeit"), "clock"),
    **dict.fromkeys(("date", "datum", "yyyymmdd"), "date"),
}
_FIGURES = re.compile(r"\d+([.,]\d*)?")
_DATE_IN_FIGURES = re.compile(r"(19|20)\d\d(0[1-9]|1[0-2])(0[1-9]|[12]\d|3[01])")
_AT_MIDNIGHT = re.compile(r"[T\s]+(0?0:00(:00([.,]0+)?)?|12:00(:00)?\s*AM)$", re.IGNORECASE)
_WHOLE_SECONDS = re.compile(
    r"(?P<whole>.*\d:\d\d:\d\d|\d+)(?P<half>(\s*[AP]\.?M\.?)?)", re.IGNORECASE
)
_WHOLE_MINUTES = re.compile(
    r"(?P<whole>(.*[T\s])?\d{1,2}:\d\d)(?P<half>(\s*[AP]\.?M\.?)?)", re.IGNORECASE
)
_LAST_WORD = re.compile(r"(.*?)([^\W_]*)$")  # header.stamp.nsec, tv_usec
# Parts that make a day, and those of a time of day.
_DAYS = ("date",), ("year", "month", "day"), ("year", "yday")
_CLOCK = ("hour", "minute", "second")


@dataclass(frozen=True)
class Columns:
    """Columns of a table, in which those of one moment become one, before all others."""

    labels: list[Label]
    cells: list[list[str]]

    def joined(
        self, parts: Sequence[int], cells: list[str], label: Label | None = None
    ) -> "Columns":
        """The same with one column in place of its parts, whose names it has without a label."""
        left = [i for i in range(len(self.cells)) if i not in parts]
        label = label or (" ".join(self.labels[i][0] for i in parts), "")
        return Columns(
            [label, *(self.labels[i] for i in left)], [cells, *(self.cells[i] for i in left)]
        )


def join_moments(columns: Columns) -> Columns:
    """The same columns, with those of years and hours, days and times, parts of a second as one."""
    return _join_fractions(_join_day_and_clock(_join_date_parts(columns)))


def with_whole_stamps(rows: list[list[str]]) -> list[list[str]]:
    """The same samples, with days and times beside them as one, where a name stands above both."""
    for i, (days, clocks) in enumerate(pairwise(zip(*rows, strict=True))):
        if _are_days(days) and _are_clocks(clocks):
            return [[*row[:i], _at_clock(row[i], row[i + 1]), *row[i + 2 :]] for row in rows]
    return rows


def _at_clock(day: str, clock: str) -> str:
    """A date, which may be written with midnight, and a time of day as one."""
    return f"{_AT_MIDNIGHT.sub('', day)} {clock}"


def _are_days(cells: Sequence[str]) -> bool:
    return mostly(cells, is_stamp) and has_day_alone(cells)


def _are_clocks(cells: Sequence[str]) -> bool:
    return mostly(cells, is_stamp) and not has_day(cells)


def _join_day_and_clock(columns: Columns) -> Columns:
    """The same columns, with one of days and one of times of day as one."""
    day = next((i for i, cells in enumerate(columns.cells) if _are_days(cells)), None)
    clock = next((i for i, cells in enumerate(columns.cells) if _are_clocks(cells)), None)
    if day is None or clock is None:
        return columns
    last, moments = "", []
    for date, time in zip(columns.cells[day], columns.cells[clock], strict=True):
        last = date or last  # which may stand where it changes alone
        moments.append(_at_clock(last if time else date, time))
    return columns.joined((day, clock), moments)


def _join_date_parts(columns: Columns) -> Columns:
    """The same columns, with those of years, days, hours, or dates and times in figures, as one.

    A date is that of a year with month and day, or with the day of the year; a time of day is of
    hours, minutes and seconds, or of figures such as 1015 and 101500.
    """
    at = _places_of_parts(columns)
    of_day = next((parts for parts in _DAYS if at.keys() >= set(parts)), ())
    of_clock = [part for part in _CLOCK if part in at and "hour" in at]
    of_clock = ["clock"] if "clock" in at else of_clock
    if not of_day or not of_clock:
        return columns
    parts = [at[part] for part in (*of_day, *of_clock)]
    rows = list(zip(*(columns.cells[i] for i in parts), strict=True))
    dates = [row[0] for row in rows if row[0]] if "date" in of_day else []
    if not all(map(_DATE_IN_FIGURES.fullmatch, dates)):
        return columns
    days = [_day_in_figures(of_day, row[: len(of_day)]) for row in rows]
    clocks = _clocks_in_figures([row[len(of_day) :] for row in rows], split="hour" in of_clock)
    moments = [f"{day}T{clock}" if day else "" for day, clock in zip(days, clocks, strict=True)]
    return columns.joined(parts, moments) if mostly(moments, is_stamp) else columns


def _places_of_parts(columns: Columns) -> dict[str, int]:
    """Columns of figures that hold parts of a date, by part."""
    at: dict[str, int] = {}
    for i, ((name, _), cells) in enumerate(zip(columns.labels, columns.cells, strict=True)):
        part = PARTS_OF_TIME.get(name.casefold())
        part = "minute" if name == "mm" and "hour" in at else part  # MM DD hh mm
        if part and part not in at and all(_FIGURES.fullmatch(cell) for cell in cells if cell):
            at[part] = i
    return at


def _day_in_figures(parts: Sequence[str], row: Sequence[str]) -> str:
    """A date as 20240305; empty where a part of it is."""
    if not all(row):
        return ""
    if "yday" in parts:
        year, number = (int(float(cell)) for cell in row)
        return f"{datetime(year, 1, 1) + timedelta(number - 1):%Y%m%d}"
    return "".join((row[0], *(f"{cell:0>2}" for cell in row[1:])))


def _clocks_in_figures(rows: Sequence[Sequence[str]], *, split: bool) -> list[str]:
    """Times of day as 101500, of those whose hours are split from minutes and seconds, or not."""
    if split:
        return ["".join(map(_two_figures, row)).ljust(6, "0") for row in rows]
    width = 4 if max(len(cell) for (cell,) in rows) <= 4 else 6
    return [f"{cell:0>{width}}{'00' * (width == 4)}" for (cell,) in rows]


def _two_figures(cell: str) -> str:
    """Hours, minutes or seconds with two figures before their decimals."""
    whole, mark, decimals = cell.replace(",", ".").partition(".")
    return f"{whole:0>2}{mark}{decimals}" if decimals.strip("0") else f"{whole:0>2}"


def _join_fractions(columns: Columns) -> Columns:
    """The same columns, with times of whole seconds or minutes and what is left of them as one.

    The times are time stamps, or seconds of a counter whose name differs by `sec` for `nsec` alone.
    Seconds may stand beside stamps of whole minutes.
    """
    stamps = [i for i, cells in enumerate(columns.cells) if mostly(cells, is_stamp)]
    whole = len(stamps) == 1 and not has_fraction(columns.cells[stamps[0]])
    stamp = stamps[0] if whole else None
    for i in range(len(columns.cells)):
        joined = _with_seconds(columns, stamp, i) or _with_fraction(columns, stamp, i)
        if joined is not None:
            return joined
    return columns


def _with_seconds(columns: Columns, stamp: int | None, i: int) -> Columns | None:
    """The same columns, with seconds behind stamps of whole minutes; None: they are not such."""
    if stamp is None or PARTS_OF_TIME.get(columns.labels[i][0].casefold()) != "second":
        return None
    moments = []
    for moment, part in zip(columns.cells[stamp], columns.cells[i], strict=True):
        match = _WHOLE_MINUTES.fullmatch(moment)
        if match is None or not _FIGURES.fullmatch(part) or float(part.replace(",", ".")) >= 60.0:
            return None
        moments.append(f"{match['whole']}:{_two_figures(part)}{match['half']}")
    return columns.joined((stamp, i), moments)


def _with_fraction(columns: Columns, stamp: int | None, i: int) -> Columns | None:
    """The same columns, with parts of a second behind whole ones; None: they are not such."""
    name, unit = columns.labels[i]
    begin, last = _LAST_WORD.findall(name.casefold().strip("[]()"))[0]
    if f"{begin}{last}" in ("time", "zeit"):  # Time [ms]
        last = unit.casefold()
    begin = "" if begin.strip(" _") in ("time", "zeit") else begin
    digits = PARTS_OF_SECOND.get(last)
    if digits is None or (unit and PARTS_OF_SECOND.get(unit.casefold(), 0) != digits):
        return None
    stamps = columns.cells[stamp] if stamp is not None else []
    if not digits and not unit and not any(a == b for a, b in pairwise(stamps)):
        return None  # a fraction of something else: stamps tell samples apart without it
    counter = [f"{begin}{word}" for word in ("sec", "secs", "seconds", "s")]
    names = [label[0].casefold() for label in columns.labels]
    at = next((k for k, name in enumerate(names) if name in counter), i)
    at = stamp if stamp is not None and not begin else at
    moments = _with_decimals(columns.cells[at], columns.cells[i], digits) if at != i else None
    if moments is None:
        return None
    counted = not mostly(columns.cells[at], is_stamp)
    label = (f"time {columns.labels[at][0]} {name}", "s") if counted else None
    return columns.joined((at, i), moments, label)


def _with_decimals(moments: list[str], parts: list[str], digits: int) -> list[str] | None:
    """Times with their parts of a second behind them; None where they are not such."""
    joined = []
    for moment, part in zip(moments, parts, strict=True):
        if not moment or not part:
            joined.append("")
            continue
        match = _WHOLE_SECONDS.fullmatch(moment)
        seconds = float(part.replace(",", ".")) * 0.1**digits if _FIGURES.fullmatch(part) else 1.0
        if match is None or not 0.0 <= seconds < 1.0:
            return None
        joined.append(f"{match['whole']}.{round(seconds * 1e9):09d}{match['half']}")
    return joined
