"""Stage 1: a recording, its conditions and its units become a `Case` in SI units."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError, closest
from workbench.recording import read_columns, read_text
from workbench.units import quantity, si_factor

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Surface = Literal["dry", "wet"]
_T = TypeVar("_T")

_DISCS = 3  # data sheet of the rig
_MIN_DURATION = 2.0  # s; a stop with coasting before it takes longer
_MIN_SAMPLES = 20  # fewer say nothing about noise

_SIGNALS = {"time": "s", "pB": "Pa", "tauR": "N.m", "omegaW": "rad/s", "omegaR": "rad/s", "Fx": "N"}

# What estimators ask of a model, with units; a model with other names is mapped onto these.
MODEL_VARIABLES = {
    "omegaW": "rad/s",
    "omegaR": "rad/s",
    "pB": "Pa",
    "tauR": "N.m",
    "dmuWR": "1",
    "dmuDC": "1",
    "Fx": "N",
    "slip": "m/s",
    "muWR": "1",
    "muDC": "1",
    "rW": "m",
    "rR": "m",
    "JR": "kg.m2",
}


@dataclass(frozen=True)
class Conditions:
    """What was set before the stop.

    Attributes
    ----------
    initial_speed : m/s, circumferential, positive in both directions.
    brake_pressure : Pa, demanded.
    wheel_rail : state of the contact.
    discs : state of each brake disc.
    direction : +1 forward, -1 backward.
    """

    initial_speed: float
    brake_pressure: float
    wheel_rail: Surface
    discs: tuple[Surface, ...]
    direction: Literal[1, -1]


@dataclass(frozen=True, eq=False)
class Case:
    """One recorded stop in SI units; its arrays are read-only.

    Attributes
    ----------
    name : of the folder.
    title : one line for reports.
    conditions : what was set before the stop.
    time : (n,) s, strictly increasing, not necessarily in even steps.
    pB : (n,) Pa, brake pressure.
    tauR : (n,) N.m, torque of the roller's drive.
    omegaW, omegaR : (n,) rad/s, speeds of wheelset and roller.
    Fx : (n,) N, measured longitudinal force, or None.
    source : the CSV file.
    names : the model's own name of each of MODEL_VARIABLES that it names otherwise.
    """

    name: str
    title: str
    conditions: Conditions
    time: Vector
    pB: Vector
    tauR: Vector
    omegaW: Vector
    omegaR: Vector
    Fx: Vector | None
    source: Path
    names: Mapping[str, str] = field(default_factory=dict)

    @property
    def u(self) -> Matrix:
        """(n, 2) inputs [pB, tauR] in Pa and N.m."""
        return _read_only(np.column_stack([self.pB, self.tauR]))

    @property
    def y(self) -> Matrix:
        """(n, 2) outputs [omegaW, omegaR] in rad/s."""
        return _read_only(np.column_stack([self.omegaW, self.omegaR]))


def read_cases(paths: Sequence[Path]) -> list[Case]:
    """Read case folders and folders of case folders.

    A folder that holds `case.toml` is a case. Of any other folder the sub-folders are read,
    sorted by name: those that hold `case.toml`, and those named `NN_...`, which ought to.

    Raises
    ------
    InputError
        If a path holds no case, two cases have one name, or a case cannot be read.
    """
    folders: dict[str, Path] = {}
    for folder in (folder for path in paths for folder in _case_folders(path)):
        name = folder.resolve().name
        if name in folders:
            raise InputError(
                where=str(folder),
                found=f"a second case '{name}' beside {folders[name]}",
                expected="a different name for each case, because results are kept by name",
                remedy="rename one of the folders, or give it once",
            )
        folders[name] = folder
    return [read_case(folder) for folder in folders.values()]


def read_case(folder: Path) -> Case:
    """Read `case.toml` of a folder and the recording it names.

    Raises
    ------
    InputError
        At the first problem, with the file and the line, column or key.
    """
    toml = folder / "case.toml"
    document = _read_toml(toml)
    where = str(toml)
    _refuse_unknown(document, ("title", "conditions", "measurement", "model"), where)
    title = _entry(document, "title", str, where)
    conditions = _conditions(_entry(document, "conditions", dict, where), f"{where}, [conditions]")
    measurement = _entry(document, "measurement", dict, where)
    _refuse_unknown(measurement, ("file", "columns"), f"{where}, [measurement]")
    source = folder / _entry(measurement, "file", str, f"{where}, [measurement]")
    columns = _column_names(measurement, f"{where}, [measurement]")
    signals = _read_signals(source, columns)
    model = _entry(document, "model", dict, where) if "model" in document else {}
    _refuse_unknown(model, ("names",), f"{where}, [model]")
    names = _entry(model, "names", dict, f"{where}, [model]") if "names" in model else {}
    return Case(
        name=folder.resolve().name,
        title=title,
        conditions=conditions,
        time=signals["time"],
        pB=signals["pB"],
        tauR=signals["tauR"],
        omegaW=signals["omegaW"],
        omegaR=signals["omegaR"],
        Fx=signals.get("Fx"),
        source=source,
        names=check_names(names, f"{where}, [model.names]"),
    )


def check_names(names: Mapping[str, Any], where: str) -> dict[str, str]:
    """Check a mapping of MODEL_VARIABLES to a model's own names, as a user wrote it.

    Parameters
    ----------
    where : place for the message of an error.

    Raises
    ------
    InputError
        If a variable is none of MODEL_VARIABLES, or two have one name.
    """
    _refuse_unknown(names, tuple(MODEL_VARIABLES), where)
    checked = {ours: _entry(names, ours, str, where) for ours in names}
    _refuse_shared(checked, where, "variable")
    return checked


def _case_folders(path: Path) -> list[Path]:
    if not path.is_dir():
        raise InputError(
            where=str(path),
            found="a file" if path.exists() else "no such folder",
            expected="a case folder or a folder of case folders",
            remedy="correct the path",
        )
    if (path / "case.toml").exists():
        return [path]
    folders = sorted(
        (
            child
            for child in path.iterdir()
            if child.is_dir() and (re.match(r"\d+_", child.name) or (child / "case.toml").exists())
        ),
        key=lambda child: child.name,
    )
    if not folders:
        raise InputError(
            where=str(path),
            found="no case.toml, neither here nor one folder below",
            expected="a case folder or a folder of case folders",
            remedy="correct the path, or write a case.toml beside the recording",
        )
    return folders


def _read_toml(path: Path) -> dict[str, Any]:
    text = read_text(path, "give a folder that holds case.toml and the recording")
    try:
        return tomllib.loads(text)
    except ValueError as error:  # TOMLDecodeError, or a number too long to convert
        place = re.search(r"line (\d+)", str(error))
        line = int(place[1]) if place else text.count("\n") + 1
        raise InputError(
            where=f"{path}, line {line}",
            found=f"text that is no TOML ({error})",
            expected='lines such as wheel_rail = "dry" under [conditions]',
            remedy="correct the line",
        ) from None


def _conditions(table: dict[str, Any], where: str) -> Conditions:
    keys = ("initial_speed", "brake_pressure", "wheel_rail", "discs", "direction")
    _refuse_unknown(table, keys, where)
    speed = quantity(_entry(table, "initial_speed", str, where), "m/s", f"{where} initial_speed")
    pressure = quantity(
        _entry(table, "brake_pressure", str, where), "Pa", f"{where} brake_pressure"
    )
    if speed <= 0:
        raise InputError(
            where=f"{where} initial_speed",
            found=f"{table['initial_speed']!r}",
            expected="a speed above zero in both directions",
            remedy="give the magnitude; 'direction' holds the sign",
        )
    if pressure < 0:
        raise InputError(
            where=f"{where} brake_pressure",
            found=f"{table['brake_pressure']!r}",
            expected="a gauge pressure of zero or more",
            remedy="correct the pressure",
        )
    discs = _entry(table, "discs", list, where)
    if len(discs) != _DISCS:
        raise InputError(
            where=f"{where} discs",
            found=f"{len(discs)} entries",
            expected=f"{_DISCS}, one for each disc",
            remedy='write "dry" or "wet" for each disc',
        )
    direction = _entry(table, "direction", int, where)
    if direction not in (1, -1):
        raise InputError(
            where=f"{where} direction",
            found=str(direction),
            expected="1 (forward) or -1 (backward)",
            remedy="write one of the two",
        )
    return Conditions(
        initial_speed=speed,
        brake_pressure=pressure,
        wheel_rail=_surface(_entry(table, "wheel_rail", str, where), f"{where} wheel_rail"),
        discs=tuple(_surface(disc, f"{where} discs[{i}]") for i, disc in enumerate(discs)),
        direction=1 if direction == 1 else -1,
    )


def _surface(value: object, where: str) -> Surface:
    if value not in ("dry", "wet"):
        raise InputError(
            where=where,
            found=repr(value),
            expected="'dry' or 'wet'",
            remedy="write one of the two",
        )
    return value


def _column_names(measurement: dict[str, Any], where: str) -> dict[str, str]:
    """Return the column of each signal; `Fx` only if it is named or has its own name."""
    named = _entry(measurement, "columns", dict, where) if "columns" in measurement else {}
    where = f"{where} columns"
    _refuse_unknown(named, tuple(_SIGNALS), where)
    columns = {signal: signal for signal in _SIGNALS}
    for signal in named:
        columns[signal] = _entry(named, signal, str, where)
    _refuse_shared(columns, where, "column")
    return columns


def _refuse_shared(names: Mapping[str, str], where: str, kind: str) -> None:
    taken: dict[str, str] = {}
    for ours, name in names.items():
        if name in taken:
            raise InputError(
                where=f"{where} {ours}",
                found=f"{kind} '{name}', which is already {taken[name]}",
                expected=f"a different {kind} for each",
                remedy=f"correct the name of one of the two {kind}s",
            )
        taken[name] = ours


def _entry(table: Mapping[str, Any], key: str, kind: type[_T], where: str) -> _T:
    """Return `table[key]`, which must be of this very type and no empty string."""
    names = {str: "a text", int: "a whole number", dict: "a table", list: "a list"}
    if key not in table:
        raise InputError(
            where=where,
            found=f"no '{key}'",
            expected=f"{names[kind]} '{key}'",
            remedy=f"add '{key}'",
        )
    value = table[key]
    if type(value) is not kind or value == "":  # `type`, because true is an int
        raise InputError(
            where=f"{where} {key}",
            found=repr(value),
            expected=names[kind],
            remedy="correct the value",
        )
    return value


def _refuse_unknown(table: Mapping[str, Any], keys: tuple[str, ...], where: str) -> None:
    for key in table:
        if key not in keys:
            raise InputError(
                where=where,
                found=f"unknown key '{key}'{closest(key, keys)}",
                expected=f"only {', '.join(keys)}",
                remedy="correct or remove the key",
            )


def _read_signals(source: Path, columns: dict[str, str]) -> dict[str, Vector]:
    """Read the signals in SI units, without `Fx` if the file has no such column."""
    required = [column for signal, column in columns.items() if signal != "Fx" or column != "Fx"]
    recorded = read_columns(source, required, [c for c in columns.values() if c not in required])
    signals = {}
    for signal, column in columns.items():
        if column in recorded:
            where = f"{source}, line 1, column '{column}'"
            factor = si_factor(recorded[column].unit, _SIGNALS[signal], where)
            signals[signal] = _read_only(recorded[column].values * factor)
    _check_time(signals["time"], source, columns["time"])
    return signals


def _check_time(time: Vector, source: Path, column: str) -> None:
    steps = np.diff(time)
    if not (steps > 0).all():
        late = int(np.argmin(steps > 0)) + 1
        raise InputError(
            where=f"{source}, line {late + 2}, column '{column}'",
            found=f"{time[late]:.9g} s after {time[late - 1]:.9g} s",
            expected="strictly increasing time",
            remedy="export with more digits, or remove the repeated or misplaced samples",
        )
    if time.size < _MIN_SAMPLES or time[-1] - time[0] < _MIN_DURATION:
        raise InputError(
            where=f"{source}, column '{column}'",
            found=f"{time.size} samples over {time[-1] - time[0]:.3g} s",
            expected=f"at least {_MIN_SAMPLES} samples, which tell signal from noise, over "
            f"{_MIN_DURATION:g} s, in which a brake stop has begun",
            remedy="export the whole stop, from coasting to standstill",
        )


def _read_only(array: NDArray[np.float64]) -> NDArray[np.float64]:
    array.flags.writeable = False
    return array
