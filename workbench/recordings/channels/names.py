"""Which channel a user says is which signal, and how alike their names are."""

import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from workbench.errors import InputError
from workbench.recordings.formats import FileChannel, Group, RecordedFile
from workbench.recordings.formats.spelling import name_and_unit, spell_unit
from workbench.system.system import System
from workbench.system.tables import Table, read_table

TIME = "time"
_TIME_WORDS = frozenset(
    "time t zeit timestamp zeitstempel datum date datetime uhrzeit temps tiempo tempo elapsed "  # noqa: SIM905
    "clock epoch unix tick ticks utc messzeit relativzeit reltime datenum doy yday jday jd mjd "
    "julian filetime gps hhmm hhmmss ts "
    "unixtime posixtime epochtime 日時 日付 日期 时间 時間 時刻".split()
)
# A value that is asked for is no measurement: words, and what tells within one, as in German.
_ASKED = frozenset(("set", "sp", "cmd", "req", "dmd", "ref", "reference"))
_ASKED_WITHIN = re.compile(
    "soll|vorgabe|anforderung|setpoint|demand|command|request|target|consigne"
)
_UMLAUTS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss"})
_LEAST = 4  # letters of a word that tells within another one: "druck" in "Bremsdruck"
_VALUE = r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"
_MISSING = re.compile(rf"(?P<channel>.*\S)\s+missing\s+(?P<values>none|{_VALUE}([,\s]+{_VALUE})*)")
EXACT, WORDS, WITHIN = 4, 3, 2  # how alike names are


@dataclass(frozen=True)
class NamedChannel:
    """A channel that a user names."""

    channel: str  # its name, or "GROUP/NAME" where several groups have it
    unit: str = ""  # what its values are in, whatever the file says; empty: as the file says
    reversed: bool = False  # whether its sign is the other one
    # values that stand for no sample; None: as is usual, and asked where one may be
    missing: tuple[float, ...] | None = None

    def to_dict(self) -> dict[str, str | bool | list[float]]:
        """Entries of a TOML table."""
        return {
            "channel": self.channel,
            **({"unit": self.unit} if self.unit else {}),
            **({"reversed": True} if self.reversed else {}),
            **({"missing": list(self.missing)} if self.missing is not None else {}),
        }


def read_named(table: Table, system: System) -> dict[str, NamedChannel]:
    """Channels by signal, as a table of TOML has them: a name, or a table."""
    table.refuse_unknown((TIME, *system.signals))
    channels: dict[str, NamedChannel] = {}
    for signal, entry in table.content.items():
        if isinstance(entry, str):
            channels[signal] = NamedChannel(table.take(signal, str))
            continue
        table.take(signal, dict)
        own = table.table(signal)
        own.refuse_unknown("channel unit reversed missing")
        unit = spell_unit(own.text("unit", ""))
        other = "reversed" in own and own.take("reversed", bool)
        markers = own.take("missing", list) if "missing" in own else None
        if not all(type(value) in (int, float) for value in markers or ()):
            raise own.wrong("missing", "a list of numbers, as the file has them, such as [-9999]")
        missing = None if markers is None else tuple(map(float, markers))
        channels[signal] = NamedChannel(own.take("channel", str), unit, other, missing)
    return channels


def parse_named(text: str, where: str, signals: Collection[str]) -> tuple[str, NamedChannel]:
    """One entry as people type it: `SIGNAL=CHANNEL`, `SIGNAL=-CHANNEL [unit]`.

    Values that stand for no sample follow it: `SIGNAL=CHANNEL [unit] missing -9999, 7999`, or none.
    """
    signal, equals, channel = (part.strip() for part in text.partition("="))
    if not equals or not channel.lstrip("-") or signal not in (TIME, *signals):
        raise InputError(
            where=where,
            found=repr(text),
            expected=f"SIGNAL=CHANNEL or SIGNAL=CHANNEL [unit], of {TIME}, {', '.join(signals)}",
            remedy="write for instance 'time=Zeit [ms]'; a minus before the channel reverses it",
        )
    own, missing = channel, None
    if match := _MISSING.fullmatch(channel):
        own, values = match["channel"], re.split(r"[,\s]+", match["values"].strip())
        missing = () if values == ["none"] else tuple(map(float, values))
    name, unit = name_and_unit(own.removeprefix("-").strip())
    return signal, NamedChannel(name, unit, channel.startswith("-"), missing)


def words(name: str) -> tuple[str, ...]:
    """The words of a name, however they are run together.

    >>> words("Brems-Druck_2"), words("rollSpeed"), words("n Rolle (gefiltert)")
    (('brems', 'druck', '2'), ('roll', 'speed'), ('n', 'rolle', 'gefiltert'))
    """
    separated = re.sub(r"([a-zäöüß])([A-ZÄÖÜ])", r"\1 \2", name)
    folded = separated.casefold().translate(_UMLAUTS)
    return tuple(re.findall(r"[^\W\d_]+|\d+", folded))


def is_time(name: str) -> bool:
    """Whether a name is one of time."""
    return bool(_TIME_WORDS.intersection(words(name)))


def is_asked(name: str) -> bool:
    """Whether a name is one of a value that is asked for, not measured."""
    own = words(name)
    return bool(_ASKED.intersection(own)) or any(map(_ASKED_WITHIN.search, own))


def likeness_to(channel: str, about: str, known: Sequence[str]) -> int:
    """How alike a channel's name is to those of a signal: EXACT, WORDS, WITHIN, or 0."""
    own = words(channel)
    best = 0
    for name in known:
        theirs = words(name)
        if channel.strip() == name or (theirs and own == theirs):
            return EXACT
        if theirs and set(theirs) <= {*own, *words(about)}:
            best = max(best, WORDS)
        joined = "".join(theirs)
        if len(joined) >= _LEAST and joined in "".join(own):
            best = max(best, WITHIN)
    return best


def listed(names: Sequence[str], most: int = 12) -> str:
    """Names for a message, not more than people read."""
    left = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + left


COLUMNS = "columns.toml"  # which channels are which signals, in all files of a folder


@dataclass(frozen=True)
class RecordingOptions:
    """What a user says of a recording that its file does not say."""

    conditions: Mapping[str, Any] = field(default_factory=dict)  # as `case.toml` has them
    columns: Mapping[str, NamedChannel] = field(default_factory=dict)  # channels by signal
    step: float | None = None  # between two samples [s]
    # whether sheets or groups with the same channels are recordings of their own, whatever their
    # times; None: if their times tell; False: they are one recording
    apart: bool | None = None


def stored_columns(folder: Path, system: System) -> dict[str, NamedChannel]:
    """Channels by signal that were confirmed for a folder; empty where none were."""
    path = folder / COLUMNS
    if not path.is_file():
        return {}
    table = read_table(path, "correct the file", "[columns]")
    table.refuse_unknown("columns")
    return read_named(table.table("columns"), system)


@dataclass(frozen=True, eq=False)
class PlacedChannel:
    """Where a channel stands, counted from 0, and a name that no other channel has."""

    file: int
    group: int
    holder: Group
    channel: FileChannel
    label: str

    @property
    def full(self) -> str:
        """Name with that of its group, whether or not others have the same."""
        return f"{self.holder.name}/{self.channel.name}"


def placed_channels(files: Sequence[RecordedFile]) -> Iterator[PlacedChannel]:
    """All channels with their places.

    Of namesakes, those of a group alone have its name before theirs; others are counted, `h#2`.
    """
    counts = Counter(c.name for file in files for group in file.groups for c in group.channels)
    for i, file in enumerate(files):
        for j, group in enumerate(file.groups):
            own = Counter(channel.name for channel in group.channels)
            before = Counter[str]()
            for channel in group.channels:
                before[channel.name] += 1
                label = channel.name
                if counts[label] > own[label]:
                    label = f"{group.name}/{label}"
                if own[channel.name] > 1:
                    label = f"{label}#{before[channel.name]}"
                yield PlacedChannel(i, j, group, channel, label)


def usable(
    stored: Mapping[str, NamedChannel], files: Sequence[RecordedFile]
) -> dict[str, NamedChannel]:
    """Of stored channels those that some files have, in no other unit than what was confirmed."""
    units: dict[str, str] = {}
    for place in placed_channels(files):
        unit = "" if place.channel.stamp else place.channel.unit
        units |= dict.fromkeys((place.channel.name, place.full, place.label), unit)
    units |= {text.name: "" for file in files for group in file.groups for text in group.left}
    return {
        signal: assignment
        for signal, assignment in stored.items()
        if assignment.channel in units
        and (
            not assignment.unit
            or not units[assignment.channel]
            or assignment.unit == units[assignment.channel]
        )
    }
