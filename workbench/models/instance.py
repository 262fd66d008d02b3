"""One instance of an FMU: loaded, initialised, taken through events, its calls checked."""

import ctypes
import math
import os
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import PurePosixPath
from typing import Any, NamedTuple
from weakref import WeakMethod, WeakValueDictionary

import numpy as np
from fmpy import fmi2, fmi3
from fmpy.fmi1 import FMICallException

from workbench.errors import FMUError, InputError, one_line
from workbench.models import fmu_cache
from workbench.models.archive import unpack
from workbench.models.description import (
    CO_SIMULATION,
    MODEL_EXCHANGE,
    OWN_TOOL,
    Description,
    Variable,
)
from workbench.models.trial import PROXY, require_trial, unloadable
from workbench.runtime.files import TemporaryFolder, own_umask

FUNCTIONS = {
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
ACCESSORS = {
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
WARNING, DISCARD, _FATAL = 1, 2, 4  # status of FMI
_LOGGED = 3  # messages that an error shows
# Of a step, relative to the state and to its nominal value: far below what a sensor resolves.
# Integration here keeps it, and an FMU is asked to in its own: without, Dymola's is off by 6e-5.
TOLERANCE = 1e-8
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


def called(description: Description) -> str:
    """What messages call a model: by its file, where that is the user's."""
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
        names = {use: function[self.version] for use, function in FUNCTIONS.items()}
        self._call = {use: dll[name] for use, name in names.items() if hasattr(dll, name)}
        if "time" in self._call:
            self._call["time"].argtypes = [ctypes.c_void_p, ctypes.c_double]
        self._instantiate()

    def _require(self, library: ctypes.CDLL) -> None:
        """Refuse a library without the functions that every use needs."""
        names = [FUNCTIONS[use][self.version] for use in _NEEDED[self.interface]]
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
            raise FMUError(f"{called(self.description)}: {error}: {self._logged()}") from None
        self._component = ctypes.c_void_p(self._instance.component)
        self._used = False

    def _note(self, *arguments: Any) -> None:
        """Keep what the FMU logs, at last its status, category, message."""
        message = one_line((arguments[-1] or b"").decode(errors="replace").strip())
        self._log.append(message)
        if arguments[-3] == WARNING:
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
        return f"the FMU {called(self.description)} warned {times}: {first}"

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
                    name = called(self.description)
                    raise FMUError(f"{name}: it says that its next time event is at nan s")
                return EventUpdate(next_time, nominals_changed)
        raise FMUError(
            f"{called(self.description)}: its discrete states are not stable after "
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
        name = called(self.description)
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
        return ACCESSORS[variable.type]

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
        if (status := self.try_call(use, *arguments)) > WARNING:
            raise self.refusal(FUNCTIONS[use][self.version], status)

    def try_call(self, use: str, *arguments: object) -> int:
        """Call the function for a use, see `call`; returns its status."""
        if use not in self._call:
            raise co_simulation_alone(self.description, FUNCTIONS[use][self.version])
        status = int(self._call[use](self._component, *arguments))
        self.notes[WARNED] += status == WARNING
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
        return next((FUNCTIONS[use][self.version] for use in uses), "a function")

    def refusal(self, function: str, status: int | str) -> FMUError:
        """The error for a call that returned `status`, with what the FMU logged."""
        name = _STATUSES.get(status, status)
        return FMUError(
            f"{called(self.description)}: {function} returned {name}: {self._logged()}{self.at()}"
        )

    def at(self) -> str:
        """When something failed, as the end of a message."""
        return ""

    def _logged(self) -> str:
        text = "; ".join(self._log) or "the FMU logged nothing"
        self._log.clear()
        return text
