"""Numbers as people and recorders write them: decimal points or commas, marks between thousands."""

import math
import re
from collections.abc import Callable, Sequence
from itertools import islice

import numpy as np

from workbench.arrays import Vector
from workbench.errors import InputError

# What recorders write where there is no number: nothing, words, an overload, dashes.
_MISSING = re.compile(
    r"|nan|na|n/a|n\.a\.|n\.d\.|<na>|#n/a|#nv|#value!|#div/0!|#bezug!|#ref!|null|none|[+-]?inf(inity)?"
    r"|-?1\.#(inf|qnan|ind)\w*|[+-]?(ol|ovl|over|overload|overrange|overflow|underrange)|burnout"
    r"|0\.?l|no ?data|invalid|bad|err|error|fault|open|-+|\*+|#+|\?+|_+",
    re.IGNORECASE,
)
_CENSORED = re.compile(r"[<>\u2264\u2265]=?\s*[+-]?[\d.,]+([eE][+-]?\d+)?")
# A negative number of bookkeeping, in brackets or with its sign behind it; and what looks like one
# number, whatever it means: figures with no more than one letter.
_NEGATIVE = re.compile(r"\(([\d.,]*\d[\d.,]*)\)|(\d[\d.,]*)-")
_LIKE_NUMBER = re.compile(r"[^A-Za-z]*\d[^A-Za-z]*[A-Za-z]?[^A-Za-z]*")
_SIGN_APART = re.compile(r"([+-])[ \u00a0]+(?=[\d.,])")
_NUMBER = re.compile(r"[+-]?[0-9.,]*[0-9][0-9.,]*([eE][+-]?[0-9]+)?")
_GROUPED = re.compile(r"[+-]?\d{1,3}([ \u00a0\u202f'\u2019]\d{3})+([.,]\d+)?")
_SPACES = re.compile(r"[ \u00a0\u202f'\u2019]")
_SET = re.compile("[ \u00a0\u202f'\u2019\u2212(]")
_EXPONENT = r"([eE][+-]?\d+)?"
_POINT, _COMMA = "decimal points", "decimal commas"
_THOUSANDS_POINT = "decimal commas, points between thousands"
_THOUSANDS_COMMA = "decimal points, commas between thousands"
# Ways to read a number, and what takes it to a text of Python.
_READINGS: dict[str, tuple[re.Pattern[str], Callable[[str], str]]] = {
    _POINT: (re.compile(rf"[+-]?(\d+\.?\d*|\.\d+){_EXPONENT}"), str),
    _COMMA: (re.compile(rf"[+-]?(\d+,?\d*|,\d+){_EXPONENT}"), lambda text: text.replace(",", ".")),
    _THOUSANDS_POINT: (
        re.compile(rf"[+-]?(\d+|[1-9]\d{{0,2}}(\.\d{{3}})+)(,\d*)?{_EXPONENT}"),
        lambda text: text.replace(".", "").replace(",", "."),
    ),
    _THOUSANDS_COMMA: (
        re.compile(rf"[+-]?(\d+|[1-9]\d{{0,2}}(,\d{{3}})+)(\.\d*)?{_EXPONENT}"),
        lambda text: text.replace(",", ""),
    ),
}
# What recorders write in place of a sample, whatever its sign; and how far outside of others, in
# widths of these, a marker stands, and a value that may be one.
_MARKERS = frozenset(
    (6999.0, 7999.0, 9999.0, 9999.9, 9999.99, 99999.0, 999999.0, 9999999.0, 32767.0, 32768.0)
) | frozenset(
    (65535.0, 3276.7, 3276.8, 6553.5, 2147483647.0, 2147483648.0, 4294967295.0, 9.9e37, 9.91e37)
)
_LARGE = 1e30, 3.5e38  # from which on single precision holds no samples, to its largest number
_MAYBE = frozenset((99.0, 99.9, 99.99, 888.0, 888.8, 8888.0, 999.0, 999.9, 999.99, 327.67, 1e10))
_FEWEST, _RARE, _FAR, _FARTHER = 5, 0.02, 3.0, 100.0
_AGAIN = 3
_LARGEST = 1e100  # no measurement comes near


def markers(values: Vector) -> tuple[dict[float, int], dict[float, int]]:
    """Values that stand alone far outside of all others, and how often: known markers, and others.

    Known are those that recorders write where they have no sample; others are rare, and come more
    than once, one or two samples at a time, or stand a hundred widths of all others apart. Of those
    that come three times and more, one width is far: noise does not hit one number again.
    """
    known: dict[float, int] = {}
    others: dict[float, int] = {}
    left = values[np.isfinite(values)]
    sizes = np.abs(left)
    coded = np.isin(sizes, list(_MARKERS)) | ((sizes >= _LARGE[0]) & (sizes <= _LARGE[1]))
    samples = left[~coded]
    if samples.size > _FEWEST and _is_varied(samples):
        for value in np.unique(left[coded]):  # beside each other they are no range
            if _distance(float(value), samples) > _FAR:
                known[float(value)] = int((left == value).sum())
        left = left[~np.isin(left, list(known))]
    while left.size > _FEWEST:
        for extreme in (float(left.max()), float(left.min())):
            within = left[left != extreme]
            if not _is_varied(within):
                continue
            distance, at = _distance(extreme, within), left == extreme
            count = left.size - within.size
            # Far outside of all others, or out and back at once, as no machine moves.
            rare = count <= max(1.0, _RARE * left.size)
            alone = distance > _FARTHER or not (at[1:-1] & at[2:] & at[:-2]).any()
            again = rare and count >= _AGAIN and not (at[1:] & at[:-1]).any()
            if distance > (1.0 if again else _FAR) and (
                abs(extreme) in _MAYBE
                or (rare and alone and count > 1)
                or (rare and distance > _FARTHER)
            ):
                others[extreme] = count
                left = within
                break
        else:
            break
    return known, others


def _is_varied(values: Vector) -> bool:
    """Whether values are no steps between a few."""
    return np.unique(values[: 100 * _FEWEST]).size >= _FEWEST


def _distance(value: float, others: Vector) -> float:
    """How far a value is from all others, in widths of these."""
    return float(np.abs(others - value).min()) / float(np.ptp(others) or 1.0)


def is_number(cell: str) -> bool:
    """Whether a cell is a number, in whatever way it is to be read."""
    return _NUMBER.fullmatch(plain(cell)) is not None


def is_missing(cell: str) -> bool:
    """Whether a cell says that there is no number."""
    return _MISSING.fullmatch(cell.strip()) is not None


def is_censored(cell: str) -> bool:
    """Whether a cell says only that a value is below or above another: <0.01."""
    return _CENSORED.fullmatch(cell.strip()) is not None


def is_like_number(cell: str) -> bool:
    """Whether a cell that is no number looks like one: 1500m, 1.2.3."""
    return _LIKE_NUMBER.fullmatch(cell.strip()) is not None


def all_plain(cells: list[str]) -> list[str]:
    """Cells without signs of type setting, which most columns have none of."""
    is_set = _SET.search("".join(cells)) or any(cell[-1:] == "-" for cell in cells)
    return [plain(cell) for cell in cells] if is_set else cells


def plain(cell: str) -> str:
    """A cell without signs of type setting."""
    text = cell.replace("\u2212", "-") if "\u2212" in cell else cell
    if text[-1:] in ("-", ")"):
        text = _NEGATIVE.sub(r"-\1\2", text) if _NEGATIVE.fullmatch(text) else text
    text = _SIGN_APART.sub(r"\1", text, count=1) if text[:1] in "+-" else text
    return _SPACES.sub("", text) if _GROUPED.fullmatch(text) else text


def reading_of(columns: Sequence[Sequence[str]], where: str, *, commas: bool) -> str:
    """The one way in which all numbers can be read."""
    marks = frozenset().union(*("".join(cells) for cells in columns)) & {",", "."}
    if not commas or not marks:
        return _POINT
    cells = (cell for column in columns for cell in column if "," in cell or "." in cell)
    if len(marks) == 1:
        usual, other = (_POINT, _THOUSANDS_POINT) if "." in marks else (_COMMA, _THOUSANDS_COMMA)
        # The first number that no mark between thousands explains decides: mostly the first at all.
        other_marks = set(islice(cells, 1)) if _all_fit(columns, other) else set()
        different = [usual, other] if other_marks else [usual]
    else:
        other_marks = {cell for cell in cells if _NUMBER.fullmatch(cell)}
        ways = {
            name: tuple(float(python(cell)) for cell in sorted(other_marks))
            for name, (pattern, python) in _READINGS.items()
            if all(map(pattern.fullmatch, other_marks))
        }
        different = list({values: name for name, values in reversed(ways.items())}.values())
    if len(different) == 1:
        return different[0]
    example = min(other_marks, key=len)
    raise InputError(
        where=where,
        found=f"numbers such as '{example}', which can be read with {' or with '.join(different)}"
        if different
        else "numbers with decimal points and others with decimal commas",
        expected="one decimal mark, and a number that tells it from one between thousands",
        remedy="export the recording again, with more decimals and no marks between thousands"
        + f"; or write this number as '{example}0', if its mark is that of decimals"
        * (len(different) == 2 and len(marks) == 1),
    )


def _all_fit(columns: Sequence[Sequence[str]], reading: str) -> bool:
    """Whether all numbers with a mark can be read so; ends at the first that cannot."""
    pattern, _ = _READINGS[reading]
    return all(
        pattern.fullmatch(cell)
        for column in columns
        for cell in column
        if ("," in cell or "." in cell) and _NUMBER.fullmatch(cell)
    )


def values_of(cells: Sequence[str], reading: str) -> Vector:
    """Numbers of a column, (n,); NaN where there is none."""
    pattern, python = _READINGS[reading]
    as_python = reading == _POINT
    try:  # nearly always all are numbers, and Python's own reader is the fastest
        values = np.array([float(cell if as_python else python(cell)) for cell in cells])
    except ValueError:
        values = np.array(
            [float(python(cell)) if pattern.fullmatch(cell) else math.nan for cell in cells]
        )
    return np.where(np.abs(values) < _LARGEST, values, np.nan)
