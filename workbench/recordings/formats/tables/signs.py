"""Columns that hold the signs of another one, by their names and what stands in them."""

import re
from collections.abc import Iterator, Sequence

from workbench.recordings.formats.numbers import is_number
from workbench.recordings.formats.tables.cells import Label, is_clock, mostly

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


def signs_beside(
    labels: Sequence[Label], columns: Sequence[Sequence[str]]
) -> Iterator[tuple[int, int, list[str]]]:
    """Columns of signs, the column of numbers that each is of, and the signs; none: in doubt."""
    numeric = [
        mostly(cells, is_number) and not is_clock(labels[k], cells)
        for k, cells in enumerate(columns)
    ]
    for i, (name, _) in enumerate(labels):
        match = _SIGN_NAME.fullmatch(name)
        if match is None and numeric[i]:
            continue  # as nearly all are
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
