"""The disturbance observer in plain C, `c_loop.c`, over the equations in an FMU's sources."""

import ctypes
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector
from workbench.errors import InputError
from workbench.models.compiler.assembly import FLAGS, PLATFORMS
from workbench.models.fmu import FMU
from workbench.observers import Gains
from workbench.system.system import System

_SOURCE = Path(__file__).parent / "c_loop.c"


class CLoop:
    """The observer of `c_loop.c`, compiled with the FMUs' own compiler and flags.

    Parameters
    ----------
    fmu : minimal model, FMI 2.0, with C sources.
    system : the wheelset.
    gains : of the disturbance observer.
    """

    def __init__(self, fmu: FMU, system: System, gains: Gains) -> None:
        assert fmu.states == ("omegaW", "omegaR")
        assert system.fading is not None
        nominal = np.array([fmu.defaults[quantity.name] for quantity in system.estimated])
        low = np.array([quantity.low for quantity in system.estimated]) - nominal
        high = np.array([quantity.high for quantity in system.estimated]) - nominal
        rR, rW = (fmu.defaults[name] for name in ("rR", "rW"))
        tail = [rR, rR / rW, system.fading.half]
        effect = gains.design["effect"]
        self._settings = np.concatenate([gains.values, effect, low, high, nominal, tail])
        names = [*(signal.name for signal in system.inputs), *system.corrections, *system.reported]
        self._references = fmu.variables(names).references.astype(np.intc)
        self._width = len(system.columns)
        self._run = _compile(fmu.path)

    def run(self, time: Vector, u: Matrix, y: Matrix) -> Matrix:
        """Estimates, (n, 8); arguments as of `Estimator.run`."""
        steps = np.diff(time, prepend=time[0])
        arrays: list[NDArray[Any]] = [np.ascontiguousarray(a) for a in (steps, u, y)]
        rows = np.empty((time.size, self._width))
        arrays += [self._settings, self._references, rows]
        if self._run(time.size, *(ctypes.c_void_p(a.ctypes.data) for a in arrays)):
            raise ArithmeticError("c_loop.c: the implicit step has no solution at this point")
        return rows


def _compile(path: Path) -> "ctypes._NamedFuncPointer":
    with tempfile.TemporaryDirectory() as scratch:
        with zipfile.ZipFile(path) as archive:
            archive.extractall(scratch, [n for n in archive.namelist() if n.startswith("sources/")])
        sources, library = Path(scratch) / "sources", Path(scratch) / "c_loop.so"
        target = {fmi3: target for _, fmi3, target, _ in PLATFORMS.values()}[fmpy.platform_tuple]
        flags = [flag for flag in FLAGS if flag != "-fvisibility=hidden"]
        command = [sys.executable, "-m", "ziglang", "cc", "-target", target, *flags, "-shared"]
        files = [str(sources / "model.c"), str(_SOURCE), "-lm", "-o", str(library)]
        run = subprocess.run(
            [*command, f"-I{sources}", *files], capture_output=True, text=True, check=False
        )
        if run.returncode != 0:
            raise InputError(
                where=str(path),
                found=run.stderr.strip()[-2000:],
                expected="C sources of FMI 2.0 that compile with c_loop.c",
                remedy="build the FMU with 'workbench fmu build'",
            )
        return ctypes.CDLL(str(library)).c_loop
