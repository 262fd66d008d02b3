"""What a command says: its result on standard output, everything else on standard error."""

import json
import math
import os
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from workbench.errors import InputError, printable
from workbench.runtime.files import end_copy


@dataclass(frozen=True)
class CommandResult:
    """How a command ended."""

    # that --json prints; also the values that stand in its files
    result: Mapping[str, Any] = field(default_factory=dict)
    # by key of `result`, at any depth; of keys without one it is 1
    units: Mapping[str, str] = field(default_factory=dict)
    status: int = 0  # of the process
    page: Path | None = None  # that shows it; None without


@dataclass(frozen=True)
class Output:
    """Standard output for results, standard error for progress."""

    json: bool  # whether standard output takes one JSON document, and nothing else
    quiet: bool  # whether progress is not printed
    # of the command, by `time.perf_counter` [s]
    begin: float = field(default_factory=time.perf_counter)

    def result(self, text: str) -> None:
        """Print a result for people."""
        if not self.json:
            _print(_shown(text))

    def progress(self, line: str) -> None:
        """Print a line of progress."""
        end_copy()
        if not self.quiet:
            print(_shown(line), file=sys.stderr, flush=True)

    def stage(self, line: str) -> None:
        """Print a line of progress, with the time since the command began."""
        self.progress(f"{time.perf_counter() - self.begin:6.1f} s  {line}")

    def step(self, done: int, total: int, name: str, begin: float) -> None:
        """Print that a step is done since `begin`, of how many, and the time left."""
        elapsed = time.perf_counter() - begin
        left = elapsed / done * (total - done)
        self.progress(f"[{done:>3}/{total}] {name:<28} {elapsed:5.1f} s, about {left:.0f} s left")

    def close(self, command: str, result: CommandResult) -> int:
        """Print the document, if it is asked for; returns the status."""
        if self.json:
            content = {"units": result.units, "result": result.result}
            _print(_document(command, result.status, content))
        return result.status

    def fail(self, command: str, status: int, error: Exception | str) -> int:
        """Print an error to standard error and into the document; returns the status."""
        end_copy()
        with suppress(OSError, ValueError):  # which is full, or closed
            message = error if isinstance(error, str) else f"error: {error}"
            print(_shown(message), file=sys.stderr)
        if self.json:
            parts = ("where", "found", "expected", "remedy")
            known = isinstance(error, InputError)
            content = {part: getattr(error, part) for part in parts} if known else {}
            with suppress(OSError):  # that standard output takes no more is told already
                _print(_document(command, status, {"error": {"message": str(error), **content}}))
        return status


def warn(message: object) -> None:
    """Print a warning."""
    print(_shown(f"warning: {message}"), file=sys.stderr, flush=True)


def _shown(text: str) -> str:
    """Lines without commands for a terminal, which names of files and channels may hold."""
    return "\n".join(map(printable, text.split("\n")))


def _document(command: str, status: int, content: Mapping[str, Any]) -> str:
    content = _plain({"command": command, "status": status, **content})
    return json.dumps(content, indent=2, allow_nan=False)


def _print(text: str) -> None:
    """Print to whoever reads; one that has gone, as `head` does, costs nothing but the text."""
    end_copy()
    if sys.stdout is None:
        raise OSError("standard output is closed, so that no result can be printed")
    encoding = sys.stdout.encoding or "utf-8"  # which may lack characters of names
    try:
        print(text.encode(encoding, "backslashreplace").decode(encoding), flush=True)
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            raise OSError(f"standard output takes no more ({error.strerror})") from None


def read_result(path: Path) -> dict[str, Any]:
    """The content of a JSON file that a command has written, so that both say the same."""
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return content


def _plain(value: Any) -> Any:
    """The same without what JSON lacks: paths are text, and what is no number is null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value
