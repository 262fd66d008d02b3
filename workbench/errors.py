"""Errors that a user can mend, and those of an FMU."""

from collections.abc import Callable, Collection, Iterable
from difflib import get_close_matches
from functools import partial
from typing import Any

_LONGEST = 600  # characters of a part, some six lines of a terminal


class InputError(ValueError):
    """A user's mistake: where it is, what was found, what was expected, what to do.

    Parameters
    ----------
    where : file, and the line, column or key in it.
    found, expected : noun phrases without a full stop.
    remedy : what to do, an imperative without a full stop.

    Each part is one line of printable characters, and cut where it is longer than people read.
    """

    def __init__(self, *, where: str, found: str, expected: str, remedy: str) -> None:
        where, found, expected, remedy = map(one_line, (where, found, expected, remedy))
        super().__init__(f"{where}: found {found}; expected {expected}. To do: {remedy}.")
        self.where = where
        self.found = found
        self.expected = expected
        self.remedy = remedy

    def __reduce__(self) -> tuple[Any, ...]:
        # Pickle would call the class with the message alone and hang a pool of processes.
        parts = {key: getattr(self, key) for key in ("where", "found", "expected", "remedy")}
        return partial(type(self), **parts), ()


def one_line(text: str) -> str:
    """One line that a terminal shows as it is, whatever stood in a file."""
    cut = text if len(text) <= _LONGEST else f"{text[:_LONGEST]}... ({len(text)} characters)"
    return printable(cut)


def printable(text: str) -> str:
    """A line with the codes of characters that a terminal takes as commands."""
    return text if text.isprintable() else "".join(map(_printable, text))


def _printable(character: str) -> str:
    return character if character.isprintable() else ascii(character)[1:-1]


class FMUError(RuntimeError):
    """A call into an FMU failed; the message includes the log of the FMU."""


class WorkerError(RuntimeError):
    """A task ended the process that worked on it, twice, or took longer than it may."""


def unknown_name(
    name: str,
    known: Iterable[str],
    *,
    where: str,
    expected: str,
    found: str = "",
    remedy: str = "correct the name",
) -> InputError:
    """The error of a name that is none of those that are known; it says the nearest one.

    Parameters
    ----------
    found : in place of the name.

    Examples
    --------
    >>> error = unknown_name("leve", ["level"], where="system.toml", expected="a signal")
    >>> str(error)
    "system.toml: found 'leve' (closest: 'level'); expected a signal. To do: correct the name."
    """
    return InputError(
        where=where,
        found=(found or f"'{name}'") + closest(name, known),
        expected=expected,
        remedy=remedy,
    )


def require_known(
    names: Iterable[str],
    known: Collection[str],
    *,
    where: str | Callable[[str], str],
    found: str = "",
    expected: str = "one of {}",
    remedy: str = "correct the name",
) -> None:
    """Refuse the first name that is none of those that are known.

    Parameters
    ----------
    where : place, or what makes it of the name.
    found : in place of the name, which stands for `{}`.
    expected : the known names stand for `{}`.

    Raises
    ------
    InputError
        As of `unknown_name`.
    """
    for name in names:
        if name not in known:
            raise unknown_name(
                name,
                known,
                where=where if isinstance(where, str) else where(name),
                found=found.format(name),
                expected=expected.format(", ".join(known)),
                remedy=remedy,
            )


def closest(name: str, names: Iterable[str]) -> str:
    """Say which of `names` was probably meant, or nothing.

    Examples
    --------
    >>> closest("presure", ["time", "pressure"])
    " (closest: 'pressure')"
    >>> closest("torque", ["time", "pressure"])
    ''
    """
    folded = {other.casefold(): other for other in names}
    matches = get_close_matches(name.casefold(), folded, n=1)
    return f" (closest: '{folded[matches[0]]}')" if matches else ""
