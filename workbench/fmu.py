"""An FMU under an observer's control, stage 2: the only file that knows FMPy.

The extended-FMI pattern of Brembeck et al. (2014): set and read continuous states, evaluate
derivatives, linearise, step, save and roll back. Standard Model Exchange offers all of it except
the step, which is done here: linearly implicit, because the slip mode of a wheelset has time
constants from milliseconds at speed to microseconds at standstill.
"""

import ctypes
import hashlib
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import fmpy
import numpy as np
from fmpy import fmi2, fmi3
from numpy.typing import NDArray

from workbench.errors import InputError

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

_FUNCTIONS = {
    "2.0": {
        "time": "fmi2SetTime",
        "set_states": "fmi2SetContinuousStates",
        "get_states": "fmi2GetContinuousStates",
        "derivatives": "fmi2GetDerivatives",
        "set": "fmi2SetReal",
        "get": "fmi2GetReal",
        "directional": "fmi2GetDirectionalDerivative",
        "save": "fmi2GetFMUstate",
        "restore": "fmi2SetFMUstate",
        "release": "fmi2FreeFMUstate",
    },
    "3.0": {
        "time": "fmi3SetTime",
        "set_states": "fmi3SetContinuousStates",
        "get_states": "fmi3GetContinuousStates",
        "derivatives": "fmi3GetContinuousStateDerivatives",
        "set": "fmi3SetFloat64",
        "get": "fmi3GetFloat64",
        "directional": "fmi3GetDirectionalDerivative",
        "save": "fmi3GetFMUState",
        "restore": "fmi3SetFMUState",
        "release": "fmi3FreeFMUState",
    },
}


class FMUError(RuntimeError):
    """A call into an FMU failed; the message holds what the FMU logged."""


@dataclass(frozen=True)
class Variables:
    """A fixed set of variables of one FMU, with a buffer for their values.

    The buffer and the references stay in place, so that a call into the FMU needs no conversion.
    """

    names: tuple[str, ...]
    references: NDArray[np.uint32]
    values: Vector


@dataclass(frozen=True)
class Linearisation:
    """dx/dt ~ A dx + B du, dy ~ C dx + D du about a point; shapes (n, n), (n, m), (l, n), (l, m)."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix


class FMU:
    """One instance of a Model Exchange FMU, FMI 2.0 or 3.0.

    Parameters
    ----------
    path : the FMU file.

    Attributes
    ----------
    states, inputs, outputs, parameters : names, in the order of the model description.
    units : unit of each variable that has one.
    defaults : start values of the model description, in the FMU's units.
    sha256 : hash of the file, its identity in results.

    Raises
    ------
    InputError
        If the file is no FMU, or has no Model Exchange for this machine.
    FMUError
        If the FMU refuses to be instantiated.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        description = _read(path)
        self.sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
        self.version: str = description.fmiVersion
        self.name: str = description.modelName
        by_causality = {
            kind: tuple(v.name for v in description.modelVariables if v.causality == kind)
            for kind in ("input", "output", "parameter")
        }
        self.inputs, self.outputs = by_causality["input"], by_causality["output"]
        self.parameters = by_causality["parameter"]
        self.units = {v.name: v.unit for v in description.modelVariables if v.unit}
        self._references = {v.name: v.valueReference for v in description.modelVariables}
        rates = [
            v
            for v in description.modelVariables
            if v.derivative is not None and _is_state_derivative(v, description)
        ]
        self.states = tuple(v.derivative.name for v in rates)
        self._rates = np.array([v.valueReference for v in rates], np.uint32)
        self.defaults = {
            v.name: float(v.start)
            for v in description.modelVariables
            if v.start is not None and v.type in ("Real", "Float64")
        }
        exchange = description.modelExchange
        self.has_directional_derivatives = bool(exchange.providesDirectionalDerivative)
        self.has_fmu_state = bool(exchange.canGetAndSetFMUstate)
        self._log: list[str] = []
        self._folder = tempfile.mkdtemp(prefix="fmu-")
        fmpy.extract(str(path), self._folder)
        self._instance = self._instantiate(description)
        self._component = ctypes.c_void_p(_address(self._instance.component))
        dll = self._instance.dll
        # A fresh pointer per function: FMPy's own carry argument types that cost conversions.
        self._call = {use: dll[name] for use, name in _FUNCTIONS[self.version].items()}
        self._call["time"].argtypes = [ctypes.c_void_p, ctypes.c_double]
        self._x = np.zeros(len(self.states))
        self._dx = np.zeros(len(self.states))
        self._state_variables = self.variables(self.states)
        self._initialised = False

    def _instantiate(self, description: "fmpy.model_description.ModelDescription") -> "fmpy.fmi1._FMU":
        arguments = {
            "guid": description.guid,
            "unzipDirectory": self._folder,
            "modelIdentifier": description.modelExchange.modelIdentifier,
            "instanceName": description.modelExchange.modelIdentifier,
        }
        log = self._log

        def log3(environment: object, status: int, category: bytes, message: bytes) -> None:
            log.append((message or b"").decode(errors="replace"))

        def log2(
            environment: object, instance: bytes, status: int, category: bytes, message: bytes
        ) -> None:
            log.append((message or b"").decode(errors="replace"))

        if self.version == "3.0":
            instance = fmi3.FMU3Model(**arguments)
            instance.instantiate(logMessage=log3)
            return instance
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(log2)
        callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmi2.calloc)
        callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmi2.free)
        instance = fmi2.FMU2Model(**arguments)
        instance.instantiate(callbacks=callbacks)
        return instance

    def __enter__(self) -> "FMU":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free the instance and the unpacked files."""
        self._instance.freeInstance()
        shutil.rmtree(self._folder, ignore_errors=True)

    # --- variables ---

    def variables(self, names: Sequence[str]) -> Variables:
        """Look names up once, for many calls of `get` and `set`.

        Raises
        ------
        InputError
            If the FMU has no variable of a name.
        """
        for name in names:
            if name not in self._references:
                raise InputError(
                    where=str(self.path),
                    found=f"no variable '{name}'",
                    expected=f"one of {', '.join(self.inputs + self.outputs)}",
                    remedy="use an FMU that has it, or map its name",
                )
        references = np.array([self._references[n] for n in names], np.uint32)
        return Variables(tuple(names), references, np.zeros(len(names)))

    def get(self, variables: Variables) -> Vector:
        """Read values; returns (k,) in the FMU's units, the buffer of `variables` itself."""
        self._real("get", variables)
        return variables.values

    def set(self, variables: Variables, values: Vector) -> None:
        """Set values, (k,) in the FMU's units."""
        variables.values[:] = values
        self._real("set", variables)

    def _real(self, use: str, variables: Variables) -> None:
        count = variables.references.size
        if not count:
            return
        pointer = variables.values.ctypes.data
        tail = (ctypes.c_size_t(count),) if self.version == "3.0" else ()
        self._checked(
            use,
            ctypes.c_void_p(variables.references.ctypes.data),
            ctypes.c_size_t(count),
            ctypes.c_void_p(pointer),
            *tail,
        )

    def _checked(self, use: str, *arguments: object) -> None:
        status = self._call[use](self._component, *arguments)
        if status > 1:
            names = {2: "discard", 3: "error", 4: "fatal", 5: "pending"}
            logged = "; ".join(self._log[-3:]) or "the FMU logged nothing"
            self._log.clear()
            function = _FUNCTIONS[self.version][use]
            raise FMUError(f"{self.path.name}: {function} returned {names.get(status)}: {logged}")

    # --- the extended-FMI pattern ---

    def start(
        self, states: Mapping[str, float], parameters: Mapping[str, float] | None = None
    ) -> None:
        """Reset and initialise at time 0, then enter continuous-time mode.

        Parameters
        ----------
        states : start values of states, in the FMU's units; others keep their defaults.
        parameters : values of parameters; others keep their defaults.
        """
        instance = self._instance
        if self._initialised:
            instance.reset()
        given = {**(parameters or {}), **states}
        variables = self.variables(list(given))
        if self.version == "3.0":
            self.set(variables, np.array(list(given.values())))
            instance.enterInitializationMode()
            instance.exitInitializationMode()
        else:
            instance.setupExperiment()
            self.set(variables, np.array(list(given.values())))
            instance.enterInitializationMode()
            instance.exitInitializationMode()
            instance.newDiscreteStates()
        instance.enterContinuousTimeMode()
        self._initialised = True

    def set_time(self, t: float) -> None:
        """Set the time [s]."""
        self._checked("time", t)

    def set_states(self, x: Vector) -> None:
        """Set the continuous states, (n,)."""
        self._x[:] = x
        self._states("set_states", self._x)

    def get_states(self) -> Vector:
        """Continuous states, (n,)."""
        self._states("get_states", self._x)
        return self._x.copy()

    def derivatives(self) -> Vector:
        """Derivatives of the states, (n,)."""
        self._states("derivatives", self._dx)
        return self._dx.copy()

    def _states(self, use: str, buffer: Vector) -> None:
        if buffer.size:
            self._checked(use, ctypes.c_void_p(buffer.ctypes.data), ctypes.c_size_t(buffer.size))

    def jacobian(self, unknowns: NDArray[np.uint32], knowns: Variables) -> Matrix:
        """Derivatives d(unknowns)/d(knowns), (rows, columns).

        Directional derivatives of the FMU; central differences where it offers none. Knowns are
        states, inputs or tunable parameters; unknowns are value references.
        """
        columns = knowns.references.size
        result = np.zeros((columns, unknowns.size))
        if not self.has_directional_derivatives:
            return self._difference(unknowns, knowns)
        seed = np.ones(1)
        tail: tuple[object, ...] = ()
        for j in range(columns):
            known = ctypes.c_void_p(knowns.references[j:].ctypes.data)
            unknown = ctypes.c_void_p(unknowns.ctypes.data)
            size, one = ctypes.c_size_t(unknowns.size), ctypes.c_size_t(1)
            seeds, out = ctypes.c_void_p(seed.ctypes.data), ctypes.c_void_p(result[j].ctypes.data)
            if self.version == "3.0":
                tail = (seeds, one, out, size)
            else:
                tail = (seeds, out)
            self._checked("directional", unknown, size, known, one, *tail)
        return result.T

    def _difference(self, unknowns: NDArray[np.uint32], knowns: Variables) -> Matrix:
        """Central differences; the step balances truncation and rounding (cube root of eps)."""
        probe = Variables((), unknowns, np.zeros(unknowns.size))
        centre = self.get(knowns).copy()
        columns = []
        for j, value in enumerate(centre):
            step = np.finfo(float).eps ** (1 / 3) * max(abs(value), 1e-3)
            sides = []
            for side in (step, -step):
                moved = centre.copy()
                moved[j] += side
                self._inject(knowns, moved)
                sides.append(self.get(probe).copy())
            columns.append((sides[0] - sides[1]) / (2 * step))
        self._inject(knowns, centre)
        return np.column_stack(columns)

    def _inject(self, variables: Variables, values: Vector) -> None:
        """Set states through the state vector, anything else by reference."""
        if set(variables.names) <= set(self.states):
            x = self.get_states()
            x[[self.states.index(name) for name in variables.names]] = values
            self.set_states(x)
        else:
            self.set(variables, values)

    def state_jacobian(self) -> Matrix:
        """A = d(dx/dt)/dx at the present point, (n, n)."""
        return self.jacobian(self._rates, self._state_variables)

    def input_jacobian(self, inputs: Variables) -> Matrix:
        """B = d(dx/dt)/du at the present point, (n, m)."""
        return self.jacobian(self._rates, inputs)

    def linearise(self, inputs: Variables, outputs: Variables) -> Linearisation:
        """Linearise about the present point."""
        return Linearisation(
            A=self.state_jacobian(),
            B=self.input_jacobian(inputs),
            C=self.jacobian(outputs.references, self._state_variables),
            D=self.jacobian(outputs.references, inputs),
        )

    def step(self, h: float) -> Vector:
        """Advance the states by h [s] with inputs as they are; returns the new states, (n,).

        Linearly implicit Euler, x + (I - h A)^-1 h f(x): L-stable, no iteration, and its result lies
        on the linearised slow manifold, so that a stiff slip mode does not disturb the force.
        Source: Hairer and Wanner (1996), Solving Ordinary Differential Equations II, IV.7.
        """
        x = self.get_states()
        system = np.eye(x.size) - h * self.state_jacobian()
        x = x + np.linalg.solve(system, h * self.derivatives())
        self.set_states(x)
        return x

    def save(self) -> ctypes.c_void_p:
        """Save the complete state of the instance; hand it to `restore`, then to `release`."""
        saved = ctypes.c_void_p()
        self._checked("save", ctypes.byref(saved))
        return saved

    def restore(self, saved: ctypes.c_void_p) -> None:
        """Roll the instance back to a saved state."""
        self._checked("restore", saved)

    def release(self, saved: ctypes.c_void_p) -> None:
        """Free a saved state."""
        self._checked("release", ctypes.byref(saved))


def _read(path: Path) -> "fmpy.model_description.ModelDescription":
    """Read and check the model description."""
    if not path.is_file():
        raise InputError(
            where=str(path),
            found="no such file",
            expected="an FMU",
            remedy="build the FMUs with 'make fmus' or give the path of one with --fmu",
        )
    try:
        description = fmpy.read_model_description(str(path), validate=False)
    except Exception as error:  # FMPy raises bare Exception for anything that is no FMU
        raise InputError(
            where=str(path),
            found=f"a file that is no FMU ({error})",
            expected="an FMU of FMI 2.0 or 3.0",
            remedy="export the model again",
        ) from None
    if description.fmiVersion not in _FUNCTIONS or description.modelExchange is None:
        kinds = "Co-Simulation only" if description.modelExchange is None else "Model Exchange"
        raise InputError(
            where=str(path),
            found=f"FMI {description.fmiVersion}, {kinds}",
            expected="Model Exchange of FMI 2.0 or 3.0, whose states an observer can set",
            remedy="export the model for Model Exchange",
        )
    if fmpy.platform_tuple not in fmpy.supported_platforms(str(path)) and (
        fmpy.platform not in fmpy.supported_platforms(str(path))
    ):
        raise InputError(
            where=str(path),
            found=f"binaries for {', '.join(fmpy.supported_platforms(str(path))) or 'no platform'}",
            expected=f"a binary for this machine ({fmpy.platform_tuple})",
            remedy="compile the FMU's sources, for instance with 'fmpy compile'",
        )
    return description


def _is_state_derivative(
    variable: "fmpy.model_description.ModelVariable",
    description: "fmpy.model_description.ModelDescription",
) -> bool:
    return any(unknown.variable is variable for unknown in description.derivatives)


def _address(component: object) -> int:
    """Plain address of an instance pointer."""
    value = getattr(component, "value", component)
    if not isinstance(value, int):
        raise FMUError("the FMU was not instantiated")
    return value
