"""Where laws find the signals of a system in its model, and the steps that all laws are made of."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.models.native import (
    OK,
    inlined,
    read,
    set_inputs,
    set_sample,
    set_states,
)
from workbench.system.system import System


class Layout(NamedTuple):
    """Where a law finds things in the model; the same for all laws."""

    # (l,) index of the state that is an output, or -1 - index among the model's outputs
    seen: NDArray[np.intp]
    # nominal, low, high: (q,) nominal estimated quantities, and limits of their corrections
    nominal: Vector
    low: Vector
    high: Vector
    doubt: Vector  # (q,) share of quantities by which the model lets them be wrong [1]
    # (q,) column of the Jacobian that shows a correction's effect: rate of a state, or an output
    # that is none; -1 for none
    acts_on: NDArray[np.intp]
    # (l,) coefficients of the outputs in the signal with which feedback fades; half of it is left
    # at `half`, 0: it never fades
    pace: Vector
    half: float
    # follower, leader: states of which one rolls along with the other, -1 for none
    follower: int
    leader: int
    ratio: float  # of follower over leader while it rolls [1]
    lead: float  # coefficient of the leader in `pace`
    reported: int  # number of the model's outputs that estimates hold
    # of the Jacobian that laws need: rates, and all outputs if one that is fed is no state
    columns: int
    # (m + 1,) 1 of an input that stays as it was sampled until the next sample, -1 of one whose
    # sample is the mean since the one before, else 0, as of the time
    holds: Vector


def layout(fmu: FMU, system: System) -> Layout:
    """Find the signals of a system in its model; the FMU is started anew."""
    states, unseen = fmu.states, 0
    seen = []
    for output in system.outputs:
        if output.name in states:
            seen.append(states.index(output.name))
        else:
            seen.append(-1 - len(system.reported) - unseen)
            unseen += 1
    shown = {
        output.name: len(states) - 1 - at
        for output, at in zip(system.outputs, seen, strict=True)
        if at < 0
    }
    nominal = np.array([fmu.defaults[quantity.name] for quantity in system.estimated])
    fading, rolling = system.fading, system.rolling
    pace = np.array(system.slopes(fading.signal)) if fading else np.zeros(len(seen))
    follower = leader = -1
    if rolling:
        follower, leader = (_state_index(fmu, name) for name in (rolling.follower, rolling.leader))
    return Layout(
        seen=np.array(seen, np.intp),
        nominal=nominal,
        low=np.array([quantity.low for quantity in system.estimated]) - nominal,
        high=np.array([quantity.high for quantity in system.estimated]) - nominal,
        doubt=np.array([quantity.relative_error for quantity in system.estimated]),
        acts_on=np.array(
            [_column(fmu, quantity.acts_on, shown) for quantity in system.estimated], np.intp
        ),
        pace=pace,
        half=fading.half if fading else 0.0,
        follower=follower,
        leader=leader,
        ratio=rolling_ratio(fmu, system) if rolling else 0.0,
        lead=float(sum(p for p, at in zip(pace, seen, strict=True) if at == leader)),
        reported=len(system.reported),
        columns=len(states) + (len(system.reported) + unseen if unseen else 0),
        holds=np.array([*system.holds, 0.0]),
    )


def _column(fmu: FMU, name: str, shown: Mapping[str, int]) -> int:
    """Column of the Jacobian for a state or an output that is none; -1 for no name."""
    return shown.get(name, -1) if name in shown or not name else _state_index(fmu, name)


def _state_index(fmu: FMU, name: str) -> int:
    if name not in fmu.states:
        raise InputError(
            where=f"{fmu.place}, variable '{fmu.names.get(name, name)}'",
            found="a variable that is no state",
            expected=f"a continuous state for {name}, because estimators set it",
            remedy=f"choose it as state in the model, or map another: --map {name}=NAME",
        )
    return fmu.states.index(name)


def rolling_ratio(fmu: FMU, system: System) -> float:
    """Follower over leader while the follower rolls along, by the model's own output [1].

    The FMU is started anew.
    """
    rolling = system.rolling
    assert rolling is not None
    zero = fmu.variables([rolling.zero])
    fmu.start({rolling.follower: 0.0, rolling.leader: 0.0})
    states = fmu.get_states()
    readings = []
    for name in (rolling.leader, rolling.follower):
        moving = states.copy()
        moving[_state_index(fmu, name)] = 1.0
        fmu.set_states(moving)
        readings.append(float(fmu.get(zero)[0]))
    fmu.set_states(states)
    ratio = -readings[0] / readings[1] if readings[1] else math.nan
    if not math.isfinite(ratio):
        raise InputError(
            where=f"{fmu.place}, variable '{fmu.names.get(rolling.zero, rolling.zero)}'",
            found=f"{readings[1]:g} where {rolling.follower} alone moves, at 1, and "
            f"{readings[0]:g} where {rolling.leader} does",
            expected="numbers that are 0 where both roll, and not otherwise",
            remedy="correct the model, or [rolling] zero of the system file",
        )
    return ratio


@inlined
def output(model, layout, j):  # type: ignore[no-untyped-def]
    """Predicted output j at model.x; an output that is no state must have been read."""
    at = layout.seen[j]
    return model.x[at] if at >= 0 else model.y[-1 - at]


@inlined
def add_slope(model, layout, j, factor, places, row):  # type: ignore[no-untyped-def]
    """Add a multiple of output j's derivatives to a row, after `linearise` of all columns.

    Parameters
    ----------
    places : (n + q,) where in the row a state or correction stands, -1: nowhere.
    """
    at = layout.seen[j]
    if at >= 0:
        row[places[at]] += factor
    else:
        for k in range(places.size):
            if places[k] >= 0:
                row[places[k]] += factor * model.jacobian[k, model.x.size - 1 - at]


@inlined
def explained(model, layout, j, places, change):  # type: ignore[no-untyped-def]
    """Change of output j, to first order, by changes of unknowns, (p,); see `add_slope`."""
    at = layout.seen[j]
    if at >= 0:
        return change[places[at]]
    total = 0.0
    for k in range(places.size):
        if places[k] >= 0:
            total += model.jacobian[k, model.x.size - 1 - at] * change[places[k]]
    return total


@inlined
def fading(layout, y):  # type: ignore[no-untyped-def]
    """Share of the feedback at measured outputs: none where they are still, all where they move."""
    if layout.half == 0.0:
        return 1.0
    pace = 0.0
    for j in range(y.size):
        if layout.pace[j] != 0.0:  # times NaN that would be NaN
            pace += layout.pace[j] * y[j]
    return pace * pace / (pace * pace + layout.half**2)


@inlined
def authority(model, layout, effect, i):  # type: ignore[no-untyped-def]
    """Share of a correction's feedback: its effect over that at the design point, -1 to 1.

    Of outputs, after all columns were linearised.
    """
    if layout.acts_on[i] < 0:
        return 1.0
    return clip(model.jacobian[model.x.size + i, layout.acts_on[i]] / effect[i], -1.0, 1.0)


@inlined
def clip(value, low, high):  # type: ignore[no-untyped-def]
    """Limit to low..high; a NaN stays."""
    return min(max(value, low), high)


@inlined
def lag(layout, x):  # type: ignore[no-untyped-def]
    """Follower that rolls along minus the follower; 0 where nothing rolls."""
    if layout.follower < 0:
        return 0.0
    return layout.ratio * x[layout.leader] - x[layout.follower]


@inlined
def near_rest(layout, x):  # type: ignore[no-untyped-def]
    """Whether what rolls along is so slow that less than half of the feedback is left."""
    return layout.follower >= 0 and abs(layout.lead * x[layout.leader]) < layout.half


@inlined
def stick(layout, x, before):  # type: ignore[no-untyped-def]
    """Let the follower roll where a step would take it past its leader close to standstill.

    What drives it is saturated there at the least lag, and a tangent to the saturation leads to
    the other side, and back in the next step.

    Parameters
    ----------
    before : `lag` before the step.
    """
    if near_rest(layout, x) and before * lag(layout, x) < 0.0:
        x[layout.follower] = layout.ratio * x[layout.leader]


@inlined
def assign_rows(target, source):  # type: ignore[no-untyped-def]
    """Copy a matrix, in rising order."""
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = source[i, j]


@inlined
def act(layout, before, u, acting):  # type: ignore[no-untyped-def]
    """Write the inputs that act in a step of Euler's, and its time, (m + 1,).

    Parameters
    ----------
    before, u : (m + 1,) inputs and time at the beginning of the step, and at its end.
    """
    for j in range(acting.size):
        acting[j] = before[j] if layout.holds[j] > 0.0 else u[j]


@inlined
def measure(model, u):  # type: ignore[no-untyped-def]
    """Set the measured inputs and the time, see `set_sample`; returns a status."""
    return set_sample(model, u)


@inlined
def measure_end(model, acted, u):  # type: ignore[no-untyped-def]
    """The same of the sample at the end of a step, (m + 1,), after those that acted in it."""
    for j in range(u.size):
        if acted[j] != u[j]:
            return measure(model, u)
    return OK


@inlined
def correct(model, corrections):  # type: ignore[no-untyped-def]
    """Set the states model.x and the corrections, (q,); returns a status."""
    first = model.u.size - corrections.size
    for i in range(corrections.size):
        model.u[first + i] = corrections[i]
    return set_inputs(model, first, corrections.size) or set_states(model)


@inlined
def put(model, z):  # type: ignore[no-untyped-def]
    """Put the FMU at states and corrections z, (n + q,); returns a status."""
    n = model.x.size
    for i in range(n):
        model.x[i] = z[i]
    return correct(model, z[n:])


@inlined
def report(model, layout, estimate):  # type: ignore[no-untyped-def]
    """Write the estimate that the FMU is at into a row; returns a status."""
    status = read(model)
    write_estimate(model, layout, estimate)
    return status


@inlined
def write_estimate(model, layout, estimate):  # type: ignore[no-untyped-def]
    """Write the estimate at states and outputs that were read into a row."""
    outputs, q = layout.seen.size, layout.nominal.size
    first = model.u.size - q
    for j in range(outputs):
        estimate[j] = output(model, layout, j)
    for i in range(q):
        estimate[outputs + i] = model.u[first + i]
        estimate[outputs + q + i] = layout.nominal[i] + model.u[first + i]
    for i in range(layout.reported):
        estimate[outputs + 2 * q + i] = model.y[i]
