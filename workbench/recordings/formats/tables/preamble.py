"""What lines above a table state: the time between samples, and when a recording began."""

import math
import re
from collections.abc import Sequence

from workbench.errors import InputError
from workbench.recordings.formats.numbers import is_number, plain, reading_of, values_of
from workbench.recordings.formats.stamps import has_day, has_day_alone, is_stamp, read_stamps

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
_ABOUT = 100  # characters before a quantity that may say of what it is
# Words for samples, for their rate and for the time between two; and of what else there are such.
_SAMPLES = re.compile("sampl|abtast|scan|mess(?!age)|meas|zeit|time|\\bdt\\b", re.IGNORECASE)
_RATE = re.compile("rate|freq", re.IGNORECASE)
INTERVAL = re.compile(
    r"interval|in[ck]rement|step|schritt|abtastzeit|sampl\w*[ _]?time|\bdt\b", re.IGNORECASE
)
OTHERS = re.compile(
    "decim|reduc|filter|pass|cut-?off|grenz|tr\u00e4ger|carrier|netz|mains", re.IGNORECASE
)
# Lines of a preamble that say when a recording began, and those that say something else.
_BEGAN = re.compile(r"start|beg[iu]n|trigger|^\W*(date|datum|t0)\b", re.IGNORECASE)
_NOT_BEGAN = re.compile(r"end|stop|export|print|druck|[ck]alib|version|software", re.IGNORECASE)
_WORD = re.compile(r"[\d./:-][\d./:T\s-]{6,}[\d](\.\d+)?(\s*[AP]M\b)?|[\d./:-]{8,}", re.IGNORECASE)


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
            meaning = _RATE if unit in _PER_SECOND else INTERVAL
            wanted = meaning.search(about) and _SAMPLES.search(about)
            if not wanted or OTHERS.search(about) or not is_number(value):
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
