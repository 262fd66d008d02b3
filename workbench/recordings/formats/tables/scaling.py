"""Lines that say that samples are not as named: factors, offsets, other units."""

import re
from collections.abc import Mapping, Sequence

from workbench.errors import InputError
from workbench.recordings.formats.numbers import is_number
from workbench.recordings.formats.spelling import conversion, name_and_unit, spell_unit
from workbench.recordings.formats.tables.cells import Cells, are_units
from workbench.recordings.formats.tables.preamble import OTHERS

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
_NEAR = 4  # words behind a name that may say its unit: h changed to cm
_OF_A_SCREEN = re.compile("horizontal|vertical", re.IGNORECASE)  # of an oscilloscope
# Powers of ten, as x2 is the name of a state.
_FACTOR = re.compile(r"[x\u00d7*]\s?(10*|0[.,]0*1|10\^[+-]?\d+)|10\^[+-]?\d+")
_ONE, _NOTHING = (
    re.compile(r"\+?1([.,]0*)?([eE][+-]?0+)?|10\^0"),
    re.compile(r"[+-]?0([.,]0*)?([eE].*)?"),
)


def refuse_units_within(table: Cells, rows: Mapping[int, Sequence[str]], where: str) -> None:
    """Refuse a row of other units among samples, and a line that says that their units change.

    Parameters
    ----------
    rows : by line, those of the file.
    """
    samples = set(table.lines)
    lines = [n for n in range(table.lines[0], table.lines[-1]) if n not in samples and n in rows]
    names, units = zip(*table.labels, strict=True)
    for line in lines:
        row = [spell_unit(cell) for cell in rows[line]]
        pairs = zip(row, units, strict=True) if len(row) == len(units) and are_units(row) else ()
        if others := [
            f"[{own}] below [{above}]" for own, above in pairs if own and above and own != above
        ]:
            raise InputError(
                where=f"{where}, line {line}",
                found=f"a row of other units among samples, {', '.join(others)}",
                expected="samples in the units that stand above them",
                remedy="part the file there, and write the names above the units",
            )
    for line in lines:
        for name, text in zip(names, remarks(table, [rows[line]]), strict=True):
            if text:
                raise InputError(
                    where=f"{where}, line {line}",
                    found=f"'{text}' among samples, which says what '{name}' is there",
                    expected="samples in the units that stand above them",
                    remedy="part the file there if its units or its range change, or delete the "
                    "line",
                )


def remarks(table: Cells, above: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Of each column the line above samples that says that its values are not as named; or ""."""
    named = {name_and_unit(cell)[0] for cell in table.names}
    texts = [
        " ".join(filter(None, (cell.strip() for cell in row)))
        for row in above  # but names above columns
        if 2 * sum(name_and_unit(cell)[0] in named for cell in row) <= len(named)
    ]
    return tuple(
        next((text for text in texts if _is_of_column(text, name, unit)), "")
        for name, unit in table.labels
    )


def _is_of_column(text: str, name: str, unit: str) -> bool:
    """Whether a line says that values of a column are not as named."""
    word = re.compile(rf"(?<!\w){re.escape(name)}(?!\w)")
    if not word.search(text) and (not _ALL_SAMPLES.search(text) or OTHERS.search(text)):
        return False
    _, *behind = word.split(text, maxsplit=1)
    return _has_factor(word.sub("", text)) or _has_other_unit("".join(behind), unit)


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


def refuse_scales(
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
