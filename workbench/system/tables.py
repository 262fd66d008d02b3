"""Tables of TOML files as users write them: each entry is of its kind, and nothing is unknown."""

import re
import tomllib
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeVar

from workbench.errors import InputError, require_known, unknown_name
from workbench.runtime.files import read_text
from workbench.system.units import quantity

_T = TypeVar("_T")
LARGEST = 1e300  # of plain numbers; leaves room for sums and products
_KINDS = {
    str: "a text",
    int: "a whole number",
    dict: "a table",
    list: "a list",
    bool: "true or false",
}


class Table:
    """One table of a file; what is taken from it is checked, and what is left is refused.

    Parameters
    ----------
    content : as TOML has it.
    file : for the message of an error.
    header : of the table in the file, such as `[outputs.h]`; empty for the file itself.
    """

    def __init__(self, content: Mapping[str, Any], file: str, header: str = "") -> None:
        self.content = content
        self.where = f"{file}, {header}" if header else file
        self._file, self._header = file, header

    def __contains__(self, key: str) -> bool:
        return key in self.content

    def take(self, key: str, type_: type[_T]) -> _T:
        """An entry that must be there, of this very type and no empty text."""
        if key not in self.content:
            raise unknown_name(
                key,
                self.content,
                where=self.where,
                found=f"no '{key}'",
                expected=f"{_KINDS[type_]} '{key}'",
                remedy=f"add '{key}'",
            )
        value = self.content[key]
        if type(value) is not type_ or value == "":  # `type`, because true is an int
            raise self.wrong(key, _KINDS[type_])
        has_zero = isinstance(value, str) and "\0" in value
        if has_zero:  # no name of a file, or of anything else
            raise self.wrong(key, "a text without zero characters")
        return value

    def text(self, key: str, default: str) -> str:
        """A text, or the default where there is none."""
        return self.take(key, str) if key in self.content else default

    def table(self, key: str) -> "Table":
        """A table within; empty where there is none."""
        content = self.take(key, dict) if key in self.content else {}
        if self._header.endswith("]"):
            return Table(content, self._file, f"{self._header[:-1]}.{_bare(key)}]")
        header = f"{self._header} {key}" if self._header else f"[{_bare(key)}]"
        return Table(content, self._file, header)

    def place(self, key: str) -> str:
        """Where an entry stands, for the message of an error."""
        return f"{self.where} {key}"

    def date(self, key: str) -> str:
        """A date or time in a form whose order is that of time; empty where there is none."""
        if key not in self:
            return ""
        try:
            known = datetime.fromisoformat(self.take(key, str))
            stamp = (known if known.tzinfo is None else known.astimezone(UTC)).isoformat()
        except (ValueError, OverflowError):
            raise self.wrong(key, 'a date as of ISO 8601, such as "2026-01-31"') from None
        return stamp.removesuffix("T00:00:00")

    def tables(self, key: str) -> list["Table"]:
        """A list of tables within; a table alone is a list of one."""
        alone = isinstance(self.content.get(key), dict)
        items = (
            [self.take(key, dict)] if alone else self.take(key, list) if key in self.content else []
        )
        if not all(isinstance(item, dict) for item in items):
            raise self.wrong(key, "a list of tables")
        name = f"{self._header[1:-1]}.{key}" if self._header else key
        return [Table(item, self._file, f"[[{name}]] {i + 1}") for i, item in enumerate(items)]

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of texts; empty where there is none."""
        items = self.take(key, list) if key in self.content else []
        if not all(isinstance(item, str) and item for item in items):
            raise self.wrong(key, "a list of texts")
        return tuple(items)

    def number(self, key: str, unit: str, default: float | None = None) -> float:
        """A quantity such as "4.2 bar" in SI `unit`; a plain number where the unit is 1.

        Raises
        ------
        InputError
            If it is missing without a default, no number, or of another dimension.
        """
        if key not in self.content and default is not None:
            return default
        return self.quantity(key, self.content.get(key), unit)

    def numbers(self, key: str, unit: str, count: int) -> tuple[float, ...]:
        """A list of quantities; see `number`."""
        items = self.take(key, list)
        if len(items) != count:
            raise self.wrong(key, f"{count} numbers")
        return tuple(self.quantity(key, item, unit) for item in items)

    def quantity(self, key: str, value: object, unit: str) -> float:
        """A value of an entry, or one of several, in SI `unit`; see `number`."""
        if isinstance(value, str):
            return quantity(value, unit, self.place(key))
        if value is None:
            raise unknown_name(
                key,
                self.content,
                where=self.where,
                found=f"no '{key}'",
                expected=f"a number '{key}' in [{unit}]",
                remedy=f"add '{key}'",
            )
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.wrong(key, f"a number in [{unit}]")
        if not abs(value) < LARGEST:  # refuses NaN, too
            raise self.wrong(key, "a finite number")
        if unit != "1":
            raise self.wrong(key, f"a text with a unit, such as '{value} {unit}'")
        return float(value)

    def wrong(self, key: str, expected: str, remedy: str = "correct the value") -> InputError:
        """The error of an entry that is not as expected."""
        found = shown(self.content.get(key))
        return InputError(where=self.place(key), found=found, expected=expected, remedy=remedy)

    def refuse_unknown(self, keys: str | Iterable[str]) -> None:
        """Refuse what nobody reads, which is a mistake in writing."""
        known = tuple(keys.split()) if isinstance(keys, str) else tuple(keys)
        require_known(
            self.content,
            known,
            where=self.where,
            found="unknown key '{}'",
            expected="only {}",
            remedy="correct or remove the key",
        )


def _bare(key: str) -> str:
    """A key as a header of TOML has it."""
    return key if re.fullmatch("[A-Za-z0-9_-]+", key) else f'"{key}"'


def shown(value: object) -> str:
    """A value of a file, for the message of an error."""
    try:
        return repr(value)
    except (ValueError, RecursionError):
        return "a number of thousands of digits, or thousands of tables within each other"


def read_table(path: Path, remedy: str, example: str) -> Table:
    """Read a TOML file.

    Parameters
    ----------
    remedy : what to do if it cannot be read.
    example : of its lines, for the message of an error.
    """
    text = read_text(path, remedy)
    try:
        return Table(tomllib.loads(text), str(path))
    except (ValueError, RecursionError) as error:
        # TOMLDecodeError, a number too long to convert, or brackets within brackets without end.
        place = re.search(r"line (\d+)", str(error))
        # Where a number, or a list within lists, is too long to be read, is most likely so.
        lines = text.split("\n")
        line = int(place[1]) if place else lines.index(max(lines, key=len)) + 1
        raise InputError(
            where=f"{path}, line {line}",
            found=f"text that is no TOML ({error})",
            expected=f"lines such as {example}",
            remedy="correct the line",
        ) from None
