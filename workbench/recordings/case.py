"""Stage 1: a recording, its conditions and its units become a `Case` in SI units."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.errors import InputError
from workbench.recordings.channels import (
    RecordingOptions,
    has_own_names,
    read_measured,
    read_named,
    stored_columns,
)
from workbench.recordings.csv import read_columns
from workbench.recordings.formats import is_other_format
from workbench.recordings.formats.numbers import markers
from workbench.recordings.plausibility import Origin, doubts, shown_by
from workbench.system.parts import Condition
from workbench.system.system import System
from workbench.system.tables import Table, read_table, shown
from workbench.system.units import quantity, si_factor

Value = float | int | str | tuple[Any, ...]
UNKNOWN = "unknown"  # a condition that nobody knows any more


def read_conditions(table: Table, system: System) -> dict[str, Value]:
    """Conditions of a recording, as the system declares them.

    What nobody knows any more is written as "unknown", and is UNKNOWN then; what sets a parameter
    of the model may be missing, and is so then.

    Raises
    ------
    InputError
        If one is missing, none of the system, or none of its choices; or the sign of the signals
        is unknown.
    """
    table.refuse_unknown(condition.name for condition in system.conditions)
    signs = [
        f"'{condition.name}' holds the sign" for condition in system.conditions if condition.sign
    ]
    remedy = "; ".join(["give the magnitude", *signs])
    stated = [
        condition
        for condition in system.conditions
        if condition.name in table or not condition.sets
    ]
    return {condition.name: _condition(table, condition, remedy) for condition in stated}


def _condition(table: Table, condition: Condition, remedy: str) -> Value:
    """One condition; `remedy` for a quantity that is too small."""
    if table.content.get(condition.name) == UNKNOWN and not condition.sign:
        return UNKNOWN
    if condition.count:
        items = table.take(condition.name, list)
        if len(items) != condition.count:
            raise InputError(
                where=f"{table.where} {condition.name}",
                found=f"{len(items)} entries",
                expected=str(condition.count),
                remedy=f"write one of {_either(condition)} for each",
            )
        return tuple(
            _choice(condition, item, f"{table.where} {condition.name}[{i}]")
            for i, item in enumerate(items)
        )
    if condition.choices:
        value: object = table.take(condition.name, type(condition.choices[0]))
        return _choice(condition, value, f"{table.where} {condition.name}")
    where = f"{table.where} {condition.name}"
    text = table.take(condition.name, str)
    number = quantity(text, condition.unit, where)
    if number < condition.least or (condition.exclusive and number == condition.least):
        raise InputError(
            where=where,
            found=repr(text),
            expected=f"{'above' if condition.exclusive else 'no less than'} {condition.least:g} "
            f"{condition.unit}",
            remedy=remedy,
        )
    return number


def _choice(condition: Condition, value: object, where: str) -> str | int:
    for choice in condition.choices:
        if type(value) is type(choice) and value == choice:
            return choice
    raise InputError(
        where=where, found=shown(value), expected=_either(condition), remedy="write one of them"
    )


def _either(condition: Condition) -> str:
    return " or ".join(map(repr, condition.choices))


def conditions_shown(signals: Mapping[str, Vector], system: System) -> dict[str, Any]:
    """Conditions that a recording shows, as `read_conditions` takes them.

    They are what the system file says that tells them (`agrees`); a choice only where it is one of
    its choices.

    Parameters
    ----------
    signals : (n,) each, SI.
    """
    texts: dict[str, Any] = {}
    compared = {rest.by for rest in system.comparison.rests}
    for condition in system.conditions:
        if condition.name in compared:
            continue  # readings are compared with it: it must be told, not read off them
        value = shown_by(condition, signals, system)
        if value is None or not np.isfinite(value):
            continue
        if not condition.choices:
            if value > condition.least or (value == condition.least and not condition.exclusive):
                texts[condition.name] = f"{value:.6g} {condition.unit}"
        elif value in condition.choices:
            texts[condition.name] = next(choice for choice in condition.choices if choice == value)
    return texts


_NOTHING = RecordingOptions()
KEYS = ("title", "date", "conditions", "measurement", "model")  # of case.toml


@dataclass(frozen=True, eq=False)
class Case:
    """One recording in SI units; its arrays are read-only.

    Attributes
    ----------
    name : of the folder.
    title : one line for reports.
    conditions : what was set before, by name: quantities in SI, words, whole numbers, tuples.
    time : (n,) s, strictly increasing, not necessarily in even steps.
    signals : (n,) each, by name; what only judges or aids may be missing, an aid in samples (NaN).
    inputs, outputs, aids : names of those that drive a model, correct it, and do so where measured.
    source : the CSV file.
    names : the model's own name of each variable that it names otherwise.
    date : when it was recorded, ISO 8601 in UTC where it says its zone; empty: unknown.
    counts_from : s, time before which samples only lead a simulation to those that are compared.
    model_time : s, of the model at the first sample; None: the start time of its FMU.
    doubts : sentences on what is unlikely in the recording.
    first_line : of the source, where its first sample stands; None: not known.
    """

    name: str
    title: str
    conditions: Mapping[str, Value]
    time: Vector
    signals: Mapping[str, Vector]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    source: Path
    names: Mapping[str, str] = field(default_factory=dict)
    date: str = ""
    counts_from: float = -np.inf
    model_time: float | None = None
    doubts: tuple[str, ...] = ()
    aids: tuple[str, ...] = ()
    first_line: int | None = None

    def __getitem__(self, signal: str) -> Vector:
        """One signal, (n,) SI."""
        return self.signals[signal]

    def __contains__(self, signal: str) -> bool:
        return signal in self.signals

    @property
    def u(self) -> Matrix:
        """(n, m) measured inputs, SI."""
        return self._table(self.inputs)

    @property
    def y(self) -> Matrix:
        """(n, l) measured outputs and aids, SI."""
        return self._table((*self.outputs, *self.aids))

    def _table(self, names: Sequence[str]) -> Matrix:
        """Some signals as columns, also none."""
        table = np.empty((self.time.size, len(names)))
        for j, name in enumerate(names):
            table[:, j] = np.nan if name in self.aids and name not in self else self[name]
        return read_only(table)

    def with_signals(self, signals: Mapping[str, Vector]) -> "Case":
        """The same case with some signals replaced."""
        return replace(self, signals={**self.signals, **signals})

    def without(self, names: Sequence[str]) -> "Case":
        """The same case without some signals."""
        kept = {name: values for name, values in self.signals.items() if name not in names}
        return replace(self, signals=kept)

    def part(self, samples: slice) -> "Case":
        """A piece of the recording."""
        cut = {name: values[samples] for name, values in self.signals.items()}
        first = range(self.time.size)[samples].start
        line = None if self.first_line is None else self.first_line + first
        return replace(self, time=self.time[samples], signals=cut, first_line=line)


def make_case(
    name: str,
    measured: tuple[Vector, Mapping[str, Vector]],
    conditions: Mapping[str, Value],
    system: System,
    origin: Origin | None = None,
) -> Case:
    """Make a case of signals, which nobody may change from here on; its title is its name.

    Parameters
    ----------
    measured : time (n,) s, and signals (n,) each, SI.
    origin : where they stand, for what is doubted; None: nothing is, as it was simulated.
    """
    time, signals = measured
    return Case(
        name=name,
        title=name,
        conditions=conditions,
        time=read_only(time),
        signals={signal: read_only(values) for signal, values in signals.items()},
        inputs=tuple(signal.name for signal in system.inputs),
        outputs=tuple(output.name for output in system.outputs),
        aids=tuple(aid.name for aid in system.intermittent),
        source=Path(name),
        doubts=doubts(time, signals, conditions, system, origin) if origin else (),
        first_line=origin.first_line if origin else None,
    )


def sign(case: Case, system: System) -> float:
    """Sign of the recording's signals, by the condition that says so; 1 without one."""
    for condition in system.conditions:
        if condition.sign:
            return float(case.conditions[condition.name])  # type: ignore[arg-type]
    return 1.0


def read_cases(
    paths: Sequence[Path], system: System, options: RecordingOptions = _NOTHING
) -> list[Case]:
    """Read case folders, folders of case folders, and log files.

    A folder that holds `case.toml` is a case. Of any other folder the sub-folders are read,
    sorted by name: those that hold `case.toml`, and those named `NN_...`, which ought to. A file is
    a recording by itself.

    Parameters
    ----------
    options : conditions and channels of files that have no `case.toml`.
    """
    folders: dict[str, Path] = {}
    for folder in (folder for path in paths for folder in _case_folders(path)):
        name = _name(folder)
        if any("\ud800" <= character <= "\udfff" for character in name):
            raise InputError(  # as Python reads bytes of a name that are none of a character
                where=str(folder),
                found="a name that is no UTF-8",
                expected="one that files and pages can hold",
                remedy="rename the folder",
            )
        if name in folders:
            raise InputError(
                where=str(folder),
                found=f"a second case '{name}' beside {folders[name]}",
                expected="a different name for each case, because results are kept by name",
                remedy="rename one of the folders, or give it once",
            )
        folders[name] = folder
    if options != _NOTHING and not any(folder.is_file() for folder in folders.values()):
        raise InputError(
            where=", ".join(map(str, paths)),
            found="conditions, columns or a rate for recordings that have a case.toml",
            expected="a file without one",
            remedy="write them into case.toml",
        )
    return [
        read_file(path, system, options) if path.is_file() else read_case(path, system)
        for path in folders.values()
    ]


def _name(path: Path) -> str:
    """Name of a case: of its folder, or of a file without what tells its format."""
    name = path.resolve().name
    return re.sub(r"(\.[A-Za-z]\w{1,6})?(\.gz)?$", "", name) if path.is_file() else name


def read_file(path: Path, system: System, options: RecordingOptions = _NOTHING) -> Case:
    """Read a file of a recorder; conditions that it shows need not be told.

    Raises
    ------
    InputError
        If it cannot be read, its channels are neither confirmed nor certain, or a condition is
        missing.
    """
    measured = read_measured(path, system, options, stored_columns(path.parent, system))
    shown = conditions_shown(measured.signals, system)
    where = "command line, --condition"
    conditions = read_conditions(Table({**shown, **options.conditions}, where), system)
    check_recording(measured.time, system, f"{path}, time", None)
    origin = Origin(str(path), None, {}, where, measured.doubts)
    case = make_case(_name(path), (measured.time, measured.signals), conditions, system, origin)
    return replace(case, title=path.name, source=path, date=measured.date(0))


def read_case(folder: Path, system: System) -> Case:
    """Read `case.toml` of a folder and the recording it names.

    Raises
    ------
    InputError
        At the first problem, with the file and the line, column or key; also where the recording
        cannot be what it says it is.
    """
    toml = folder / "case.toml"
    document = read_table(
        toml, "give a folder that holds case.toml and the recording", 'title = "..."'
    )
    document.refuse_unknown(KEYS)
    title = document.take("title", str)
    if system.conditions:
        document.take("conditions", dict)
    conditions = read_conditions(document.table("conditions"), system)
    document.take("measurement", dict)
    measurement = document.table("measurement")
    measurement.refuse_unknown(("file", "columns", "counts_from", "model_time"))
    source = folder / measurement.take("file", str)
    time, signals, origin = _read_recording(source, measurement, system)
    origin = replace(origin, conditions=f"{toml}, [conditions]")
    model = document.table("model")
    model.refuse_unknown(("names",))
    names = model.table("names")
    case = make_case(folder.resolve().name, (time, signals), conditions, system, origin)
    return replace(
        case,
        title=title,
        source=source,
        names=check_names(names.content, f"{toml}, [model.names]", system),
        date=document.date("date"),
        counts_from=_counts_from(measurement, time),
        model_time=measurement.number("model_time", "s") if "model_time" in measurement else None,
    )


def _read_recording(
    source: Path, measurement: Table, system: System
) -> tuple[Vector, Mapping[str, Vector], Origin]:
    """Time and signals of a case's recording, SI, and where they stand.

    A CSV whose columns have names and units as the workbench writes them is read to the letter; any
    other file is that of a recorder.
    """
    own = measurement.table("columns")
    stored = stored_columns(source.parent.parent, system) | stored_columns(source.parent, system)
    as_named = not any(isinstance(name, dict) for name in own.content.values())
    if not is_other_format(source) and as_named and (not stored or has_own_names(source, system)):
        columns = _column_names(measurement, system)
        time, signals = _read_signals(source, columns, system)
        return time, signals, Origin(str(source), 2, columns, "")
    options = RecordingOptions(columns=read_named(own, system))
    measured = read_measured(source, system, options, stored)
    check_recording(measured.time, system, f"{source}, time", None)
    return measured.time, measured.signals, Origin(str(source), None, {}, "", measured.doubts)


def _counts_from(measurement: Table, time: Vector) -> float:
    """Time from which samples are compared with a model [s]."""
    if "counts_from" not in measurement:
        return -np.inf
    begin = measurement.number("counts_from", "s")
    if begin >= time[-1]:
        raise measurement.wrong("counts_from", f"a time before the last sample, {time[-1]:.9g} s")
    return begin


def check_names(names: Mapping[str, Any], where: str, system: System) -> dict[str, str]:
    """Check a mapping of a system's variables to a model's own names, as a user wrote it.

    Parameters
    ----------
    where : place for the message of an error.

    Raises
    ------
    InputError
        If a variable is none that estimators ask for, or two have one name.
    """
    table = Table(names, where)
    table.refuse_unknown(system.variables)
    checked = {ours: table.take(ours, str) for ours in names}
    _refuse_shared(checked, where, "variable")
    return checked


def check_recording(time: Vector, system: System, where: str, first_line: int | None = 2) -> None:
    """Refuse time that does not increase, or too little of it.

    Parameters
    ----------
    where : place for the message of an error.
    first_line : line of the first sample in a file, None without one.
    """
    steps = np.diff(time)
    if not (steps > 0).all():
        late = int(np.argmin(steps > 0)) + 1
        path, _, column = where.partition(", ")
        line = f", line {late + first_line}" if first_line is not None else ""
        raise InputError(
            where=f"{path}{line}, {column}",
            found=f"{time[late]:.9g} s after {time[late - 1]:.9g} s",
            expected="strictly increasing time",
            remedy="export with more digits, or remove the repeated or misplaced samples",
        )
    if time.size < system.fewest or time[-1] - time[0] < system.shortest:
        raise InputError(
            where=where,
            found=f"{time.size} samples over {time[-1] - time[0]:.3g} s",
            expected=f"at least {system.fewest} samples, which tell signal from noise"
            + (f", over {system.shortest:g} s" if system.shortest else ""),
            remedy="export the whole recording, from before it begins to its end",
        )


def _case_folders(path: Path) -> list[Path]:
    try:
        return _found_folders(path)
    except OSError as error:
        raise InputError(
            where=str(path),
            found=f"a folder that cannot be read ({error.strerror})",
            expected="a case folder or a folder of case folders",
            remedy="correct the path, or the permissions of the folder",
        ) from None


def _found_folders(path: Path) -> list[Path]:
    if path.is_file() and path.suffix != ".toml":
        return [path]
    if not path.is_dir():
        raise InputError(
            where=str(path),
            found="a file" if path.exists() else "no such folder",
            expected="a case folder, a folder of case folders, or a recording",
            remedy="correct the path",
        )
    if (path / "case.toml").exists():
        return [path]
    below = sorted(
        (entry for entry in path.iterdir() if entry.is_dir()), key=lambda path: path.name
    )
    folders = [
        folder
        for folder in below
        if re.match(r"\d+_", folder.name) or (folder / "case.toml").exists()
    ]
    if not folders:
        raise InputError(
            where=str(path),
            found="no case.toml, neither here nor one folder below",
            expected="a case folder or a folder of case folders",
            remedy="correct the path, or write a case.toml beside the recording",
        )
    return folders


def _column_names(measurement: Table, system: System) -> dict[str, str]:
    """Return the column of each signal."""
    named = measurement.table("columns")
    named.refuse_unknown(("time", *system.signals))
    columns = {signal: named.text(signal, signal) for signal in ("time", *system.signals)}
    _refuse_shared(columns, named.where, "column")
    return columns


def _refuse_shared(names: Mapping[str, str], where: str, noun: str) -> None:
    taken: dict[str, str] = {}
    for ours, name in names.items():
        if name in taken:
            raise InputError(
                where=f"{where} {ours}",
                found=f"{noun} '{name}', which is already {taken[name]}",
                expected=f"a different {noun} for each",
                remedy=f"correct the name of one of the two {noun}s",
            )
        taken[name] = ours


def _read_signals(
    source: Path, columns: dict[str, str], system: System
) -> tuple[Vector, dict[str, Vector]]:
    """Time and signals in SI units; what only judges or aids may be missing under its own name."""
    spare = [signal.name for signal in (*system.reference_signals, *system.intermittent)]
    optional = [name for name in spare if columns[name] == name]
    required = [column for signal, column in columns.items() if signal not in optional]
    recorded = read_columns(
        source, required, optional, [columns[aid.name] for aid in system.intermittent]
    )
    units = {"time": "s", **{name: signal.unit for name, signal in system.signals.items()}}
    signals = {}
    for signal, column in columns.items():
        if column in recorded:
            where = f"{source}, line 1, column '{column}'"
            factor = si_factor(recorded[column].unit, units[signal], where)
            values = recorded[column].values
            _refuse_markers(values, source, column)
            signals[signal] = values * factor
    time = signals.pop("time")
    check_recording(time, system, f"{source}, column '{columns['time']}'")
    return time, signals


def _refuse_markers(values: Vector, source: Path, column: str) -> None:
    """Refuse values that recorders write in place of a sample."""
    known, _ = markers(values)
    for value, count in known.items():
        first = int(np.flatnonzero(values == value)[0])
        raise InputError(
            where=f"{source}, line {first + 2}, column '{column}'",
            found=f"{value:g} in {count} samples, far outside of all others, as loggers write for "
            "missing values",
            expected="samples",
            remedy=f"run 'workbench import {source}', which leaves them out, or remove the lines",
        )


def read_only(array: Matrix) -> Matrix:
    """The array, which nobody may change from here on."""
    array.flags.writeable = False
    return array
