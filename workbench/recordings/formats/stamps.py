"""Dates and times of day as recorders write them, to seconds.

A date such as 24/03/01 has several readings. The one with which times go on evenly is taken; where
two do and differ, the column is in doubt, and its times are asked for. Local time goes on through
both changes of the clock.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import numpy as np

from workbench.arrays import Vector
from workbench.recordings.formats.contents import FileChannel

_CLOCK = (
    r"(?P<h>\d{1,2}):(?P<m>\d\d)(:(?P<s>\d\d)((?P<dot>[.,:])(?P<f>\d{1,12}))?)?"
    r"(\s*(?P<half>[AaPp])\.?[Mm]\.?)?"
)
_ZONE = r"\s*(?P<zone>(UTC|GMT)?[+-]\d\d?(:?\d\d)?|[A-Z][A-Za-z]+/[A-Za-z_/]+|[A-Za-z]{3,5}|[zZ])?"
_MONTHS = {  # English and German, by the letters that tell
    **{"jan": 1, "feb": 2, "mar": 3, "mär": 3, "apr": 4, "may": 5, "mai": 5, "jun": 6, "jul": 7},
    **{"aug": 8, "sep": 9, "oct": 10, "okt": 10, "nov": 11, "dec": 12, "dez": 12},
}
_CALLED = rf"(?P<called>{'|'.join(_MONTHS)})[^\W\d]{{0,6}}"
_DAY = re.compile(
    r"((?P<year>\d{4})[-/.](?P<month>\d{1,2})[-/.](?P<day>\d{1,2})"
    rf"|(?P<of>\d{{1,2}})[-/.\s]{{1,2}}{_CALLED}\.?[-/\s](?P<in>\d{{4}}|\d\d)"
    r"|(?P<one>\d{1,2})(?P<mark>[-/.])(?P<two>\d{1,2})[-/.](?P<last>\d{4}|\d\d))"
    rf"([T\s]+{_CLOCK}{_ZONE})?",
    re.IGNORECASE,
)
_CALLED_FIRST = re.compile(  # Mar 5, 2024 10:00; Tue Mar  5 10:00:00 2024
    rf"([A-Za-z]{{3,9}},?\s+)?{_CALLED}\.?\s+(?P<of>\d{{1,2}})(,?\s+(?P<in>\d{{4}})\s+{_CLOCK}{_ZONE}"
    rf"|\s+{_CLOCK.replace('(?P<', '(?P<c')}\s+(?P<cin>\d{{4}}))",
    re.IGNORECASE,
)
_COMPACT = re.compile(  # 20240305T101500.25
    r"(?P<year>(19|20)\d\d)(?P<month>0[1-9]|1[0-2])(?P<day>0[1-9]|[12]\d|3[01])[T_\s-]?"
    rf"(?P<h>[01]\d|2[0-3])(?P<m>[0-5]\d)(?P<s>[0-5]\d)([.,](?P<f>\d{{1,12}}))?{_ZONE}"
)
_OF_DAY = re.compile(_CLOCK + _ZONE)
_OF_HOUR = re.compile(r"(?P<m>\d{1,2}):(?P<s>\d\d)[.,](?P<f>\d{1,12})")  # as spreadsheets save it
_EPOCH = date(1970, 1, 1).toordinal()
_START = datetime(1970, 1, 1)
_HOUR = 3600
ORDERS = {"ymd": "year, month, day", "dmy": "day, month, year", "mdy": "month, day, year"}
# Hours that zones are ahead of UTC, by the letters that recorders write.
_AHEAD = {
    **{"": 0, "Z": 0, "UTC": 0, "GMT": 0, "WET": 0, "WEST": 1, "BST": 1, "CET": 1, "MEZ": 1},
    **{"CEST": 2, "MESZ": 2, "EET": 2, "EEST": 3, "MSK": 3, "JST": 9, "KST": 9, "AWST": 8},
    **{"AEST": 10, "AEDT": 11, "ACST": 9.5, "ACDT": 10.5, "NZST": 12, "NZDT": 13, "HST": -10},
    **{"EST": -5, "EDT": -4, "CST": -6, "CDT": -5, "MST": -7, "MDT": -6, "PST": -8, "PDT": -7},
    **{"AKST": -9, "AKDT": -8},
}
# Zones that change their clocks at local times of their own; others change as one of these.
_CHANGING = (
    *("Europe/Berlin", "Europe/London", "Europe/Athens", "America/New_York"),
    *("Australia/Sydney", "Pacific/Auckland", "America/Santiago"),
)
_EVEN = 3.0  # median steps, above which one step is a jump


def is_stamp(cell: str) -> bool:
    """Whether a cell is a date, a time of day, or both."""
    return _match(cell.strip()) is not None


def _match(text: str) -> re.Match[str] | None:
    patterns = (_DAY, _OF_DAY, _OF_HOUR, _COMPACT, _CALLED_FIRST)
    stamp = next((match for pattern in patterns if (match := pattern.fullmatch(text))), None)
    return stamp if stamp is None or _zone_known(stamp.groupdict().get("zone")) else None


def _zone_known(zone: str | None) -> bool:
    if not zone or zone[-1].isdigit() or zone.upper() in _AHEAD:
        return True
    return "/" in zone and _zone(zone) is not None


def _zone(name: str) -> ZoneInfo | None:
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        return None


def read_stamps(name: str, cells: Sequence[str], how: str = "") -> FileChannel | None:
    """Times of a column, (n,) s from its first one; NaN where a cell is none.

    Where days can be read in two ways that differ, the channel has a doubt. Times of day go on
    after midnight.

    Parameters
    ----------
    how : what the user says of them: DMY, MDY or YMD, or a format such as %d/%m/%y %H:%M; and a
        zone such as Europe/Berlin. Empty: nothing.
    """
    texts = [cell.strip() for cell in cells]
    order, stated, zone = _said(how)
    if stated:
        return _formatted(name, texts, stated, zone)
    first = next((match for text in texts if (match := _match(text))), None)
    if first is None:
        return None
    if first.re in (_OF_DAY, _OF_HOUR):
        return _of_day(name, texts, first.re)
    return _dated(name, texts, first.re, order, zone)


def is_said(how: str) -> bool:
    """Whether a text says how dates are to be read.

    >>> is_said("DMY Europe/Berlin"), is_said("%H:%M"), is_said("ms")
    (True, True, False)
    """
    order, stated, zone = _said(how)
    return bool(order or stated or zone)


def _said(how: str) -> tuple[str, str, ZoneInfo | None]:
    """Order of dates, their format, and their zone, of what a user says."""
    words = how.split()
    named = [word for word in words if word in ("UTC", "GMT") or ("/" in word and "%" not in word)]
    zone = next((known for word in named if (known := _zone(word)) is not None), None)
    words = [word for word in words if zone is None or word not in named]
    text = " ".join(words)
    letters = "".join(dict.fromkeys(re.sub(r"[^a-z]", "", text.casefold().split(" ")[0])))
    return (letters if letters in ORDERS else ""), (text if "%" in text else ""), zone


def has_day(cells: Sequence[str]) -> bool:
    """Whether a column holds dates, with or without a time of day."""
    return _first_day(cells) is not None


def has_day_alone(cells: Sequence[str]) -> bool:
    """Whether a column holds dates without a time of day."""
    first = _first_day(cells)
    return first is not None and first.re is _DAY and first["h"] is None


def has_fraction(cells: Sequence[str]) -> bool:
    """Whether times of a column have parts of a second."""
    matches = (_match(cell.strip()) for cell in cells)
    return any(match is not None and match.groupdict().get("f") for match in matches)


def _first_day(cells: Sequence[str]) -> re.Match[str] | None:
    matches = (_match(cell.strip()) for cell in cells)
    first = next((match for match in matches if match), None)
    return None if first is None or first.re in (_OF_DAY, _OF_HOUR) else first


def _of_day(name: str, texts: Sequence[str], pattern: re.Pattern[str]) -> FileChannel:
    """Times without dates."""
    period = _HOUR if pattern is _OF_HOUR else 24 * _HOUR
    matches = [pattern.fullmatch(text) for text in texts]
    known = np.array([match is not None for match in matches])
    whole = np.array([_clock(match) if match else 0 for match in matches])
    times = whole + _fractions(matches) - np.array([_offset(match) for match in matches])
    # A step back by more than half a period is the next day, or the next hour.
    back = np.diff(times[known]) < -period / 2
    times[known] += np.concatenate([[0], np.cumsum(back)]) * period
    corrections: tuple[str, ...] = ()
    if pattern is _OF_DAY and not any(match and match["zone"] for match in matches):
        times[known], corrections = _mended(times[known], dated=False)
    shown = float(times[known][0])
    values = _from_first(times, known)
    return FileChannel(
        name, "s", values, stamp=True, shown=shown, corrections=corrections, texts=tuple(texts)
    )


def _formatted(
    name: str, texts: Sequence[str], stated: str, zone: ZoneInfo | None
) -> FileChannel | None:
    """Times in a format that the user states."""
    moments: list[datetime | None] = []
    for text in texts:
        try:
            moments.append(datetime.strptime(text, stated))
        except ValueError:
            moments.append(None)
    known = np.array([moment is not None for moment in moments])
    if known.sum() < 2:
        return None
    offset = [m.utcoffset() if m else None for m in moments]
    plain = [m.replace(tzinfo=None) if m else _START for m in moments]
    whole = np.array([(m.replace(microsecond=0) - _START) // timedelta(seconds=1) for m in plain])
    shift = np.array([o.total_seconds() if o else 0.0 for o in offset])
    parts = np.array([m.microsecond * 1e-6 for m in plain])
    return _channel(name, texts, known, (whole, parts, shift), zone, zoned=any(offset))


def _dated(
    name: str, texts: Sequence[str], pattern: re.Pattern[str], order: str, zone: ZoneInfo | None
) -> FileChannel | None:
    matches = [pattern.fullmatch(text) for text in texts]
    known = np.array([match is not None for match in matches])
    parts = _fractions(matches)
    shift = np.array([_offset(match) for match in matches])
    zones = {match["zone"] for match in matches if match and match["zone"]}
    if len(zones) == 1 and "/" in (own := zones.pop()):
        zone = _zone(own)
    readings: dict[str, FileChannel] = {}
    for reading in _readings(matches) if not order else [order]:
        try:
            days = _days(matches, reading)
        except ValueError:  # a 31st of February
            continue
        whole = days + np.array([_clock(match) if match else 0 for match in matches])
        zoned = bool(zones) or any(match and match.groupdict().get("zone") for match in matches)
        channel = _channel(name, texts, known, (whole, parts, shift), zone, zoned=zoned)
        readings[reading] = channel
    return _chosen(name, texts, readings, matches)


def _channel(
    name: str,
    texts: Sequence[str],
    known: np.ndarray,
    moment: tuple[np.ndarray, Vector, Vector],
    zone: ZoneInfo | None,
    *,
    zoned: bool,
) -> FileChannel:
    """A channel of local seconds, their fractions, and seconds that they are ahead of UTC."""
    whole, parts, shift = moment
    corrections: tuple[str, ...] = ()
    local = whole.astype(np.float64)
    if zone is not None and not shift.any():
        local[known] -= _ahead(local[known] + parts[known], zone)
        zoned = True
    elif zoned:
        local -= shift
    else:
        mended, corrections = _mended(local[known] + parts[known], dated=True)
        local[known] = np.round(mended - parts[known])
    begin = local[known][0]
    start = float(begin + parts[known][0])
    values = _from_first(local - begin + parts, known)
    return FileChannel(
        name,
        "s",
        values,
        start=start,
        stamp=True,
        shown=start,
        corrections=corrections,
        zoned=zoned,
        texts=tuple(texts),
    )


def _readings(matches: Sequence[re.Match[str] | None]) -> list[str]:
    """Orders in which days may be written, the usual one for their marks first."""
    kinds = {
        (match["mark"], len(match["last"]))
        for match in matches
        if match and match.groupdict().get("one")
    }
    if not kinds:
        return ["ymd"]
    years = {digits for _, digits in kinds}
    if {mark for mark, _ in kinds} == {"."}:
        return ["dmy"] if years == {4} else ["dmy", "ymd"]
    return ["dmy", "mdy"] if years == {4} else ["dmy", "mdy", "ymd"]


def _chosen(
    name: str,
    texts: Sequence[str],
    readings: dict[str, FileChannel],
    matches: Sequence[re.Match[str] | None],
) -> FileChannel | None:
    """The reading with which times go on evenly; a doubt where several do and differ."""
    going = {order: channel for order, channel in readings.items() if _goes_on(channel.values)}
    left = going or readings
    even = {order: channel for order, channel in left.items() if _is_even(channel.values)}
    # Nobody records on one day of each year, where another reading has days that follow.
    near = {k: c for k, c in left.items() if _longest(c.values) <= 31 * 24 * _HOUR}
    far = {k: c for k, c in left.items() if _longest(c.values) > 300 * 24 * _HOUR}
    left = even or (near if near and len(near) + len(far) == len(left) else left)
    if not left:
        return None
    order, channel = next(iter(left.items()))
    others = [other for key, other in left.items() if key != order]
    if not others:
        return channel
    if all(np.array_equal(channel.values, other.values, equal_nan=True) for other in others):
        # The day is not known, the times are; points are German, the day first.
        points = all(match is None or match["mark"] == "." for match in matches)
        sure = points and _moment(channel.start).year >= 2010
        return channel if sure else replace(channel, start=math.nan)
    words = [
        f"{_moment(c.start):%Y-%m-%d} to {_moment(c.start + np.nanmax(c.values)):%Y-%m-%d} "
        f"({key.upper()}: {ORDERS[key]})"
        for key, c in left.items()
    ]
    first = next(text for text, match in zip(texts, matches, strict=True) if match)
    doubt = f"dates such as '{first}' that go on in two ways, {' or '.join(words)}"
    none = np.full(len(texts), math.nan)
    return FileChannel(name, "s", none, stamp=True, doubt=doubt, texts=tuple(texts))


def _moment(seconds: float) -> datetime:
    return _START + timedelta(seconds=seconds)


def _goes_on(times: Vector) -> bool:
    steps = np.diff(times[np.isfinite(times)])
    return bool((steps >= 0.0).all())


def _longest(times: Vector) -> float:
    steps = np.diff(times[np.isfinite(times)])
    return float(steps.max()) if steps.size else 0.0


def _is_even(times: Vector) -> bool:
    steps = np.diff(times[np.isfinite(times)])
    ahead = steps[steps > 0.0]
    return not ahead.size or bool(ahead.max() <= _EVEN * np.median(ahead))


def _ahead(local: Vector, zone: ZoneInfo) -> Vector:
    """Seconds that local times are ahead of UTC; an hour that comes twice goes on from its end."""
    quarters, where = np.unique(np.floor(local / 900.0), return_inverse=True)
    begins = [_START + timedelta(seconds=float(quarter) * 900.0) for quarter in quarters]
    early, late = (
        np.array([_utc_offset(moment, zone, fold) for moment in begins])[where] for fold in (0, 1)
    )
    twice = early > late
    second = np.zeros(local.size, dtype=bool)
    for k in np.flatnonzero(twice):
        again = k > 0 and local[k] <= local[k - 1]
        second[k] = again or (k > 0 and twice[k - 1] and second[k - 1])
    return np.where(second, late, early)


def _utc_offset(moment: datetime, zone: ZoneInfo, fold: int) -> float:
    offset = moment.replace(tzinfo=zone, fold=fold).utcoffset()
    return offset.total_seconds() if offset is not None else 0.0


def _mended(times: Vector, *, dated: bool) -> tuple[Vector, tuple[str, ...]]:
    """Local times that go on through changes of the clock, and what was changed, in words.

    A step back by an hour is the end of summer time; a step that is an hour too long is its begin
    where some zone changes its clock just there.
    """
    steps = np.diff(times)
    ahead = steps[steps > 0.0]
    usual = float(np.median(ahead)) if ahead.size else 0.0
    if not 0.0 < usual <= _HOUR:
        return times, ()
    twice = steps + _HOUR
    back = np.flatnonzero((steps <= 0.0) & (twice > 0.0) & (twice <= _EVEN * usual))
    long = np.flatnonzero(np.abs(steps - _HOUR - usual) <= 0.1 * usual)
    if dated:
        back = back[[_changes(times[k], times[k + 1], -_HOUR) for k in back]] if back.size else back
        long = long[[_changes(times[k], times[k + 1], _HOUR) for k in long]] if long.size else long
    else:
        of_day = times % (24 * _HOUR)
        back = back[(of_day[back] <= 4 * _HOUR) & (of_day[back] >= _HOUR)][:1]
        back, long = back[np.abs(twice[back] - usual) <= 0.1 * usual], long[:0]
    if not back.size and not long.size:
        return times, ()
    shift = np.zeros(times.size)
    shift[back + 1] += _HOUR
    shift[long + 1] -= _HOUR
    words = []
    for k in sorted([*back.tolist(), *long.tolist()]):
        at = f"{_moment(times[k]):%Y-%m-%d %H:%M:%S}" if dated else f"{_moment(times[k]):%H:%M:%S}"
        if k in back:
            words.append(f"the hour after {at} comes twice: summer time ends, later times go on")
        else:
            words.append(f"the hour after {at} is missing: summer time begins, no gap is left")
    return times + np.cumsum(shift), tuple(words)


def _changes(before: float, after: float, by: int) -> bool:
    """Whether some zone sets its clock ahead [s] between two local times."""
    for name in _CHANGING:
        zone = _zone(name)
        if zone is None:
            continue
        folds = (0, 1) if by < 0 else (0, 0)
        offsets = [
            _utc_offset(_moment(seconds), zone, fold)
            for seconds, fold in zip((before, after), folds, strict=True)
        ]
        if offsets[1] - offsets[0] == by:
            return True
    return False


def _days(matches: Sequence[re.Match[str] | None], order: str) -> np.ndarray:
    """Seconds since 1970 at the begin of each day, (n,)."""
    known: dict[tuple[str, ...], int] = {}
    days = np.zeros(len(matches), dtype=np.int64)
    for i, match in enumerate(matches):
        if match is None:
            continue
        own = match.groupdict()
        names = ("year", "month", "day", "of", "called", "in", "one", "two", "last", "cin")
        key = tuple(own.get(name) or "" for name in names)
        if key not in known:
            known[key] = (_day(key, order).toordinal() - _EPOCH) * 24 * _HOUR
        days[i] = known[key]
    return days


def _day(parts: tuple[str, ...], order: str) -> date:
    year, month, day, of, called, in_year, *numbers, of_year = parts
    if called:
        return date(_full(in_year or of_year), _MONTHS[called.casefold()], int(of))
    if year:
        return date(int(year), int(month), int(day))
    named = dict(zip(order, numbers, strict=True))
    if len(named["y"]) > 2 and order == "ymd":
        raise ValueError("a year of four digits at the end")
    return date(_full(named["y"]), int(named["m"]), int(named["d"]))


def _full(year: str) -> int:
    return int(year) + (2000 if len(year) <= 2 else 0)


def _offset(match: re.Match[str] | None) -> float:
    """Seconds that a cell says that it is ahead of UTC."""
    zone = (match.groupdict().get("zone") or "") if match else ""
    if not zone or "/" in zone:
        return 0.0
    if not zone[-1].isdigit():
        return _AHEAD[zone.upper()] * _HOUR if zone.upper() in _AHEAD else math.nan
    sign, digits = re.sub(r"^(UTC|GMT)", "", zone, flags=re.IGNORECASE)[0], re.sub(r"\D", "", zone)
    hours, minutes = (digits[:-2], digits[-2:]) if len(digits) > 2 else (digits, "0")
    return int(f"{sign}1") * (int(hours) * _HOUR + int(minutes) * 60.0)


def _clock(match: re.Match[str]) -> int:
    """Whole seconds of the day, or of the hour."""
    parts = match.groupdict()
    c = "c" if parts.get("ch") else ""
    hour = int(parts.get(f"{c}h") or 0)
    if half := parts.get(f"{c}half"):
        hour = hour % 12 + (12 if half in "Pp" else 0)
    return hour * _HOUR + int(parts.get(f"{c}m") or 0) * 60 + int(parts.get(f"{c}s") or 0)


def _fractions(matches: Sequence[re.Match[str] | None]) -> Vector:
    """Parts of a second, (n,); behind a colon they count milliseconds where digits differ."""
    digits = [(match.groupdict() if match else {}) for match in matches]
    held = [own for own in digits if own.get("f")]
    if not held:
        return np.zeros(len(matches))
    colons = all(own.get("dot") == ":" for own in held)
    widths = {len(own["f"] or "") for own in held}
    if colons and max(widths) <= 3 < 3 * len(widths):
        return np.array([int(own["f"]) * 1e-3 if own.get("f") else 0.0 for own in digits])
    return np.array([float(f"0.{own['f']}") if own.get("f") else 0.0 for own in digits])


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
