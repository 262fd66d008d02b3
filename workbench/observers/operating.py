"""Where models are linearised, and what gains follow from there."""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.models.fmu import FMU
from workbench.observers.layout import layout
from workbench.system.parts import OperatingPoint
from workbench.system.system import System

_STEPS = 400  # of implicit Euler, which takes any model to rest


@dataclass(frozen=True, eq=False)
class LinearModel:
    """A model about an operating point.

    Attributes
    ----------
    states : names, (n,).
    A, B, C, D : by states (n), corrections (q) and outputs (l): dx/dt = A x + B c, y = C x + D c.
    nominal : (n,) typical size of the states.
    """

    states: tuple[str, ...]
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    nominal: Vector

    def of(self, states: tuple[str, ...]) -> "LinearModel":
        """The same for some of the states, the others held."""
        at = [self.states.index(name) for name in states]
        A, B, C = self.A[np.ix_(at, at)], self.B[at], self.C[:, at]
        return LinearModel(states, A, B, C, self.D, self.nominal[at])


def settle(
    fmu: FMU, system: System, point: OperatingPoint, *, extensions: bool = True
) -> tuple[Vector, Vector]:
    """Hold some states and inputs until the others rest; the FMU is left there.

    Linearly implicit Euler over `system.settles`, in which what is slower hardly moves.

    Parameters
    ----------
    extensions : whether states rest that no observer corrects. If not, they stay as they start,
        such as a temperature, but for those that follow inputs alone.

    Returns
    -------
    x : (n,) states.
    u : (m + q,) measured inputs and corrections.
    """
    rolling, names = system.rolling, [signal.name for signal in system.inputs]
    places = layout(fmu, system)
    held = {name: float(formula(fmu.defaults)) for name, formula in point.held.items()}
    fmu.start(held)
    if rolling is not None and rolling.leader in held and rolling.follower not in held:
        fmu.start({**held, rolling.follower: places.ratio * held[rolling.leader]})
    offsets = [
        point.quantities.get(quantity.name, fmu.defaults[quantity.name])
        - fmu.defaults[quantity.name]
        for quantity in system.estimated
    ]
    u = np.array([*(point.inputs.get(name, 0.0) for name in names), *offsets])
    fmu.set(fmu.variables([*names, *system.corrections]), u)
    x = fmu.get_states()
    rests = np.ones(x.size, bool)
    if not extensions:
        A, corrected = fmu.state_jacobian(), corrected_states(fmu, system)
        alone = (A.diagonal() < 0.0) & (np.count_nonzero(A, axis=1) == 1)
        rests = alone | np.array([name in corrected for name in fmu.states], bool)
    free = [i for i, name in enumerate(fmu.states) if rests[i] and name not in held]
    h = system.settles / _STEPS
    for _ in range(_STEPS if free else 0):
        A = fmu.state_jacobian()[np.ix_(free, free)]
        x[free] += np.linalg.solve(np.eye(len(free)) / h - A, fmu.derivatives()[free])
        fmu.set_states(x)
    return x, u


def linearised(fmu: FMU, system: System) -> LinearModel:
    """A model linearised at the design point; the FMU is left there."""
    settle(fmu, system, system.design, extensions=False)
    names = [output.name for output in system.outputs]
    # A state is an output by itself; not every FMU differentiates it.
    unseen = [name for name in names if name not in fmu.states]
    linear = fmu.linearise(fmu.variables(system.corrections), fmu.variables(unseen))
    C, D = np.zeros((len(names), len(fmu.states))), np.zeros((len(names), linear.B.shape[1]))
    for j, name in enumerate(names):
        if name in fmu.states:
            C[j, fmu.states.index(name)] = 1.0
        else:
            C[j], D[j] = linear.C[unseen.index(name)], linear.D[unseen.index(name)]
    nominal = {v.name: abs(v.nominal or 1.0) for v in fmu.description.variables}
    return LinearModel(
        fmu.states,
        linear.A,
        linear.B,
        C,
        D,
        np.array([nominal[name] for name in fmu.states]),
    )


def corrected_states(fmu: FMU, system: System) -> tuple[str, ...]:
    """States that observers correct: those of the system's own observer model.

    States that an extension adds, such as a temperature, follow from the model alone. A model that
    names its states otherwise is corrected in all of them.

    In the order of that model: gains are numbered by it, and compilers order states as they like.
    """
    own = fmu.states if system.states is None else system.states
    return tuple(name for name in own if name in fmu.states) or (fmu.states if own else ())


def swinging_states(fmu: FMU, system: System) -> tuple[str, ...]:
    """States that no observer corrects and that move each other, at the design point.

    Such as a spring and the mass on it; stepped one by one, they would swing ever more.
    """
    corrected = corrected_states(fmu, system)
    others = np.array([name not in corrected for name in fmu.states], np.bool_)
    if others.sum() < 2:  # each candidate of a tuning asks, and rest takes time
        return ()
    settle(fmu, system, system.design, extensions=False)
    A = fmu.state_jacobian() != 0.0
    moves = A & others & others[:, None] & ~np.eye(others.size, dtype=np.bool_)
    return tuple(fmu.states[i] for i in np.flatnonzero(moves.any(axis=0) | moves.any(axis=1)))


def walks(fmu: FMU, system: System) -> Vector:
    """Random walk of the states, (n,) [unit/sqrt(s)]: declared, or a small share of their size.

    2e-4 of a nominal value in a second is what a good model of a machine leaves out.
    """
    nominal = {v.name: abs(v.nominal or 1.0) for v in fmu.description.variables}
    return np.array([system.walks.get(name, 2e-4 * nominal[name]) for name in fmu.states])


def start_spreads(fmu: FMU, system: System) -> Vector:
    """Standard deviation of the states at the start, (n,), where no sample shows them [unit].

    Declared, or the nominal value, which says of what size a state is; never more than that of any
    value between the limits that the model has. A walk says nothing of a start.
    """
    variables = {variable.name: variable for variable in fmu.description.variables}
    spreads = []
    for name in fmu.states:
        size = abs(variables[name].nominal or 1.0)
        low, high = variables[name].minimum, variables[name].maximum
        if low is not None and high is not None:
            size = min(size, (high - low) / np.sqrt(12.0))
        spreads.append(system.spreads.get(name, size))
    return np.array(spreads)


def loops(model: LinearModel) -> tuple[Matrix, Matrix]:
    """Order of the loop that each gain closes from an output to a quantity's rate, and its effect.

    Directly, or through the slowest mode of the model, whichever is larger.

    Returns
    -------
    orders, effects : (q, l); w^order = effect * gain.
    """
    common = np.zeros_like(model.B)
    if model.A.size:
        values, right = np.linalg.eig(model.A)
        rates, left = np.linalg.eig(model.A.T)
        v = right[:, np.argmax(values.real)].real
        w = left[:, np.argmax(rates.real)].real
        common = np.outer(v, w @ model.B) / (w @ v) if abs(w @ v) > 0.0 else common
    q, outputs = model.B.shape[1], len(model.C)
    orders, effects = np.full((q, outputs), np.nan), np.full((q, outputs), np.nan)
    chain = np.maximum(np.abs(model.B), np.abs(common))
    for order in range(2, 2 + len(model.A)):
        reach = np.abs(model.C) @ np.abs(chain)
        reached = (reach.T > 0.0) & np.isnan(orders)
        orders[reached], effects[reached] = order, reach.T[reached]
        chain = model.A @ chain
    direct = np.abs(model.D.T) > 0.0
    orders[direct], effects[direct] = 1.0, np.abs(model.D.T)[direct]
    known = np.isfinite(effects)
    # An output that a quantity never reaches: any gain on it is as good as none.
    fallback = effects[known].max() if known.any() else 1.0
    return np.where(known, orders, 2.0), np.where(known, effects, fallback)
