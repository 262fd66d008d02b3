"""Texts and files in which something else stands; what is replaced must be there."""

from collections.abc import Callable
from pathlib import Path


def replaced(text: str, *changes: tuple[str, str], count: int = 1) -> str:
    """A text with new words for old ones, `count` times each; -1: everywhere."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, count)
    return text


def edit(path: Path, *changes: tuple[str, str], count: int = -1) -> Path:
    """Write new words for old ones into a file."""
    path.write_text(replaced(path.read_text(), *changes, count=count))
    return path


def edits(file: str, *changes: tuple[str, str], count: int = -1) -> Callable[[Path], None]:
    """What writes new words for old ones into a file of a folder."""

    def change(folder: Path) -> None:
        edit(folder / file, *changes, count=count)

    return change
