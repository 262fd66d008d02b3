"""One instance of an FMU in this process, and its functions, those of FMI 2.0 and 3.0 alike.

With `description` the only file that knows FMPy.
"""

import ctypes
import os
from collections.abc import Callable
from pathlib import PurePosixPath

from fmpy import fmi2, fmi3
from fmpy.fmi1 import FMICallException

from workbench.archive import unpack
from workbench.description import CO_SIMULATION, MODEL_EXCHANGE, Description
from workbench.errors import FMUError, InputError
from workbench.proof import prove
from workbench.scratch import Scratch

_FUNCTIONS = {
    "time": {"2.0": "fmi2SetTime", "3.0": "fmi3SetTime"},
    "set_states": {"2.0": "fmi2SetContinuousStates", "3.0": "fmi3SetContinuousStates"},
    "get_states": {"2.0": "fmi2GetContinuousStates", "3.0": "fmi3GetContinuousStates"},
    "derivatives": {"2.0": "fmi2GetDerivatives", "3.0": "fmi3GetContinuousStateDerivatives"},
    "set": {"2.0": "fmi2SetReal", "3.0": "fmi3SetFloat64"},
    "get": {"2.0": "fmi2GetReal", "3.0": "fmi3GetFloat64"},
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

_CLASSES = {
    (MODEL_EXCHANGE, "2.0"): fmi2.FMU2Model,
    (MODEL_EXCHANGE, "3.0"): fmi3.FMU3Model,
    (CO_SIMULATION, "2.0"): fmi2.FMU2Slave,
    (CO_SIMULATION, "3.0"): fmi3.FMU3Slave,
}


class Loaded:
    """An FMU that is unpacked and loaded, with one instance.

    Parameters
    ----------
    description : of the FMU.
    interface : MODEL_EXCHANGE or CO_SIMULATION.

    Attributes
    ----------
    version : of FMI.

    Raises
    ------
    InputError
        If the FMU has no such interface for this machine, or its archive or binary is damaged.
    FMUError
        If it refuses to be instantiated, or is not known and does not stand being tried.
    """

    def __init__(self, description: Description, interface: str) -> None:
        identifier = description.require(interface).identifier
        self.version = description.version
        self._description = description
        self._interface = interface
        self._log: list[str] = []
        self._scratch = Scratch()
        try:
            library = description.library(interface)
            folder = self._scratch.path
            unpack(description.path, folder, str(PurePosixPath(library).parent))
            prove(description, interface, folder)
            self._library = str(folder / library)
            self._load(identifier)
        except BaseException:
            self._scratch.close()
            raise

    def _load(self, identifier: str) -> None:
        """Load the library and make an instance."""
        here = os.getcwd()
        try:
            self._instance = _CLASSES[self._interface, self.version](
                guid=self._description.token,
                unzipDirectory=str(self._scratch.path),
                modelIdentifier=identifier,
                instanceName=identifier,
                libraryPath=self._library,
            )
        except Exception as error:  # FMPy raises bare Exception where a library cannot be loaded
            os.chdir(here)  # it looks for the library in its own folder, and stays there
            raise InputError(
                where=str(self._description.path),
                found=f"a binary that cannot be loaded ({error})",
                expected="one that this machine can load, with the functions of FMI",
                remedy="export the model again for this machine",
            ) from None
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
        names = [_FUNCTIONS[use][self.version] for use in _NEEDED[self._interface]]
        if missing := [name for name in names if not hasattr(library, name)]:
            raise InputError(
                where=str(self._description.path),
                found=f"a binary without the function {missing[0]}",
                expected=f"all of FMI {self.version}, {self._interface}",
                remedy="export the model again",
            )

    def _instantiate(self) -> None:
        log = self._log

        def note(*arguments: bytes | None) -> None:
            log.append((arguments[-1] or b"").decode(errors="replace"))

        try:
            if self.version == "3.0":
                self._instance.instantiate(logMessage=note)
            else:
                callbacks = fmi2.fmi2CallbackFunctions()
                callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(note)
                callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmi2.calloc)
                callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmi2.free)
                self._instance.instantiate(callbacks=callbacks)
        except Exception as error:  # FMPy raises bare Exception where the FMU returns NULL
            raise FMUError(f"{self._description.path.name}: {error}: {self._logged()}") from None
        self._component = ctypes.c_void_p(self._instance.component)
        self._used = False

    def close(self) -> None:
        """Free the instance and the unpacked files."""
        self._instance.freeInstance()
        self._scratch.close()

    def renew(self, *, reload: bool) -> None:
        """Free the instance and make a new one; with `reload` of a library loaded anew."""
        if reload:
            self._instance.freeInstance()
            self._load(self._instance.modelIdentifier)
            return
        free = "fmi3FreeInstance" if self.version == "3.0" else "fmi2FreeInstance"
        getattr(self._instance, free)(self._instance.component)
        self._instantiate()

    def start(self, prepare: Callable[[], None]) -> None:
        """Reset and initialise at time 0; in Model Exchange enter continuous-time mode.

        Parameters
        ----------
        prepare : sets what differs from the start values.

        Raises
        ------
        FMUError
            If the FMU refuses a call.
        """
        instance = self._instance
        try:
            if self._used:
                instance.reset()
            self._used = True
            if self.version == "2.0":
                instance.setupExperiment()
            prepare()
            instance.enterInitializationMode()
            instance.exitInitializationMode()
            if self._interface == MODEL_EXCHANGE:
                if self.version == "2.0":
                    instance.newDiscreteStates()
                else:
                    instance.updateDiscreteStates()
                instance.enterContinuousTimeMode()
        except FMICallException as error:
            raise self.refusal(error.function, error.status) from None

    def call(self, use: str, *arguments: object) -> None:
        """Call the function for a use such as "get".

        Raises
        ------
        FMUError
            If the FMU refuses the call.
        """
        status = self._call[use](self._component, *arguments)
        if status > 1:
            raise self.refusal(_FUNCTIONS[use][self.version], status)

    @property
    def address(self) -> int:
        """Address of the instance, for whoever calls its functions."""
        return int(self._component.value or 0)

    def function_address(self, use: str) -> int:
        """Address of the FMU's function for a use such as "get"; 0 if it has none."""
        call = self._call.get(use)
        return int(ctypes.cast(call, ctypes.c_void_p).value or 0) if call else 0

    def refusal(self, function: str, status: int) -> FMUError:
        """The error for a call that returned `status`, with what the FMU logged."""
        name = {2: "discard", 3: "error", 4: "fatal", 5: "pending"}.get(status, status)
        return FMUError(
            f"{self._description.path.name}: {function} returned {name}: {self._logged()}"
        )

    def _logged(self) -> str:
        text = "; ".join(self._log[-3:]) or "the FMU logged nothing"
        self._log.clear()
        return text
