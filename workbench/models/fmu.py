"""An FMU under an observer's control, stage 2.

The extended-FMI pattern of Brembeck et al. (2014): set and read continuous states, evaluate
derivatives, linearise, step, save and roll back. Standard Model Exchange offers all of it except
the step, which is done here: linearly implicit, because machines have
motions of microseconds beside those of seconds.
"""

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError, InputError, unknown_name
from workbench.models.description import (
    CO_SIMULATION,
    MODEL_EXCHANGE,
    Variable,
    read_description,
)
from workbench.models.instance import (
    ACCESSORS,
    DISCARD,
    FUNCTIONS,
    WARNING,
    EventError,
    EventUpdate,
    FMUInstance,
    NoFunctionError,
    called,
    co_simulation_alone,
)
from workbench.models.trial import (
    built_here,
    contradict_derivatives,
    derivatives_hold,
    remembers_steps,
)

_SAME_STEP = 1e-4  # by which sample times may differ: what rounding of time stamps leaves
_STEP = float(np.finfo(float).eps) ** (1 / 3)  # of differences, relative
SAME_RATE = 1e-4  # of its size, by which iterations within a model may change a rate
ALIKE = 1e3  # times: what a start or a scale says of a size is rougher than factors of ten
# Points of a recording at which directional derivatives are compared with differences; shares of a
# derivative: differences of one that agree less show a bend, and it is wrong by more.
_COMPARED, _BENDS, _WRONG = 20, 0.01, 0.03

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
            if v.type in ACCESSORS and not v.array and not v.real
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
        return called(self.description)

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
                    "fit, workbench diagnose" * (variable.type in ACCESSORS),
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

    @property
    def takes_slopes(self) -> bool:
        """Whether real inputs may go in straight lines within a step (FMI 2.0)."""
        return self.description.interfaces[CO_SIMULATION].interpolates

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
            if status <= WARNING and not tail:
                reached.value = self._clock(t.value + span.value)
            short = begin + (part + 1) * h / parts - reached.value
            end.value = end.value or (status == DISCARD and self._has_ended())
            if status > WARNING and not end.value:
                error = self.refusal(FUNCTIONS["do_step"][self.version], status)
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
        if status <= WARNING:
            return ""
        if not (offered.variable_steps or self.description.step):
            return (
                ". It takes steps of one size only (canHandleVariableCommunicationStepSize is not "
                "true), and its description does not say of which: record at such steps, or export "
                "the model with a stepSize in its default experiment"
            )
        asked = getattr(self._instance.dll, "fmi2GetRealStatus", None)
        last_successful_time = 2  # fmi2StatusKind
        if status != DISCARD or asked is None:
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
