"""Compares what was kept of two states."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, takewhile, zip_longest
from pathlib import Path

_WIDE = 160  # characters of a line that are shown
_PAGES = (".html",)


@dataclass(frozen=True)
class Difference:
    """Say what is not the same.

    Attributes
    ----------
    group : under which it is listed.
    name : of the file and line, or of the test.
    before, after : what differs first; empty where there is nothing.
    """

    group: str
    name: str
    before: str = ""
    after: str = ""

    def __str__(self) -> str:
        """Tell it in three lines at most."""
        lines = [f"  {self.name}"]
        for sign, text in (("-", self.before), ("+", self.after)):
            if text:
                lines.append(f"    {sign} {text[:_WIDE]}")
        return "\n".join(lines)


def compare(before: Path, after: Path, only: Sequence[str] = ()) -> list[Difference]:
    """Compare two folders of results, or some parts of them, or two files of refusals."""
    if before.is_dir() and after.is_dir():
        return list(_folders(before, after, only))
    return list(_refusals(before, after))


def listed(differences: list[Difference]) -> str:
    """List differences for people, by group."""
    lines = []
    ordered = sorted(differences, key=lambda difference: difference.group)
    for group, some in groupby(ordered, lambda difference: difference.group):
        members = list(some)
        lines += [f"{group}: {len(members)}", *map(str, members)]
    return "\n".join(lines)


def _folders(before: Path, after: Path, only: Sequence[str]) -> Iterator[Difference]:
    """Compare files by their lines; pages are a group of their own, as their words may change.

    A part that one of the folders lacks is a difference by itself.
    """
    parts, others = ({path.name for path in folder.iterdir()} for folder in (before, after))
    for part in only or sorted(parts | others):
        if part not in parts or part not in others:
            yield Difference("parts", f"{part}: not kept {'after' if part in parts else 'before'}")
            continue
        first, last = _files(before / part), _files(after / part)
        for name in sorted(first.keys() | last.keys()):
            group = "pages" if name.endswith(_PAGES) else part
            if name not in first or name not in last:
                yield Difference(group, f"{part}/{name}: {'gone' if name in first else 'new'}")
            elif first[name].read_bytes() != last[name].read_bytes():
                yield _first_line(group, f"{part}/{name}", first[name], last[name])


def _files(folder: Path) -> dict[str, Path]:
    return {str(path.relative_to(folder)): path for path in folder.rglob("*") if path.is_file()}


def _first_line(group: str, name: str, before: Path, after: Path) -> Difference:
    """Show the first line that differs, from a little before the place where it does."""
    texts = (path.read_text(encoding="utf-8").split("\n") for path in (before, after))
    pairs = enumerate(zip_longest(*texts, fillvalue=""), 1)
    number, (first, last) = next((number, pair) for number, pair in pairs if pair[0] != pair[1])
    alike = sum(
        1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(first, last, strict=False))
    )
    begin = max(alike - _WIDE // 4, 0)
    more = sum(first != last for _, (first, last) in pairs)
    place = f"{name}, line {number}" + (f" and {more} more" if more else "")
    return Difference(group, place, first[begin:], last[begin:])


def _refusals(before: Path, after: Path) -> Iterator[Difference]:
    """Compare what tests of the same name are refused; where files are does not count."""
    first, last = (json.loads(path.read_text(encoding="utf-8")) for path in (before, after))
    for test in sorted(first.keys() | last.keys()):
        was, now = (set(tests.get(test, {"refusals": []})["refusals"]) for tests in (first, last))
        gone, new = sorted(was - now), sorted(now - was)
        if gone and test not in last:
            yield Difference("refusals lost, with their test", test, gone[0])
            continue
        group = "changed" if gone and new else "lost" if gone else "gained"
        for text, other in zip_longest(gone, new, fillvalue=""):
            yield Difference(f"refusals {group}", test, text, other)
