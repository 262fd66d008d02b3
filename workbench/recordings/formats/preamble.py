"""What stands above a table: the time between its samples."""

import math
import re
from collections.abc import Sequence

from workbench.errors import InputError
from workbench.recordings.formats.numbers import is_number, plain, reading_of, values_of

_PER_SECOND = {"khz": 1e3, "hz": 1.0, "1/s": 1.0, "s/s": 1.0}
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "\u00b5s": 1e-6}
_QUANTITY = re.compile(
    r"(?<!\d)(?P<value>\d[\d.,'\u2019\s]{0,20}([eE][+-]?\d+)?)[\s;,\"']*[(\[]?"
    rf"(?P<unit>{'|'.join((*_PER_SECOND, *_SECONDS))})\b",
    re.IGNORECASE,
)
_ABOUT = 100  # characters before a quantity that may say of what it is
# Words for samples, for their rate and for the time between two; and of what else there are such.
_SAMPLES = re.compile("sampl|abtast|scan|mess(?!age)|meas|zeit|time|\\bdt\\b", re.IGNORECASE)
_RATE = re.compile("rate|freq", re.IGNORECASE)
_INTERVAL = re.compile(
    r"interval|in[ck]rement|step|schritt|abtastzeit|sampl\w*[ _]?time|\bdt\b", re.IGNORECASE
)
_OTHERS = re.compile("filter|pass|cut-?off|grenz|tr\u00e4ger|carrier|netz|mains", re.IGNORECASE)


def stated_step(head: Sequence[str]) -> tuple[float, str]:
    """Time between samples that a preamble states [s], and why it is in doubt, in words.

    Without a statement, and where there is a doubt, the time is NaN.

    Parameters
    ----------
    head : lines above a table.
    """
    steps: dict[str, float] = {}
    for line in head:
        for match in _QUANTITY.finditer(line):
            before = line[max(0, match.start() - _ABOUT) : match.start()]
            about = re.split(r"\d", before)[-1]
            value, unit = match["value"].strip(), match["unit"].casefold()
            kind = _RATE if unit in _PER_SECOND else _INTERVAL
            wanted = kind.search(about) and _SAMPLES.search(about)
            if not wanted or _OTHERS.search(about) or not is_number(value):
                continue
            number, doubt = _number(value)
            if doubt:
                return math.nan, doubt
            if number > 0.0:
                said = f"'{about.strip()} {value} {match['unit']}'"
                rate = unit in _PER_SECOND
                steps[said] = (
                    1.0 / (number * _PER_SECOND[unit]) if rate else number * _SECONDS[unit]
                )
    if not steps:
        return math.nan, ""
    step, *others = steps.values()
    if all(math.isclose(step, other) for other in others):
        return step, ""
    return math.nan, f"a preamble that states {' and '.join(steps)}"


def _number(text: str) -> tuple[float, str]:
    """A number, NaN if it can be read in two ways; and these, in words."""
    if plain(text) != text:
        return math.nan, f"a preamble with '{text}', which may be one number or two"
    try:
        reading = reading_of([[text]], "", commas=True)
    except InputError as error:
        return math.nan, f"a preamble with {error.found}"
    return float(values_of([text], reading)[0]), ""
