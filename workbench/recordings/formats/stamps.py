"""Dates and times of day as recorders write them, to seconds."""

import math
import re
from collections.abc import Sequence
from datetime import UTC, date, datetime, timedelta

import numpy as np

from workbench.arrays import Vector
from workbench.recordings.formats.contents import FileChannel

_CLOCK = (
    r"(?P<h>\d{1,2}):(?P<m>\d\d)(:(?P<s>\d\d)([.,:](?P<f>\d{1,12}))?)?(\s*(?P<half>[AaPp])[Mm])?"
)
_ZONE = r"\s*(?P<zone>Z|z|UTC|GMT|[+-]\d\d(:?\d\d)?)?"
_MONTHS = {  # English and German, by the letters that tell
    **{"jan": 1, "feb": 2, "mar": 3, "mär": 3, "apr": 4, "may": 5, "mai": 5, "jun": 6, "jul": 7},
    **{"aug": 8, "sep": 9, "oct": 10, "okt": 10, "nov": 11, "dec": 12, "dez": 12},
}
_DAY = re.compile(
    r"((?P<year>\d{4})[-/.](?P<month>\d{1,2})[-/.](?P<day>\d{1,2})"
    rf"|(?P<of>\d{{1,2}})[-/.\s]{{1,2}}(?P<called>{'|'.join(_MONTHS)})[^\W\d]{{0,6}}\.?[-/\s]"
    r"(?P<in>\d{4})"
    r"|(?P<one>\d{1,2})(?P<mark>[-/.])(?P<two>\d{1,2})[-/.](?P<last>\d{4}|\d\d))"
    rf"([T\s]+{_CLOCK}{_ZONE})?",
    re.IGNORECASE,
)
_OF_DAY = re.compile(_CLOCK + _ZONE)
_OF_HOUR = re.compile(r"(?P<m>\d{1,2}):(?P<s>\d\d)[.,](?P<f>\d{1,12})")  # as spreadsheets save it
_EPOCH = date(1970, 1, 1).toordinal()


def is_stamp(cell: str) -> bool:
    """Whether a cell is a date, a time of day, or both."""
    text = cell.strip()
    return any(pattern.fullmatch(text) for pattern in (_DAY, _OF_DAY, _OF_HOUR))


def read_stamps(name: str, cells: Sequence[str]) -> FileChannel | None:
    """Times of a column, (n,) s from its first one; NaN where a cell is none.

    Days that could be read in two ways are refused (None) where a column has several of them. Times
    of day go on after midnight.
    """
    texts = [cell.strip() for cell in cells]
    first = next((text for text in texts if is_stamp(text)), None)
    if first is None:
        return None
    if _DAY.fullmatch(first):
        return _dated(name, texts)
    pattern, period = (_OF_HOUR, 3600) if _OF_HOUR.fullmatch(first) else (_OF_DAY, 86400)
    matches = [pattern.fullmatch(text) for text in texts]
    whole = np.array([_clock(match) if match else -1 for match in matches])
    known = whole >= 0
    times = np.where(known, whole, 0) + _fractions(matches)
    # A step back by more than half a period is the next day, or the next hour.
    back = np.diff(times[known]) < -period / 2
    times[known] += np.concatenate([[0], np.cumsum(back)]) * period
    shown = float(times[known][0])
    return FileChannel(name, "s", _from_first(times, known), stamp=True, shown=shown)


def has_day(cells: Sequence[str]) -> bool:
    """Whether a column holds dates, with or without a time of day."""
    return _first_day(cells) is not None


def has_day_alone(cells: Sequence[str]) -> bool:
    """Whether a column holds dates without a time of day."""
    first = _first_day(cells)
    return first is not None and first["h"] is None


def _first_day(cells: Sequence[str]) -> re.Match[str] | None:
    return next((match for cell in cells if (match := _DAY.fullmatch(cell.strip()))), None)


def _dated(name: str, texts: Sequence[str]) -> FileChannel | None:
    matches = [_DAY.fullmatch(text) for text in texts]
    order = _day_first(matches)
    if order is None:
        return None
    try:
        whole = np.array([_since_epoch(m, order) if m else 0 for m in matches], dtype=np.int64)
    except ValueError:  # a 31st of February
        return None
    known = np.array([match is not None for match in matches])
    begin = int(whole[known][0])
    fractions = _fractions(matches)
    times = (whole - begin) + fractions
    surely = matches[int(known.argmax())]["mark"] != "/"  # type: ignore[index]
    shown = begin + float(fractions[known][0])
    start = shown if surely else math.nan
    values = _from_first(times, known)
    return FileChannel(name, "s", values, start=start, stamp=True, shown=shown)


def _day_first(matches: Sequence[re.Match[str] | None]) -> bool | None:
    """Whether the day stands before the month; None if that cannot be told and matters."""
    two = {(m["one"], m["two"], m["mark"]) for m in matches if m and m["one"]}
    if not two or all(mark == "." for *_, mark in two):
        return True
    if any(int(one) > 12 for one, *_ in two):
        return True
    if any(int(second) > 12 for _, second, _ in two):
        return False
    return True if len(two) == 1 else None


def _since_epoch(match: re.Match[str], day_first: bool) -> int:
    """Whole seconds since 1970."""
    if match["called"]:
        day = date(int(match["in"]), _MONTHS[match["called"].casefold()], int(match["of"]))
    elif match["year"]:
        day = date(int(match["year"]), int(match["month"]), int(match["day"]))
    else:
        one, two, year = int(match["one"]), int(match["two"]), int(match["last"])
        year += 2000 if year < 100 else 0
        day = date(year, two, one) if day_first else date(year, one, two)
    zone = match["zone"] or ""
    shift = 0
    if zone[:1] in ("+", "-"):
        digits = zone[1:].replace(":", "").ljust(4, "0")
        shift = int(zone[0] + "1") * (int(digits[:2]) * 3600 + int(digits[2:]) * 60)
    return (day.toordinal() - _EPOCH) * 86400 + (_clock(match) if match["h"] else 0) - shift


def _clock(match: re.Match[str]) -> int:
    """Whole seconds of the day, or of the hour."""
    parts = match.groupdict()
    hour = int(parts.get("h") or 0)
    if half := parts.get("half"):
        hour = hour % 12 + (12 if half in "Pp" else 0)
    return hour * 3600 + int(parts["m"]) * 60 + int(parts["s"] or 0)


def _fractions(matches: Sequence[re.Match[str] | None]) -> Vector:
    return np.array([float(f"0.{m['f']}") if m and m["f"] else 0.0 for m in matches])


def _from_first(times: Vector, known: np.ndarray) -> Vector:
    return np.where(known, times - times[known][0], np.nan)


def iso(seconds: float) -> str:
    """A time since 1970 as people and programs read it; empty where it is not known."""
    if not math.isfinite(seconds):
        return ""
    try:
        moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=seconds)
    except OverflowError:  # no calendar goes as far
        return ""
    return moment.replace(tzinfo=None).isoformat(timespec="microseconds")
