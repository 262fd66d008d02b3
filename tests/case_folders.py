"""Case folders written line by line, and what reading them gives or refuses."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.recordings.case import Case, read_case
from workbench.system.parts import Sampling, Signal
from workbench.system.system import System

from .systems import WHEELSET

ROUNDING = 1e-14  # some ten roundings of 1.1e-16: text, unit factor, product

TOML = """\
title = "80 km/h, 1.5 bar"
[conditions]
initial_speed = "80 km/h"
brake_pressure = "1.5 bar"
wheel_rail = "dry"
discs = ["dry", "wet", "dry"]
direction = -1
[measurement]
file = "measured.csv"
"""
UNITS = {"time": "s", "pB": "bar", "tauR": "N.m", "omegaW": "rad/s", "omegaR": "rad/s", "Fx": "N"}
SI_OF_UNITS = {"bar": 1e5}  # every other unit above is SI already
ROWS = 25
LINES = [
    ",".join(f"{name} [{unit}]" for name, unit in UNITS.items()),
    *(
        f"{k / 10:.1f},{k / 50:.2f},-{k},-48.2{4 + k % 2},-31.7{4 + k % 2},-120.5"
        for k in range(ROWS)
    ),
]

Text = str | bytes


def write(folder: Path, csv: Text | list[str] = LINES, toml: Text = TOML) -> Path:
    """Write a case folder; a list is the lines of the CSV."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in (("measured.csv", csv), ("case.toml", toml)):
        if isinstance(content, list):
            content = "\n".join(content) + "\n"
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder


def with_line(line: int, text: str) -> list[str]:
    """Return LINES with one line replaced; lines count from 1 as in an editor."""
    return [*LINES[: line - 1], text, *LINES[line:]]


def with_field(line: int, name: str, field: str) -> list[str]:
    fields = LINES[line - 1].split(",")
    fields[list(UNITS).index(name)] = field
    return with_line(line, ",".join(fields))


def german(lines: list[str]) -> list[str]:
    header, *rows = (line.replace(",", ";") for line in lines)
    return [header, *(row.replace(".", ",") for row in rows)]


def assert_refused(match: str, read: Callable[[], object]) -> InputError:
    """Assert an InputError with this message whose four parts all say something."""
    with pytest.raises(InputError, match=match) as caught:
        read()
    error = caught.value
    parts = [error.where, error.found, error.expected, error.remedy]
    assert all(part.strip() for part in parts)
    assert all(part in str(error) for part in parts)
    return error


def assert_same(case: Case, other: Case, rtol: float = ROUNDING) -> None:
    assert case.conditions == other.conditions
    assert ("Fx" in case) == ("Fx" in other)
    for name in UNITS:
        assert_allclose(signal(case, name), signal(other, name), rtol=rtol)


def anything_goes(system: System) -> System:
    """The same system with nothing that says whether a recording is likely."""
    infinite = -np.inf, np.inf

    def unknown(signals: Sequence[Signal]) -> tuple[Signal, ...]:
        return tuple(
            replace(signal, noise=0.0, relative_noise=0.0, plausible=infinite, possible=infinite)
            for signal in signals
        )

    return replace(
        system,
        inputs=unknown(system.inputs),
        outputs=unknown(system.outputs),
        reference_signals=unknown(system.reference_signals),
        conditions=tuple(replace(condition, agrees=None) for condition in system.conditions),
        redundancies=(),
        sampling=Sampling(np.inf, (np.inf, np.inf)),
        sample_time=np.inf,
    )


# A wheelset that may do anything: how a file is read is asked here.
TOLERANT = anything_goes(WHEELSET)


def read(folder: Path) -> Case:
    return read_case(folder, TOLERANT)


def signal(case: Case, name: str) -> Vector:
    """Time or a signal, (n,)."""
    return case.time if name == "time" else case[name]


def in_unit(name: str, unit: str) -> list[str]:
    """Return LINES with another unit in the header, the numbers as they are."""
    return with_line(1, LINES[0].replace(f"{name} [{UNITS[name]}]", f"{name} [{unit}]"))
