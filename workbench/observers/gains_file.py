"""The file of gains, `gains.toml`: what the tuning writes, and who runs observers reads."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.observers.contract import Estimator
from workbench.observers.gains import Gains
from workbench.system.plugins import find_plugin
from workbench.system.system import System
from workbench.system.tables import LARGEST, read_table, shown

_AGAIN = "take the gains.toml that 'workbench tune' wrote"


def read_gains(path: Path, reasoned: Mapping[str, Gains]) -> Gains:
    """Gains of a file, for the estimator that it names.

    Parameters
    ----------
    reasoned : gains of the estimators that it may be for, by name; their values are not used.
    """
    content = _content(path)
    blank = reasoned[estimator_of(path, reasoned)]
    given = _table(content, "gains", path)
    if missing := [name for name in blank.names if name not in given]:
        raise _wrong(path, f"no {missing[0]} in [gains]", f"the gains {', '.join(blank.names)}")
    if unknown := [name for name in given if name not in blank.names]:
        raise _wrong(path, f"{unknown[0]} in [gains]", f"the gains {', '.join(blank.names)}")
    values = np.array([_number(given[name], name, path) for name in blank.names])
    design = _table(content, "design", path)
    constants = {
        name: _constants(design.get(name), name, len(usual), path)
        for name, usual in blank.design.items()
    }
    source = f"tuned, {path.name}"
    return Gains(blank.estimator, blank.names, values, constants, source)


def estimator_of(path: Path, known: Collection[str]) -> str:
    """Name of the estimator that a file of gains is for, one of those that are known."""
    estimator = _content(path).get("estimator")
    if not isinstance(estimator, str) or estimator not in known:
        raise _wrong(path, f"estimator = {shown(estimator)}", f"one of {', '.join(known)}")
    return estimator


def format_gains(gains: Gains, meaning: str, provenance: Mapping[str, Any]) -> str:
    """The text of a file of gains; numbers have all their digits."""
    values = map(float, gains.values)
    comment = "".join(f"# {line}\n" for line in meaning.splitlines())
    parts = [
        tomli_w.dumps({"estimator": gains.estimator}),
        comment + tomli_w.dumps({"gains": dict(zip(gains.names, values, strict=True))}),
    ]
    if gains.design:
        design = {name: constants.tolist() for name, constants in gains.design.items()}
        parts.append("# constants of the design\n" + tomli_w.dumps({"design": design}))
    return "\n".join([*parts, tomli_w.dumps({"provenance": provenance})])


def usual_gains(estimator: type[Estimator], fmu: FMU, system: System) -> Gains:
    """Gains of an estimator where none are given.

    Those that the system's plugin brings serve the model that they were tuned on; another one
    gets gains that follow from its linearisation. The FMU is left at an operating point.
    """
    reasoned = estimator.default_gains(fmu, system)
    name = estimator.tuned_as or estimator.name
    path = tuned_file(system, name)
    if path is None:
        return reasoned
    tuned_on = _content(path).get("provenance", {}).get("fmu", {}).get("model")
    return read_gains(path, {name: reasoned}) if tuned_on == fmu.name else reasoned


def tuned_file(system: System, name: str) -> Path | None:
    """The file of tuned gains that a system's plugin brings for an estimator, if it does."""
    gains = find_plugin(system.plugin).gains
    path = gains / f"{name}.toml" if gains else None
    return path if path and path.exists() else None


def _content(path: Path) -> Mapping[str, Any]:
    return read_table(path, _AGAIN, 'estimator = "NAME"').content


def _table(content: Mapping[str, Any], name: str, path: Path) -> dict[str, Any]:
    table = content.get(name, {})
    if not isinstance(table, dict):
        raise _wrong(path, f"{name} = {shown(table)}", f"a table [{name}]")
    return table


def _constants(given: object, name: str, count: int, path: Path) -> Vector:
    """Constants of the design, which gains are divided by."""
    if isinstance(given, list) and len(given) == count:
        values = np.array([_number(value, name, path) for value in given])
        if values.all():
            return values
    raise _wrong(path, f"{name} = {shown(given)} in [design]", f"{count} numbers other than zero")


def _number(value: object, name: str, path: Path) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise _wrong(path, f"{name} = {shown(value)}", "a number")
    if not abs(value) < LARGEST:  # refuses NaN, too
        raise _wrong(path, f"{name} = {shown(value)}", "a finite number")
    return float(value)


def _wrong(path: Path, found: str, expected: str = "a file as the tuning writes it") -> InputError:
    return InputError(where=str(path), found=found, expected=expected, remedy=_AGAIN)
