"""The hot loop's view of an FMU: its own C functions, called from compiled Python.

numba compiles the laws of the observers once; which FMU they run on is an argument, an `Instance`
with the addresses of the FMU's functions, so that another FMU needs no compilation. Everything here
may also be called from ordinary Python.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError, InputError
from workbench.models.description import CO_SIMULATION
from workbench.models.fmu import FMU, CoSimulation, References
from workbench.models.instance import REFUSED_BY, STATE, STATUS, WARNED, co_simulation_alone
from workbench.models.jit import jit

compiled = jit()
inlined = jit(inline=True)

OK, REFUSED, SINGULAR, EVENT, MOVED = 0, 1, 2, 3, 4
WARNING = 1  # of FMI: the call did what it is for


@intrinsic
def _returned(typing, address, words):  # type: ignore[no-untyped-def]
    """Call a C function of whole numbers and doubles, which returns an int; arrays by address."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        given = []
        for word_type, value in zip(
            words.types, cgutils.unpack_tuple(builder, values[1]), strict=True
        ):
            if isinstance(word_type, types.Array):
                data = context.make_array(word_type)(context, builder, value).data
                given.append(builder.ptrtoint(data, context.get_value_type(types.intp)))
            elif isinstance(word_type, types.Float):
                given.append(value)
            else:
                given.append(context.cast(builder, value, word_type, types.intp))
        function = ir.FunctionType(ir.IntType(32), [word.type for word in given])
        return builder.call(builder.inttoptr(values[0], function.as_pointer()), given)

    return types.int32(types.intp, words), generate


@inlined
def _call(model, function, words):  # type: ignore[no-untyped-def]
    """Call a function of an FMU, by its address; a status. Warnings and refusals are noted."""
    status = _returned(function, words)
    if status == WARNING:
        model.notes[WARNED] += 1
    if status <= WARNING:
        return OK
    model.notes[REFUSED_BY], model.notes[STATUS] = function, status
    return REFUSED


class Instance(NamedTuple):
    """One FMU instance, its functions and the buffers they read and write."""

    address: int  # of the FMU instance
    # set_states, get_states, derivatives, set_real, get_real, directional, set_time: addresses of
    # the FMU's functions; get_indicators, too, and complete_step, 0 where the FMU does not need it.
    # FMI 2.0 takes no length of values in set_real and get_real; the register it would be in is not
    # read.
    set_states: int
    get_states: int
    derivatives: int
    set_real: int
    get_real: int
    directional: int
    set_time: int
    get_indicators: int
    complete_step: int
    # (1,) version of FMI, whose directional derivatives are taken; 0: differences
    directional_fmi: NDArray[np.int64]
    foreign: bool  # whether another tool made the FMU
    measured: int  # number of the measured inputs, the first of u
    time: Vector  # (1,) that the FMU was set to last [s]
    # indicators, event_signs: (z,) event indicators, and whether they were above 0 at the start
    indicators: Vector
    event_signs: NDArray[np.bool_]
    next_event: Vector  # (1,) time of the next time event [s], infinite for none
    notes: NDArray[np.int64]  # see `FMU.notes`
    # (2,) whether the step ends at an event, and whether the FMU asks to end
    ended: NDArray[np.int32]
    kept: Matrix  # (2, n) states before and after the end of a step
    # x, dx: (n,) states and their derivatives
    x: Vector
    dx: Vector
    # u, y: (m,) inputs, (l,) outputs
    u: Vector
    y: Vector
    least: Vector  # (n + q,) steps of differences at zero
    jacobian: Matrix  # (n + q, n + l) derivatives of [dx; y] (columns) by [x; last q inputs] (rows)
    seed: Vector  # (1,) one
    # inputs, outputs, unknowns, knowns: value references of u and y, of columns and rows of the
    # Jacobian
    inputs: References
    outputs: References
    unknowns: References
    knowns: References


def instance(
    fmu: FMU,
    inputs: Sequence[str],
    corrections: Sequence[str],
    outputs: Sequence[str],
    *,
    only_read: bool = False,
) -> Instance:
    """Prepare an FMU for compiled loops; the FMU must outlive the result.

    Parameters
    ----------
    inputs : measured.
    corrections : inputs that an observer sets, (q,).
    outputs : what estimates are made of, (l,).
    only_read : whether the caller makes no step that the FMU cannot, so that Co-Simulation and
        variables of other types will do.

    Raises
    ------
    InputError
        If the FMU lacks a function that is called, or an input may change at events only.
    """
    if fmu.interface == CO_SIMULATION and not only_read:
        raise co_simulation_alone(fmu.description, "derivatives")
    n, m, q, k = len(fmu.states), len(inputs), len(corrections), len(outputs)
    if not only_read:
        _refuse_discrete(fmu, [*inputs, *corrections])
        fmu.variables([*inputs, *outputs, *fmu.states])
    unknowns = np.concatenate([fmu.rate_references, fmu.references(outputs)])
    return Instance(
        address=fmu.instance_address,
        set_states=fmu.function_address("set_states"),
        get_states=fmu.function_address("get_states"),
        derivatives=fmu.function_address("derivatives"),
        set_real=fmu.function_address("set"),
        get_real=fmu.function_address("get"),
        directional=fmu.function_address("directional"),
        set_time=fmu.function_address("time"),
        get_indicators=fmu.function_address("indicators"),
        complete_step=fmu.function_address("complete_step") if fmu.needs_completed_steps else 0,
        directional_fmi=fmu.directional_fmi
        if fmu.states_derivatives(unknowns)
        else np.zeros(1, np.int64),
        foreign=not fmu.is_own,
        measured=m,
        time=fmu.time,
        indicators=np.zeros(fmu.event_signs.size),
        event_signs=fmu.event_signs,
        next_event=fmu.next_event,
        notes=fmu.notes,
        ended=np.zeros(2, np.int32),
        kept=np.zeros((2, n)),
        x=np.zeros(n),
        dx=np.zeros(n),
        u=np.zeros(m + q),
        y=np.zeros(k),
        least=fmu.difference_steps([*fmu.states, *corrections], np.zeros(n + q)),
        jacobian=np.zeros((n + q, n + k)),
        seed=np.ones(1),
        inputs=fmu.references([*inputs, *corrections]),
        outputs=fmu.references(outputs),
        unknowns=unknowns,
        knowns=fmu.references([*fmu.states, *corrections]),
    )


def _refuse_discrete(fmu: FMU, names: Sequence[str]) -> None:
    """Refuse inputs that FMI allows to be set at events only."""
    variability = {v.name: v.variability for v in fmu.description.variables}
    for name in names:
        if variability.get(name) == "discrete":
            raise InputError(
                where=f"{fmu.place}, variable '{fmu.names.get(name, name)}'",
                found="a discrete input, which may change at events only",
                expected="a continuous input, since estimators do not stop at events",
                remedy="export the model with a continuous input in its place",
            )


class CoSimulationInstance(NamedTuple):
    """One instance of a Co-Simulation FMU, as `Instance`."""

    # address, set_real, get_real, inputs, outputs, u, y, notes: see `Instance`
    address: int
    set_real: int
    get_real: int
    do_step: int  # address of the FMU's function
    fmi: int  # version, 2 or 3
    inputs: References
    outputs: References
    u: Vector
    y: Vector
    time: Vector  # (1,) where the next step begins [s]
    notes: NDArray[np.int64]
    # flags, reached: (3,) and (1,) what FMI 3.0 says of a step
    flags: NDArray[np.bool_]
    reached: Vector


def co_simulation_instance(
    fmu: CoSimulation, inputs: Sequence[str], outputs: Sequence[str]
) -> CoSimulationInstance:
    """Prepare an FMU that was started for compiled loops; it must outlive the result."""
    return CoSimulationInstance(
        address=fmu.instance_address,
        set_real=fmu.function_address("set"),
        get_real=fmu.function_address("get"),
        do_step=fmu.function_address("do_step"),
        fmi=int(fmu.version[0]),
        inputs=fmu.variables(inputs).references,
        outputs=fmu.variables(outputs).references,
        u=np.zeros(len(inputs)),
        y=np.zeros(len(outputs)),
        time=np.full(1, fmu.start_time),
        notes=fmu.notes,
        flags=np.zeros(3, np.bool_),
        reached=np.zeros(1),
    )


@inlined
def assign(target, source):  # type: ignore[no-untyped-def]
    """Copy a vector, in rising order."""
    for i in range(target.size):
        target[i] = source[i]


@inlined
def set_inputs(model, first, count):  # type: ignore[no-untyped-def]
    """Set `count` inputs from number `first` on to model.u; returns a status."""
    references, values = model.inputs[first:], model.u[first:]
    return _call(model, model.set_real, (model.address, references, count, values, count))


@inlined
def set_sample(model, u):  # type: ignore[no-untyped-def]
    """Set the measured inputs and the time of a sample, (m + 1,); returns a status.

    Without the time, (m,), the FMU stays at the time that it is at. EVENT, if the FMU is at a point
    beyond a state event, or the time is beyond a time event.
    """
    m = model.measured
    status = check_state_events(model)
    for j in range(m):
        model.u[j] = u[j]
    status = status or set_inputs(model, 0, m)
    if u.size > m:
        status = status or set_time(model, u[m])
    return status


@inlined
def set_point(model, u):  # type: ignore[no-untyped-def]
    """Set measured inputs and time, (m + 1,), within a step, where no event counts; a status."""
    m = model.measured
    for j in range(m):
        model.u[j] = u[j]
    return set_inputs(model, 0, m) or set_time(model, u[m])


@inlined
def set_time(model, t):  # type: ignore[no-untyped-def]
    """Set the time to t [s]; returns a status."""
    if t > model.next_event[0]:
        return EVENT
    model.time[0] = t
    return _call(model, model.set_time, (model.address, t))


@inlined
def check_state_events(model):  # type: ignore[no-untyped-def]
    """EVENT if the FMU, at the end of a step, is beyond a state event or at a step event; a status.

    A state event: an indicator has another sign than at the start.
    """
    status = end_step(model) or read_indicators(model)
    for i in range(model.indicators.size):
        if (model.indicators[i] > 0.0) != model.event_signs[i]:
            return status or EVENT
    return status


@inlined
def end_step(model):  # type: ignore[no-untyped-def]
    """Tell the FMU that a step is over; EVENT if it says that a step event is due.

    MOVED if it moves its states, which it may at an event alone.
    """
    if model.complete_step != 0:
        n, before, after = model.x.size, model.kept[0], model.kept[1]
        # The zero: states may be set back to before this point. FMI 3.0 writes one byte of each.
        words = model.address, 0, model.ended, model.ended[1:]
        status = _call(model, model.get_states, (model.address, before, n)) if n else OK
        status = status or _call(model, model.complete_step, words)
        if status == OK and n:
            status = _call(model, model.get_states, (model.address, after, n))
        if status != OK:
            return REFUSED
        if model.ended[0] != 0 or model.ended[1] != 0:
            return EVENT
        for i in range(n):
            if after[i] != before[i] and not (np.isnan(after[i]) and np.isnan(before[i])):
                model.notes[STATE] = i
                return MOVED
    return OK


@inlined
def read_indicators(model):  # type: ignore[no-untyped-def]
    """Event indicators into model.indicators; returns a status."""
    n = model.indicators.size
    words = model.address, model.indicators, n
    return _call(model, model.get_indicators, words) if n else OK


@inlined
def set_states(model):  # type: ignore[no-untyped-def]
    """Set the states to model.x; returns a status."""
    n = model.x.size
    return _call(model, model.set_states, (model.address, model.x, n)) if n else OK


@inlined
def place(model):  # type: ignore[no-untyped-def]
    """Put the FMU at the states model.x and the inputs model.u; returns a status."""
    return set_inputs(model, 0, model.u.size) or set_states(model)


@inlined
def evaluate(model):  # type: ignore[no-untyped-def]
    """Derivatives of the states into model.dx; returns a status."""
    return _call(model, model.derivatives, (model.address, model.dx, model.dx.size))


@inlined
def read(model):  # type: ignore[no-untyped-def]
    """Outputs into model.y; returns a status."""
    n = model.y.size
    return _call(model, model.get_real, (model.address, model.outputs, n, model.y, n))


@inlined
def do_step(model, h):  # type: ignore[no-untyped-def]
    """Advance a Co-Simulation FMU by h [s] with inputs held; returns a status."""
    t = model.time[0]
    model.time[0] = t + h
    words, flags = (model.address, t, h, 1), model.flags  # 1: it never goes back
    if model.fmi == 2:
        return _call(model, model.do_step, words)
    return _call(model, model.do_step, (*words, flags, flags[1:], flags[2:], model.reached))


@inlined
def differentiate(model, row, count):  # type: ignore[no-untyped-def]
    """One row of the Jacobian, by state or correction `row`, into model.jacobian; a status.

    Where the FMU has no directional derivatives, all rows are written; see `linearise`.
    """
    if model.directional_fmi[0] == 0:
        return _differences(model)
    along = model.jacobian[row, :count]
    return direction(model, model.unknowns, model.knowns[row:], model.seed, along)


@inlined
def direction(model, unknowns, knowns, seeds, out):  # type: ignore[no-untyped-def]
    """Derivatives of as many unknowns as `out` has, along as many knowns as `seeds`; a status."""
    count, number = out.size, seeds.size
    if model.directional_fmi[0] == 2:
        words = model.address, unknowns, count, knowns, number, seeds, out
        return _call(model, model.directional, words)
    more = model.address, unknowns, count, knowns, number, seeds, number, out, count
    return _call(model, model.directional, more)


@inlined
def linearise(model, count):  # type: ignore[no-untyped-def]
    """Jacobian at the present point into model.jacobian; returns a status.

    The first `count` columns are written: n for the derivatives, n + l for the outputs too.
    Afterwards the FMU is where it was; model.dx and model.y are undefined.
    """
    if model.directional_fmi[0] == 0:
        return _differences(model)
    for j in range(model.jacobian.shape[0]):
        if differentiate(model, j, count):
            return REFUSED
    return recover(model)


@inlined
def recover(model):  # type: ignore[no-untyped-def]
    """Set the states anew after directional derivatives; returns a status.

    An FMU of another tool may keep variables as these left them: Dymola's velocity is the rate.
    """
    return set_states(model) if model.foreign else OK


@compiled
def _differences(model):  # type: ignore[no-untyped-def]
    """Central differences; the step balances truncation and rounding (cube root of eps)."""
    rows, columns = model.jacobian.shape
    n, m = model.x.size, model.u.size
    first = m - (rows - n)  # of the corrections
    for j in range(rows):
        centre = model.x[j] if j < n else model.u[first + j - n]
        step = max(6e-6 * abs(centre), model.least[j])
        for side in (1.0, -1.0, 0.0):
            if j < n:
                model.x[j] = centre + side * step
            else:
                model.u[first + j - n] = centre + side * step
            if place(model):
                return REFUSED
            if side == 0.0:
                continue
            if evaluate(model) or read(model):
                return REFUSED
            for i in range(columns):
                value = model.dx[i] if i < n else model.y[i - n]
                if side > 0.0:
                    model.jacobian[j, i] = value
                else:
                    model.jacobian[j, i] = (model.jacobian[j, i] - value) / (2.0 * step)
    return OK


@inlined
def implicit(model, h, system):  # type: ignore[no-untyped-def]
    """Write I - h A, of an implicit step, to the first columns; after `linearise`."""
    n = model.x.size
    for i in range(n):
        for j in range(n):
            system[i, j] = -h * model.jacobian[j, i]
        system[i, i] += 1.0


@compiled
def invert(a, pivots):  # type: ignore[no-untyped-def]
    """Invert a matrix in place, (n, n), by Gauss and Jordan with partial pivoting; a status.

    For the few unknowns of an observer its products take half the time of substitutions.

    Parameters
    ----------
    pivots : (n,) work space: the row that each row is exchanged with.
    """
    n = a.shape[0]
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if not abs(a[pivot, k]) > 0.0:
            return SINGULAR
        pivots[k] = pivot
        if pivot != k:
            for j in range(n):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
        inverse = 1.0 / a[k, k]
        a[k, k] = 1.0
        for j in range(n):
            a[k, j] *= inverse
        for i in range(n):
            if i != k:
                factor = a[i, k]
                a[i, k] = 0.0
                for j in range(n):
                    a[i, j] -= factor * a[k, j]
    for k in range(n - 1, -1, -1):
        pivot = pivots[k]
        if pivot != k:
            for i in range(n):
                a[i, k], a[i, pivot] = a[i, pivot], a[i, k]
    return OK


@compiled
def solve(a):  # type: ignore[no-untyped-def]
    """Solve a linear system in place; returns a status.

    Gaussian elimination with partial pivoting; for the few unknowns of an observer it is several
    times faster than a call into LAPACK. It works along rows, which compilers turn into operations
    on several numbers at once, and leaves out factors that are zero.

    Parameters
    ----------
    a : (n, n + k) the matrix, which is destroyed, and right-hand sides, which become solutions.
    """
    return solve_part(a, a.shape[0], a.shape[1])


@compiled
def solve_part(a, n, columns):  # type: ignore[no-untyped-def]
    """The same for the first n rows and `columns` columns of an array."""
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if not abs(a[pivot, k]) > 0.0:
            return SINGULAR
        if pivot != k:
            for j in range(columns):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, n):
            factor = a[i, k] * inverse
            if factor != 0.0:
                for j in range(columns):
                    a[i, j] -= factor * a[k, j]
    if columns == n + 1:
        # A sum in a register takes two thirds of the time.
        for k in range(n - 1, -1, -1):
            total = a[k, n]
            for i in range(k + 1, n):
                if a[k, i] != 0.0:
                    total -= a[k, i] * a[i, n]
            a[k, n] = total / a[k, k]
        return OK
    for k in range(n - 1, -1, -1):
        for i in range(k + 1, n):
            factor = a[k, i]
            if factor != 0.0:
                for j in range(n, columns):
                    a[k, j] -= factor * a[i, j]
        for j in range(n, columns):
            a[k, j] /= a[k, k]
    return OK


def read_only(values: Matrix) -> Matrix:
    """What a compiled loop reads of its caller, of one type, so that it is compiled once."""
    view = np.ascontiguousarray(values).view()
    view.flags.writeable = False
    return view


def raise_on_failure(status: int, fmu: FMU) -> None:
    """Turn a status of a compiled loop into an exception.

    Raises
    ------
    FMUError
        If the FMU refused a call, with what it logged; an implicit step had no solution; the model
        moved a state without an event, or has one, at which estimators do not stop.
    """
    if status == REFUSED:
        raise fmu.refusal(fmu.function_at(int(fmu.notes[REFUSED_BY])), int(fmu.notes[STATUS]))
    if status == MOVED:
        raise fmu.moved_error(int(fmu.notes[STATE]))
    if status == SINGULAR:
        unknown = fmu.unknown_rate()
        reason = f", with {unknown}" if unknown else fmu.at()
        raise FMUError(f"{fmu.called}: the implicit step has no solution{reason}")
    if status == EVENT:
        raise fmu.event_error()
