"""An FMU under an observer's control, stage 2.

The extended-FMI pattern of Brembeck et al. (2014): set and read continuous states, evaluate
derivatives, linearise, step, save and roll back. Standard Model Exchange offers all of it except
the step, which is done here: linearly implicit, because machines have
motions of microseconds beside those of seconds.
"""

import ctypes
import math
import os
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple, Self
from weakref import WeakMethod, WeakValueDictionary

import numpy as np
from fmpy import fmi2, fmi3
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError, InputError, one_line, unknown_name
from workbench.models import fmu_cache
from workbench.models.archive import unpack
from workbench.models.description import (
    CO_SIMULATION,
    MODEL_EXCHANGE,
    OWN_TOOL,
    Description,
    Variable,
    read_description,
)
from workbench.models.trial import (
    PROXY,
    built_here,
    contradict_derivatives,
    derivatives_hold,
    remembers_steps,
    require_trial,
    unloadable,
)
from workbench.runtime.files import TemporaryFolder, own_umask

_FUNCTIONS = {
    "time": {"2.0": "fmi2SetTime", "3.0": "fmi3SetTime"},
    "set_states": {"2.0": "fmi2SetContinuousStates", "3.0": "fmi3SetContinuousStates"},
    "get_states": {"2.0": "fmi2GetContinuousStates", "3.0": "fmi3GetContinuousStates"},
    "derivatives": {"2.0": "fmi2GetDerivatives", "3.0": "fmi3GetContinuousStateDerivatives"},
    "set": {"2.0": "fmi2SetReal", "3.0": "fmi3SetFloat64"},
    "get": {"2.0": "fmi2GetReal", "3.0": "fmi3GetFloat64"},
    "nominals": {
        "2.0": "fmi2GetNominalsOfContinuousStates",
        "3.0": "fmi3GetNominalsOfContinuousStates",
    },
    "complete_step": {"2.0": "fmi2CompletedIntegratorStep", "3.0": "fmi3CompletedIntegratorStep"},
    "indicators": {"2.0": "fmi2GetEventIndicators", "3.0": "fmi3GetEventIndicators"},
    "directional": {"2.0": "fmi2GetDirectionalDerivative", "3.0": "fmi3GetDirectionalDerivative"},
    "do_step": {"2.0": "fmi2DoStep", "3.0": "fmi3DoStep"},
    "save": {"2.0": "fmi2GetFMUstate", "3.0": "fmi3GetFMUState"},
    "restore": {"2.0": "fmi2SetFMUstate", "3.0": "fmi3SetFMUState"},
    "release": {"2.0": "fmi2FreeFMUstate", "3.0": "fmi3FreeFMUState"},
    "size": {"2.0": "fmi2SerializedFMUstateSize", "3.0": "fmi3SerializedFMUStateSize"},
    "serialise": {"2.0": "fmi2SerializeFMUstate", "3.0": "fmi3SerializeFMUState"},
    "deserialise": {"2.0": "fmi2DeSerializeFMUstate", "3.0": "fmi3DeserializeFMUState"},
}

_NEEDED = {
    MODEL_EXCHANGE: ("time", "set_states", "get_states", "derivatives", "set", "get"),
    CO_SIMULATION: ("do_step", "set", "get"),
}

# Ends of FMPy's functions for numbers that are no scalars of type Real or Float64, by type.
_ACCESSORS = {
    "Integer": "Integer",
    "Enumeration": "Integer",
    "Boolean": "Boolean",
    **{
        name: name
        for name in (
            "Float32",
            "Float64",
            *(f"{sign}Int{n}" for sign in ("", "U") for n in (8, 16, 32, 64)),
        )
    },
}

_STATUSES: Mapping[int | str, str] = {
    2: "discard (it cannot do that at these values)",
    3: "error",
    4: "fatal",
    5: "pending",
}
# Places in `FMU.notes`.
WARNED, REFUSED_BY, STATUS, STATE = range(4)
_WARNING, _DISCARD, _FATAL = 1, 2, 4  # status of FMI
_LOGGED = 3  # messages that an error shows
# Of a step, relative to the state and to its nominal value: far below what a sensor resolves.
# Integration here keeps it, and an FMU is asked to in its own: without, Dymola's is off by 6e-5.
TOLERANCE = 1e-8
_SAME_STEP = 1e-4  # by which sample times may differ: what rounding of time stamps leaves
_STEP = float(np.finfo(float).eps) ** (1 / 3)  # of differences, relative
SAME_RATE = 1e-4  # of its size, by which iterations within a model may change a rate
ALIKE = 1e3  # times: what a start or a scale says of a size is rougher than factors of ten
# Points of a recording at which directional derivatives are compared with differences; shares of a
# derivative: differences of one that agree less show a bend, and it is wrong by more.
_COMPARED, _BENDS, _WRONG = 20, 0.01, 0.03
_MOST_ITERATIONS = 100  # of discrete states at one event; models need some

_CLASSES = {
    (MODEL_EXCHANGE, "2.0"): fmi2.FMU2Model,
    (MODEL_EXCHANGE, "3.0"): fmi3.FMU3Model,
    (CO_SIMULATION, "2.0"): fmi2.FMU2Slave,
    (CO_SIMULATION, "3.0"): fmi3.FMU3Slave,
}


def _limits(type_name: str) -> tuple[float, float]:
    """Least and greatest number that a type holds; ctypes would wrap others around."""
    if type_name == "Boolean":
        return 0.0, 1.0
    if type_name in ("Float32", "Float64"):
        largest = float(np.finfo(type_name.lower()).max)
        return -largest, largest
    integer = np.iinfo("int32" if type_name in ("Integer", "Enumeration") else type_name.lower())
    return float(integer.min), float(integer.max)


def _called(description: Description) -> str:
    kept = fmu_cache.is_cached(description.path)
    return f"model {description.name}" if kept else description.path.name


def co_simulation_alone(description: Description, found: str) -> InputError:
    """The refusal of an FMU whose states nobody can set or differentiate."""
    offered = ", ".join(description.interfaces)
    return InputError(
        where=str(description.path),
        found=f"{offered}, without {found}",
        expected="Model Exchange, which lets states be set and says their derivatives",
        remedy="export the model for Model Exchange. With Co-Simulation alone these run: workbench "
        "simulate --estimator open_loop, workbench fit, workbench diagnose",
    )


class EventError(FMUError):
    """A model passes an event, at which the method does not stop, or remembers its steps."""


class NoFunctionError(FMUError):
    """Rates of a model do not follow from time, states and inputs alone."""


class EventUpdate(NamedTuple):
    """What an FMU says after an event."""

    time: float  # of the next time event [s], infinite where there is none
    nominals_changed: bool  # of the continuous states, whose values may change at any event


def _weakly(method: Callable[..., None]) -> Callable[..., None]:
    """Call a method while its object lives: a cycle would keep an FMU that nobody uses loaded."""
    reference = WeakMethod(method)

    def call(*arguments: Any) -> None:
        if (living := reference()) is not None:
            living(*arguments)

    return call


# FMI 2.0 hands a message as `printf` takes it, with arguments that only C can read. FMPy's proxy
# formats it, for one callback of the process: this one, which finds who logged by the environment.
_LOGGING: WeakValueDictionary[int, "FMUInstance"] = WeakValueDictionary()


def _log_formatted(environment: int | None, *arguments: Any) -> None:
    """Hand a message to the instance of its environment; to the last one if an FMU says none."""
    # As items: by keys, one that is collected meanwhile would be an error.
    instances = dict(_LOGGING.items())
    if instances:
        instances.get(environment or 0, instances[max(instances)])._note(*arguments)


_LOGGER = fmi2.fmi2CallbackLoggerTYPE(_log_formatted)


class FMUInstance:
    """An FMU that is unpacked and loaded, with one instance.

    Raises
    ------
    InputError
        If the FMU has no such interface for this machine, or its archive or binary is damaged.
    FMUError
        If it refuses to be instantiated, or is not known and does not stand being tried.
    """

    interface: str

    def __init__(self, description: Description) -> None:
        identifier = description.require(self.interface).identifier
        self.version = description.version  # of FMI
        self.description = description
        self.notes = np.zeros(4, np.int64)
        self._log: deque[str] = deque(maxlen=_LOGGED)
        self._warning_messages, self._first_warning = 0, ""
        self._number = max(_LOGGING, default=0) + 1
        _LOGGING[self._number] = self
        own_umask()  # before a model can change it
        self._scratch = TemporaryFolder()
        try:
            library = description.library(self.interface)
            folder = self._scratch.path
            unpack(description.path, folder, str(PurePosixPath(library).parent))
            require_trial(description, self.interface, folder)
            self._library = str(folder / library)
            self._load(identifier)
        except BaseException:
            self._scratch.close()
            raise

    def _load(self, identifier: str) -> None:
        """Load the library and make an instance."""
        here = os.getcwd()
        try:
            self._instance = _CLASSES[self.interface, self.version](
                guid=self.description.token,
                unzipDirectory=str(self._scratch.path),
                modelIdentifier=identifier,
                instanceName=identifier,
                libraryPath=self._library,
                fmiCallLogger=_weakly(self._note_call),
            )
        except Exception as error:  # FMPy raises bare Exception where a library cannot be loaded
            os.chdir(here)  # it looks for the library in its own folder, and stays there
            message = str(error).replace(f"{self._scratch.path}{os.sep}", "")
            raise unloadable(self.description.path, message) from None
        dll = self._instance.dll
        self._require(dll)
        # A fresh pointer per function: FMPy's own carry argument types that cost conversions.
        names = {use: function[self.version] for use, function in _FUNCTIONS.items()}
        self._call = {use: dll[name] for use, name in names.items() if hasattr(dll, name)}
        if "time" in self._call:
            self._call["time"].argtypes = [ctypes.c_void_p, ctypes.c_double]
        self._instantiate()

    def _require(self, library: ctypes.CDLL) -> None:
        """Refuse a library without the functions that every use needs."""
        names = [_FUNCTIONS[use][self.version] for use in _NEEDED[self.interface]]
        if missing := [name for name in names if not hasattr(library, name)]:
            raise InputError(
                where=str(self.description.path),
                found=f"a binary without the function {missing[0]}",
                expected=f"all of FMI {self.version}, {self.interface}",
                remedy="export the model again",
            )

    def _instantiate(self) -> None:
        try:
            if self.version == "3.0":
                self._instance.instantiate(logMessage=_weakly(self._note))
            else:
                callbacks = fmi2.fmi2CallbackFunctions()
                callbacks.logger = _LOGGER
                callbacks.componentEnvironment = self._number
                callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmi2.calloc)
                callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmi2.free)
                if PROXY is not None:
                    PROXY.addLoggerProxy(ctypes.byref(callbacks))
                self._instance.instantiate(callbacks=callbacks)
        except Exception as error:  # FMPy raises bare Exception where the FMU returns NULL
            raise FMUError(f"{_called(self.description)}: {error}: {self._logged()}") from None
        self._component = ctypes.c_void_p(self._instance.component)
        self._used = False

    def _note(self, *arguments: Any) -> None:
        """Keep what the FMU logs, at last its status, category, message."""
        message = one_line((arguments[-1] or b"").decode(errors="replace").strip())
        self._log.append(message)
        if arguments[-3] == _WARNING:
            self._warning_messages += 1
            self._first_warning = self._first_warning or message

    def _note_call(self, text: str) -> None:
        """Count warnings of calls that FMPy makes, which it passes over."""
        self.notes[WARNED] += text.endswith("-> WARNING")

    def take_warning(self) -> str:
        """How often the FMU warned since this was asked last, and its first message; or nothing."""
        count = max(int(self.notes[WARNED]), self._warning_messages)
        first = self._first_warning or "no message, but the status of a call"
        self.notes[WARNED], self._warning_messages, self._first_warning = 0, 0, ""
        if not count:
            return ""
        times = f"{count} times, first" if count > 1 else "once"
        return f"the FMU {_called(self.description)} warned {times}: {first}"

    def close(self) -> None:
        """Free the instance and the unpacked files."""
        self._instance.freeInstance()
        self._scratch.close()

    @property
    def is_own(self) -> bool:
        """Whether it was built here, from equations."""
        return self.description.tool.startswith(OWN_TOOL)

    def renew(self, *, reload: bool) -> None:
        """Free the instance and make a new one; with `reload` of a library loaded anew."""
        if reload:
            self._instance.freeInstance()
            self._load(self._instance.modelIdentifier)
            return
        free = "fmi3FreeInstance" if self.version == "3.0" else "fmi2FreeInstance"
        getattr(self._instance, free)(self._instance.component)
        self._instantiate()

    def initialise(self, prepare: Callable[[], None], time: float) -> float:
        """Reset and initialise; in Model Exchange enter continuous-time mode.

        Parameters
        ----------
        prepare : sets what differs from the start values.
        time : at which the model starts [s].

        Returns
        -------
        Time of the next time event [s], infinite where the FMU tells none.

        Raises
        ------
        FMUError
            If the FMU refuses a call, or asks to end.
        """
        # Those built here keep 1e-6 by themselves, with which the recordings of the rig were made.
        # Model Exchange is integrated here; Dymola's warns of a tolerance that it has no use for.
        alone = self.interface == CO_SIMULATION and not self.is_own
        tolerance = TOLERANCE if alone else None
        try:
            if self._used:
                self._reset()
            self._used, instance = True, self._instance
            if self.version == "2.0":
                instance.setupExperiment(tolerance=tolerance, startTime=time)
            prepare()
            if self.version == "2.0":
                instance.enterInitializationMode()
            else:
                instance.enterInitializationMode(tolerance=tolerance, startTime=time)
            instance.exitInitializationMode()
            if self.interface == CO_SIMULATION:
                return math.inf
            return self._update_discrete_states().time
        except FMICallException as error:
            raise self.refusal(error.function, error.status) from None

    def _reset(self) -> None:
        """Reset the instance; of a Co-Simulation that refuses it, take a new one.

        A Model Exchange may be held by compiled loops.
        """
        try:
            self._instance.reset()
        except FMICallException as error:
            if self.interface != CO_SIMULATION or error.status == _FATAL:
                raise
            self.renew(reload=True)  # some keep values that outlast an instance

    def pass_event(self, prepare: Callable[[], None]) -> EventUpdate:
        """Enter Event Mode, set what changes there, and go on in continuous time.

        Parameters
        ----------
        prepare : sets inputs that jump.

        Raises
        ------
        FMUError
            If the FMU refuses a call, or asks to end.
        """
        try:
            self._instance.enterEventMode()
            prepare()
            return self._update_discrete_states()
        except FMICallException as error:
            raise self.refusal(error.function, error.status) from None

    def _update_discrete_states(self) -> EventUpdate:
        """Iterate until the discrete states are stable, and go on in continuous time.

        Source: FMI 2.0.4, section 3.2.2; FMI 3.0, 3.2.1.
        """
        instance = self._instance
        update = (
            instance.newDiscreteStates if self.version == "2.0" else instance.updateDiscreteStates
        )
        nominals_changed = False
        for _ in range(_MOST_ITERATIONS):
            needed, end, nominals, _, defined, time = update()
            nominals_changed |= bool(nominals)
            if end:
                raise self.end_error()
            if not needed:
                instance.enterContinuousTimeMode()
                next_time = float(time) if defined else math.inf
                if math.isnan(next_time):
                    name = _called(self.description)
                    raise FMUError(f"{name}: it says that its next time event is at nan s")
                return EventUpdate(next_time, nominals_changed)
        raise FMUError(
            f"{_called(self.description)}: its discrete states are not stable after "
            f"{_MOST_ITERATIONS} iterations{self.at()}"
        )

    def complete_step(self) -> bool:
        """Say that a step of integration is over; returns whether it ends at a step event."""
        try:
            event, end = self._instance.completedIntegratorStep()
        except FMICallException as error:
            raise self.refusal(error.function, error.status) from None
        if end:
            raise self.end_error()
        return bool(event)

    def end_error(self) -> FMUError:
        """The error for an FMU that asks to end the simulation, with what it logged."""
        name = _called(self.description)
        return FMUError(f"{name}: it asks to end the simulation: {self._logged()}{self.at()}")

    def get_whole(self, variable: Variable) -> float:
        """Value of a variable whose type is not Real or Float64, as a number."""
        return float(self._whole_values(variable)[variable.element])

    def _whole_values(self, variable: Variable) -> list[float]:
        """Values of a variable, or of the array that it is an element of."""
        get = getattr(self._instance, f"get{self._accessor(variable)}")
        several = {"nValues": variable.size} if variable.of else {}
        try:
            return list(get([variable.reference], **several))
        except FMICallException as error:
            raise self.refusal(error.function, error.status) from None

    def _accessor(self, variable: Variable) -> str:
        """End of the name of FMPy's functions for a type that holds whole numbers, or Float32."""
        if variable.type == "Enumeration" and self.version == "3.0":
            return "Int64"
        return _ACCESSORS[variable.type]

    def set_whole(self, variable: Variable, value: float) -> None:
        """Set a parameter whose type is not Real or Float64, from a number.

        Raises
        ------
        InputError
            If the type does not hold the number.
        """
        low, high = _limits(variable.type)
        whole = variable.type not in ("Float32", "Float64")
        items = variable.items
        held = low <= value <= high and not (whole and value != int(value))
        if not held or (items and value not in items):
            raise InputError(
                where=f"{self.description.path}, variable '{variable.name}'",
                found=f"the value {value:g}",
                expected="0 or 1, of a Boolean"
                if variable.type == "Boolean"
                else f"{', '.join(map(str, items))}, an item of its enumeration"
                if items
                else f"a {'whole ' * whole}number from {low:.4g} to {high:.4g}, of {variable.type}",
                remedy="correct the value",
            )
        number = bool(value) if variable.type == "Boolean" else int(value) if whole else value
        values = self._whole_values(variable) if variable.of else [number]
        values[variable.element] = number
        try:
            getattr(self._instance, f"set{self._accessor(variable)}")([variable.reference], values)
        except FMICallException as error:
            raise self.refusal(error.function, error.status) from None

    def call(self, use: str, *arguments: object) -> None:
        """Call the function for a use such as "get".

        Raises
        ------
        FMUError
            If the FMU refuses the call.
        InputError
            If it has no such function: Co-Simulation alone does not let states be set.
        """
        if (status := self.try_call(use, *arguments)) > _WARNING:
            raise self.refusal(_FUNCTIONS[use][self.version], status)

    def try_call(self, use: str, *arguments: object) -> int:
        """Call the function for a use, see `call`; returns its status."""
        if use not in self._call:
            raise co_simulation_alone(self.description, _FUNCTIONS[use][self.version])
        status = int(self._call[use](self._component, *arguments))
        self.notes[WARNED] += status == _WARNING
        return status

    @property
    def instance_address(self) -> int:
        """Address of the instance, for compiled loops that call the FMU's functions."""
        return int(self._component.value or 0)

    def function_address(self, use: str) -> int:
        """Address of the FMU's function for a use such as "get"; 0 if it has none."""
        call = self._call.get(use)
        return int(ctypes.cast(call, ctypes.c_void_p).value or 0) if call else 0

    def function_at(self, address: int) -> str:
        """Name of the FMU's function at an address."""
        uses = (use for use in self._call if self.function_address(use) == address)
        return next((_FUNCTIONS[use][self.version] for use in uses), "a function")

    def refusal(self, function: str, status: int | str) -> FMUError:
        """The error for a call that returned `status`, with what the FMU logged."""
        name = _STATUSES.get(status, status)
        return FMUError(
            f"{_called(self.description)}: {function} returned {name}: {self._logged()}{self.at()}"
        )

    def at(self) -> str:
        """When something failed, as the end of a message."""
        return ""

    def _logged(self) -> str:
        text = "; ".join(self._log) or "the FMU logged nothing"
        self._log.clear()
        return text


References = NDArray[np.uint32]


@dataclass(frozen=True)
class Variables:
    """A fixed set of variables of one FMU, with a buffer for their values.

    The buffer and the references stay in place, so that a call into the FMU needs no conversion.
    """

    names: tuple[str, ...]
    references: References
    values: Vector

    @cached_property
    def arguments(self) -> tuple[ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p]:
        """References, their number and values, as calls into the FMU take them."""
        return (
            ctypes.c_void_p(self.references.ctypes.data),
            ctypes.c_size_t(self.references.size),
            ctypes.c_void_p(self.values.ctypes.data),
        )


@dataclass(frozen=True)
class TypedVariables:
    """A fixed set of variables of one FMU, of any types that hold numbers; see `FMU.typed`."""

    names: tuple[str, ...]
    # real, others: those of type Real or Float64, and all others
    real: Variables
    # real_at, others_at: their places among all
    real_at: NDArray[np.intp]
    others: tuple[Variable, ...]
    others_at: NDArray[np.intp]


@dataclass(frozen=True)
class Linearisation:
    """dx/dt ~ A dx + B du, dy ~ C dx + D du; shapes (n, n), (n, m), (l, n), (l, m)."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix


def central_differences(evaluate: Callable[[Vector], Vector], x: Vector, steps: Vector) -> Matrix:
    """Jacobian (rows, n) of `evaluate` at x (n,): (f(x + h_j e_j) - f(x - h_j e_j)) / (2 h_j).

    Parameters
    ----------
    steps : (n,) h.
    """
    columns = [
        (evaluate(x + step) - evaluate(x - step)) / (2 * step[j])
        for j, step in enumerate(np.diag(steps))
    ]
    return np.column_stack(columns)


class FMU(FMUInstance):
    """One instance of a Model Exchange FMU, FMI 2.0 or 3.0.

    Parameters
    ----------
    path : the FMU file.
    names : names to use for variables that the FMU names otherwise, {"p": "pressure"}.
    parameters : values that differ from those of the model description, in the FMU's units.

    Attributes
    ----------
    names : as given.
    states, inputs, outputs, parameters : names, in the order of the model description.
    units : unit of each variable that has one.
    defaults : start values, those given or of the model description, in the FMU's units.
    sha256 : hash of the file, its identity in results.
    start_time : at which the model starts [s], see `begin_at`.
    event_signs : (z,) whether event indicators were above 0 at the last start.
    time : (1,) that the FMU was set to last [s].
    next_event : (1,) time of the next time event [s], of the last start; infinite for none.
    notes : (4,) calls that it answered with a warning. Of what a compiled loop ended at: address of
        the function that refused, its status, and the state that moved without an event.
    directional_fmi : (1,) version of FMI whose directional derivatives are taken, 0 for none.
    rate_references : (n,) value references of the derivatives of the states.
    scales : typical size of signals that a system declares, in the FMU's units; see `sizes`.

    Raises
    ------
    InputError
        If the file is no FMU, or has no Model Exchange for this machine.
    FMUError
        If the FMU refuses to be instantiated.
    """

    interface = MODEL_EXCHANGE

    def __init__(
        self,
        path: Path,
        names: Mapping[str, str] | None = None,
        parameters: Mapping[str, float] | None = None,
    ) -> None:
        self.path = path
        self.names = dict(names or {})
        self._given = dict(parameters or {})
        self.description = read_description(path).renamed(self.names)
        offered = self.description.require(self.interface)
        self.sha256 = self.description.sha256
        self.name = self.description.name
        self.states = self.description.states
        self.inputs = self.description.names("input")
        self.outputs = self.description.names("output")
        self.parameters = self.description.names("parameter")
        self.units = {v.name: v.unit for v in self.description.variables if v.unit}
        self.defaults = {
            v.name: float(v.start)
            for v in self.description.variables
            if v.scalar and v.start is not None
        } | self._given
        self._references = {v.name: v.reference for v in self.description.variables}
        self._real_names = {v.name for v in self.description.variables if v.real}
        self._calculated = {v.name for v in self.description.variables if v.initial == "calculated"}
        # What states are calculated from: a reset does not restore it in FMUs of some tools.
        self._origins = {
            v.name: float(v.start)
            for v in self.description.variables
            if v.initial == "exact"
            and v.real
            and v.causality == "local"
            and v.variability == "continuous"
            and v.start is not None
            and not v.array
            and self._calculated.intersection(self.states)
        }
        self._whole = [
            v
            for v in self.description.variables
            if v.type in _ACCESSORS and not v.array and not v.real
        ]
        self.rate_references = np.array(
            [self._references[r] for r in self.description.rates], np.uint32
        )
        self.needs_completed_steps = offered.completed_steps
        self.saves_state = offered.saves_state
        self._x = np.zeros(len(self.states))
        self._dx = np.zeros(len(self.states))
        self._z = np.zeros(self.description.event_indicators)
        self.begin_at(None)
        self.event_signs = np.zeros(self._z.size, np.bool_)
        self.time = np.full(1, self.start_time)
        self.next_event = np.full(1, np.inf)
        super().__init__(self.description)
        # Wrong ones would be wrong steps of a model, and nothing would show it.
        self.directional_fmi = np.zeros(1, np.int64)
        self.has_directional_derivatives = offered.directional_derivatives and derivatives_hold(
            self.description
        )
        self.remembers_steps = self.needs_completed_steps and remembers_steps(self.description)
        self._variants: list[FMU] = []
        self.scales: Mapping[str, float] = {}

    @property
    def has_directional_derivatives(self) -> bool:
        """Whether directional derivatives of the FMU are taken, also by loops that are compiled."""
        return bool(self.directional_fmi[0])

    @has_directional_derivatives.setter
    def has_directional_derivatives(self, taken: bool) -> None:
        self.directional_fmi[0] = int(self.version[0]) if taken else 0

    def states_derivatives(self, unknowns: NDArray[np.uint32]) -> bool:
        """Whether the FMU states directional derivatives of these variables, by value reference.

        FMI asks for those of outputs and rates only; some tools refuse all others (FMI 2.0.4,
        section 2.1.9). FMUs that were built here have those of all variables.
        """
        if self.has_directional_derivatives and not self.is_own:
            outputs = self.references(list(filter(self.is_real, self.outputs)))
            asked = {*self.rate_references.tolist(), *outputs.tolist()}
            return asked.issuperset(unknowns.tolist())
        return self.has_directional_derivatives

    @cached_property
    def _state_variables(self) -> Variables:
        return self.variables(self.states)

    @property
    def place(self) -> str:
        """Where a refusal says it is: its file, or its model where it was built to be kept."""
        called = self.called
        return str(self.path) if called == self.path.name else called

    def at(self) -> str:
        """See FMUInstance; a Co-Simulation keeps its time to itself."""
        exchange = self.interface == MODEL_EXCHANGE
        return f"; at {self.time[0]:.9g} s of its time" if exchange else ""

    @property
    def called(self) -> str:
        """What messages call it: its file's name, or its model where it was built to be kept."""
        return _called(self.description)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the instance and the unpacked files, those of variants too."""
        for variant in self._variants:
            variant.close()
        super().close()

    def variant(self, parameters: Mapping[str, float]) -> "FMU":
        """Another instance with some parameters changed, which is closed with this one.

        Raises
        ------
        InputError
            If the FMU has one instance in a process alone.
        """
        if self.description.require(self.interface).one_instance_per_process:
            raise InputError(
                where=str(self.path),
                found="canBeInstantiatedOnlyOncePerProcess, and two instances are needed here, "
                "whose parameters differ",
                expected="an FMU that can have several instances in a process",
                remedy="export it so; simulate with other estimators than imm, fit and diagnose "
                "need one alone",
            )
        other = type(self)(self.path, self.names, {**self._given, **parameters})
        other.scales = self.scales
        self._variants.append(other)
        return other

    # --- variables ---

    def variables(self, names: Sequence[str]) -> Variables:
        """Look names up once, for many calls of `get` and `set`."""
        for name in names:
            if name not in self._references:
                raise unknown_name(
                    name,
                    self._references,
                    where=self.place,
                    found=f"no variable '{name}'",
                    expected=f"one of {', '.join(self.inputs + self.outputs)}",
                    remedy="use an FMU that has it. If the FMU names it otherwise, write "
                    f"variable = 'NAME' in the table of '{name}' of the system file, or "
                    f"--map {name}=NAME",
                )
            if name not in self._real_names:
                variable = self.description.by_name[name]
                raise InputError(
                    where=f"{self.place}, variable '{variable.name}'",
                    found=f"a variable of type {variable.type}"
                    + (", an array" if variable.array else "")
                    + (f", an element of '{variable.of}'" if variable.of else ""),
                    expected="a scalar of type Real (FMI 2.0) or Float64 (FMI 3.0)",
                    remedy="export the model with a real variable in its place, or leave this one "
                    "out"
                    + ". With it these run: workbench simulate --estimator open_loop, workbench "
                    "fit, workbench diagnose" * (variable.type in _ACCESSORS),
                )
        references = np.array([self._references[n] for n in names], np.uint32)
        return Variables(tuple(names), references, np.zeros(len(names)))

    def typed(self, names: Sequence[str]) -> TypedVariables:
        """Look up names of variables of any types that hold numbers."""
        whole = {v.name: v for v in self._whole}
        others = [i for i, name in enumerate(names) if name in whole]
        real = [i for i, name in enumerate(names) if name not in whole]
        return TypedVariables(
            names=tuple(names),
            real=self.variables([names[i] for i in real]),
            real_at=np.array(real, np.intp),
            others=tuple(whole[names[i]] for i in others),
            others_at=np.array(others, np.intp),
        )

    def get_typed(self, variables: TypedVariables) -> Vector:
        """Read values as numbers, (k,) in the FMU's units."""
        values = np.zeros(len(variables.names))
        values[variables.real_at] = self.get(variables.real)
        values[variables.others_at] = [self.get_whole(v) for v in variables.others]
        return values

    def set_typed(self, variables: TypedVariables, values: Vector) -> None:
        """Set values, (k,) in the FMU's units."""
        self.set(variables.real, values[variables.real_at])
        for variable, value in zip(variables.others, values[variables.others_at], strict=True):
            self.set_whole(variable, float(value))

    def get(self, variables: Variables) -> Vector:
        """Read values; returns (k,) in the FMU's units, the buffer of `variables` itself."""
        self._real("get", variables)
        return variables.values

    def set(self, variables: Variables, values: Vector) -> None:
        """Set values, (k,) in the FMU's units."""
        variables.values[:] = values
        self._real("set", variables)

    def _real(self, use: str, variables: Variables) -> None:
        references, count, values = variables.arguments
        if not count.value:
            return
        tail = (count,) if self.version == "3.0" else ()
        self.call(use, references, count, values, *tail)

    def references(self, names: Sequence[str]) -> References:
        """Value references of variables that there are, (k,)."""
        self.typed(names)
        return np.array([self._references[name] for name in names], np.uint32)

    def is_real(self, name: str) -> bool:
        """Whether a variable is a scalar of type Real or Float64."""
        return name in self._real_names

    def is_continuous(self, name: str) -> bool:
        """Whether a variable is real and may be set between events."""
        return any(
            v.name == name and v.real and v.variability == "continuous"
            for v in self.description.variables
        )

    def moves(self, name: str) -> bool:
        """Whether a variable may go on in a straight line; one of whole numbers jumps."""
        variable = self.description.by_name[name]
        return variable.variability == "continuous" and variable.floats

    # --- the extended-FMI pattern ---

    def begin_at(self, time: float | None) -> None:
        """Start at a time [s] from now on; None: that of the default experiment, 0 without one."""
        self.start_time = (self.description.start or 0.0) if time is None else time

    def start(
        self, states: Mapping[str, float], parameters: Mapping[str, float] | None = None
    ) -> None:
        """Reset and initialise at `start_time`, then enter continuous-time mode.

        Parameters
        ----------
        states : start values of states, in the FMU's units; others keep their defaults.
        parameters : values of parameters; others keep their defaults.
        """
        begin = {name: value for name, value in states.items() if name not in self._calculated}
        given = {**self._origins, **self._given, **(parameters or {}), **begin}
        whole = [(v, given.pop(v.name)) for v in self._whole if v.name in given]
        variables = self.variables(list(given))
        values = np.array(list(given.values()))

        def prepare() -> None:
            self.set(variables, values)
            for variable, value in whole:
                self.set_whole(variable, value)

        self.time[0] = self.start_time
        self.next_event[0] = self.initialise(prepare, self.start_time)
        if self.interface != MODEL_EXCHANGE:
            return
        x = self.get_states()
        wanted = np.array([states.get(name, x[i]) for i, name in enumerate(self.states)])
        if self.event_signs.size:
            self.event_signs[:] = self.event_indicators() > 0.0
        if not np.array_equal(x, wanted):  # such as of calculated ones
            self.set_states(wanted)
            signs = self.event_signs
            if signs.size and ((self.event_indicators() > 0.0) != signs).any():
                self.handle_event()  # it began elsewhere, in the mode of that place

    @property
    def has_events(self) -> bool:
        """Whether it has event indicators, named a time event at its start, or remembers steps."""
        announced = self.event_signs.size or np.isfinite(self.next_event[0])
        return bool(announced or self.remembers_steps)

    def check_event(self) -> None:
        """Refuse to go on if the FMU has passed an event since its start, or remembers steps."""
        if self.remembers_steps:
            raise EventError(
                f"{self.called}: its rates or outputs follow from earlier steps, too, as those of "
                "a delay. Only the open loop, fit and diagnose go step by step, and the Kalman "
                "filters ekf and ukf on an FMU that saves its state (canGetAndSetFMUState); "
                "results of other estimators would be wrong. Replace what is remembered by states"
            )
        signs = self.event_signs
        if (
            self.time[0] > self.next_event[0]
            or self.complete_step()
            or (signs.size and ((self.event_indicators() > 0.0) != signs).any())
        ):
            raise self.event_error()

    def event_error(self) -> EventError:
        """The error for an event of the model, which estimators do not treat."""
        return EventError(
            f"{self.called}: an event of the model by {self.time[0]:.6g} s of its time, or in "
            "the step after: an event indicator changes its sign, a time event is due, or the "
            "model asks for Event Mode or to end. Only the open loop, fit and diagnose go through "
            "events, and the Kalman filters ekf and ukf on an FMU that saves its state "
            "(canGetAndSetFMUState); results of other estimators would be wrong from there on. "
            "Replace jumps of the model by smooth functions, or cut the recording before the event"
        )

    def handle_event(
        self, variables: TypedVariables | None = None, values: Vector | None = None
    ) -> EventUpdate:
        """Update discrete states at the present point, with variables that jump there.

        Raises
        ------
        FMUError
            If the FMU asks to end, or its discrete states are not stable.
        """

        def prepare() -> None:
            if variables is not None and values is not None:
                self.set_typed(variables, values)

        update = self.pass_event(prepare)
        self.next_event[0] = update.time
        if self.event_signs.size:
            self.event_signs[:] = self.event_indicators() > 0.0
        return update

    @property
    def is_function(self) -> bool:
        """Whether nothing is to be shown by `require_function`.

        FMUs that were built here have no memory, and a Co-Simulation has its own.
        """
        return self.interface != MODEL_EXCHANGE or built_here(self.description)

    def require_function(
        self, inputs: Sequence[str], outputs: Sequence[str], time: Vector, x: Matrix, u: Matrix
    ) -> None:
        """Refuse rates and outputs that follow from more than time, states and inputs.

        Each point is visited twice, in opposite orders, from where the model was started; at each,
        outputs are read before rates, after them, and where the step is said to be over.

        Parameters
        ----------
        inputs, outputs : names, of any types that hold numbers.
        time, x, u : (k,) of the FMU [s], (k, n) states, (k, m) inputs.

        Raises
        ------
        NoFunctionError
        """
        able = [i for i, name in enumerate(inputs) if self.is_continuous(name)]
        driven, shown = self.variables([inputs[i] for i in able]), self.typed(outputs)
        names = [*self.description.rates, *outputs]

        def read() -> Vector:
            return np.concatenate([self.derivatives(), self.get_typed(shown)])

        def visit(k: int, *, ends: bool) -> Matrix:
            self.set_time(time[k])
            self.set(driven, u[k, able])
            self.set_states(x[k])
            unread = self.get_typed(shown)
            values = read()
            unread = np.concatenate([values[: x.shape[1]], unread])
            return np.array(
                [values, unread, values if not ends or self.complete_step() else read()]
            )

        forth = again = np.array([visit(k, ends=True) for k in range(time.size)])
        ends = not self.remembers_steps
        if not ends:  # steps go on in time alone
            self.start({})
            again = np.array([visit(k, ends=False) for k in range(time.size)])
        back = np.array([visit(k, ends=ends) for k in reversed(range(time.size))])[::-1]
        for first, other, then in (
            (forth[:, 0], forth[:, 1], "before derivatives are read"),
            (forth[:, 0], forth[:, 2], "once a step is said to be over, without an event"),
            (again[:, 0], back[:, 0], "there if it was at later points before"),
        ):
            known = np.where(np.isfinite(first), first, 0.0)  # one sample hides no other
            sizes = np.maximum(np.abs(known), np.ptp(known, axis=0))
            with np.errstate(invalid="ignore"):  # of what is infinite in both
                moved = np.abs(other - first) > SAME_RATE * sizes
            for k, i in np.argwhere(moved):
                raise NoFunctionError(
                    f"{self.called}: '{names[i]}' is {first[k, i]:.6g} at {time[k]:.6g} s of its "
                    f"time, or {other[k, i]:.6g} {then}: the model remembers calls, and no event "
                    "tells it. Export it with events where it switches, with states for what it "
                    "remembers, and without random numbers"
                )

    def check_derivatives(
        self, knowns: Sequence[str], outputs: Sequence[str], time: Vector, x: Matrix, u: Matrix
    ) -> None:
        """Take differences from now on if directional derivatives are others, along a recording.

        As those that hold at the start alone, or are of the point before. A derivative is wrong
        where differences to both sides, and those of ten times the step, agree with each other and
        not with it: a bend, or noise of an iteration, says nothing.

        Parameters
        ----------
        knowns : continuous inputs and corrections.
        outputs : names, of any types.
        time, x, u : (k,) of the FMU [s], (k, n) states, (k, m) values of `knowns`.
        """
        if not self.has_directional_derivatives:
            return
        shown = self.variables([y for y in outputs if y in self.outputs and self.is_real(y)])
        unknowns = np.concatenate([self.rate_references, shown.references])
        driven = self.variables(knowns)
        for k in np.unique(np.linspace(0, time.size - 1, _COMPARED).astype(int)):
            for variables in (self._state_variables, driven):
                self.set_time(time[k])
                self.set(driven, u[k])
                self.set_states(x[k])
                if self._contradicts(self.jacobian(unknowns, variables), variables, shown):
                    self.has_directional_derivatives = False
                    contradict_derivatives(self.description)
                    return

    def _contradicts(self, stated: Matrix, knowns: Variables, shown: Variables) -> bool:
        """Whether derivatives of rates and outputs at the present point are no differences."""

        def evaluate(values: Vector) -> Vector:
            self._inject(knowns, values)
            return np.concatenate([self.derivatives(), self.get(shown)])

        centre = self.get(knowns).copy()
        if not centre.size:
            return False
        steps = self.difference_steps(knowns.names, centre)
        at = evaluate(centre)[:, None]
        ahead, behind, wide, back = (
            np.column_stack([evaluate(centre + share * step) for step in np.diag(steps)])
            for share in (1.0, -1.0, 10.0, -10.0)
        )
        self._inject(knowns, centre)
        mean = (ahead - behind) / (2.0 * steps)
        bend = np.maximum(
            np.abs(ahead - 2.0 * at + behind) / steps, np.abs(mean - (wide - back) / (20.0 * steps))
        )
        rounding = 64.0 * np.finfo(float).eps * np.abs(at) / steps
        size = np.maximum(np.abs(stated), np.abs(mean))
        smooth = bend <= _BENDS * size + rounding
        return bool((smooth & (np.abs(stated - mean) > _WRONG * size + rounding)).any())

    def complete_step(self) -> bool:
        """Say that a step of integration is over; returns whether a step event is due.

        Raises
        ------
        FMUError
            If the FMU asks to end, or moves its states without an event.
        """
        if not self.needs_completed_steps:
            return False
        before = self.get_states()
        event = super().complete_step()
        after = self.get_states()
        moved = np.flatnonzero((after != before) & (np.isfinite(after) | np.isfinite(before)))
        if moved.size and not event:
            raise self.moved_error(int(moved[0]))
        return event

    def moved_error(self, state: int) -> FMUError:
        """The error for a state, by its place, that moved where there was no event."""
        return FMUError(
            f"{self.called}: it changes '{self.states[state]}' at the end of a step "
            f"without an event, by {self.time[0]:.9g} s of its time, which no integrator can "
            "follow. Export it with an event there (enterEventMode)"
        )

    def nominals(self) -> Vector:
        """Typical sizes of the states at the present point, (n,)."""
        sizes = np.ones(len(self.states))
        self._states("nominals", sizes)
        stated = np.isfinite(sizes) & (sizes != 0.0) & (sizes != 1.0)  # which FMI has for unknown
        return np.where(stated, np.abs(sizes), self.sizes(self.states))

    def sizes(self, names: Sequence[str]) -> Vector:
        """Typical sizes of variables, (k,): their nominal values.

        Of those without, 1, as FMI says, unless the scale of a signal of this name, or the start,
        is off that by orders of magnitude: 1 would make a charge of 1e-9 C unknown to 1 C.
        """
        return np.array([self._size(self.description.by_name[name]) for name in names])

    def _size(self, variable: Variable) -> float:
        if variable.nominal:
            return abs(variable.nominal)
        scale = self.scales.get(variable.name) or abs(self.defaults.get(variable.name, 0.0))
        return scale if scale and not 1.0 / ALIKE <= scale <= ALIKE else 1.0

    def event_indicators(self) -> Vector:
        """Values whose change of sign is a state event, (z,)."""
        self._states("indicators", self._z)
        return self._z.copy()

    def set_time(self, t: float) -> None:
        """Set the time [s]."""
        self.time[0] = t
        self.call("time", t)

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

    def unknown_rate(self) -> str:
        """A derivative that is no finite number where the FMU is, with the time; empty: none."""
        rates = self.derivatives()
        if np.isfinite(rates).all():
            return ""
        i = int(np.argmin(np.isfinite(rates)))
        return f"a derivative of '{self.states[i]}' that is {rates[i]:g}{self.at()}"

    def _states(self, use: str, buffer: Vector) -> None:
        if buffer.size:
            self.call(use, ctypes.c_void_p(buffer.ctypes.data), ctypes.c_size_t(buffer.size))

    def jacobian(self, unknowns: NDArray[np.uint32], knowns: Variables) -> Matrix:
        """Derivatives d(unknowns)/d(knowns), (rows, columns).

        Directional derivatives of the FMU; central differences where it states none. Knowns are
        states, inputs or tunable parameters; unknowns are value references.
        """
        columns = knowns.references.size
        result = np.zeros((columns, unknowns.size))
        if not result.size:
            return result.T
        if not self.states_derivatives(unknowns):
            return self._difference(unknowns, knowns)
        seed = np.ones(1)
        for j in range(columns):
            known = ctypes.c_void_p(knowns.references[j:].ctypes.data)
            unknown = ctypes.c_void_p(unknowns.ctypes.data)
            size, single = ctypes.c_size_t(unknowns.size), ctypes.c_size_t(1)
            seeds, out = ctypes.c_void_p(seed.ctypes.data), ctypes.c_void_p(result[j].ctypes.data)
            tail = (seeds, single, out, size) if self.version == "3.0" else (seeds, out)
            self.call("directional", unknown, size, known, single, *tail)
        return result.T

    def _difference(self, unknowns: NDArray[np.uint32], knowns: Variables) -> Matrix:
        """Central differences."""
        probe = Variables((), unknowns, np.zeros(unknowns.size))
        centre = self.get(knowns).copy()

        def evaluate(values: Vector) -> Vector:
            self._inject(knowns, values)
            return self.get(probe).copy()

        steps = self.difference_steps(knowns.names, centre)
        jacobian = central_differences(evaluate, centre, steps)
        self._inject(knowns, centre)
        return jacobian

    def difference_steps(self, names: Sequence[str], values: Vector) -> Vector:
        """Steps of differences about values, (k,): truncation and rounding are alike.

        A value far below its nominal one, such as zero, does not say its size.
        """
        steps: Vector = _STEP * np.maximum(np.abs(values), 1e-3 * self.sizes(names))
        return steps

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
        return self.jacobian(self.rate_references, self._state_variables)

    def input_jacobian(self, inputs: Variables) -> Matrix:
        """B = d(dx/dt)/du at the present point, (n, m)."""
        return self.jacobian(self.rate_references, inputs)

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

        Linearly implicit Euler, x + (I - h A)^-1 h f(x): L-stable, no iteration, and its result
        lies on the linearised slow manifold, so that a stiff motion does not disturb the slow ones.
        Source: Hairer and Wanner (1996), Solving Ordinary Differential Equations II, IV.7.
        """
        x = self.get_states()
        system = np.eye(x.size) - h * self.state_jacobian()
        x = x + np.linalg.solve(system, h * self.derivatives())
        self.set_states(x)
        return x

    def save(self, over: ctypes.c_void_p | None = None) -> ctypes.c_void_p:
        """Save the complete state of the instance; hand it to `restore`, then to `release`.

        Parameters
        ----------
        over : a saved state that is no longer needed, whose place it takes.
        """
        saved = ctypes.c_void_p() if over is None else over
        self.call("save", ctypes.byref(saved))
        return saved

    def restore(self, saved: ctypes.c_void_p) -> None:
        """Roll the instance back to a saved state."""
        self.call("restore", saved)

    def release(self, saved: ctypes.c_void_p) -> None:
        """Free a saved state."""
        self.call("release", ctypes.byref(saved))

    def serialise(self, saved: ctypes.c_void_p) -> bytes:
        """Turn a saved state into bytes, which outlive the instance."""
        size = ctypes.c_size_t()
        self.call("size", saved, ctypes.byref(size))
        buffer = ctypes.create_string_buffer(size.value)
        self.call("serialise", saved, buffer, size)
        return buffer.raw

    def deserialise(self, data: bytes) -> ctypes.c_void_p:
        """Turn bytes from any instance of this FMU back into a saved state."""
        saved = ctypes.c_void_p()
        self.call("deserialise", data, ctypes.c_size_t(len(data)), ctypes.byref(saved))
        return saved


class CoSimulation(FMU):
    """One instance of a Co-Simulation FMU, which brings its own integrator.

    Everything that works on states needs an FMU that offers it in Co-Simulation too, which the
    standard does not ask for; values, steps and saved states are standard.
    """

    interface = CO_SIMULATION

    def start(
        self, states: Mapping[str, float], parameters: Mapping[str, float] | None = None
    ) -> None:
        """Reset and initialise at `start_time`; see `FMU.start`."""
        super().start(states, parameters)
        self._t, self._length, self._goes_back = self.start_time, 0.0, False

    @cached_property
    def _typed_states(self) -> TypedVariables:
        return self.typed(self.states)

    def check_event(self) -> None:
        """Nothing: a Co-Simulation treats its events itself."""

    def jacobian(self, unknowns: NDArray[np.uint32], knowns: Variables) -> Matrix:
        """Derivatives, see `FMU.jacobian`; refused where the FMU has Co-Simulation alone."""
        if MODEL_EXCHANGE not in self.description.interfaces:
            raise co_simulation_alone(self.description, "derivatives")
        return super().jacobian(unknowns, knowns)

    def set_time(self, t: float) -> None:
        """Say where the next step begins [s], after `restore`."""
        self._t = t

    def set_slopes(self, inputs: Variables, slopes: Vector) -> None:
        """Set time derivatives of real inputs, (k,), from where the next step begins (FMI 2.0)."""
        try:
            self._instance.setRealInputDerivatives(
                inputs.references.tolist(), [1] * slopes.size, slopes.tolist()
            )
        except FMICallException as error:
            raise self.refusal(error.function, error.status) from None

    def save(self, over: ctypes.c_void_p | None = None) -> ctypes.c_void_p:
        """Save the complete state, see `FMU.save`; steps are then ones that may be undone."""
        self._goes_back = True
        return super().save(over)

    def step(self, h: float, drive: Callable[[float, float], None] | None = None) -> Vector:
        """Advance by h [s]; returns the new states, (n,).

        An FMU that takes steps of one size only goes in those of its default experiment, or of the
        first h.

        Parameters
        ----------
        drive : sets inputs for each step made, between two shares of h; without, they are held.

        Raises
        ------
        FMUError
            If the FMU refuses the step, or asks to end; if it takes one size only, and h is no
            multiple of it.
        """
        parts = 1
        if not self.description.interfaces[CO_SIMULATION].variable_steps:
            # That of its default experiment, else that of the first sample.
            self._length = self._length or self.description.step or h
            parts = round(h / self._length)
            if abs(h - parts * self._length) > _SAME_STEP * h:
                raise FMUError(
                    f"{self.called}: it takes steps of one size only "
                    "(canHandleVariableCommunicationStepSize is not true), of "
                    f"{self._length:.6g} s, and samples are {h:.6g} s apart, which is no multiple "
                    "of it. Record at such steps, or export the model with steps of any size"
                )
        tail: tuple[object, ...] = ()
        event, end, early = (ctypes.c_bool() for _ in range(3))
        reached = ctypes.c_double()
        if self.version == "3.0":
            tail = tuple(ctypes.byref(value) for value in (event, end, early, reached))
        begin = self._t
        for part in range(parts):
            if drive is not None:
                drive(part / parts, (part + 1) / parts)
            t, span = ctypes.c_double(begin + part * h / parts), ctypes.c_double(h / parts)
            reached.value = t.value + span.value
            # By noSetFMUStatePriorToCurrentPoint = false, some take a step for the last one again.
            status = self.try_call("do_step", t, span, ctypes.c_int(not self._goes_back), *tail)
            if status <= _WARNING and not tail:
                reached.value = self._clock(t.value + span.value)
            short = begin + (part + 1) * h / parts - reached.value
            end.value = end.value or (status == _DISCARD and self._has_ended())
            if status > _WARNING and not end.value:
                error = self.refusal(_FUNCTIONS["do_step"][self.version], status)
            elif end.value:
                error = self.end_error()
            elif early.value or event.value or abs(short) > _SAME_STEP * span.value:
                error = FMUError(
                    f"{self.called}: it ends the step at {reached.value:.9g} s"
                    f"{' and asks for Event Mode' * event.value}, where it was told that "
                    "steps are whole and without events (earlyReturnAllowed, eventModeUsed). If "
                    "its solver has steps of one size, record at multiples of that"
                )
            else:
                continue
            raise FMUError(
                f"{error}; in its step of {span.value:.9g} s from {t.value:.9g} s of its time"
                f"{'' if end.value else self._step_advice(t.value, status)}"
            )
        self._t = begin + h
        return self.get_typed(self._typed_states)

    @cached_property
    def _clocks(self) -> list[Variables]:
        variables = self.description.variables
        return [
            self.variables([v.name]) for v in variables if v.causality == "independent" and v.real
        ]

    def _clock(self, end: float) -> float:
        """Its own time [s] where it shows one that runs, else the end that a step should have.

        FMI 2.0 does not say how far a step came: one of a solver with long steps may be none.
        """
        for clock in self._clocks:
            with suppress(FMUError):
                shown = float(self.get(clock)[0])
                return end if shown == self.start_time else shown
        return end

    def _has_ended(self) -> bool:
        """Whether a step was discarded because the FMU asks to end (FMI 2.0)."""
        asked = getattr(self._instance.dll, "fmi2GetBooleanStatus", None)
        terminated, ended = ctypes.c_int(3), ctypes.c_int()  # fmi2StatusKind
        return (
            asked is not None
            and not asked(self._component, terminated, ctypes.byref(ended))
            and bool(ended.value)
        )

    def _step_advice(self, begin: float, status: int) -> str:
        """What is known of a step that failed, which began at a time [s], and what to do."""
        offered, reached = self.description.interfaces[CO_SIMULATION], ctypes.c_double(math.nan)
        if status <= _WARNING:
            return ""
        if not (offered.variable_steps or self.description.step):
            return (
                ". It takes steps of one size only (canHandleVariableCommunicationStepSize is not "
                "true), and its description does not say of which: record at such steps, or export "
                "the model with a stepSize in its default experiment"
            )
        asked = getattr(self._instance.dll, "fmi2GetRealStatus", None)
        last_successful_time = 2  # fmi2StatusKind
        if status != _DISCARD or asked is None:
            return ""
        kind = ctypes.c_int(last_successful_time)
        if asked(self._component, kind, ctypes.byref(reached)) or not reached.value > begin:
            return ""
        return (
            f", of which it made {reached.value - begin:.9g} s. Record at steps that are no longer "
            "than that, or export the model with a solver that makes longer ones"
        )


def open_fmu(
    path: Path,
    names: Mapping[str, str] | None = None,
    parameters: Mapping[str, float] | None = None,
) -> FMU:
    """Open a model file for Model Exchange, or for Co-Simulation where it has no more."""
    interfaces = read_description(path).interfaces
    alone = CO_SIMULATION in interfaces and MODEL_EXCHANGE not in interfaces
    return (CoSimulation if alone else FMU)(path, names, parameters)
