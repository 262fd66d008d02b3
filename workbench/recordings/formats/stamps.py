"""Dates and times of day as recorders write them, to seconds.

A date such as 24/03/01 has several readings. The one with which times go on evenly is taken; where
two do and differ, the column is in doubt, and its times are asked for. Local time goes on through
both changes of the clock.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta, timezone, tzinfo
from itertools import pairwise
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import numpy as np

from workbench.arrays import Vector
from workbench.recordings.formats.contents import FileChannel

_HALF = r"(?P<half>[AaPp])(\.?\s?[Mm]\.?)?"
_PARTS_OF_DAY = r"(?P<h>\d{1,2}):(?P<m>\d\d)(:(?P<s>\d\d)((?P<dot>[.,:;])(?P<f>\d{1,24}))?)?"
_CLOCK = rf"{_PARTS_OF_DAY}(\s*{_HALF})?"
# Behind a date, hours and minutes may be parted by other signs, and stand alone with AM or PM.
_CLOCK_OF_DATE = (
    rf"({_HALF.replace('half', 'early')}\s+)?"
    + r"(?P<h>\d{1,2})([:.h-](?P<m>\d\d)([:.-](?P<s>\d\d)((?P<dot>[.,:;])(?P<f>\d{1,24}))?)?"
    rf"(\s*{_HALF})?|\s*{_HALF.replace('half', 'late')})"
)
_ZONE = (
    r"(\s*(Uhr|h)\b)?"
    r"\s*(?P<zone>(UTC|GMT)?[+-]\d\d?(:?\d\d)?|[A-Z][A-Za-z]+/[A-Za-z_/]+|[A-Za-z]{2,5}|[zZ])?"
    r"(\[[A-Za-z_/+-]+\])?"
)
_MONTHS = {  # by the letters that tell, in the languages of Europe; jan, feb, ...
    begin: number
    for number, begins in enumerate(
        (
            "jan ene gen ian sty led jaan tammi oca sij янв яну",
            "feb fév fev lut úno veebr helmi şub velj фев",
            "mar mär mrt maa bře márc ožu мар",
            "apr avr abr kwi dub ápr huhti nis tra апр",
            "may mai mag mei maj maí máj kvě touko svi май мая",
            "jun juin giu cze jún čvn červen červn iun juun kesä haz lipan lipnja meith июн юни",
            "jul juil lug lipi lipc lip júl čvc červenec červenc iul juul heinä tem srpan srpnja"
            " июл юли",
            "aug aoû aou ago avg sie srp elo ağu kolo авг",
            "sep set wrz zář szept syys eyl ruj сен",
            "oct okt ott out paź říj loka eki окт",
            "nov noi lis marras kas stu ноя ное",
            "dec dez déc dic des gru pro joulu ara дек",
        ),
        1,
    )
    for begin in begins.split()
}
# Months that are others in Zagreb: 11 and 10, 7 and 6, 8 and 7.
_MONTHS_OF_TWO = re.compile("lis(topada?)?|lip|srp", re.IGNORECASE)
_YEARS = 1900, 2200  # of recordings; 1404 is one of Tehran, 2569 of Bangkok
_CALLED = rf"(?P<called>{'|'.join(sorted(_MONTHS, key=len, reverse=True))})[^\W\d]{{0,9}}"
_WEEKDAYS = (
    r"(mo|di|mi|do|fr|sa|so|ma|wo|vr|za|zo|pn|wt|śr|cz|pt|nd|po|út|st|čt|pá|ne|pe|la|su)\b"
    "|mon|tue|wed|thu|fri|sat|sun|diens|mitt|don|frei|sams|sonn|lun|mar|mer|mié|jue|jeu|gio|ven|vie"
    "|sam|sab|sáb|dim|dom|maa|din|woe|zat|zon|vri|mån|man|tis|tir|ons|tor|lör|lør|sön|søn|pon|wto"
    "|śro|czw|pią|sob|nie|seg|ter|qua|qui|sex"
)
_WEEKDAY = rf"((?:{_WEEKDAYS})[^\W\d]{{0,9}}\.?,?\s+)?"
_DAY = re.compile(
    rf"{_WEEKDAY}((?P<year>\d{{4}})(?P<by>[-/.:_\s])(?P<month>\d{{1,2}})(?P=by)(?P<day>\d{{1,2}})"
    # Behind a point, three figures alone are decimals: 1013.250.
    r"|(?P<ordinal_year>(?:19|20)\d\d)(?:[-/]|\.(?=\d{3}\D))(?P<ordinal>[0-3]\d\d)"
    rf"|(?P<of>\d{{1,2}})[-/.\s]{{1,2}}{_CALLED}\.?[-/\s](?P<in>\d{{4}}|\d\d)"
    r"|(?P<one>\d{1,2})(?P<mark>[-/.])(?P<two>\d{1,2})[-/.](?P<last>\d{4}|\d\d))"
    rf"(([T,;_\s-]+|:){_CLOCK_OF_DATE}{_ZONE})?",
    re.IGNORECASE,
)
_CALLED_FIRST = re.compile(  # Mar 5, 2024 10:00; Tue Mar  5 10:00:00 2024
    rf"([A-Za-z]{{3,9}},?\s+)?{_CALLED}\.?\s+(?P<of>\d{{1,2}})(,?\s+(?P<in>\d{{4}}),?\s+{_CLOCK}"
    rf"|\s+{_CLOCK.replace('(?P<', '(?P<c')}\s+(?P<cin>\d{{4}})){_ZONE}",
    re.IGNORECASE,
)
_COMPACT = re.compile(  # 20240305T101500.25
    r"(?P<year>(19|20)\d\d)(?P<month>0[1-9]|1[0-2])(?P<day>0[1-9]|[12]\d|3[01])[T_\s-]?"
    rf"(?P<h>[01]\d|2[0-3]|24(?=0000))(?P<m>[0-5]\d)(?P<s>[0-5]\d)((?:[.,]|(?=\d{{3}}(?!\d)))(?P<f>\d{{1,12}}))?{_ZONE}"
)
_COMPACT_SHORT = re.compile(  # 240305 101500
    r"(?P<one>\d\d)(?P<mark>)(?P<two>\d\d)(?P<last>\d\d)[T_\s-]"
    r"(?P<h>[01]\d|2[0-3])(?P<m>[0-5]\d)(?P<s>[0-5]\d)([.,](?P<f>\d{1,24}))?"
)
# Durations of days go on with d, days or a point: 1d 10:00:00, 1 days 10:00:00, 1.10:00:00.
_BEFORE = r"(?P<sign>-(?=\d+:\d\d[:.,]\d))?"  # a trigger; -05:00 is an offset of UTC
_OF_DAY = re.compile(
    rf"{_BEFORE}((?P<days>\d+)(\s*d(ays?)?,?\s+|\s+Tage?,?\s+|\.(?=\d\d:)))?{_CLOCK}{_ZONE}"
)
_OF_HOUR = re.compile(
    _BEFORE + r"(?P<m>\d{1,2}):(?P<s>\d\d)[.,](?P<f>\d{1,24})"
)  # as spreadsheets save it
_OF_MINUTES = re.compile(r"(?P<m>\d{1,4}):(?P<s>\d\d)")  # where it is said that they are minutes
_OF_DURATION = (
    r"(?=.*\d)P?((?P<days>\d+)\s*d\s*)?T?((?P<h>\d+)\s*h\s*)?((?P<m>\d+)\s*m(in)?\s*)?"
    r"((?P<s>\d+)([.,](?P<f>\d{1,24}))?\s*s(ec)?)?"
)
_DURATION = re.compile(rf"(?=P|.*\d\s*[hm].*\d){_OF_DURATION}", re.IGNORECASE)  # PT1H15M, 1h 15m 0s
_SHORT_DURATION = re.compile(_OF_DURATION, re.IGNORECASE)  # beside these, 5.2s
# What a sample most often is, and no time is: the shortest without a mark has 14 figures.
_NUMBER = re.compile(r"[+-]?\d{0,13}([.,]\d*)?([eE][+-]?\d+)?")
_OF_CONTROLLERS = re.compile(r"^(DATE_AND_TIME|DT|TIME_OF_DAY|TOD|TIME|T)#", re.IGNORECASE)
_OF_WEEK = re.compile(r"(\d{4})-?W(\d\d)-?(\d)(?!\d)")
_ZONE_WITHIN = re.compile(r"(?<=:\d\d )([A-Z]{3,4}) ((?:19|20)\d\d)$")  # 10:00:00 CEST 2024
# How others write dates, where a word, a bracket or a letter of theirs may tell; and as what they
# are read: zones in brackets, as of JavaScript; "at" in other languages; times before dates, as of
# LabVIEW; dates of China, Japan and Korea.
_MAY_BE_OTHER = re.compile(r"[^\x00-\xff]|[(à]|\b(at|um|kl|de)\b|\d\.\s|^\d\d?:\S+\s+(\S\S\s)?\d")
_CLOCK_ALONE = r"(\d\d?\s*[:时時시]\s*\d\d?\s*[:分분]?(?:\s*\d\d?(?:[.,]\d+)?\s*[秒초]?)?)"
_OTHERS = tuple(
    (re.compile(form, re.IGNORECASE), read)
    for form, read in (
        (r"(?<=[+-]\d{4}) \([^()\d]+\)$", ""),
        (r"\(((?:UTC|GMT)[+-]?[\d:]*)\)$", r"\1"),
        (r"((?<=\d)\s+|^)(?:à|at|um|kl\.?)\s+(?=\d)", " "),
        (r"\sde\s", " "),
        (r"^(\d{1,2}:\d\d\S*(?:\s[AP]M)?)\s+(\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4})$", r"\2 \1"),
        (r"\(?(?:星期|周|週)[一二三四五六日天]\)?|\([月火水木金土日월화수목금토일]\)", " "),
        (rf"(?:上午|午前|오전)\s*{_CLOCK_ALONE}|{_CLOCK_ALONE}\s*(?:上午|午前|오전)", r" \1\2 AM"),
        (rf"(?:下午|午後|오후)\s*{_CLOCK_ALONE}|{_CLOCK_ALONE}\s*(?:下午|午後|오후)", r" \1\2 PM"),
        (r"^(\d{1,2}\.)\s+(\d{1,2}\.)\s+(?=\d{4}\b)", r"\1\2"),  # of Prague and Ljubljana
        (r"^(\d{4})\s*(?:年|년|\.\s)\s*(\d\d?)\s*[月월.]\s*(\d\d?)\s*[日일.]?", r"\1-\2-\3 "),
        (r"(?<=\d{4})\.(?=\s\d)", ""),  # of Zagreb
        (r"\s*[时時시]\s*(?=\d)|(?<=\d)\s*[分분]\s*(?=\d)", ":"),
        (r"(?<=\d)\s*[分분秒초]", ""),
        (r"(?<=:)(\d)(?!\d)", r"0\1"),
    )
)
_TIMES_ALONE = (_OF_DAY, _OF_HOUR, _OF_MINUTES, _DURATION)
_EPOCH = date(1970, 1, 1).toordinal()
_START = datetime(1970, 1, 1)
_HOUR = 3600
_QUARTER = 900
_HALF_HOUR = 1800  # by which Lord Howe Island changes its clocks
ORDERS = {"ymd": "year, month, day", "dmy": "day, month, year", "mdy": "month, day, year"}
_OFFSET_ZONE = re.compile(r"(?:UTC|GMT)([+-])(\d\d?):?(\d\d)?")
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
    *("Australia/Sydney", "Pacific/Auckland", "America/Santiago", "Australia/Lord_Howe"),
    *("Africa/Cairo", "America/Asuncion", "America/Havana", "Asia/Beirut", "Asia/Gaza"),
    *("Asia/Tehran", "Pacific/Chatham", "Africa/Casablanca"),
)
# Letters of several zones: alone they only say that times are local.
_AMBIGUOUS = frozenset(("CST", "IST", "BST", "AST", "SST"))
MINUTES, HOURS = "min:s", "h:min"  # what 10:15 may be
_FRAMES = (24, 25, 30, 50, 60)  # in a second, of films and television (SMPTE ST 12-1)
_EVENER = 0.3  # of the deviation of steps as decimals, below which those as counts are even
_EVEN = 3.0  # median steps, above which one step is a jump


def is_stamp(cell: str) -> bool:
    """Whether a cell is a date, a time of day, or both."""
    text = cell.strip()
    return _NUMBER.fullmatch(text) is None and _match(text) is not None


def _match(text: str) -> re.Match[str] | None:
    text = _spelled(text)
    patterns = (_DAY, _OF_DAY, _OF_HOUR, _COMPACT, _COMPACT_SHORT, _CALLED_FIRST, _DURATION)
    match = next((match for pattern in patterns if (match := pattern.fullmatch(text))), None)
    return match if _zone_known(_part(match, "zone")) else None


def _part(match: re.Match[str] | None, name: str) -> str:
    """A part of a time by its name; empty where it has none, or is none."""
    return match[name] or "" if match and name in match.re.groupindex else ""


def _spelled(text: str) -> str:
    """A time as others write it: without DT# of controllers, its zone behind its year.

    Days of weeks (2026-W48-7) are as those of months.
    """
    if "W" in text and (match := _OF_WEEK.match(text)):
        try:
            day = date.fromisocalendar(*map(int, match.groups()))
        except ValueError:  # a week 54
            return text
        return f"{day if '-' in match[0] else f'{day:%Y%m%d}'}{text[match.end() :]}"
    text = _OF_CONTROLLERS.sub("", text) if "#" in text else text
    if text[:1].isalnum() and _MAY_BE_OTHER.search(text):
        text = " ".join(text.split())
        for form, read in _OTHERS:
            text = form.sub(read, text)
        text = " ".join(text.split())
    return _ZONE_WITHIN.sub(r"\2 \1", text)


def _zone_known(zone: str) -> bool:
    """Whether letters behind a time may be a zone: those of none that is known are capitals."""
    if not zone or zone[-1].isdigit() or zone.upper() in _AHEAD:
        return True
    return _zone(zone) is not None if "/" in zone else zone.isupper()


def _zone(name: str) -> tzinfo | None:
    try:
        if fixed := _OFFSET_ZONE.fullmatch(name):
            ahead = timedelta(hours=int(fixed[2]), minutes=int(fixed[3] or 0))
            return timezone(ahead if fixed[1] == "+" else -ahead)
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        return None


def read_stamps(name: str, cells: Sequence[str], how: str = "") -> FileChannel | None:
    """Times of a column, (n,) s from its first one; NaN where a cell is none.

    Where days can be read in two ways that differ, the channel has a doubt. Times of day go on
    after midnight.

    Parameters
    ----------
    how : what the user or the header says of them: DMY, MDY or YMD, or a format such as
        %d/%m/%y %H:%M; and a zone such as Europe/Berlin; "min:s" of what is no time of day. Empty:
        nothing.
    """
    texts = [_spelled(cell.strip()) for cell in cells]
    order, stated, zone = _read_statement(how)
    if stated in (MINUTES, HOURS):
        pattern = _OF_MINUTES if stated == MINUTES else _OF_DAY
        return _of_day(name, texts, pattern) if any(map(pattern.fullmatch, texts)) else None
    if stated:
        return _by_format(name, texts, stated, zone)
    first = next((match for text in texts if (match := _match(text))), None)
    if first is None:
        return None
    if first.re in _TIMES_ALONE:
        return _of_day(name, texts, _SHORT_DURATION if first.re is _DURATION else first.re)
    return _by_date(name, texts, first.re, order, zone)


def is_said(how: str) -> bool:
    """Whether a text says how dates are to be read.

    >>> is_said("DMY Europe/Berlin"), is_said("%H:%M"), is_said("min:s"), is_said("ms")
    (True, True, True, False)
    """
    order, stated, zone = _read_statement(how)
    return bool(order or stated or zone)


def _read_statement(how: str) -> tuple[str, str, tzinfo | None]:
    """Order of dates, their format, and their zone, of what a user says."""
    words = how.split()
    named = [w for w in words if w.startswith(("UTC", "GMT")) or ("/" in w and "%" not in w)]
    zone = next((known for word in named if (known := _zone(word)) is not None), None)
    words = [word for word in words if zone is None or word not in named]
    text = " ".join(words)
    letters = "".join(dict.fromkeys(re.sub(r"[^a-z]", "", text.casefold().split(" ")[0])))
    stated = text if "%" in text or text in (MINUTES, HOURS) else ""
    return (letters if letters in ORDERS else ""), stated, zone


def has_day(cells: Sequence[str]) -> bool:
    """Whether a column holds dates, with or without a time of day."""
    first = next((match for cell in cells if (match := _match(cell.strip()))), None)
    return first is not None and first.re not in _TIMES_ALONE


def has_day_alone(cells: Sequence[str]) -> bool:
    """Whether a column holds dates without a time of day, or all at midnight."""
    matches = (match for cell in cells if cell and (match := _match(cell.strip())))
    first = next(matches, None)
    if first is None or first.re is not _DAY or _clock(first):
        return False
    return first["h"] is None or not any(map(_clock, matches))


def has_fraction(cells: Sequence[str]) -> bool:
    """Whether times of a column have parts of a second."""
    return any(_fraction(_match(cell.strip())) for cell in cells)


def _of_day(name: str, texts: Sequence[str], pattern: re.Pattern[str]) -> FileChannel:
    """Times without dates."""
    matches = [pattern.fullmatch(text) for text in texts]
    known = np.array([match is not None for match in matches])
    whole = np.array([_clock(match) for match in matches])
    parts, words, doubt = _counted_frames(matches, whole)
    if doubt:
        return _in_doubt(name, texts, doubt)
    signs = np.array([-1.0 if _part(match, "sign") else 1.0 for match in matches])
    times = signs * (whole + parts) - np.array([_offset(match) for match in matches])
    period = 24 * _HOUR
    if pattern in (_OF_HOUR, _OF_MINUTES):
        period = _HOUR
    elif _twelve_hours(matches):
        period = 12 * _HOUR
        times = times % period
        words = ["hours count to 12, without AM or PM; times go on from 12 to 1"]
    # A step back by more than half a period is the next day, or the next hour.
    back = np.diff(times[known]) < -period / 2
    times[known] += np.concatenate([[0], np.cumsum(back)]) * period
    if pattern is _OF_DAY and not any(_part(match, "zone") for match in matches):
        times[known], mended = _mend_changes(times[known], dated=False)
        words += mended
    shown = float(times[known][0]) if signs.min() > 0.0 else math.nan
    values = _from_first(times, known)
    return FileChannel(
        name, "s", values, stamp=True, shown=shown, corrections=tuple(words), texts=tuple(texts)
    )


def _twelve_hours(matches: Sequence[re.Match[str] | None]) -> bool:
    """Whether hours go from 12 to 1, and none says which half of a day it is of."""
    if any(_part(match, "half") or _part(match, "days") for match in matches):
        return False
    hours = [int(hour) for match in matches if (hour := _part(match, "h"))]
    return set(hours) <= set(range(1, 13)) and (12, 1) in pairwise(hours)


def _by_format(
    name: str, texts: Sequence[str], stated: str, zone: tzinfo | None
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


def _by_date(
    name: str, texts: Sequence[str], pattern: re.Pattern[str], order: str, zone: tzinfo | None
) -> FileChannel | None:
    """Times with dates: read in each order that days may have, of which one is chosen."""
    matches = [pattern.fullmatch(text) for text in texts]
    known = np.array([match is not None for match in matches])
    clocks = np.array([_clock(match) for match in matches])
    parts, notes, doubt = _counted_frames(matches, clocks)
    if doubt:
        return _in_doubt(name, texts, doubt)
    shift, named, zoned = _stated_zone(matches)
    readings: dict[str, FileChannel] = {}
    for reading in [order] if order else _readings(matches):
        try:
            days = _days(matches, reading)
        except ValueError:  # a 31st of February
            continue
        whole, leap = _with_leap_second(matches, days + clocks, parts)
        channel = _channel(name, texts, known, (whole, parts, shift), named or zone, zoned=zoned)
        readings[reading] = replace(channel, corrections=(*notes, *leap, *channel.corrections))
    chosen = _choose_reading(name, texts, readings, matches)
    return chosen and _with_sure_date(chosen, texts[int(np.argmax(known))])


def _stated_zone(matches: Sequence[re.Match[str] | None]) -> tuple[Vector, tzinfo | None, bool]:
    """Seconds ahead of UTC that cells state, (n,), a zone that all name, and whether any does.

    Letters that mean nothing, or several zones, say only that times are local.
    """
    zones = {zone for match in matches if (zone := _part(match, "zone"))}
    one = next(iter(zones)) if len(zones) == 1 else ""
    if one.isalpha() and (one.upper() in _AMBIGUOUS or one.upper() not in _AHEAD):
        return np.zeros(len(matches)), None, False
    shift = np.array([_offset(match) for match in matches])
    return shift, _zone(one) if "/" in one else None, bool(zones)


def _with_sure_date(channel: FileChannel, first: str) -> FileChannel:
    """The channel, without its date where that may be of another language or another calendar."""
    if not math.isfinite(channel.start):
        return channel
    year, why = _moment(channel.start).year, ""
    if any(map(_MONTHS_OF_TWO.fullmatch, re.split(r"[\W\d]+", first))):
        why = "the month is another one in Croatian"
    if not _YEARS[0] <= year <= _YEARS[1]:
        why = f"{year} is a year of another calendar, or of a clock that was not set"
    if not why:
        return channel
    note = f"of '{first}' {why}: the date is not taken"
    return replace(channel, start=math.nan, corrections=(*channel.corrections, note))


def _channel(
    name: str,
    texts: Sequence[str],
    known: np.ndarray,
    moment: tuple[np.ndarray, Vector, Vector],
    zone: tzinfo | None,
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
        mended, corrections = _mend_changes(local[known] + parts[known], dated=True)
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
    numbers = [match for match in matches if match and _part(match, "one")]
    if not numbers:
        return ["ymd"]
    marks = {match["mark"] for match in numbers}
    if marks == {""}:
        return ["ymd", "dmy", "mdy"]
    usual = ["dmy"] if marks == {"."} else ["dmy", "mdy"]
    return usual if all(len(match["last"]) == 4 for match in numbers) else [*usual, "ymd"]


def _choose_reading(
    name: str,
    texts: Sequence[str],
    readings: dict[str, FileChannel],
    matches: Sequence[re.Match[str] | None],
) -> FileChannel | None:
    """The reading with which times go on evenly; a doubt where several do and differ."""
    going = {order: channel for order, channel in readings.items() if goes_on(channel.values)}
    left = _likely_readings(going or readings)
    if not left:
        return None
    channel, *others = left.values()
    if not others and (going or not _twelve_hours(matches)):
        return channel
    alike = (np.array_equal(channel.values, own.values, equal_nan=True) for own in others)
    if going and all(alike):
        # The day is not known, the times are; points are German, the day first, and YYMMDD has no
        # marks.
        marks = {match["mark"] for match in matches if match}
        sure = marks in ({"."}, {""}) and _moment(channel.start).year >= 2010
        return channel if sure else replace(channel, start=math.nan)
    first = next(text for text, match in zip(texts, matches, strict=True) if match)
    words = [
        f"{_moment(c.start):%Y-%m-%d} to {_moment(c.start + np.nanmax(c.values)):%Y-%m-%d} "
        f"({key.upper()}: {ORDERS[key]})"
        for key, c in left.items()
    ]
    doubt = f"dates such as '{first}' that go on in two ways, {' or '.join(words)}"
    if _twelve_hours(matches):
        doubt = f"times such as '{first}', whose hours count to 12 without AM or PM"
    elif not going:
        doubt = f"dates such as '{first}' that go back in each order of day, month and year"
    return _in_doubt(name, texts, doubt)


def _likely_readings(readings: dict[str, FileChannel]) -> dict[str, FileChannel]:
    """Those of some readings whose times are even; else those without years between samples.

    Nobody records on one day of each year, where another reading has days that follow.
    """
    longest = {order: steps_of(c.values).max(initial=0.0) for order, c in readings.items()}
    near = {order: c for order, c in readings.items() if longest[order] <= 31 * 24 * _HOUR}
    far = {order for order in readings if longest[order] > 300 * 24 * _HOUR}
    even = {order: c for order, c in readings.items() if _is_even(c.values)}
    return even or (near if near and len(near) + len(far) == len(readings) else readings)


def _in_doubt(name: str, texts: Sequence[str], doubt: str) -> FileChannel:
    none = np.full(len(texts), math.nan)
    return FileChannel(name, "s", none, stamp=True, doubt=doubt, texts=tuple(texts))


def _moment(seconds: float) -> datetime:
    return _START + timedelta(seconds=seconds)


def steps_of(times: Vector) -> Vector:
    """Steps between times; NaN is none."""
    return np.diff(times[np.isfinite(times)])


def goes_on(times: Vector) -> bool:
    """Whether times never go back; NaN where there is none."""
    return bool((steps_of(times) >= 0.0).all())


def _is_even(times: Vector) -> bool:
    steps = steps_of(times)
    ahead = steps[steps > 0.0]
    return not ahead.size or bool(ahead.max() <= _EVEN * np.median(ahead))


def _ahead(local: Vector, zone: tzinfo) -> Vector:
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


def _utc_offset(moment: datetime, zone: tzinfo, fold: int) -> float:
    offset = moment.replace(tzinfo=zone, fold=fold).utcoffset()
    return offset.total_seconds() if offset is not None else 0.0


def _mend_changes(times: Vector, *, dated: bool) -> tuple[Vector, tuple[str, ...]]:
    """Local times that go on through changes of the clock, and what was changed, in words."""
    times, words = _mend_changes_by(_HOUR, times, dated=dated)
    times, more = _mend_changes_by(_HALF_HOUR, times, dated=dated)
    words = (*words, *more)
    return times, words if words or not dated else _set_ahead(times)


def _set_ahead(times: Vector) -> tuple[str, ...]:
    """Say which one gap may be a clock that was set ahead, in samples that are even otherwise.

    Offsets of zones are multiples of a quarter of an hour; a zone may also leave out a day.
    """
    steps = np.diff(times)
    if steps.size < 2:
        return ()
    at, usual = int(np.argmax(steps)), float(np.median(steps))
    gap, others = float(steps[at]) - usual, np.delete(steps, at)
    even = np.abs(others - usual).max() <= 0.1 * usual
    quarters = gap / _QUARTER
    if not even or not 0.5 < quarters <= 100.0 or abs(quarters - round(quarters)) > 1e-3:
        return ()
    return (
        f"{gap / 60.0:g} min are missing after {_moment(times[at]):%Y-%m-%d %H:%M:%S}: a gap, or a "
        "clock that was set ahead; say the zone, such as [Europe/Berlin], or [UTC]; times after "
        "it are as they are written",
    )


def _mend_changes_by(by: int, times: Vector, *, dated: bool) -> tuple[Vector, tuple[str, ...]]:
    """Mend changes of the clock by so many seconds.

    A step back by them is the end of summer time; a step that is too long by them is its begin
    where some zone changes its clock just there.
    """
    steps = np.diff(times)
    ahead = steps[steps > 0.0]
    usual = float(np.median(ahead)) if ahead.size else 0.0
    if not 0.0 < usual <= 12 * _HOUR:
        return times, ()
    find, form = (_dated_changes, "%Y-%m-%d %H:%M:%S") if dated else (_night_changes, "%H:%M:%S")
    ends, begins, doubted = find(times, usual, by)
    named = "an hour" if by == _HOUR else "a half-hour"
    words = [f"{named} {doubt}" for doubt in doubted]
    called = named.partition(" ")[2]
    shift = np.zeros(times.size)
    for k in sorted([*ends, *begins]):
        at = f"{_moment(times[k]):{form}}"
        shift[k + 1] = by if k in ends else -by
        words.append(
            f"the {called} after {at} comes twice: summer time ends, later times go on"
            if k in ends
            else f"the {called} after {at} is missing: summer time begins, no gap is left"
        )
    return times + np.cumsum(shift), tuple(words)


def _steps_off(steps: Vector, usual: float, by: int) -> tuple[np.ndarray, np.ndarray]:
    """Places of steps that are too short, and of those that are too long, by so many seconds."""
    twice = steps + by
    back = (steps <= 0.0) & (twice > 0.0) & (twice <= _EVEN * usual)
    if usual > by:  # a step that is too short by them is one ahead
        back = np.abs(twice - usual) <= 0.1 * by
    long = np.abs(steps - by - usual) <= 0.1 * min(usual, by)
    return np.flatnonzero(back), np.flatnonzero(long)


def _dated_changes(times: Vector, usual: float, by: int) -> tuple[list[int], list[int], list[str]]:
    """Where summer time ends and begins in some zone, and where it may begin, in words."""
    steps = np.diff(times)
    back, long = _steps_off(steps, usual, by)
    near = np.flatnonzero((steps > by) & (steps < by + _EVEN * usual))
    begins = [k for k in near.tolist() if _changes(times[k], times[k + 1], by)]
    words = [
        f"may be missing after {_moment(times[k]):%Y-%m-%d %H:%M:%S}, where summer time begins in "
        "some zones; say the zone, such as [Europe/Berlin], or [UTC]"
        for k in begins
        if k not in long
    ]
    ends = [k for k in back.tolist() if _changes(times[k], times[k + 1], -by)]
    return ends, [k for k in begins if k in long], words


def _night_changes(times: Vector, usual: float, by: int) -> tuple[list[int], list[int], list[str]]:
    """The same of times of day: summer time ends once in a night; that it begins a date tells."""
    steps, of_day = np.diff(times), times % (24 * _HOUR)
    back, long = _steps_off(steps, usual, by)
    ends = back[(of_day[back] <= 4 * _HOUR) & (of_day[back] >= _HOUR)][:1]
    ends = ends[np.abs(steps[ends] + by - usual) <= 0.1 * usual]
    night = (of_day[long] <= 3 * _HOUR) & (of_day[long + 1] >= 2 * _HOUR)
    words = [
        f"is missing after {_moment(times[k]):%H:%M:%S}: a gap, or summer time begins, which only "
        "a date tells; times after it are as they are written"
        for k in long[night]
        if usual <= by
    ]
    return ends.tolist(), [], words


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


_PARTS_OF_DATE = (
    *("year", "month", "day", "of", "called", "in", "one", "two", "last", "cin"),
    *("ordinal_year", "ordinal"),
)


def _days(matches: Sequence[re.Match[str] | None], order: str) -> np.ndarray:
    """Seconds since 1970 at the begin of each day, (n,)."""
    known: dict[tuple[str, ...], int] = {}
    days = np.zeros(len(matches), dtype=np.int64)
    for i, match in enumerate(matches):
        if match is None:
            continue
        own = match.groupdict()
        names = _PARTS_OF_DATE
        key = tuple(own.get(name) or "" for name in names)
        if key not in known:
            known[key] = (_day(key, order).toordinal() - _EPOCH) * 24 * _HOUR
        days[i] = known[key]
    return days


def _day(parts: tuple[str, ...], order: str) -> date:
    year, month, day, of, called, in_year, *numbers, of_year, ordinal_year, ordinal = parts
    if ordinal:
        return date(int(ordinal_year), 1, 1) + timedelta(days=int(ordinal) - 1)
    if called:
        return date(_full(in_year or of_year), _MONTHS[called.casefold()], int(of))
    if year:
        return date(int(year), int(month), int(day))
    named = dict(zip(order, numbers, strict=True))
    if len(named["y"]) > 2 and order == "ymd":
        raise ValueError("a year of four digits at the end")
    return date(_full(named["y"]), int(named["m"]), int(named["d"]))


def _full(year: str) -> int:
    """A year of four digits; of two, it is from 1969 to 2068, as POSIX has it."""
    return int(year) + (0 if len(year) > 2 else 2000 if int(year) < 69 else 1900)


def _offset(match: re.Match[str] | None) -> float:
    """Seconds that a cell says that it is ahead of UTC."""
    zone = _part(match, "zone")
    if not zone or "/" in zone:
        return 0.0
    if not zone[-1].isdigit():
        return _AHEAD[zone.upper()] * _HOUR if zone.upper() in _AHEAD else math.nan
    sign, digits = re.sub(r"^(UTC|GMT)", "", zone, flags=re.IGNORECASE)[0], re.sub(r"\D", "", zone)
    hours, minutes = (digits[:-2], digits[-2:]) if len(digits) > 2 else (digits, "0")
    return int(f"{sign}1") * (int(hours) * _HOUR + int(minutes) * 60.0)


def _clock(match: re.Match[str] | None) -> int:
    """Whole seconds of the day, or of the hour."""
    parts = match.groupdict() if match else {}
    c = "c" if parts.get("ch") else ""
    hour = int(parts.get(f"{c}h") or 0)
    half = parts.get(f"{c}half") or parts.get("early") or parts.get("late")
    if half:
        hour = hour % 12 + (12 if half in "Pp" else 0)
    hour += 24 * int(parts.get("days") or 0)
    return hour * _HOUR + int(parts.get(f"{c}m") or 0) * 60 + int(parts.get(f"{c}s") or 0)


def _fractions(
    matches: Sequence[re.Match[str] | None], whole: np.ndarray
) -> tuple[Vector, list[str], str]:
    """Parts of a second, (n,), what is said of them, and why they are in doubt.

    Where their digits differ, they may be counts of milliseconds. Behind a colon they are; decimals
    are none where one ends in 0, as .50 beside .125, and counts none where one begins with 0. Else
    those are taken with which times go on evenly.
    """
    digits = [_fraction(match) for match in matches]
    held = [own for own in digits if len(own) > 1]
    parts = np.array([float(f"0.{own or 0}") for own in digits])
    widths = {len(own) for own in digits if own}
    if not widths or not max(widths) <= 3 < 3 * len(widths):
        return parts, [], ""
    counts = np.array([int(own or 0) * 1e-3 for own in digits])
    if all(_part(match, "dot") == ":" for match in matches if _fraction(match)):
        return counts, [], ""
    short = any(own.endswith("0") and len(own) < max(widths) for own in held)
    padded = any(own.startswith("0") for own in held)
    if padded and not short:
        return parts, [], ""
    steps = np.diff(whole + parts), np.diff(whole + counts)
    uneven = np.array([np.abs(own - np.median(own)) for own in steps])
    uneven = uneven[:, (uneven < 1.0).all(axis=0)].sum(axis=1)  # without those over midnight
    whole_digits = any(own.endswith("0") for own in held)
    if short or whole_digits or uneven[1] < _EVENER * uneven[0]:
        return counts, ["parts of a second are milliseconds without zeros before them"], ""
    if uneven[0] < _EVENER * uneven[1] or not uneven.any():
        return parts, [], ""
    text = min((own for own in digits if own), key=len)
    doubt = (
        f"parts of a second such as .{text} and .{max(digits, key=len)}, which may be decimals, or"
    )
    return parts, [], f"{doubt} milliseconds without zeros before them"


def _fraction(match: re.Match[str] | None) -> str:
    """Figures of a part of a second, also before the year."""
    return _part(match, "f") or _part(match, "cf")


def _counted_frames(
    matches: Sequence[re.Match[str] | None], whole: np.ndarray
) -> tuple[Vector, list[str], str]:
    """Parts of a second, as `_fractions`: behind a colon may be frames of a film.

    They are where times go on evenly as such, and not as decimals. Where 60 of them are a second,
    they may be seconds behind minutes.
    """
    parts, notes, doubt = _fractions(matches, whole)
    held = [match for match in matches if match and _part(match, "dot") == ":"]
    if len(held) < len(matches) or any(len(match["f"]) != 2 for match in held):
        return parts, notes, doubt
    frames = np.array([int(match["f"]) for match in held])
    for rate in [0, *(rate for rate in _FRAMES if rate > frames.max())]:
        steps = np.diff(whole + (frames / rate if rate else parts))
        if steps.size and np.abs(steps - np.median(steps)).max() <= 1.0 / (rate or 50):
            break
    else:
        rate = 0
    if held[0].re is _OF_DAY and (rate == _FRAMES[-1] or np.ptp(whole) == 0):
        doubt = f"times such as '{held[0][0]}', whose last part may be of a second, or seconds"
        return parts, [], f"{doubt} behind days, hours and minutes"
    notes = [f"behind the last colon are frames, {rate} in a second"] if rate else []
    return frames / rate if rate else parts, notes, ""


def _with_leap_second(
    matches: Sequence[re.Match[str] | None], whole: np.ndarray, parts: Vector
) -> tuple[np.ndarray, list[str]]:
    """Whole seconds, (n,), a second later behind a 60th second that the next minute repeats."""
    leaps = [k for k, match in enumerate(matches) if _part(match, "s") == "60"]
    after = leaps[-1] + 1 if leaps else len(matches)
    if after >= whole.size or (whole + parts)[after] > (whole + parts)[after - 1]:
        return whole, []
    return whole + (np.arange(whole.size) >= after), ["a leap second: later times go on behind it"]


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
