"""A table of cells as people and recorders lay it out: names, units, then samples."""

import math
import re
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from itertools import pairwise, zip_longest

import numpy as np

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.recordings.formats.contents import FileChannel, Group
from workbench.recordings.formats.numbers import (
    all_plain,
    is_censored,
    is_like_number,
    is_missing,
    is_number,
    plain,
    reading_of,
    values_of,
)
from workbench.recordings.formats.spelling import conversion, is_unit, name_and_unit, spell_unit
from workbench.recordings.formats.stamps import (
    goes_on,
    has_day,
    has_day_alone,
    has_fraction,
    is_said,
    is_stamp,
    read_stamps,
)

# The time between samples, as a preamble states it.
_PER_SECOND = {"khz": 1e3, "hz": 1.0, "1/s": 1.0, "s/s": 1.0}
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "\u00b5s": 1e-6}
_QUANTITY = re.compile(
    r"(?<!\d)(?P<value>\d[\d.,'\u2019\s]{0,20}([eE][+-]?\d+)?)[\s;,\"']*[(\[]?"
    rf"(?P<unit>{'|'.join((*_PER_SECOND, *_SECONDS))})\b",
    re.IGNORECASE,
)
_UNIT_BEFORE = re.compile(  # Abtastrate [Hz]: 200
    rf"[\[(](?P<unit>{'|'.join((*_PER_SECOND, *_SECONDS))})[\])]\W{{1,4}}"
    r"(?P<value>\d[\d.,]{0,20}([eE][+-]?\d+)?)(?=\s|$)",
    re.IGNORECASE,
)
_SCALES = re.compile(
    r"\b(scale[ _]?factor|scale|scaling|gain|factor|multiplier|slope|faktor|skalierung|steigung"
    r"|(?P<offset>offset))\b",
    re.IGNORECASE,
)
_SIZES = re.compile(  # and what else says, in a line of words, that samples are not as named
    rf"{_SCALES.pattern}|\b(multipl|divid)\w+|(\bper |/ ?)(count|digit|lsb)s?\b"
    r"|(?P<power>(?<!\w)[x\u00d7*/] ?10+|\b1 ?/ ?10+)\b(?!/)",
    re.IGNORECASE,
)
_ALL_SAMPLES = re.compile(r"\b(all|values|signals|channels|alle|werte)\b", re.IGNORECASE)
_SIZE = re.compile(r"(?<![\w.,])[+-]?\d+([.,]\d+)?([eE][+-]?\d+)?(?!\w)")
_STATED_UNITS = re.compile(r"\W*(units?|einheit(en)?)\s*[:=]\s*(?P<units>\S.*)", re.IGNORECASE)
_STATISTICS = re.compile(
    r"(min|max|avg|mean|std|average|median|rms|sum|total|minim\w+|maxim\w+|st(d|andard)[ ._]*dev\w*"
    r"|mittel\w*|mw|summe|standardabw\w*|stabw|moyenne|gemiddelde)\W*",
    re.IGNORECASE,
)
_LISTED = (r"[,;|\t]\s*", r"[,;|]?\s+")  # marks between units in words
_NEAR = 4  # words behind a name that may say its unit: h changed to cm
_MOST_STATISTICS = 10  # rows at an end of a table; more are states
_OF_A_SCREEN = re.compile("horizontal|vertical", re.IGNORECASE)  # of an oscilloscope
# Powers of ten, as x2 is the name of a state.
_FACTOR = re.compile(r"[x\u00d7*]\s?(10*|0[.,]0*1|10\^[+-]?\d+)|10\^[+-]?\d+")
_ONE, _NOTHING = (
    re.compile(r"\+?1([.,]0*)?([eE][+-]?0+)?|10\^0"),
    re.compile(r"[+-]?0([.,]0*)?([eE].*)?"),
)
_ABOUT = 100  # characters before a quantity that may say of what it is
# Words for samples, for their rate and for the time between two; and of what else there are such.
_SAMPLES = re.compile("sampl|abtast|scan|mess(?!age)|meas|zeit|time|\\bdt\\b", re.IGNORECASE)
_RATE = re.compile("rate|freq", re.IGNORECASE)
_INTERVAL = re.compile(
    r"interval|in[ck]rement|step|schritt|abtastzeit|sampl\w*[ _]?time|\bdt\b", re.IGNORECASE
)
_OTHERS = re.compile(
    "decim|reduc|filter|pass|cut-?off|grenz|tr\u00e4ger|carrier|netz|mains", re.IGNORECASE
)

_DIGITS = frozenset("0123456789+-.,eE")
_HEADER_ROWS = 5  # of names, units and kinds
_MOST_TURNED = 500  # rows of a table whose channels are rows
_FEWEST = 3  # samples one after the other
_FEW = 50  # rows that tell whether times go back
# Labels of rows: of names, of units; and of a column that holds remarks.
_NAME_ROW = re.compile(
    r"((channel|kanal|signal|trace|sensor|long)[ _]?)?(names?|title|bezeichnung)\W*"
    r"|kanal|channel|signal|path",
    re.IGNORECASE,
)
_UNIT_ROW = re.compile(
    r"(y[ _]|v|eng(ineering)?[ _]?)?(units?|unit[ _]?(label|name)|einheit(en)?)\W*", re.IGNORECASE
)
_TIME_NAME = re.compile(r"(time|zeit|date|datum)", re.IGNORECASE)
_RULE = re.compile(r"[-=_+]+|\[data\]", re.IGNORECASE)  # of a table that is drawn, or follows
_REMARK = re.compile(r"comments?|remarks?|notes?|kommentar|bemerkung", re.IGNORECASE)
_WITH_UNIT = re.compile(
    r"\s*(?P<number>[+-]?\s?[\d.,]*\d([eE][+-]?\d+)?)\s*(?P<unit>[^\W\d][^\s;,|]{0,9}|%|°\S)\s*"
)
_QUOTIENT = re.compile(r"\s*(?P<name>[^/\s][^/]*?)\s*/\s*(?P<unit>[^\s/].*?)\s*")
_FORTRAN = re.compile(r"(\d\.?)[dD]([+-]?\d+)")
# A column that says which samples of another one, or of the one beside it, are good; words that
# say so, and the code of OPC from which on samples are.
_VALID = ("validity", "valid", "g\u00fcltig", "gueltig")
_VERDICT = re.compile(
    r"((?!is[ _])(?P<own>.+?)[ _.])?(?P<word>quality|qual|qualit\u00e4t|status|flag"
    rf"|(is[ _]?)?({'|'.join(_VALID)})"
    r"|(?<=_)q)([ _]?(code|flag))?",
    re.IGNORECASE,
)
_OF_MACHINES = ("status", "flag")  # unless they say of one column that it is good
_FEW_STATES = 3  # more are no verdicts, but a measure
_GOOD, _OPC_GOOD = frozenset(("good", "ok", "valid", "gut", "true", "g")), 192
_BAD = frozenset(("bad", "uncertain", "invalid", "error", "fault", "schlecht", "unsicher"))
# A column that holds the signs of another one, by its name, and what stands in it.
_SIGN_NAME = re.compile(
    r"((?P<own>.+?)[ _.])??(sign|signum|vorzeichen|vz|polarity|polarit\u00e4t|signe|signo|segno"
    r"|\+/?-|\u00b1)([ _.]*(of|von)[ _.](?P<of>.+))?",
    re.IGNORECASE,
)
_SIGNS = {
    **dict.fromkeys(("+", "plus", "pos", "positive", "positiv"), ""),
    **dict.fromkeys(("-", "\u2212", "minus", "neg", "negative", "negativ"), "-"),
}
_SIGNS_IN_FIGURES = {"1": "", "+1": "", "-1": "-", "0": ""}
_STATES = {"true": "1", "false": "0", "on": "1", "off": "0"}
_WORDS = re.compile(r"[^\W\d_]+")
_LETTERS = frozenset("abcdefghijklmnopqrstuvwxyz")  # that count columns: Time A, Time B; t1 has one
# What recorders write into a row of units above record numbers, dates and times.
_NO_UNIT = re.compile(
    r"(ts|rn|no|nr|num|number|#|date|time|datum|zeit|date ?& ?time|id|index|text|sequence"
    r"|yr|mo|dy|hr|mn)\.?"  # parts of a date, of buoys
    r"|[A-Z]\d{4,}",  # of Graphtec's alarms
    re.IGNORECASE,
)
# Columns of a table with a row for each value: whose it is, the value, its unit.
_PARTS_OF_TAGS = {
    **dict.fromkeys(("tag", "tagname", "tag name", "signal", "variable", "channel", "name"), "tag"),
    **dict.fromkeys(
        ("kanal", "sensor", "point", "measurement", "_field", "messstelle", "varname"), "tag"
    ),
    # of Grafana, Home Assistant and Kepware
    **dict.fromkeys(("series", "metric", "entity_id", "_name"), "tag"),
    **dict.fromkeys(("value", "wert", "_value", "messwert", "val", "varvalue", "state"), "value"),
    "physical value": "value",  # of decoded CAN
    **dict.fromkeys(("unit", "units", "einheit", "uom"), "unit"),
    "attributes.unit_of_measurement": "unit",  # of Home Assistant
}
# Columns that hold parts of a second beside time stamps, and digits of these.
_PARTS = {
    **dict.fromkeys(
        ("ms", "msec", "millisecond", "milliseconds", "millisekunden", "millis", "millitm"), 3
    ),
    **dict.fromkeys(("us", "\u00b5s", "usec", "microseconds", "mikrosekunden", "micros"), 6),
    **dict.fromkeys(("ns", "nsec", "nsecs", "nanosec", "nanoseconds"), 9),
    **dict.fromkeys(("fraction", "frac", "subsec", "subseconds"), 0),
}
# Columns that hold parts of a date, by their names in small letters.
_PARTS_OF_TIME = {
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
# Lines of a preamble that say when a recording began, and those that say something else.
_BEGAN = re.compile(r"start|beg[iu]n|trigger|^\W*(date|datum|t0)\b", re.IGNORECASE)
_NOT_BEGAN = re.compile(r"end|stop|export|print|druck|[ck]alib|version|software", re.IGNORECASE)
_WORD = re.compile(r"[\d./:-][\d./:T\s-]{6,}[\d](\.\d+)?(\s*[AP]M\b)?|[\d./:-]{8,}", re.IGNORECASE)
_AT_MIDNIGHT = re.compile(r"[T\s]+(0?0:00(:00([.,]0+)?)?|12:00(:00)?\s*AM)$", re.IGNORECASE)
_WHOLE_SECONDS = re.compile(
    r"(?P<whole>.*\d:\d\d:\d\d|\d+)(?P<half>(\s*[AP]\.?M\.?)?)", re.IGNORECASE
)
_WHOLE_MINUTES = re.compile(
    r"(?P<whole>(.*[T\s])?\d{1,2}:\d\d)(?P<half>(\s*[AP]\.?M\.?)?)", re.IGNORECASE
)
# What stands behind a name and is no unit, such as how its dates are written, or their zone.
_BEHIND_NAME = re.compile(r"\(([^()]+)\)$|, ((?:GMT|UTC)\S*)$")
_LAST_WORD = re.compile(r"(.*?)([^\W_]*)$")  # header.stamp.nsec, tv_usec


@dataclass(frozen=True)
class Cells:
    """Rows of cells, and where the samples among them begin."""

    rows: list[list[str]]  # of one width
    lines: list[int]  # of the file, from 1, on which they stand
    head: tuple[str, ...]  # lines above the samples, as text
    # names, units: cells of the header; empty where there is none
    names: tuple[str, ...]
    units: tuple[str, ...]
    # what a row of the preamble says of each column, which begins with its name
    about: tuple[str, ...] = ()
    # the line above samples that says of each column that its values are not as named
    remarks: tuple[str, ...] = ()


def find_tables(rows: Sequence[Sequence[str]], lines: Sequence[int], where: str) -> list[Cells]:
    """Find all tables that stand below each other, each with a header of its own.

    A header that comes again, as at the begin of a page, begins no table where its times go on.

    Parameters
    ----------
    lines : of the file, on which the rows stand.

    Raises
    ------
    InputError
        See `find_table`.
    """
    tables: list[Cells] = []
    rows_at = dict(zip(lines, rows, strict=True))
    while (begin := _next_table(table := find_table(rows, lines, where), rows, lines)) is not None:
        tables.append(find_table(rows[:begin], lines[:begin], where))
        rows, lines = rows[begin:], lines[begin:]
    for own in (*tables, table):
        _refuse_units_within(own, rows_at, where)
        _refuse_remarks_within(own, rows_at, where)
    return [*tables, table]


def _refuse_units_within(table: Cells, rows: Mapping[int, Sequence[str]], where: str) -> None:
    """Refuse a row of other units among samples, without names above it."""
    samples = set(table.lines)
    units = [_label(table, i)[1] for i in range(len(table.names))]
    for line in range(table.lines[0], table.lines[-1]):
        row = [spell_unit(cell) for cell in rows.get(line, ())]
        if line in samples or len(row) != len(units) or not _are_units(row):
            continue
        pairs = [pair for pair in zip(row, units, strict=True) if all(pair)]
        if others := [f"[{own}] below [{above}]" for own, above in pairs if own != above]:
            raise InputError(
                where=f"{where}, line {line}",
                found=f"a row of other units among samples, {', '.join(others)}",
                expected="samples in the units that stand above them",
                remedy="part the file there, and write the names above the units",
            )


def _refuse_remarks_within(table: Cells, rows: Mapping[int, Sequence[str]], where: str) -> None:
    """Refuse a line among samples that says that a column is in other units from there on."""
    samples = set(table.lines)
    for line in range(table.lines[0], table.lines[-1]):
        row = rows.get(line, ()) if line not in samples else ()
        for i in range(len(table.names) if row else 0):
            if text := _remark(table, i, [row]):
                raise InputError(
                    where=f"{where}, line {line}",
                    found=f"'{text}' among samples, which says what '{_label(table, i)[0]}' is "
                    "there",
                    expected="samples in the units that stand above them",
                    remedy="part the file there if its units or its range change, or delete the "
                    "line",
                )


def _has_factor(text: str) -> bool:
    """Whether a line of words says a factor or an offset that changes values."""
    scales = None if _OF_A_SCREEN.search(text) else _SIZES.search(text)
    if scales is None:
        return False
    neutral = _NOTHING if scales["offset"] else _ONE
    numbers = [match[0] for match in _SIZE.finditer(text)]
    return bool(scales["power"]) or not all(map(neutral.fullmatch, numbers))


def _has_other_unit(behind: str, unit: str) -> bool:
    """Whether words behind the name of a column say another unit of its kind."""
    near = (word.strip(",;:.=") for word in behind.split()[:_NEAR])
    others = {spell_unit(word) for word in near if word not in ("in", "at", "a")}
    known = [base for base in (unit, "K") if unit and conversion(unit, base)]
    return any(conversion(other, base) for other in others - {"", "1", unit} for base in known)


def _remark(table: Cells, i: int, above: Sequence[Sequence[str]]) -> str:
    """The line above samples that says of a column that its values are not as named; or nothing."""
    name, unit = _label(table, i)
    names = {name_and_unit(cell)[0] for cell in table.names}
    for row in above:
        text = " ".join(filter(None, (cell.strip() for cell in row)))
        if 2 * sum(name_and_unit(cell)[0] in names for cell in row) > len(names):
            continue  # names above columns
        word = re.compile(rf"(?<!\w){re.escape(name)}(?!\w)")
        if word.search(text) or (_ALL_SAMPLES.search(text) and not _OTHERS.search(text)):
            _, *behind = word.split(text, maxsplit=1)
            if _has_factor(word.sub("", text)) or _has_other_unit("".join(behind), unit):
                return text
    return ""


def _next_table(table: Cells, rows: Sequence[Sequence[str]], lines: Sequence[int]) -> int | None:
    """Row at which a table below begins, with its preamble."""
    samples = set(table.lines)
    others = (
        i for i, line in enumerate(lines) if line > table.lines[0] and line not in samples
    )  # none of a table whose channels are rows
    begin = next((i for i in others if _begins_table(rows, i, table, lines)), None)
    while begin is not None and lines[begin - 1] not in samples:
        begin -= 1
    return begin


def _begins_table(
    rows: Sequence[Sequence[str]], i: int, table: Cells, lines: Sequence[int]
) -> bool:
    """Whether a row below samples is a header of others than those of a table."""
    names = [cell.strip() for cell in _trim(rows[i])]
    if len(names) < 2 or not all(map(_is_text, names)):
        return False
    below = next((k for k in range(i + 1, len(rows)) if _is_data(rows[k])), len(rows))
    following = rows[below : below + _FEWEST]
    if below - i > _HEADER_ROWS or len(following) < _FEWEST or all(map(_is_statistic, following)):
        return False
    if any(len(_trim(row)) > len(names) or not _is_data(row) for row in following):
        return False
    if names == [cell.strip() for cell in _trim(table.names)]:
        units = [
            [spell_unit(cell) for cell in row] for row in rows[i + 1 : below] if _are_units(row)
        ]
        if any(_trim(own) != list(_trim(table.units)) for own in units):
            return True
        last = table.rows[bisect_left(table.lines, lines[i]) - 1][0]
        pair = last.replace(",", "."), following[0][0].replace(",", ".")
        return all(map(is_number, pair)) and float(pair[1]) <= float(pair[0])
    known = {name_and_unit(name)[0] for name in table.names}
    return any(name_and_unit(name)[0] in known or name_and_unit(name)[1] for name in names)


def find_table(rows: Sequence[Sequence[str]], lines: Sequence[int], where: str) -> Cells:
    """Find samples and header among rows of any width.

    Parameters
    ----------
    lines : of the file, on which the rows stand.

    Raises
    ------
    InputError
        If there are no two columns of samples, or their names do not reach as far as they do.
    """
    if turned := _rows_of_channels(rows):
        return find_table(turned, range(1, len(turned) + 1), where)
    samples = _samples(rows, lines, _is_data)
    if len(samples) < _FEWEST:  # numbers may have units behind them
        samples = _samples(rows, lines, lambda row: _is_data(_without_units(row)))
    width = Counter(len(rows[i]) for i in samples).most_common(1)[0][0] if samples else 0
    # A line of a preamble may hold numbers, too, but not several one after the other.
    # Between samples of slow channels, those of fast ones may have a time alone.
    taken = set(samples)
    others = (i for i, row in enumerate(rows) if i not in taken and _is_time_alone(row, width))
    known = sorted({*samples, *others})
    runs = (i for i, j in zip(known, known[2:], strict=False) if j == i + 2)
    first = next((i for i in runs if samples), None)
    if first is None or width < 2:
        raise InputError(
            where=where,
            found="no columns of numbers",
            expected="a table: names, then a row for each sample, at least a time and a signal",
            remedy="export the recording as a table",
        )
    _refuse_scales(rows[:first], lines, width, where)
    above = [_with_own_cells(row, width) for row in rows[:first]]
    names, units = _header(_with_index_name(above, width), width)
    own = len(_trim(names)) - 1
    if len(units) == own > 0 and _TIME_NAME.match(names[0]) and conversion(units[0], "s") is None:
        units = ["", *units]  # between spaces, dates and times have none
    head = tuple(" ".join(filter(None, row)) for row in rows[:first])
    kept = [i for i in samples if i >= first]
    body = [list(rows[i][:width]) for i in kept]
    if 0 < len(_trim(names)) == width - 1:
        body = _with_whole_stamps(body)
        width = len(body[0])
    if names:
        _refuse_narrow(names, units, body, f"{where}, above line {lines[first]}")
    else:
        names = [f"column {i + 1}" for i in range(width)]
    names = names if units else _with_slashes(names)
    own_names, own_units = (tuple((row + [""] * width)[:width]) for row in (names, units))
    # Recorders of portable kind name channels CH1 above samples, and say further up what they are.
    listed = {row[0].strip(): row[1].strip() for row in rows[:first] if len(row) > 2}
    about = tuple(text if (text := listed.get(name, "")) not in names else "" for name in names)
    table = Cells(body, [lines[i] for i in kept], head, own_names, own_units, about)
    return replace(table, remarks=tuple(_remark(table, i, rows[:first]) for i in range(width)))


def _with_own_cells(row: Sequence[str], width: int) -> Sequence[str]:
    """A row of units behind their label as cells, which other marks may part: units: s, mm."""
    match = _STATED_UNITS.fullmatch(" ".join(filter(None, map(str.strip, row))))
    cells = [re.split(mark, match["units"].strip()) for mark in _LISTED] if match else []
    return next((own for own in cells if len(own) == width and _are_units(own)), row)


def _refuse_scales(
    rows: Sequence[Sequence[str]], lines: Sequence[int], width: int, where: str
) -> None:
    """Refuse a row of factors or offsets above samples: nobody says whether they are applied."""
    for row, line in zip(rows, lines, strict=False):
        label, *cells = row or [""]
        match = None if _OF_A_SCREEN.search(label) else _SCALES.search(label)
        numbers = [cell.strip() for cell in cells if is_number(cell)]
        factors = [cell.strip() for cell in row if _FACTOR.fullmatch(cell.strip())]
        # Without a label, over all columns but that of times: x1;x10.
        if len(factors) > 1 and len(factors) + 1 >= len([cell for cell in row if cell.strip()]):
            label, numbers = factors[0], [cell.lstrip("x\u00d7* ") for cell in factors]
        elif match is None or 2 * len(numbers) < width - 1:
            continue
        neutral = _NOTHING if match and match["offset"] else _ONE
        if other := next((n for n in numbers if not neutral.fullmatch(n)), ""):
            raise InputError(
                where=f"{where}, line {line}",
                found=f"'{label.strip()}' of columns, {other} among them",
                expected="samples in the units that stand above them",
                remedy="apply it to the samples, unless they have it, and delete the line",
            )


def _with_slashes(names: list[str]) -> list[str]:
    """Names with units in brackets, where most are written as quotients: t/s, U/V, Ewe/V."""
    matches = [_QUOTIENT.fullmatch(name) for name in names]
    units = [match["unit"] if match and is_unit(match["unit"]) else "" for match in matches]
    if sum(map(bool, units)) < max(2, len(names) / 3):
        return names
    return [
        f"{match['name']} [{unit}]" if match and unit else name
        for name, match, unit in zip(names, matches, units, strict=True)
    ]


def _samples(
    rows: Sequence[Sequence[str]], lines: Sequence[int], is_sample: Callable[[Sequence[str]], bool]
) -> list[int]:
    """Places of the rows that are samples, of one width.

    A row whose first cell is a text, where those of samples are none, is one of statistics or of
    settings, and so are rows that say it at the begin or the end; one or two rows below an empty
    line at the end are sums.
    """
    data = [i for i, row in enumerate(rows) if is_sample(row)]
    width = Counter(len(rows[i]) for i in data).most_common(1)[0][0] if data else 0
    samples = [i for i in data if len(rows[i]) == width or len(_trim(rows[i])) == width]
    texts = {i for i in samples if _is_text(rows[i][0])}
    if 2 * len(texts) < len(samples):
        samples = [i for i in samples if i not in texts]
    above = _statistics_at_begin([rows[i] for i in samples[: 2 * _MOST_STATISTICS]])
    below = _statistics_at_begin([rows[i] for i in samples[: -2 * _MOST_STATISTICS : -1]])
    samples = samples[above : len(samples) - below]
    empty = [lines[j] - lines[i] > j - i for i, j in pairwise(samples)]  # lines that are no rows
    numbers = [str(k + 1) for k in range(width)]  # of channels, above an empty line
    if any(empty[:1]) and [cell.strip(' "') for cell in rows[samples[0]]] == numbers:
        samples, empty = samples[1:], empty[1:]
    for k in range(max(2, len(samples) - _FEWEST + 1), len(samples)):
        if empty[k - 1] and not empty[k - 2]:
            return samples[:k]
    return samples


def _is_statistic(row: Sequence[str]) -> bool:
    return any(map(_STATISTICS.fullmatch, map(str.strip, row)))


def _statistics_at_begin(rows: Sequence[Sequence[str]]) -> int:
    """How many rows at an end say that they are statistics, where those beside them do not."""
    says = [_is_statistic(row) for row in rows]
    count = sum(says)
    return count if count <= min(_MOST_STATISTICS, len(says) - 1) and all(says[:count]) else 0


def _is_text(cell: str) -> bool:
    """Whether a cell is neither a number nor a time, nor says that there is none."""
    text = cell.strip().strip("'\"")
    if not text or text[0] in "0123456789+-.<>=":
        return False
    return not (is_missing(text) or is_number(text) or is_stamp(text))


def is_quantity(cell: str) -> bool:
    """Whether a cell is a number with a unit behind it."""
    return _WITH_UNIT.fullmatch(cell) is not None


def _without_units(cells: Sequence[str]) -> list[str]:
    """Cells, of numbers with units behind them the numbers alone."""
    return [match["number"] if (match := _WITH_UNIT.fullmatch(c)) else c for c in cells]


def _rows_of_channels(rows: Sequence[Sequence[str]]) -> list[list[str]]:
    """Columns as rows, where each channel is a row with its name first; empty: they are none."""
    data = [row for row in rows if _is_data(row)] if len(rows) < _MOST_TURNED else []
    width = max(map(len, data), default=0)
    if not 2 <= len(data) <= width // 4 or not all(_is_text(row[0]) for row in data):
        return []
    return [list(column) for column in zip_longest(*data, fillvalue="")]


def _with_whole_stamps(rows: list[list[str]]) -> list[list[str]]:
    """The same samples, with days and times beside them as one, where a name stands above both."""
    columns = list(zip(*rows, strict=True))
    for i, (days, clocks) in enumerate(pairwise(columns)):
        dated = _mostly(days, is_stamp) and has_day_alone(days)
        if dated and _mostly(clocks, is_stamp) and not has_day(clocks):
            return [
                [*row[:i], f"{_AT_MIDNIGHT.sub('', row[i])} {row[i + 1]}", *row[i + 2 :]]
                for row in rows
            ]
    return rows


def _refuse_narrow(
    names: Sequence[str], units: Sequence[str], samples: Sequence[Sequence[str]], where: str
) -> None:
    """Refuse a header that does not reach as far as the samples: which name is whose is not known.

    R writes row numbers without a name; numbers with decimal commas between commas are two cells.
    """
    named = len(_trim(names))
    held = max(len(_trim(row)) for row in samples)
    if named >= held and (not units or len(units) >= named):
        return
    raise InputError(
        where=where,
        found=f"{named} names over {held} columns of samples"
        if named < held
        else f"{len(units)} units below {named} names",
        expected="as many cells in each row, so that each column has its own name and unit",
        remedy="name every column, that of row numbers, too; between commas, write decimal points "
        "or put numbers into quotation marks",
    )


def _trim(row: Sequence[str]) -> Sequence[str]:
    """A row without empty cells at its end."""
    end = len(row)
    while end and not row[end - 1].strip():
        end -= 1
    return row[:end]


def _is_data(row: Sequence[str]) -> bool:
    """Whether a row holds two numbers or times, and little else."""
    if _DIGITS.issuperset("".join(row)) and sum(cell[-1:].isdigit() for cell in row) > 1:
        return True  # as nearly all rows are
    held = [cell.strip() for cell in row if not is_missing(cell)]
    count = sum(is_number(cell) or is_stamp(cell) for cell in held)
    return count >= min(2, max(1, len(row) - 1)) and 3 * count > len(held)


def _is_time_alone(row: Sequence[str], width: int) -> bool:
    """Whether a row of a table has a time or a number in its first cell, and nothing else."""
    text = row[0].strip() if len(row) == width > 1 else ""
    return bool(text) and not any(map(str.strip, row[1:])) and (is_number(text) or is_stamp(text))


def _with_index_name(above: Sequence[Sequence[str]], width: int) -> Sequence[Sequence[str]]:
    """The same rows; where the last holds the name of times alone, this in the first of the names.

    So pandas writes it, below columns with names of several levels.
    """
    last = above[-1] if above else []
    begin = len(above) - 1
    while begin > 0 and len(above[begin - 1]) == width:
        begin -= 1
    if len(last) != width or len(_trim(last)) != 1 or not _TIME_NAME.match(last[0].strip()):
        return above
    names = above[begin:-1]
    named = [[last[0] if k == 0 else "", *row[1:]] for k, row in enumerate(names)]
    return [*above[:begin], *named]


def _header(above: Sequence[Sequence[str]], width: int) -> tuple[list[str], list[str]]:
    """Names and units as they stand above the samples; empty where there are none."""
    rows: list[list[str]] = []
    for row in reversed(above):
        cells = [cell.strip() for cell in row]
        if len(cells) == width + 1 and _REMARK.fullmatch(cells[-1]):
            cells = cells[:width]
        if not _trim(cells) or all(_RULE.fullmatch(cell) for cell in cells):
            continue
        if len(cells) == width and any(map(_is_moment, cells)):
            continue  # a sample of texts, as historians begin with: Pt Created
        if len(_trim(cells)) > width or len(_trim(cells)) < max(2, (width + 1) // 2):
            break
        rows.insert(0, cells)
        if len(rows) == _HEADER_ROWS:
            break
    if pairs := _header_of_pairs(above, width):
        return pairs
    at = next((i for i in range(1, len(rows)) if _are_units(rows[i])), None)
    if at is None and len(rows) > 1 and _are_units(rows[0]):
        rows = [*rows[1:2], rows[0], *rows[2:]]
        at = 1
    if at is not None and (names_and_units := _header_below(rows[at], rows[at + 1 :], width)):
        return names_and_units
    # Below units stand kinds, such as Avg; channel numbers are no names.
    named = [row for row in rows[:at] if not all(is_number(cell) for cell in row if cell)]
    is_labelled = at is None or (
        _UNIT_ROW.fullmatch(rows[at][0]) and not _NAME_ROW.fullmatch(rows[at - 1][0])
    )
    labelled = _labelled_row(above, _UNIT_ROW, width) if is_labelled else []
    if labelled and (own := _labelled_row(above, _NAME_ROW, width)):
        named = [own]
    if not named:
        return (rows[-1], []) if rows and at is None else ([], [])
    if at is None:
        with_units = max(named, key=_units_within)
        if 2 * _units_within(with_units) > width and all(with_units):  # above a row of kinds
            return with_units, []
        return _whole_names(named), [spell_unit(cell) for cell in labelled]
    units = [cell if is_unit(cell) or not _says_nothing(cell) else "" for cell in rows[at]]
    names = _whole_names(named)
    for below in rows[at + 1 :]:  # dates and times may have their names there
        for i, cell in enumerate(below[: len(names)]):
            if not any(units[i : i + 1]) and cell.casefold() in {*_PARTS, *_PARTS_OF_TIME}:
                names[i] = cell
    return names, [spell_unit(cell) for cell in units]


def _is_moment(cell: str) -> bool:
    """Whether a cell is a date with a time of day, as no header has it."""
    return is_stamp(cell) and has_day([cell]) and not has_day_alone([cell])


def _header_below(
    units: list[str], below: Sequence[list[str]], width: int
) -> tuple[list[str], list[str]] | None:
    """Names and units, where settings with a row of units stand above the header; else None."""
    if not below or len(_trim(below[-1])) != width or len(set(below[-1])) != width:
        return None
    names = below[-1]
    if all(names) and 2 * _units_within(names) > width:
        return names, []
    labelled = _UNIT_ROW.fullmatch(units[0]) and not _UNIT_ROW.fullmatch(names[0])
    if labelled and _TIME_NAME.match(names[0]):
        return names, [spell_unit(cell) if is_unit(cell) else "" for cell in units]
    return None


def _header_of_pairs(
    above: Sequence[Sequence[str]], width: int
) -> tuple[list[str], list[str]] | None:
    """Names and units, where rows repeat their label before each value, over times; else None."""
    rows = [[cell.strip() for cell in row] for row in above if len(row) >= width > 2]
    paired = [row[:width] for row in rows if len(set(row[:width:2])) == 1]
    names = next((row for row in paired if _NAME_ROW.fullmatch(row[0])), None)
    units = next((row for row in paired if _UNIT_ROW.fullmatch(row[0])), None)
    if names is None or units is None or width % 2:
        return None
    clock = next((name_and_unit(row[0])[1] for row in paired if _INTERVAL.search(row[0])), "")
    return (
        [cell if i % 2 else f"{names[i + 1]} time" for i, cell in enumerate(names)],
        [spell_unit(cell) if i % 2 else clock for i, cell in enumerate(units)],
    )


def _units_within(row: Sequence[str]) -> int:
    """How many names of a row have a unit behind them."""
    return sum(bool(name_and_unit(cell)[1]) for cell in row)


def _labelled_row(above: Sequence[Sequence[str]], label: re.Pattern[str], width: int) -> list[str]:
    """The row of a preamble that a label of its own says what it is, over all columns; or none."""
    for row in reversed(above):
        cells = [cell.strip() for cell in row]
        if width < 2 * len(_trim(cells)) <= 2 * width and label.fullmatch(cells[0]):
            return ["", *cells[1:], *[""] * (width - len(cells))]
    return []


def _whole_names(rows: Sequence[list[str]]) -> list[str]:
    """The last row; where its names are not enough, with what stands over each of them.

    A cell over several columns holds its text in the first of them.
    """
    names = rows[-1]
    held = [name for name in names if name]
    if len(rows) < 2 or (len(set(held)) == len(held) and len(held) == len(_trim(names))):
        return names
    over, last = [], ""
    for cell in rows[-2] + [""] * (len(names) - len(rows[-2])):
        last = cell or last
        over.append(last)
    names = names + [""] * (len(over) - len(names))
    return [" ".join(filter(None, pair)) for pair in zip(over, names, strict=True)]


def _says_nothing(cell: str) -> bool:
    """Whether a cell in a row of units is of a column that has none, such as one of dates."""
    return not cell or bool(_NO_UNIT.fullmatch(cell) or _UNIT_ROW.fullmatch(cell))


def _are_units(cells: Sequence[str]) -> bool:
    silent = (_says_nothing, is_number, is_said)  # DD/MM/YYYY is above dates
    held = [cell for cell in cells if not any(says(cell) for says in silent)]
    return bool(held) and sum(map(is_unit, held)) >= 0.6 * len(held)


def parts_of_tables(tables: Sequence[Cells]) -> list[tuple[str, Cells]]:
    """What is to be read as groups of their own, by name: of each table what `parted` finds."""
    named = [(f"table {k}" * (len(tables) > 1), table) for k, table in enumerate(tables, 1)]
    return [(f"{name} {tag}".strip(), own) for name, table in named for tag, own in parted(table)]


def parted(table: Cells) -> list[tuple[str, Cells]]:
    """Tables with times of their own, by name, where one holds several; else one without a name.

    Rows may hold one value of one signal that a column names, as historians of plants export: a
    tag, a time and a value, perhaps with its unit. Or columns of times stand before others each.
    """
    labels = [name_and_unit(name)[0].casefold() for name in table.names]
    at = {part: i for i, name in enumerate(labels) if (part := _PARTS_OF_TAGS.get(name))}
    if not at.keys() >= {"tag", "value"}:
        return _by_clock(table)
    columns = [[cell.strip() for cell in column] for column in zip(*table.rows, strict=True)]
    tags = list(dict.fromkeys(columns[at["tag"]]))
    if not 1 < len(tags) <= len(table.rows) / _FEWEST or any(map(is_number, tags)):
        return [("", table)]
    tables = []
    for tag in tags:
        kept = [k for k, own in enumerate(columns[at["tag"]]) if own == tag]
        names, units = list(table.names), list(table.units)
        names[at["value"]], names[at["tag"]] = tag, "tag"
        if "unit" in at:
            own_units = {columns[at["unit"]][k] for k in kept}
            units[at["value"]] = spell_unit(own_units.pop()) if len(own_units) == 1 else ""
        own_table = replace(
            table,
            rows=[table.rows[k] for k in kept],
            lines=[table.lines[k] for k in kept],
            names=tuple(names),
            units=tuple(units),
        )
        tables.append((tag, own_table))
    return tables


def by_tag(group: Group) -> list[Group]:
    """Groups of one signal each, where rows hold one value of one that a column names; else it."""
    at = {_PARTS_OF_TAGS.get(name_and_unit(c.name)[0].casefold()): c for c in group.channels}
    texts = {_PARTS_OF_TAGS.get(c.name.casefold()): c.texts for c in group.left}
    value, tags = at.get("value"), texts.get("tag", ())
    called = list(dict.fromkeys(filter(None, tags)))
    if value is None or not 1 < len(called) <= len(tags) / _FEWEST:
        return [group]
    groups = []
    for tag in called:
        rows = [k for k, own in enumerate(tags) if own == tag]
        units = [texts["unit"][k] if "unit" in texts else value.unit for k in rows]
        unit, factors = _one_unit(units) or ("", np.ones(len(rows)))
        own_value = _rows_of(value, rows)
        own_value = replace(own_value, name=tag, unit=unit, values=factors * own_value.values)
        if count := int((factors != 1.0).sum()):
            note = f"{count} samples in other units were taken to [{unit}]"
            own_value = replace(own_value, corrections=(note,))
        channels = (own_value if c is value else _rows_of(c, rows) for c in group.channels)
        own_group = replace(
            group,
            name=tag,
            channels=tuple(channels),
            time=_rows_of(group.time, rows) if group.time else None,
            within=(*group.within, tag),
            left=(),
        )
        groups.append(own_group)
    return groups


def _rows_of(channel: FileChannel, rows: list[int]) -> FileChannel:
    """Some samples of a channel."""
    return replace(
        channel,
        values=channel.values[rows],
        texts=tuple(channel.texts[k] for k in rows) if channel.texts else (),
        censored=tuple(np.flatnonzero(np.isin(rows, channel.censored)).tolist()),
    )


def _by_clock(table: Cells) -> list[tuple[str, Cells]]:
    """A table for each column of times, with the columns behind it, where these differ."""
    labels = [_label(table, i) for i in range(len(table.names))]
    columns = list(zip(*table.rows, strict=True))
    at = [i for i, cells in enumerate(columns) if _is_clock(*labels[i], cells)]
    if len(at) < 2:
        return [("", table)]
    blocks = list(pairwise([*at, len(columns)]))
    behind = [[name for name, _ in labels[a + 1 : b] if name] for a, b in blocks]
    alike = {
        tuple(sorted({*_WORDS.findall(labels[a][0].casefold())} - _words(own) - _LETTERS))
        for a, own in zip(at, behind, strict=True)
    }
    # Or each column ends where its times do, and these elsewhere than others.
    lengths = [{_length(columns[i]) for i in range(a, b) if any(columns[i])} for a, b in blocks]
    apart = max(map(len, lengths)) == 1 and len(set().union(*lengths)) > 1
    same = len({columns[a] for a in at}) == 1
    if not all(behind) or same or not (apart or len(alike) == 1):
        return [("", table)]
    tables = []
    for (clock, b), own in zip(blocks, behind, strict=True):
        a = clock if clock != at[0] else 0
        kept = [k for k, cell in enumerate(columns[clock]) if not is_missing(cell)]
        part = replace(
            table,
            rows=[table.rows[k][a:b] for k in kept],
            lines=[table.lines[k] for k in kept],
            names=table.names[a:b],
            units=table.units[a:b],
            about=table.about[a:b],
            remarks=table.remarks[a:b],
        )
        tables.append((own[0], part))
    return tables


def _is_clock(name: str, unit: str, cells: Sequence[str]) -> bool:
    """Whether a column may be one of times: it says so, and holds times or numbers."""
    named = _TIME_NAME.match(name) is not None or (unit and conversion(unit, "s") is not None)
    return bool(named) and _mostly(cells, lambda cell: is_number(cell) or is_stamp(cell))


def _length(cells: Sequence[str]) -> int:
    """Cells up to the last one that holds anything."""
    return max((k + 1 for k, cell in enumerate(cells) if not is_missing(cell)), default=0)


def _words(names: Sequence[str]) -> set[str]:
    return {word for name in names for word in _WORDS.findall(name.casefold())}


def numbers_of(table: Cells) -> list[list[str]]:
    """Columns of a table that hold numbers, without those of dates such as 14.03.2026."""
    columns = ([cell.strip() for cell in column] for column in zip(*table.rows, strict=True))
    return [
        all_plain(cells)
        for cells in columns
        if _mostly(cells, is_number) and not _mostly(cells, is_stamp)
    ]


def read_group(
    table: Cells,
    name: str,
    where: str,
    beside: Sequence[Sequence[str]] = (),
    *,
    commas: bool = True,
) -> tuple[Group, str, list[str]]:
    """Channels of a table, how its numbers are written, and notes on what was left out.

    Parameters
    ----------
    beside : numbers of other tables of the file, which are written in the same way.
    commas : whether numbers may hold commas.

    Raises
    ------
    InputError
        If numbers can be read in two ways.
    """
    columns = [[cell.strip() for cell in column] for column in zip(*table.rows, strict=True)]
    stamps: list[FileChannel] = []
    numbers: dict[int, list[str]] = {}
    factors: dict[int, Vector] = {}  # by row, of columns with several units
    texts: dict[int, list[str]] = {}
    notes: list[str] = []
    labels = [_label(table, i) for i in range(len(columns))]
    about, remarks = (
        {name: text for (name, _), text in zip(labels, own, strict=False)}
        for own in (table.about, table.remarks)
    )
    if turned := _newest_first(columns):
        columns = [cells[::-1] for cells in columns]
        table = replace(table, lines=table.lines[::-1])
        notes.append(f"rows with the newest first were turned, by {turned}")
    labels, columns = _with_parts(*_join_day_and_clock(*_join_date_parts(labels, columns)))
    said: dict[int, list[str]] = {i: [] for i in range(len(columns))}  # of what was changed
    for i, k, signs in _signs_beside(labels, columns):
        if signs:
            columns[k] = list(map("".join, zip(signs, columns[k], strict=True)))
            said[k].append(f"its sign is taken from '{labels[i][0]}'")
        else:
            held = ", ".join(sorted({*columns[i]} - {""}))
            remarks[labels[k][0]] = f"'{labels[i][0]}' beside it with {held}"
    left: list[FileChannel] = []
    for i, cells in enumerate(columns):
        behind = _BEHIND_NAME.search(labels[i][0])
        statements = (labels[i][1], behind[1] or behind[2] if behind else "")
        how = next(filter(is_said, statements), "")
        if _mostly(cells, is_stamp) and (channel := read_stamps(labels[i][0], cells, how)):
            stamps.append(channel)
            notes += [f"'{labels[i][0]}' holds {channel.doubt}"] * bool(channel.doubt)
        elif _mostly(cells, is_number):
            numbers[i] = all_plain(cells)
        elif (bare := _numbers_within(cells, labels[i][1])) is not None:
            numbers[i] = all_plain(bare[0])
            labels[i] = labels[i][0], bare[1][0]
            factors[i] = bare[1][1]
        elif any(cells) or table.names[i].strip():
            texts[i] = cells
    for k, i in _units_beside(labels, numbers, texts).items():
        rows = list(zip(numbers[k], texts.pop(i), strict=True))
        if one := _one_unit([unit if is_number(cell) else None for cell, unit in rows]):
            labels[k], factors[k] = (labels[k][0], one[0]), one[1]
        else:
            del numbers[k]
            texts[k] = [" ".join(row) for row in rows]
    for k, factor in factors.items():
        if count := int((factor != 1.0).sum()):
            said[k].append(f"{count} samples in other units were taken to [{labels[k][1]}]")
    for i, cells in texts.items():
        notes.append(f"'{labels[i][0]}' holds {'texts' if any(cells) else 'nothing'}")
        none = np.full(len(cells), math.nan)
        left.append(FileChannel(labels[i][0], "", none, texts=tuple(cells)))
    for k, text, question in _leave_out_bad(labels, columns, numbers):
        said[k] += [text] * bool(text)
        if question:
            remarks[labels[k][0]] = question
    reading = reading_of([*numbers.values(), *beside], where, commas=commas)
    channels: list[FileChannel] = []
    for i, cells in numbers.items():
        values = factors.get(i, 1.0) * values_of(cells, reading)
        gaps = np.flatnonzero(np.isnan(values)).tolist()
        beyond = [k for k in gaps if is_censored(cells[k])]
        if beyond:
            said[i].append(
                f"{len(beyond)} cells say only that a value is below or above "
                f"another, the first {cells[beyond[0]]!r} in line {table.lines[beyond[0]]}; they "
                "are no samples"
            )
        bad = [k for k in gaps if not is_missing(cells[k]) and k not in set(beyond)]
        if bad:
            said[i].append(
                f"{len(bad)} cells that are no numbers are gaps, the first "
                f"{columns[i][bad[0]]!r} in line {table.lines[bad[0]]}"
            )
        like = [k for k in bad if is_like_number(cells[k])]
        unread = f"{len(like)} cells such as {columns[i][like[0]]!r}" if like else ""
        channel = FileChannel(
            *labels[i],
            values,
            about.get(labels[i][0], ""),
            censored=tuple(beyond),
            unread=unread,
            remark=remarks.get(labels[i][0], ""),
            corrections=tuple(said[i]),
        )
        notes += [f"'{labels[i][0]}': {text}" for text in said[i]]
        channels.append(channel)
    step, doubt = stated_step(table.head)
    within = (name,) if name else ()
    group = Group(
        name,
        (*stamps, *channels),
        step=step,
        step_doubt=doubt,
        within=within,
        left=tuple(left),
        begun=stated_begin(table.head),
    )
    return group, reading, notes


def _leave_out_bad(
    labels: Sequence[tuple[str, str]],
    columns: Sequence[Sequence[str]],
    numbers: dict[int, list[str]],
) -> Iterator[tuple[int, str, str]]:
    """Empty the cells that another column calls bad, as servers of plants do; say of which.

    And what may be verdicts of another column, which somebody must say.
    """
    verdicts = {
        i: match for i, (name, _) in enumerate(labels) if (match := _VERDICT.fullmatch(name))
    }
    values = [k for k in numbers if k not in verdicts and not _is_clock(*labels[k], columns[k])]
    for i, match in verdicts.items():
        own = (match["own"] or "").casefold()
        judged = [
            k
            for k in values
            if (labels[k][0].casefold() == own if own else len(verdicts) == 1 or k == i - 1)
        ]
        states = [cell.strip().casefold() for cell in columns[i]]
        words = {_first_word(state) for state in states if state}
        unclear = match["word"].casefold() in _OF_MACHINES and not (
            words <= _GOOD | _BAD or "good" in words
        )
        if not words or (unclear and not own):
            continue  # of a machine
        good = {state for state in states if _is_good(state, match["word"])}
        counts = Counter(filter(None, states)).most_common(_FEW_STATES + 1)
        if not good and len(counts) <= _FEW_STATES and 2 * counts[0][1] > len(states):
            good = {counts[0][0]}  # of codes that are not known, what most samples have
        bad = [k for k, state in enumerate(states) if state and state not in good]
        if not judged or not bad or (unclear and len(counts) > _FEW_STATES):
            continue
        if unclear:
            codes = ", ".join(sorted(state for state, _ in counts))
            yield from ((k, "", f"'{labels[i][0]}' beside it with {codes}") for k in judged)
            continue
        left = set(bad) if good else set()
        called = f"{len(bad)} samples that '{labels[i][0]}' calls {columns[i][bad[0]]!r} are gaps"
        unknown = f"'{labels[i][0]}' may tell good samples from bad ones; all were taken"
        for k in judged:
            numbers[k] = ["" if n in left else cell for n, cell in enumerate(numbers[k])]
            yield k, called if good else unknown, ""


def _signs_beside(
    labels: Sequence[tuple[str, str]], columns: Sequence[Sequence[str]]
) -> Iterator[tuple[int, int, list[str]]]:
    """Columns of signs, the column of numbers that each is of, and the signs; none: in doubt."""
    numeric = [
        _mostly(cells, is_number) and not _is_clock(*labels[k], cells)
        for k, cells in enumerate(columns)
    ]
    for i, (name, _) in enumerate(labels):
        match = _SIGN_NAME.fullmatch(name)
        held = {cell.casefold() for cell in columns[i] if cell}
        if match and held and held <= _SIGNS.keys() | _SIGNS_IN_FIGURES.keys():
            own = (match["own"] or match["of"] or "").casefold()
        elif "+" in held <= {"+", "-", "\u2212"}:
            own = ""
        else:
            continue
        beside = [k for k in (i + 1, i - 1) if 0 <= k < len(numeric) and numeric[k]]
        if own:
            beside = [k for k, label in enumerate(labels) if label[0].casefold() == own]
        signs = [(_SIGNS | _SIGNS_IN_FIGURES).get(cell.casefold(), "") for cell in columns[i]]
        for k in beside:
            rows = zip(columns[i], columns[k], strict=True)
            bare = all(sign and number[0].isdigit() for sign, number in rows if number)
            sure = match and bare and "0" not in held and len(beside) == 1
            yield i, k, signs if sure else []


def _is_good(state: str, word: str) -> bool:
    """Whether a state, in a column of some name, says that a sample is good."""
    is_valid = state == "1" and word.casefold().endswith(_VALID)
    of_opc = state.isdecimal() and int(state) & _OPC_GOOD == _OPC_GOOD
    return _first_word(state) in _GOOD or is_valid or of_opc


def _first_word(state: str) -> str:
    """What a state begins with: Good, Local Override is a good one."""
    return re.split(r"[\W_]", state, maxsplit=1)[0]


def _units_beside(
    labels: Sequence[tuple[str, str]],
    numbers: Mapping[int, Sequence[str]],
    texts: Mapping[int, Sequence[str]],
) -> dict[int, int]:
    """For columns of numbers with their units in one beside them, the column of these.

    So meters write them that choose a range by themselves. A column of values of several signals,
    which another one names, is for `by_tag`.
    """
    parts = [_PARTS_OF_TAGS.get(name.casefold(), "") for name, _ in labels]
    tagged = any(parts[i] == "tag" and len(set(cells)) > 1 for i, cells in texts.items())
    units = {}
    for k in numbers:
        name, unit = labels[k]
        if unit or (tagged and parts[k] == "value"):
            continue
        # One before belongs to a column of numbers before that, if it has no unit.
        taken = k - 2 in numbers and not any((labels[k - 2][1], _TIME_NAME.match(labels[k - 2][0])))
        near = {k + 1, *([] if taken else [k - 1])} & texts.keys()
        own = (
            i
            for i in near
            if _is_label_of_units(labels[i][0], name) and any(map(is_unit, {*texts[i]} - {""}))
        )
        if (at := max(own, default=-1)) >= 0:
            units[k] = at
    return units


def _is_label_of_units(label: str, name: str) -> bool:
    """Whether a column has the units of one of some name: Unit, or h unit of h."""
    own = label.casefold().removeprefix(name.casefold()).strip(" _.")
    return _PARTS_OF_TAGS.get(own) == "unit"


def _one_unit(units: Sequence[str | None]) -> tuple[str, Vector] | None:
    """The unit that most rows have, and factors that take the values of each to it, (n,).

    None where there are several, of which one cannot be converted.

    Parameters
    ----------
    units : (n,), None of a row without a number.
    """
    counts = Counter(unit for unit in units if unit is not None)
    if not counts:
        return None
    common = spell_unit(counts.most_common(1)[0][0])
    factors = dict.fromkeys(counts, 1.0)
    for unit in counts if len(counts) > 1 else ():
        scale = conversion(spell_unit(unit), common)
        if scale is None or scale.zero:
            return None
        factors[unit] = scale.factor
    return common, np.array([1.0 if unit is None else factors[unit] for unit in units])


def _newest_first(columns: Sequence[Sequence[str]]) -> str:
    """The time stamp of the first row, where they go back from row to row; empty: they do not."""
    for cells in columns:
        few = cells[:_FEW]
        if not _mostly(few, is_stamp) or _is_ordered(few) or not _is_ordered(few[::-1]):
            continue
        if _is_ordered(cells[::-1]):
            return f"'{next(filter(None, cells))}' in the first"
    return ""


def _is_ordered(cells: Sequence[str]) -> bool:
    """Whether time stamps go on from cell to cell."""
    stamps = read_stamps("", cells)
    return stamps is not None and not stamps.doubt and goes_on(stamps.values)


def _numbers_within(cells: Sequence[str], unit: str) -> tuple[list[str], tuple[str, Vector]] | None:
    """Numbers of cells that hold their unit, too, or are written as no other; and `_one_unit`.

    Texts of a spreadsheet (="1.5"), exponents of Fortran (1.5D+02), and what is on or off.
    """
    held = [cell for cell in cells if not is_missing(cell) or cell.casefold() in _STATES]
    ones = np.ones(len(cells))
    if held and unit in ("", "1") and all(cell.casefold() in _STATES for cell in held):
        return [_STATES.get(cell.casefold(), cell) for cell in cells], (unit or "1", ones)
    plainer = [_FORTRAN.sub(r"\1E\2", cell.removeprefix("=").strip("'\"")) for cell in cells]
    if _mostly(plainer, is_number):
        return plainer, (unit, ones)
    matches = [_WITH_UNIT.fullmatch(cell) for cell in plainer]
    one = _one_unit([match["unit"] if match else None for match in matches])
    if one is None or not is_unit(one[0]) or 2 * sum(map(bool, matches)) <= len(held):
        return None
    if unit and spell_unit(unit) != one[0]:
        return None
    return _without_units(plainer), one


def _join_date_parts(
    labels: list[tuple[str, str]], columns: list[list[str]]
) -> tuple[list[tuple[str, str]], list[list[str]]]:
    """The same columns, with those of years, days, hours, or dates and times in figures, as one.

    A date is that of a year with month and day, or with the day of the year; a time of day is of
    hours, minutes and seconds, or of figures such as 1015 and 101500.
    """
    at: dict[str, int] = {}
    for i, (name, _) in enumerate(labels):
        part = _PARTS_OF_TIME.get(name.casefold())
        part = "minute" if name == "mm" and "hour" in at else part  # MM DD hh mm
        if part and part not in at and all(_FIGURES.fullmatch(cell) for cell in columns[i] if cell):
            at[part] = i
    dates = (
        at.keys() & {"date"}
        or at.keys() >= {"year", "month", "day"}
        or at.keys() >= {"year", "yday"}
    )
    times = at.keys() & {"clock", "hour"}
    if not dates or not times:
        return labels, columns
    if "date" in at:
        held = [cell for cell in columns[at["date"]] if cell]
        if not all(_DATE_IN_FIGURES.fullmatch(cell) for cell in held):
            return labels, columns
        days = columns[at["date"]]
        used = ["date"]
    elif "month" in at and "day" in at:
        used = ["year", "month", "day"]
        rows = zip(*(columns[at[part]] for part in used), strict=True)
        days = [f"{y}{m:0>2}{d:0>2}" if y and m and d else "" for y, m, d in rows]
    else:
        used = ["year", "yday"]
        rows = zip(*(columns[at[part]] for part in used), strict=True)
        days = [
            f"{datetime(int(float(y)), 1, 1) + timedelta(int(float(d)) - 1):%Y%m%d}"
            if y and d
            else ""
            for y, d in rows
        ]
    if "clock" in at:
        used.append("clock")
        width = 4 if max(map(len, columns[at["clock"]])) <= 4 else 6
        clocks = [f"{cell:0>{width}}{'00' * (width == 4)}" for cell in columns[at["clock"]]]
    else:
        own = [part for part in ("hour", "minute", "second") if part in at]
        used += own
        rows = zip(*(columns[at[part]] for part in own), strict=True)
        clocks = ["".join(_two_figures(cell) for cell in row).ljust(6, "0") for row in rows]
    joined = [f"{day}T{clock}" if day else "" for day, clock in zip(days, clocks, strict=True)]
    if not _mostly(joined, is_stamp):
        return labels, columns
    left = [i for i in range(len(columns)) if i not in {at[part] for part in used}]
    label = " ".join(labels[at[part]][0] for part in used), ""
    return [label, *(labels[i] for i in left)], [joined, *(columns[i] for i in left)]


def _two_figures(cell: str) -> str:
    """Hours, minutes or seconds with two figures before their decimals."""
    whole, mark, decimals = cell.replace(",", ".").partition(".")
    return f"{whole:0>2}{mark}{decimals}" if decimals.strip("0") else f"{whole:0>2}"


def _join_day_and_clock(
    labels: list[tuple[str, str]], columns: list[list[str]]
) -> tuple[list[tuple[str, str]], list[list[str]]]:
    """The same columns, with one of days and one of times of day as one."""
    kinds = [_mostly(cells, is_stamp) and has_day_alone(cells) for cells in columns]
    clocks = [_mostly(cells, is_stamp) and not has_day(cells) for cells in columns]
    if not any(kinds) or not any(clocks):
        return labels, columns
    day, clock = kinds.index(True), clocks.index(True)
    last, joined = "", []
    for date, other in zip(columns[day], columns[clock], strict=True):
        last = date or last  # which may stand where it changes alone
        joined.append(f"{_AT_MIDNIGHT.sub('', last if other else date)} {other}")
    left = [i for i in range(len(columns)) if i not in (day, clock)]
    name = f"{labels[day][0]} {labels[clock][0]}", ""
    return [name, *(labels[i] for i in left)], [joined, *(columns[i] for i in left)]


def _with_parts(
    labels: list[tuple[str, str]], columns: list[list[str]]
) -> tuple[list[tuple[str, str]], list[list[str]]]:
    """The same columns, with times of whole seconds and their parts of a second as one.

    The times are time stamps, or seconds of a counter whose name differs by `sec` for `nsec` alone.
    Seconds may stand beside stamps of whole minutes.
    """
    stamps = [i for i, cells in enumerate(columns) if _mostly(cells, is_stamp)]
    stamped = len(stamps) == 1 and not has_fraction(columns[stamps[0]])
    for i, (name, unit) in enumerate(labels):
        if stamped and _PARTS_OF_TIME.get(name.casefold()) == "second":
            moments = columns[stamps[0]]
            if joined := _join_seconds(moments, columns[i]):
                left = [k for k in range(len(columns)) if k not in (stamps[0], i)]
                label = f"{labels[stamps[0]][0]} {name}", ""
                return [label, *(labels[k] for k in left)], [joined, *(columns[k] for k in left)]
        begin, last = _LAST_WORD.findall(name.casefold().strip("[]()"))[0]
        if f"{begin}{last}" in ("time", "zeit"):  # Time [ms]
            last = unit.casefold()
        begin = "" if begin.strip(" _") in ("time", "zeit") else begin
        digits = _PARTS.get(last)
        if digits is None or (unit and _PARTS.get(unit.casefold(), 0) != digits):
            continue
        if not digits and not (unit or (stamped and _repeats(columns[stamps[0]]))):
            continue  # a fraction of something else: stamps tell samples apart without it
        counters = [
            k for k, other in enumerate(labels) if other[0].casefold() in _seconds_beside(begin)
        ]
        at = stamps[0] if stamped and not begin else next(iter(counters), i)
        if at == i or (joined := _join_parts(columns[at], columns[i], digits)) is None:
            continue
        left = [k for k in range(len(columns)) if k not in (at, i)]
        label = f"{labels[at][0]} {name}", ""
        if at not in stamps:
            label = f"time {labels[at][0]} {name}", "s"
        return [label, *(labels[k] for k in left)], [joined, *(columns[k] for k in left)]
    return labels, columns


def _join_seconds(moments: list[str], seconds: list[str]) -> list[str] | None:
    """Stamps of whole minutes with their seconds behind them; None where they are not such."""
    joined = []
    for moment, part in zip(moments, seconds, strict=True):
        match = _WHOLE_MINUTES.fullmatch(moment)
        if match is None or not _FIGURES.fullmatch(part) or float(part.replace(",", ".")) >= 60.0:
            return None
        joined.append(f"{match['whole']}:{_two_figures(part)}{match['half']}")
    return joined


def _repeats(cells: Sequence[str]) -> bool:
    """Whether cells beside each other are alike."""
    return any(a == b for a, b in pairwise(cells))


def _seconds_beside(begin: str) -> list[str]:
    """Names of a counter of seconds, beside one of parts of a second whose name begins so."""
    return [f"{begin}{word}" for word in ("sec", "secs", "seconds", "s")]


def _join_parts(moments: list[str], parts: list[str], digits: int) -> list[str] | None:
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


def _label(table: Cells, i: int) -> tuple[str, str]:
    """Name and unit of a column."""
    name, unit = name_and_unit(table.names[i])
    return name or f"column {i + 1}", unit or table.units[i]


def _mostly(cells: Sequence[str], is_one: Callable[[str], bool]) -> bool:
    """Whether more than half of the cells that hold anything are of a kind."""
    few = cells[:: max(1, len(cells) // 1000)]  # a thousand tell, if they hold anything
    held = [cell for cell in few if not is_missing(cell)]
    if not held:
        held = [cell for cell in cells if not is_missing(cell)]
    return len(held) > 0 and 2 * sum(map(is_one, held)) > len(held)


def stated_step(head: Sequence[str]) -> tuple[float, str]:
    """Time between samples that a preamble states [s], and why it is in doubt, in words.

    Without a statement, and where there is a doubt, the time is NaN.

    Parameters
    ----------
    head : lines above a table.
    """
    steps: dict[str, float] = {}
    for line in head:
        for match in (*_QUANTITY.finditer(line), *_UNIT_BEFORE.finditer(line)):
            before = line[max(0, match.start() - _ABOUT) : match.start()]
            about = re.split(r"\d", before)[-1]
            value, unit = match["value"].strip(), match["unit"].casefold()
            meaning = _RATE if unit in _PER_SECOND else _INTERVAL
            wanted = meaning.search(about) and _SAMPLES.search(about)
            if not wanted or _OTHERS.search(about) or not is_number(value):
                continue
            number, doubt = _number(value)
            if doubt:
                return math.nan, doubt
            if number > 0.0:
                statement = f"'{about.strip()} {value} {match['unit']}'"
                rate = unit in _PER_SECOND
                steps[statement] = (
                    1.0 / (number * _PER_SECOND[unit]) if rate else number * _SECONDS[unit]
                )
    if not steps:
        return math.nan, ""
    step, *others = steps.values()
    if all(math.isclose(step, other) for other in others):
        return step, ""
    return math.nan, f"a preamble that states {' and '.join(steps)}"


def stated_begin(head: Sequence[str]) -> float:
    """When a recording began, as a preamble states it [s since 1970]; NaN where it does not.

    Parameters
    ----------
    head : lines above a table.
    """
    for line in head:
        if not _BEGAN.search(line) or _NOT_BEGAN.search(line):
            continue
        for match in _WORD.finditer(line):
            text = match[0].strip(" -.:")
            stamp = read_stamps("", [text, text]) if has_day([text]) else None
            if stamp is not None and math.isfinite(stamp.start) and not stamp.doubt:
                return stamp.start + (_clock_beside(head) if has_day_alone([text]) else 0.0)
    return math.nan


def _clock_beside(head: Sequence[str]) -> float:
    """A time of day that a line of a preamble states by itself [s]; 0 without one."""
    for line in head:
        if label := re.match(r"\W*(start ?|begin ?)?(time|zeit|uhrzeit)\b", line, re.IGNORECASE):
            words = (line[label.end() :], *(match[0] for match in _WORD.finditer(line)))
            for text in (word.strip(" -.:=\t") for word in words):
                stamp = read_stamps("", [text]) if is_stamp(text) else None
                if stamp is not None and math.isfinite(stamp.shown):
                    return stamp.shown
    return 0.0


def _number(text: str) -> tuple[float, str]:
    """A number, NaN if it can be read in two ways; and these, in words."""
    if plain(text) != text:
        return math.nan, f"a preamble with '{text}', which may be one number or two"
    try:
        reading = reading_of([[text]], "", commas=True)
    except InputError as error:
        return math.nan, f"a preamble with {error.found}"
    return float(values_of([text], reading)[0]), ""
