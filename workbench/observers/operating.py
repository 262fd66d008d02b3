"""Where models are linearised, and what gains follow from there."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError, InputError
from workbench.models.description import CO_SIMULATION
from workbench.models.fmu import FMU
from workbench.observers.layout import layout
from workbench.system.parts import OperatingPoint
from workbench.system.system import System

_STEPS = 400  # of implicit Euler, which takes any model to rest
_SHOWN = 6  # values of a point that a message has
_NEGLIGIBLE = 1e-6  # share of an output that differences of an FMU leave of what does not act on it


@dataclass(frozen=True, eq=False)
class LinearModel:
    """A model about an operating point."""

    states: tuple[str, ...]  # names, (n,)
    # A, B, C, D: by states (n), corrections (q) and outputs (l): dx/dt = A x + B c, y = C x + D c
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    nominal: Vector  # (n,) typical size of the states

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

    Raises
    ------
    DesignPointError
        If the model cannot be evaluated on the way there.
    """
    try:
        x, u = _settle(fmu, system, point, extensions=extensions)
        _require_rates(fmu)
    except FMUError as error:
        raise DesignPointError.at(fmu, system, str(error)) from None
    except np.linalg.LinAlgError:
        raise DesignPointError.at(fmu, system, "equations without a solution") from None
    return x, u


def _require_rates(fmu: FMU) -> None:
    """Refuse derivatives that are no finite numbers where the FMU is, by name."""
    if unknown := fmu.unknown_rate():
        raise FMUError(unknown)


def _settle(
    fmu: FMU, system: System, point: OperatingPoint, *, extensions: bool
) -> tuple[Vector, Vector]:
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
    u = np.array([*(point.inputs.get(name, fmu.defaults[name]) for name in names), *offsets])
    fmu.set(fmu.variables([*names, *system.corrections]), u)
    x = fmu.get_states()
    rests = np.ones(x.size, bool)
    if not extensions:
        A, corrected = fmu.state_jacobian(), corrected_states(fmu, system)
        alone = (A.diagonal() < 0.0) & (np.count_nonzero(A, axis=1) == 1)
        rests = alone | np.array([name in corrected for name in fmu.states], bool)
    free = [i for i, name in enumerate(fmu.states) if rests[i] and name not in held]
    _require_rates(fmu)
    h = system.settles / _STEPS
    for _ in range(_STEPS if free else 0):
        A = fmu.state_jacobian()[np.ix_(free, free)]
        x[free] += np.linalg.solve(np.eye(len(free)) / h - A, fmu.derivatives()[free])
        fmu.set_states(x)
    return x, u


class DesignPointError(InputError):
    """A design point where what is estimated moves no output in its own way, or a model fails."""

    @classmethod
    def at(cls, fmu: FMU, system: System, text: str) -> "DesignPointError":
        """Say what is wrong where the FMU is, on its way to rest at the inputs of a point."""
        names = [*fmu.states, *(signal.name for signal in system.inputs)]
        values = fmu.get_typed(fmu.typed(names))
        pairs = zip(names[:_SHOWN], values, strict=False)
        place = ", ".join(f"{name} = {value:.4g}" for name, value in pairs)
        more = ", ..." * (len(names) > _SHOWN)
        return cls(
            where=fmu.place,
            found=f"{text.removeprefix(f'{fmu.called}: ')}, at the design point, where states come "
            f"to rest at given inputs: {place}{more}",
            expected="a model that can be evaluated and linearised there",
            remedy="give inputs at which the model works, such as those of a recording, in "
            "[points.design] inputs of the system file, and states that are held in 'held'. "
            "Estimators that need no such point are open_loop, ekf and ukf; fit needs none",
        )

    @classmethod
    def of(cls, fmu: FMU, hidden: str) -> "DesignPointError":
        """Name what is hidden."""
        return cls(
            where=fmu.place,
            found=f"{hidden}, which the outputs do not show, or not apart, at the design point",
            expected="a model whose outputs show all that is estimated",
            remedy="choose a [points.design] where each moves an output in its own way, leave "
            "out quantities that no output shows, or use --estimator ekf",
        )


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
    if not all(np.isfinite(part).all() for part in (linear.A, linear.B, C, D)):
        raise DesignPointError.at(fmu, system, "derivatives that are no finite numbers")
    return LinearModel(
        fmu.states,
        linear.A,
        linear.B,
        C,
        D,
        fmu.sizes(fmu.states),
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
    sizes = zip(fmu.states, fmu.sizes(fmu.states), strict=True)
    return np.array([system.walks.get(name, 2e-4 * size) for name, size in sizes])


def start_spreads(fmu: FMU, system: System) -> Vector:
    """Standard deviation of the states at the start, (n,), where no sample shows them [unit].

    Declared, or the size of a state, or of its start if that is larger and no nominal value is
    stated. Never more than that of any value between the limits that the model has. A walk says
    nothing of a start.
    """
    variables = fmu.description.by_name
    spreads = []
    for name, size in zip(fmu.states, fmu.sizes(fmu.states), strict=True):
        if not variables[name].nominal:
            size = max(size, abs(fmu.defaults.get(name, 0.0)))
        low, high = variables[name].minimum, variables[name].maximum
        if low is not None and high is not None:
            size = min(size, (high - low) / np.sqrt(12.0))
        spreads.append(system.spreads.get(name, size))
    return np.array(spreads)


class ShownStart(NamedTuple):
    """Where a state begins as an output shows it, and the deviation of that [unit of the state]."""

    value: float
    deviation: float


def shown_states(
    fmu: FMU,
    system: System,
    u: Vector,
    samples: Mapping[str, float],
    begun: Collection[str],
) -> dict[str, ShownStart]:
    """Starts of states that outputs show under other names, such as in another unit.

    An output that follows one state alone, and no estimated quantity, shows its value if the model
    then says what was measured, within the noise; one that bends does not. A start whose deviation
    the system file says stays. The FMU was started, and is left elsewhere.

    Parameters
    ----------
    u : (m,) measured inputs at the start.
    samples : of the outputs at the start; NaN where there is none.
    begun : states that begin as they are to.
    """
    unseen = [
        (output, samples[output.name])
        for output in system.outputs
        if output.name not in fmu.states
        and np.isfinite(samples.get(output.name, np.nan))
        and fmu.is_real(output.name)
    ]
    inputs = [signal.name for signal in system.inputs]
    alone = fmu.interface == CO_SIMULATION
    settable = all(map(fmu.is_continuous, inputs)) and all(map(fmu.is_real, fmu.states))
    if not unseen or not fmu.states or alone or not settable:
        return {}
    fmu.set(fmu.variables(inputs), u)
    outputs = fmu.variables([output.name for output, _ in unseen])
    knowns = (fmu.variables(names) for names in (fmu.states, system.corrections))
    # What a state or a quantity moves each output by, if it is off by what is not known of it.
    by_states, by_quantities = (fmu.jacobian(outputs.references, known) for known in knowns)
    spreads = np.maximum(start_spreads(fmu, system), np.finfo(float).tiny)
    unknown = np.array([quantity.spread for quantity in system.estimated])
    begin, shown = fmu.get_states(), dict[str, ShownStart]()
    # Of others nobody says how far off they may be, and so not that noise is more than that.
    sized = {v.name for v in fmu.description.variables if v.nominal}
    for j, (output, value) in enumerate(unseen):
        moves = np.abs(by_states[j]) * spreads
        at, noise = int(moves.argmax()), output.deviation(value)
        others = np.delete(moves, at).sum() + np.abs(by_quantities[j]) @ unknown
        name = fmu.states[at]
        less = moves[at] == 0.0 or (moves[at] <= noise and name in sized)
        known = less or name in {*begun, *shown, *system.spreads}
        if known or others > _NEGLIGIBLE * moves[at]:
            continue
        fmu.set_states(begin)
        x = begin.copy()
        x[at] += (value - fmu.get(outputs)[j]) / by_states[j, at]
        fmu.set_states(x)
        if abs(fmu.get(outputs)[j] - value) <= noise:
            shown[name] = ShownStart(float(x[at]), float(noise / abs(by_states[j, at])))
    return shown


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
