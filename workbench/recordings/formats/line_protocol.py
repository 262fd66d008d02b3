"""Line protocol of InfluxDB: measurement and tags, fields, and a time since 1970 in each line.

Source: InfluxData, Line protocol reference (documentation of InfluxDB OSS v2).
"""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from workbench.errors import InputError
from workbench.recordings.formats.contents import Contents
from workbench.recordings.formats.tables.cells import Cells
from workbench.recordings.formats.tables.groups import read_group

_KEY = r"(?:[^,= \\]|\\.)+"
_FIELD = rf'{_KEY}=(?:"(?:[^"\\]|\\.)*"|[^, "]+)'
_LINE = re.compile(
    rf"(?P<series>(?:[^, \\]|\\.)+(?:,{_KEY}={_KEY})*) +(?P<fields>{_FIELD}(?:,{_FIELD})*)"
    r" +(?P<time>-?\d+)\s*"
)
_SPLIT = re.compile(rf'({_KEY})=("(?:[^"\\]|\\.)*"|[^, "]+)')
_LOOKED_AT = 5  # lines, of which each must be one


def is_line_protocol(raw: bytes) -> bool:
    """Whether the first lines of a file are such."""
    text = raw[:20_000].decode("utf-8", "replace")
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    whole = lines[:-1] if len(raw) > len(text) else lines
    return len(whole) > 1 and all(map(_LINE.fullmatch, whole[:_LOOKED_AT]))


def read(path: Path, raw: bytes) -> Contents:
    """Kind, groups and notes of a file, with a group for each measurement with its tags.

    Raises
    ------
    InputError
        If a line is none of the protocol.
    """
    series: dict[str, list[tuple[int, dict[str, str]]]] = {}
    for number, line in enumerate(raw.decode("utf-8-sig", "replace").splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        match = _LINE.fullmatch(line.strip())
        if match is None:
            raise InputError(
                where=f"{path}, line {number}",
                found=f"'{line[:60]}', which is no line of InfluxDB's protocol with a time",
                expected="a measurement with tags, fields, and a time, as 'tank,site=a h=1.2 "
                "1709330400000000000'",
                remedy="export it again, or as CSV",
            )
        name = _plain(match["series"])
        fields = {key if key != "value" else name: own for key, own in _fields(match["fields"])}
        series.setdefault(name, []).append((number, {"time": match["time"], **fields}))
    groups, notes = [], []
    for name, records in series.items():
        names = list(dict.fromkeys(key for _, record in records for key in record))
        rows = [[record.get(key, "") for key in names] for _, record in records]
        cells = replace(Cells.named(names, rows), lines=[number for number, _ in records])
        group, _, own = read_group(cells, name, str(path))
        groups.append(group)
        notes += own
    return Contents("line protocol of InfluxDB", groups, notes)


def _fields(text: str) -> Iterator[tuple[str, str]]:
    """Names and values; whole numbers end in i or u, and texts are in quotation marks."""
    for name, value in _SPLIT.findall(text):
        number = re.fullmatch(r"(-?\d+)[iu]", value)
        yield _plain(name), number[1] if number else value.strip('"')


def _plain(text: str) -> str:
    return re.sub(r"\\(.)", r"\1", text)
