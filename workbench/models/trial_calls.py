"""Make the calls of an observer into an FMU; run by `trial` in a process of its own.

It stands alone, on the standard library, to start in hundredths of a second. A child makes the
calls and tells the name of each before it is made; this process says how the child ended, and ends
what it started.
"""

import _ctypes
import ctypes
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

try:
    import resource
    import signal
except ImportError:  # Windows: the time of an answer is all that is limited
    resource = None  # type: ignore[assignment]

_ROUNDS = 10  # of set and get, as an observer goes through them sample by sample
_STEP, _LEAST = 6e-6, 1e-3  # relative step of differences, cube root of eps; and the least size
_EPSILON = sys.float_info.epsilon
_BENDS, _WRONG = 0.01, 0.1  # shares of a derivative: more is a bend, or no derivative of that rate
_MOVED, _SAME = 0.01, 1e-4  # iterations within models end at 1e-6, calls that add up do not
_OK, _WARNING, _DISCARD, _ERROR, _FATAL = range(5)
_STATUS = {_DISCARD: "discard", _ERROR: "error", _FATAL: "fatal", 5: "pending"}
_DIE_WITH_PARENT, _ADOPT = 1, 36  # PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER
_SIZE, _DOUBLE, _TEXT, _POINTER = ctypes.c_size_t, ctypes.c_double, ctypes.c_char_p, ctypes.c_void_p
_LOG2 = ctypes.CFUNCTYPE(None, _POINTER, _TEXT, ctypes.c_int, _TEXT, _TEXT)
_LOG3 = ctypes.CFUNCTYPE(None, _POINTER, ctypes.c_int, _TEXT, _TEXT)
_ALLOCATE = ctypes.CFUNCTYPE(_POINTER, _SIZE, _SIZE)
_FREE = ctypes.CFUNCTYPE(None, _POINTER)
_UNWRITTEN = bytes.fromhex("0123456789abf87f")  # a NaN that no calculation gives


def limit_processor(seconds: float) -> None:
    """Limit what this process may use of the processor from now on [s]."""
    if resource is not None:
        used = resource.getrusage(resource.RUSAGE_SELF)
        end = int(used.ru_utime + used.ru_stime + seconds) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (end, resource.RLIM_INFINITY))


def limit_sizes(file: int, memory: int) -> None:
    """Limit the files that this process writes, and its memory [bytes]."""
    if resource is None:
        return
    signal.signal(signal.SIGXFSZ, signal.SIG_DFL)  # Python ignores it
    # Of memory that can be written: some runtimes reserve much more than they use.
    for limit, size in (
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_FSIZE, file),
        (resource.RLIMIT_DATA, memory),
    ):
        resource.setrlimit(limit, (size, size))


class _RefusedError(Exception):
    """The FMU answered a call with an error."""

    def __init__(self, message: str, status: int) -> None:
        super().__init__(message)
        self.status = status


class _HarmError(Exception):
    """The FMU answered a call without an error, and did other than FMI says with what it was given.

    Whoever may refuse a call may not do that.
    """


class _Callbacks(ctypes.Structure):
    _fields_ = (
        ("logger", _LOG2),
        ("allocate", _ALLOCATE),
        ("free", _FREE),
        ("finished", _POINTER),
        ("environment", _POINTER),
    )


class _EventInfo(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int) for name in ("again", "end", "nominals", "values", "defined")),
        ("next", _DOUBLE),
    )


class _Calls:
    """The functions of an FMU that was loaded, each limited in time and told before it is made."""

    def __init__(self, task: dict[str, Any], tell: Callable[[str], None]) -> None:
        self._task, self._tell = task, tell
        self.three = task["version"] == "3.0"
        self._prefix = "fmi3" if self.three else "fmi2"
        tell("loading of its library")
        limit_processor(task["processor"])
        os.chdir(os.path.dirname(task["library"]))
        self._library = ctypes.CDLL(task["library"])
        self.component: int | None = None
        self._made = False  # an instance, before
        self.refused: list[str] = []  # of what not everybody needs
        self._log: list[str] = []
        libc = ctypes.CDLL(None) if os.name == "posix" else ctypes.cdll.msvcrt
        self._kept = (
            _LOG2(self._note),
            _LOG3(self._note),
            _ALLOCATE(("calloc", libc)),
            _FREE(("free", libc)),
        )
        self._callbacks = _Callbacks(self._kept[0], *self._kept[2:], None, None)
        if task["proxy"]:  # it formats messages
            ctypes.CDLL(task["proxy"]).addLoggerProxy(ctypes.byref(self._callbacks))

    def _note(self, *arguments: Any) -> None:
        self._log = [*self._log[-2:], (arguments[-1] or b"")[:400].decode(errors="replace")]

    def _refusal(self, call: str, status: int) -> _RefusedError:
        logged = "; ".join(self._log) or "the FMU logged nothing"
        return _RefusedError(f"{call} returned {_STATUS.get(status, status)}: {logged}", status)

    def __call__(self, name: str, *arguments: Any) -> None:
        """Call a function with the instance and further arguments."""
        arrays = [a for a in arguments if isinstance(a, ctypes.Array) and len(a)]
        asked = [arrays.pop()] if arrays and name.startswith("Get") else []
        given = [bytes(array) for array in arrays]
        for array in asked if name != "GetDirectionalDerivative" else ():  # which is compared
            ctypes.memmove(array, _UNWRITTEN * len(array), ctypes.sizeof(array))
        status = self._raw(self._prefix + name, ctypes.c_int, self.component, *arguments)
        if status not in (_OK, _WARNING):
            if status == _FATAL:
                self.component = None
            raise self._refusal(f"{self._prefix}{name}", status)
        wrong = ""
        if given != [bytes(array) for array in arrays]:
            wrong = "wrote into what it was given, which destroys inputs and states"
        elif any(bytes(_DOUBLE(x)) == _UNWRITTEN for array in asked for x in array):
            wrong = "returned without an error and wrote no value where one was asked for"
        if wrong:
            raise _HarmError(f"{self._prefix}{name} {wrong}")

    def _raw(self, name: str, result: Any, *arguments: Any) -> Any:
        function = getattr(self._library, name)
        function.restype = result
        again = " of a second instance, the first freed," if "Instantiate" in name else ""
        self._tell(name + again * self._made)
        limit_processor(self._task["processor"])
        return function(*(_POINTER(a) if isinstance(a, int) else a for a in arguments))

    def instantiate(self) -> None:
        task, no, text = self._task, ctypes.c_int(0), str.encode
        identifier, token = text(task["identifier"]), text(task["token"])
        if not self.three:
            name = "fmi2Instantiate"
            interface = ctypes.c_int(0 if task["exchange"] else 1)
            arguments = (identifier, interface, token, text(task["resources"]))
            callbacks = ctypes.byref(self._callbacks)
            made = self._raw(name, _POINTER, *arguments, callbacks, no, no)
        else:
            false = ctypes.c_bool(False)
            common = (identifier, token, text(task["resources"]), false, false)
            if task["exchange"]:
                name = "fmi3InstantiateModelExchange"
                settings: list[Any] = [None, self._kept[1]]
            else:
                name = "fmi3InstantiateCoSimulation"
                settings = [false, false, None, _SIZE(0), None, self._kept[1], None]
            made = self._raw(name, _POINTER, *common, *settings)
        if not made:
            raise self._refusal(f"{name}, which did not instantiate it,", 3)
        self.component, self._made = made, True

    @contextmanager
    def optional(self) -> Iterator[None]:
        """Go on where the FMU refuses what not everybody needs."""
        try:
            yield
        except (_RefusedError, _HarmError) as error:
            if self.component is None:
                raise
            self.refused.append(str(error))

    def free(self) -> None:
        if self.component is not None:
            self._raw(f"{self._prefix}FreeInstance", None, self.component)
        self.component = None

    def unload(self) -> None:
        """Unload the library, which runs what it has for its end."""
        self._tell("unloading of its library")
        limit_processor(self._task["processor"])
        getattr(_ctypes, "dlclose" if os.name == "posix" else "FreeLibrary")(self._library._handle)

    def reals(self, use: str, references: list[int], values: Any) -> None:
        """Set or get real variables."""
        if references:
            count = _SIZE(len(references))
            name = f"{use}Float64" if self.three else f"{use}Real"
            array = (ctypes.c_uint * len(references))(*references)
            self(name, array, count, values, *((count,) if self.three else ()))


def _initialise(call: _Calls, task: dict[str, Any]) -> None:
    if not call.three:
        zero, time = _DOUBLE(0.0), _DOUBLE(task["time"])
        call("SetupExperiment", ctypes.c_int(0), zero, time, ctypes.c_int(0), zero)
    begin = task["start"]
    call.reals("Set", [r for r, _ in begin], (_DOUBLE * len(begin))(*(v for _, v in begin)))
    if call.three:
        false, zero, time = ctypes.c_bool(False), _DOUBLE(0.0), _DOUBLE(task["time"])
        call("EnterInitializationMode", false, zero, time, false, zero)
    else:
        call("EnterInitializationMode")
    call("ExitInitializationMode")
    if not task["exchange"]:
        return
    if call.three:
        flags = [ctypes.byref(ctypes.c_bool()) for _ in range(5)]
        call("UpdateDiscreteStates", *flags, ctypes.byref(_DOUBLE()))
    else:
        call("NewDiscreteStates", ctypes.byref(_EventInfo()))
    call("EnterContinuousTimeMode")


def _go(call: _Calls, task: dict[str, Any]) -> None:
    """Set and get what an observer does, some times."""
    n, inputs = task["states"], task["inputs"]
    states, rates = (_DOUBLE * n)(), (_DOUBLE * n)()
    outputs = (_DOUBLE * len(task["outputs"]))()
    held, everything = (_DOUBLE * len(inputs))(), (_DOUBLE * len(task["reals"]))()
    indicators, flags = (_DOUBLE * task["indicators"])(), (ctypes.c_int(), ctypes.c_int())
    call.reals("Get", inputs, held)
    for k in range(_ROUNDS):
        call.reals("Set", inputs, held)
        if task["exchange"]:
            call("SetTime", _DOUBLE(task["time"] + 1e-3 * k))
            if n:
                call("GetContinuousStates", states, _SIZE(n))
                call("SetContinuousStates", states, _SIZE(n))
                rate = "GetContinuousStateDerivatives" if call.three else "GetDerivatives"
                call(rate, rates, _SIZE(n))
            if task["indicators"]:
                call("GetEventIndicators", indicators, _SIZE(task["indicators"]))
            if task["completed"]:
                call("CompletedIntegratorStep", ctypes.c_int(0), *map(ctypes.byref, flags))
        else:
            _step(call, task["time"] + task["step"] * k, task["step"])
        call.reals("Get", task["outputs"], outputs)
        if not call.refused:
            with call.optional():
                call.reals("Get", task["reals"], everything)
        for unknowns, knowns in task["directional"]:
            _differentiate(call, unknowns, knowns[k % len(knowns)])


def _step(call: _Calls, t: float, h: float) -> None:
    if not call.three:
        call("DoStep", _DOUBLE(t), _DOUBLE(h), ctypes.c_int(0))
        return
    flags = [ctypes.byref(ctypes.c_bool()) for _ in range(3)]
    last = ctypes.byref(_DOUBLE())
    call("DoStep", _DOUBLE(t), _DOUBLE(h), ctypes.c_bool(False), *flags, last)


def _differentiate(call: _Calls, unknowns: list[int], known: int) -> list[float]:
    rows, single = _SIZE(len(unknowns)), _SIZE(1)
    result, seed = (_DOUBLE * len(unknowns))(), (_DOUBLE * 1)(1.0)
    references = (
        (ctypes.c_uint * len(unknowns))(*unknowns),
        rows,
        (ctypes.c_uint * 1)(known),
        single,
    )
    tail = (seed, single, result, rows) if call.three else (seed, result)
    call("GetDirectionalDerivative", *references, *tail)
    return list(result)


def _contradicted(call: _Calls, task: dict[str, Any]) -> bool:
    """Whether directional derivatives are not those of rates and outputs where the FMU is."""
    return any(
        _is_wrong(call, task, rows, columns, j)
        for rows, columns in task["directional"]
        for j in range(min(len(columns), _ROUNDS))
    )


def _is_wrong(
    call: _Calls, task: dict[str, Any], rows: list[int], columns: list[int], j: int
) -> bool:
    """Whether a derivative by state or input j is wrong.

    An entry d is, if (f(x + h) - f(x)) / h and (f(x) - f(x - h)) / h agree with each other, beyond
    rounding, and not with d. Where f bends, they do not agree, and nothing is said.
    """
    n = task["states"]
    states, values = (_DOUBLE * n)(), (_DOUBLE * len(rows))()
    if n:
        call("GetContinuousStates", states, _SIZE(n))

    def moved(value: float) -> list[float]:
        if columns == task["inputs"]:
            call.reals("Set", [columns[j]], (_DOUBLE * 1)(value))
        else:
            states[j] = value
            call("SetContinuousStates", states, _SIZE(n))
        if rows == task["outputs"]:
            call.reals("Get", rows, values)
        else:
            rate = "GetContinuousStateDerivatives" if call.three else "GetDerivatives"
            call(rate, values, _SIZE(n))
        return list(values)

    x = (_DOUBLE * 1)()
    call.reals("Get", [columns[j]], x)
    h = _STEP * max(abs(x[0]), _LEAST)
    above, below, at = (moved(x[0] + step) for step in (h, -h, 0.0))
    stated = _differentiate(call, rows, columns[j])
    for d, f, g, b in zip(stated, above, at, below, strict=True):
        ahead, behind = (f - g) / h, (g - b) / h
        size = max(abs(d), abs(ahead), abs(behind))
        rounding = 64.0 * _EPSILON * max(abs(f), abs(g), abs(b)) / h
        agree = abs(ahead - behind) <= _BENDS * size + rounding
        if agree and abs(d - (ahead + behind) / 2.0) > _WRONG * size + rounding:
            return True
    return False


class _Function:
    """Rates and outputs of the FMU by time, states and inputs, about where it is."""

    def __init__(self, call: _Calls, task: dict[str, Any]) -> None:
        self._call, self._task, n = call, task, task["states"]
        self._states, self._rates = (_DOUBLE * n)(), (_DOUBLE * n)()
        self._held = (_DOUBLE * len(task["inputs"]))()
        self._shown = (_DOUBLE * len(task["outputs"]))()
        if n:
            call("GetContinuousStates", self._states, _SIZE(n))
        call.reals("Get", task["inputs"], self._held)
        self._begun, self._given = list(self._states), list(self._held)

    def at(self, share: float, time: float) -> list[float]:
        """Values at a time [s], where states and inputs are off by a share of their sizes."""
        self._call("SetTime", _DOUBLE(time))
        self._held[:] = [u + share * max(abs(u), 1.0) for u in self._given]
        self._call.reals("Set", self._task["inputs"], self._held)
        nominal = zip(self._begun, self._task["nominal"], strict=True)
        self._states[:] = [x + share * max(abs(x), size) for x, size in nominal]
        if self._begun:
            self._call("SetContinuousStates", self._states, _SIZE(len(self._begun)))
        return self.read()

    def read(self) -> list[float]:
        """Values where it is."""
        if self._begun:
            rate = "GetContinuousStateDerivatives" if self._call.three else "GetDerivatives"
            self._call(rate, self._rates, _SIZE(len(self._begun)))
        self._call.reals("Get", self._task["outputs"], self._shown)
        return [*self._rates, *self._shown]

    def end_step(self) -> bool:
        """Say that a step is over; whether that is an event, or the end."""
        event, end = ctypes.c_int(), ctypes.c_int()
        if self._task["completed"]:
            arguments = ctypes.c_int(0), ctypes.byref(event), ctypes.byref(end)
            self._call("CompletedIntegratorStep", *arguments)
        return bool(event.value or end.value)


def _remembers_steps(call: _Calls, task: dict[str, Any]) -> bool:
    """Whether rates and outputs follow from the steps that were over before, as those of a delay.

    They are compared at the end of a way of steps, and in a new instance that is put there at once.
    """
    if not task["completed"]:
        return False
    with suppress(_RefusedError):  # nobody else moves them so
        values, times = [], [task["time"] + task["span"] * k / _ROUNDS for k in range(_ROUNDS + 1)]
        for way in (times, times[-1:]):
            call.free()
            call.instantiate()
            _initialise(call, task)
            function = _Function(call, task)
            for k, time in enumerate(way, 1):
                values.append(function.at(_MOVED * (-1) ** (len(way) - k), time))
                if k < len(way) and function.end_step():
                    return False
        before, after, fresh = values[-3:]
        if fresh != function.read():  # which remembers calls, and is refused for that
            return False
        for b, a, other in zip(before, after, fresh, strict=True):
            if abs(other - a) > _SAME * max(abs(a), abs(b - a)):
                return True
    return False


def _require_counts(call: _Calls, task: dict[str, Any]) -> None:
    """Refuse a model structure of FMI 3.0 with other numbers than the FMU has."""
    for name, use in (("ContinuousStates", "states"), ("EventIndicators", "indicators")):
        size = _SIZE(task[use])
        with suppress(_RefusedError, AttributeError):  # few ask
            call(f"GetNumberOf{name}", ctypes.byref(size))
        if size.value != task[use]:
            raise _RefusedError(
                f"fmi3GetNumberOf{name} says {size.value}, and the model structure of its "
                f"description has {task[use]}: events or states would be passed over. Export it "
                "again",
                3,
            )


def _roll_back(call: _Calls) -> None:
    saved = _POINTER()
    name = "FMUState" if call.three else "FMUstate"
    call(f"Get{name}", ctypes.byref(saved))
    call(f"Set{name}", saved)
    call(f"Free{name}", ctypes.byref(saved))


def _try(task: dict[str, Any], tell: Callable[[str], None]) -> tuple[str, bool, bool]:
    """Make the calls.

    Returns
    -------
    What the FMU refused that not everybody needs, whether differences contradict its directional
    derivatives, and whether it remembers steps.

    Raises
    ------
    _RefusedError
        If it refuses another call.
    """
    call, contradicted, remembers = _Calls(task, tell), False, False
    try:
        call.instantiate()
        _initialise(call, task)
        _go(call, task)
        with call.optional():
            if task["saves"]:
                _roll_back(call)
        with call.optional():  # who runs it once does not reset it
            call("Reset")
            _initialise(call, task)
            _go(call, task)
        # Last, and without a word where it is refused: nobody else moves states so.
        with suppress(_RefusedError):
            contradicted = call.component is not None and _contradicted(call, task)
        if call.component is not None and task["exchange"]:
            if call.three:
                _require_counts(call, task)
            remembers = _remembers_steps(call, task)
    except _RefusedError as error:
        borne = (_DISCARD,) if task["any_step"] else (_DISCARD, _ERROR)
        if call.component is None or error.status not in borne or task["exchange"]:
            raise
        call.refused.append(str(error))  # of a step whose size its solver does not take
    finally:
        call.free()
    call.unload()
    return "; ".join(call.refused), contradicted, remembers


def _work(task: dict[str, Any], report: int) -> None:
    """Try the FMU, and end this process."""
    own = os.getpid()

    def tell(call: str, **results: str) -> None:
        if os.getpid() == own:  # not another that the FMU made of this process
            write_record(report, task["secret"], {"call": call, **results})

    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what an FMU prints is nobody's concern
    os.dup2(1, 2)
    if resource is not None:
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # Python ignores it
    limit_sizes(task["file"], task["memory"])
    refused, contradicted, remembers = "", False, False
    try:
        partly, contradicted, remembers = _try(task, tell)
    except (_RefusedError, _HarmError) as error:
        partly = refused = str(error)
    except (OSError, AttributeError) as error:
        tell("not loaded", error=str(error))
        os._exit(0)
    one, little = 1.0, 1e-30
    results = {
        "contradicted": "yes" * contradicted,
        "remembers": "yes" * remembers,
        "rounds": "yes" * (one - little == one == one + little),
    }
    if resource is not None:
        os.kill(own, signal.SIGCONT)  # stops a process that is traced, and no other
    tell("end", refused=refused, partly=partly, **results)
    os._exit(0)


def write_record(file: int, secret: str, content: dict[str, Any]) -> None:
    """Write a line that begins with a secret, by which it is told from what an FMU writes there."""
    os.write(file, f"{secret}{json.dumps(content)}\n".encode())


def _watch(child: int, answer: float) -> dict[str, Any]:
    """Wait for the end of a process, and end what it left; returns how it was."""
    late = []

    def end(*_: object) -> None:
        late.append(True)
        os.kill(child, signal.SIGKILL)

    signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, answer)
    _, ending, used = os.wait4(child, 0)
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    if traced := os.WIFSTOPPED(ending):  # of which a parent hears who traces its child
        os.kill(child, signal.SIGKILL)
        _, ending, used = os.wait4(child, 0)
    while orphans := _orphans():
        for orphan in orphans:
            os.kill(orphan, signal.SIGKILL)
            os.waitpid(orphan, 0)
    status = os.waitstatus_to_exitcode(ending)
    seconds = used.ru_utime + used.ru_stime
    return {"status": status, "used": seconds, "late": bool(late), "traced": traced}


def _orphans() -> list[int]:
    """Processes that the child left to this one (`_ADOPT`); each that ends may leave others."""
    try:
        with open(f"/proc/self/task/{os.getpid()}/children") as listing:
            return [int(reference) for reference in listing.read().split()]
    except OSError:
        return []


def main() -> None:
    """Work on the task that standard input holds, and say on standard output how it ended."""
    task = json.load(sys.stdin)
    report = os.dup(1)
    if not hasattr(os, "fork"):
        _work(task, report)
    control = ctypes.CDLL(None).prctl if sys.platform == "linux" else lambda *_: None
    control(_DIE_WITH_PARENT, signal.SIGKILL, 0, 0, 0)
    control(_ADOPT, 1, 0, 0, 0)
    child = os.fork()
    if child == 0:
        control(_DIE_WITH_PARENT, signal.SIGKILL, 0, 0, 0)
        _work(task, report)
    write_record(report, task["secret"], _watch(child, task["answer"]))


if __name__ == "__main__":
    main()
