"""The C runtime compiled with small models written by hand (tests/runtime), and its instances."""

import ctypes
import re
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Model, FMU3Slave
from scipy.linalg import expm

from .processes import COMPILER

MODELS = Path(__file__).parent / "runtime"
RUNTIME = Path(__file__).parents[1] / "workbench" / "models" / "compiler" / "runtime"
HEADERS = Path(fmpy.__file__).parent / "c-code"
DISCARD, ERROR = 2, 3

# Value references of the oscillator: x1' = x2, x2' = -k*x1 - d*x2 + u, output force, local energy.
X1, X2, DX1, DX2, U, K, D, FORCE, ENERGY, TIME = range(10)


def compile_model(model: str, version: int, library: Path, visibility: str = "hidden") -> None:
    """Compile runtime and model into a shared library; warnings are errors."""
    library.parent.mkdir(parents=True, exist_ok=True)
    sources = [RUNTIME / f"{name}.c" for name in ("instance", "integrator", f"fmi{version}")]
    sources += [MODELS / "defaults.c", MODELS / model / "model.c"]
    subprocess.run(
        [
            *(COMPILER, "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O2", "-shared"),
            *("-fPIC", f"-fvisibility={visibility}", f"-I{RUNTIME}", f"-I{MODELS / model}"),
            *("-isystem", HEADERS, *sources, "-o", library, "-lm"),
        ],
        check=True,
    )


class Fmu:
    """An instance through FMPy, under the same names for both versions of FMI.

    `log` holds (status, category, message).
    """

    def __init__(
        self,
        folder: Path,
        model: str,
        version: int,
        slave: bool,
        name: str = "instance",
        token: str | None = None,
        verbose: bool = False,
    ) -> None:
        self.version = version
        self.log: list[tuple[int, str, str]] = []
        client = {(2, True): FMU2Slave, (2, False): FMU2Model, (3, True): FMU3Slave}.get(
            (version, slave), FMU3Model
        )
        self.fmi = client(
            guid=f"{{{model}}}" if token is None else token,
            modelIdentifier=model,
            unzipDirectory=str(folder),
            instanceName=name,
        )
        if version == 2:
            # No memory functions: the runtime has to bring its own.
            callbacks = fmi2CallbackFunctions(
                logger=fmi2CallbackLoggerTYPE(lambda _, __, *message: self.note(*message))
            )
            self.fmi.instantiate(callbacks=callbacks, loggingOn=verbose)
        else:
            self.fmi.instantiate(
                logMessage=lambda _, *message: self.note(*message), loggingOn=verbose
            )

    def note(self, status: int, category: bytes, message: bytes) -> None:
        self.log.append((status, category.decode(), message.decode()))

    def initialize(
        self, tolerance: float | None = None, start: float = 0.0, stop: float | None = None
    ) -> "Fmu":
        if self.version == 2:
            self.fmi.setupExperiment(tolerance, start, stop)
            self.fmi.enterInitializationMode()
        else:
            self.fmi.enterInitializationMode(tolerance, start, stop)
        return self

    def start(self, tolerance: float | None = None, stop: float | None = None) -> "Fmu":
        self.initialize(tolerance, stop=stop)
        self.fmi.exitInitializationMode()
        return self

    def get(self, *references: int) -> list[float]:
        read = self.fmi.getReal if self.version == 2 else self.fmi.getFloat64
        return list(read(references))

    def set(self, references: Sequence[int], values: Sequence[float]) -> None:
        write = self.fmi.setReal if self.version == 2 else self.fmi.setFloat64
        write(references, values)

    def run(self, begin: float, end: float, size: float) -> None:
        for k in range(round((end - begin) / size)):
            self.fmi.doStep(begin + k * size, size)

    def save(self) -> ctypes.c_void_p:
        return self.fmi.getFMUstate() if self.version == 2 else self.fmi.getFMUState()

    def restore(self, state: ctypes.c_void_p) -> None:
        (self.fmi.setFMUstate if self.version == 2 else self.fmi.setFMUState)(state)

    def free(self, state: ctypes.c_void_p) -> None:
        (self.fmi.freeFMUstate if self.version == 2 else self.fmi.freeFMUState)(state)

    def serialize(self, state: ctypes.c_void_p) -> bytes:
        if self.version == 2:
            return bytes(self.fmi.serializeFMUstate(state))
        return bytes(self.fmi.serializeFMUState(state))

    def deserialize(self, data: bytes) -> ctypes.c_void_p:
        if self.version == 2:
            return self.fmi.deSerializeFMUstate(data)
        return self.fmi.deserializeFMUState(data)

    @contextmanager
    def refuses(self, status: int, match: str) -> Iterator[None]:
        """The call fails with `status` and one message that matches; no value changes."""
        before = self.serialize(self.save())
        count = len(self.log)
        with pytest.raises(FMICallException, match="failed") as caught:
            yield
        assert caught.value.status == status
        assert [(s, c) for s, c, _ in self.log[count:]] == [(status, "logStatusError")]
        assert re.search(match, self.log[-1][2]), self.log[-1][2]
        assert self.serialize(self.save()) == before


def oscillate(x: Sequence[float], u: float, t: float, k: float = 4.0, d: float = 0.5) -> np.ndarray:
    """State of the oscillator after t with constant input: the matrix exponential."""
    A = np.array([[0.0, 1.0, 0.0], [-k, -d, 1.0], [0.0, 0.0, 0.0]])
    return (expm(A * t) @ [*x, u])[:2]
