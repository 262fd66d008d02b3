"""Machines and recordings that tests write; FMUs are built once for each state of the sources.

A worker of the suite finds what another one has built, and so does the next run.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from string import Template

import numpy as np
import pandas as pd

from workbench.api import diagnose, read_cases
from workbench.arrays import Vector
from workbench.diagnosis import Outcome
from workbench.models import compiler, fmu_cache
from workbench.recordings.case import Case
from workbench.system.registry import load_system
from workbench.system.system import System

MACHINES = Path(__file__).with_name("machines")


def machine_file(path: str, **values: object) -> str:
    """Text of a file of a machine for tests, with a value in place of each `$NAME`."""
    text = (MACHINES / path).read_text()
    return Template(text).substitute(values) if values else text


def machine(name: str, **values: object) -> tuple[str, str]:
    """Modelica library of a machine for tests, and its system file with these values."""
    return machine_file(f"{name}/package.mo"), machine_file(f"{name}/system.toml", **values)


def library(folder: Path, text: str) -> Path:
    """Write a library `Lib` of classes; returns its package.mo."""
    package = folder / "Lib" / "package.mo"
    package.parent.mkdir(parents=True)
    package.write_text(f"package Lib\n{text}\nend Lib;\n")
    return package


def build_here(package: Path, model: str, path: Path, fmi: int = 2) -> None:
    """Write the FMU of a model for this machine."""
    here = compiler.native()
    fmu_cache.fetch(
        fmu_cache.key(package, model, f"FMI {fmi}", here),
        path,
        lambda path: compiler.build(package, model, path, fmi=fmi, platforms=[here]),
    )


def build_text(folder: Path, text: str, fmi: int = 2) -> Path:
    """Write a model that stands alone, and build its FMU beside it."""
    name = re.findall(r"^model (\w+)", text, re.MULTILINE)[0]
    source, path = folder / f"{name}.mo", folder / f"{name}.fmu"
    source.write_text(text)
    build_here(source, name, path, fmi)
    return path


def write_case(folder: Path, columns: Mapping[str, Vector], title: str, digits: str = "") -> Path:
    """Write a case folder of a machine without conditions.

    Parameters
    ----------
    columns : by `signal [unit]`, with `time [s]`.
    digits : format of the numbers; all digits unless given.
    """
    folder.mkdir(parents=True)
    (folder / "case.toml").write_text(f'title = "{title}"\n[measurement]\nfile = "measured.csv"\n')
    pd.DataFrame(columns).to_csv(folder / "measured.csv", index=False, float_format=digits or None)
    return folder


def declare(folder: Path, library: str, system: str, **fmus: str) -> System:
    """Write the library and the system file of a machine, build its FMUs, and read it.

    Parameters
    ----------
    fmus : model of each FMU, by the name of its file.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "package.mo").write_text(library)
    for name, model in fmus.items():
        build_here(folder / "package.mo", model, folder / f"{name}.fmu")
    (folder / "system.toml").write_text(system)
    return load_system(folder)


def diagnosed(
    system: System, cases: Sequence[Case] | Path, out: Path, *effects: str, **given: Sequence[Case]
) -> Outcome:
    """What is missing in recordings or those of a folder, quietly; written in `out`."""
    cases = read_cases(cases, system) if isinstance(cases, Path) else cases
    quiet = {"workers": 1, "report": lambda line: None}
    return diagnose(system, cases, effects=effects, out=out, **quiet, **given)


def lagged(u: Vector, step: float, k: float, start: float) -> Vector:
    """Solution of der(x) = u - k x at samples, (n,), by the closed form of each; u is held."""
    x = [start]
    for held in u[:-1]:
        x.append(held / k + (x[-1] - held / k) * np.exp(-k * step))
    return np.array(x)
