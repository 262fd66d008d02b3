"""The disturbance observer of Schwarz, Brembeck, Heckmann (2018), equations (8) to (10).

The states of the model are joined by the deviations of the estimated quantities, which decay with
rates T; all are corrected by L [dy; integral of dy], dy = y - y_hat.

Two factors of the rows of L are ours, because recordings also rest: authority (a quantity is
corrected in proportion to the effect it has) and fading (where measured outputs are noise).

The paper leaves a physical model of g_D open: `target` is where deviations decay to, and a method
that has such a model moves it.
"""

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solve_continuous_are

from workbench.arrays import Matrix, Vector, zeros
from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.models.native import assign, evaluate, inlined, linearise, solve
from workbench.observers.contract import Estimator
from workbench.observers.gains import (
    Gains,
    SearchSpace,
    feedback_meanings,
    feedback_space,
    matrix_names,
)
from workbench.observers.layout import (
    Layout,
    act,
    add_slope,
    authority,
    clip,
    correct,
    explained,
    fading,
    lag,
    measure,
    measure_end,
    output,
    report,
    stick,
)
from workbench.observers.operating import (
    DesignPointError,
    LinearModel,
    corrected_states,
    linearised,
    loops,
    swinging_states,
    walks,
)
from workbench.system.system import System
from workbench.system.units import quotient


class ObserverSettings(NamedTuple):
    """What the law is given."""

    layout: Layout  # see Layout
    # (s,) indices of the states that are stepped together: corrected ones, and those that swing
    states: NDArray[np.intp]
    # (n + q,) index of states and corrections among the unknowns, -1 for other states
    places: NDArray[np.intp]
    L: Matrix  # (s + q, 2 l) gains, zero for states that are not corrected
    decay: Vector  # (q,) rates at which deviations decay [1/s], negative
    effect: Vector  # (q,) d(rate)/d(quantity) from which on a quantity has full authority


class ObserverState(NamedTuple):
    """What the law remembers."""

    z: Annotated[Vector, "q"]  # deviations of the estimated quantities
    integral: Annotated[Vector, "l"]  # of dy
    # target, drift: what deviations decay to, and by how much it moved in this step
    target: Annotated[Vector, "q"]
    drift: Annotated[Vector, "q"]
    system: Annotated[Matrix, "s + q, s + q + 1"]  # of the step, with its right-hand side
    # others, innovation: work space
    others: Annotated[Vector, "n"]
    innovation: Annotated[Vector, "l"]
    # inputs, acting: the sample before, and what acts in the step, see `act`
    inputs: Annotated[Vector, "m"]
    acting: Annotated[Vector, "m"]


@inlined
def disturbance_step(model, settings, state, h, u, y, estimate):  # type: ignore[no-untyped-def]
    """One linearly implicit Euler step of equation (9); other states each by themselves."""
    layout, states, z = settings.layout, settings.states, state.z
    system, innovation = state.system, state.innovation
    n, s, q, outputs = model.x.size, states.size, z.size, y.size
    change = system[:, s + q]
    status = 0
    if h > 0.0:
        act(layout, state.inputs, u, state.acting)
        status = measure(model, state.acting)
        for j in range(outputs):
            innovation[j] = y[j] - output(model, layout, j)
        status = status or linearise(model, layout.columns) or evaluate(model)
        for i in range(n):
            state.others[i] = h * model.dx[i]
        for i in range(s):
            change[i] = h * model.dx[states[i]]
        for i in range(q):
            decay = settings.decay[i] * (z[i] - state.target[i])
            change[s + i] = h * decay + state.drift[i]
        fade = fading(layout, y)
        for i in range(s + q):
            equation, total, share = system[i], change[i], fade
            if i < s:
                for k in range(s):
                    equation[k] = -h * model.jacobian[states[k], states[i]]
                for k in range(q):
                    equation[s + k] = -h * model.jacobian[n + k, states[i]]
                equation[i] += 1.0
            else:
                share *= authority(model, layout, settings.effect, i - s)
                for k in range(s + q):
                    equation[k] = 0.0
                equation[i] = 1.0 - h * settings.decay[i - s]
            for j in range(outputs):
                # The integral at the end of the step is part of the implicit equation.
                direct, integrated = share * settings.L[i, j], share * settings.L[i, outputs + j]
                gain = h * (direct + h * integrated)
                total += gain * innovation[j] + h * integrated * state.integral[j]
                add_slope(model, layout, j, gain, settings.places, equation)
            change[i] = total
        status = status or solve(system)
        if status:
            return status
        for j in range(outputs):
            left = innovation[j] - explained(model, layout, j, settings.places, change)
            state.integral[j] += h * left
        before = lag(layout, model.x)
        for i in range(n):
            if settings.places[i] < 0:
                model.x[i] += state.others[i] / (1.0 - h * model.jacobian[i, i])
        for i in range(s):
            model.x[states[i]] += change[i]
        for i in range(q):
            z[i] = clip(z[i] + change[s + i], layout.low[i], layout.high[i])
        stick(layout, model.x, before)
        status = measure_end(model, state.acting, u) or correct(model, z)
    else:
        status = measure(model, u) or correct(model, z)
    assign(state.inputs, u)
    return status or report(model, layout, estimate)


def _hidden(A: Matrix, C: Matrix, names: Sequence[str]) -> list[str]:
    """Names in directions, (s,), that do not fade by themselves and that no output shows.

    A v = lambda v and C v = 0. Source: Hautus (1969), Indagationes Mathematicae 72, 443-448.
    """
    hidden: set[int] = set()
    for rate in np.linalg.eigvals(A):
        pencil = np.vstack([A - rate * np.eye(len(A)), C])
        _, sizes, directions = np.linalg.svd(pencil)
        nothing = len(A) * np.sqrt(np.finfo(float).eps) * sizes.max()
        if rate.real > -nothing:
            for direction in directions[sizes <= nothing]:
                hidden |= set(np.flatnonzero(np.abs(direction) > 0.1 * np.abs(direction).max()))
    return [names[i] for i in sorted(hidden)]


class DisturbanceObserver(Estimator):
    """A model with deviations of quantities as states, corrected by measured outputs.

    A row of L that acts on a quantity is multiplied by its authority: its effect on the rate of a
    state over the effect at the design point, limited to -1..1. It vanishes where the quantity has
    no effect, and has the sign of that effect.

    The step is linearly implicit in states and quantities, feedback included, so that any gain
    keeps a stable step; so are states that are not corrected but swing with each other. States
    that an extension adds, such as a temperature, step each by themselves, implicit in their own
    value. Quantities are kept within their physical range.

    Parameters
    ----------
    fmu : observer model, also extended by effects with states of their own.
    gains : L, (s + q, 2 l), rows states and quantities, columns dy and its integral; T, (q,);
        design: effect, (q,).
    """

    name = "disturbance_observer"
    label = "disturbance observer"
    coarse_steps = True
    rank = 20
    meaning = (
        "L: rows states, then corrections of quantities; columns dy, integral of dy. T [1/s]: "
        "rate at which a deviation decays"
    )
    _step = staticmethod(disturbance_step)

    def __init__(self, fmu: FMU, system: System, gains: Gains) -> None:
        super().__init__(fmu, system, gains)
        corrected = corrected_states(fmu, system)
        names = (*corrected, *swinging_states(fmu, system))
        s, q, outputs = len(names), len(system.estimated), len(system.outputs)
        L = np.zeros((s + q, 2 * outputs))
        given = [*range(len(corrected)), *range(s, s + q)]
        L[given] = gains.values[: gains.values.size - q].reshape(len(given), 2 * outputs)
        self._settings = ObserverSettings(
            layout=self._layout,
            states=np.array([fmu.states.index(name) for name in names], np.intp),
            places=np.array(
                [
                    *(names.index(name) if name in names else -1 for name in fmu.states),
                    *range(s, s + q),
                ],
                np.intp,
            ),
            L=L,
            decay=np.ascontiguousarray(gains.values[gains.values.size - q :]),
            effect=np.ascontiguousarray(gains.design["effect"]),
        )
        sizes = {"n": len(fmu.states), "m": len(system.inputs) + 1, "l": outputs, "q": q, "s": s}
        self._state = zeros(ObserverState, sizes)

    def _begin(self, u: Vector, y: Vector) -> None:
        state = self._state
        for values in (state.z, state.integral, state.target, state.drift):
            values[:] = 0.0
        self._model.x[:] = self.fmu.get_states()

    @classmethod
    def acts_on(cls, fmu: FMU, system: System) -> tuple[str, ...]:
        """See Estimator."""
        return corrected_states(fmu, system)

    @classmethod
    def meanings(cls, fmu: FMU, system: System, gains: Gains) -> dict[str, tuple[str, str]]:
        """See Estimator."""
        states = corrected_states(fmu, system)
        estimates = {name: fmu.units.get(name, "1") for name in states}
        estimates |= {quantity.correction: quantity.unit for quantity in system.estimated}
        rates = {f"rate of {name}": quotient(unit, "s") for name, unit in estimates.items()}
        meanings = feedback_meanings(rates, {output.name: output.unit for output in system.outputs})
        decays = {
            f"T_{quantity.name}": (f"rate at which {quantity.correction} decays", "1/s")
            for quantity in system.estimated
        }
        return meanings | decays

    @classmethod
    def of(cls, L: Matrix, T: Vector, effect: Vector, system: System, source: str = "") -> Gains:
        """Gains of given matrices; see `DisturbanceObserver`."""
        names = (
            *matrix_names("L", *L.shape),
            *(f"T_{quantity.name}" for quantity in system.estimated),
        )
        return Gains(cls.name, names, np.append(L, T), {"effect": np.asarray(effect)}, source)

    @classmethod
    def default_gains(cls, fmu: FMU, system: System) -> Gains:
        """Gains from the linearised model: the stationary Kalman filter of the extended system.

        The model is extended by the quantities as states, and the filter's Riccati equation is
        solved for the sensors' noise. The gain on the integral of dy is zero: the quantities are
        integrators already.
        Source: D. Simon, Optimal State Estimation, Wiley 2006, section 8.4.

        Raises
        ------
        InputError
            If the outputs do not show a state of the model, there is nothing to estimate, or a
            quantity does not move, which no gain that stays can find.
        """
        names = corrected_states(fmu, system)
        model = linearised(fmu, system).of(names)
        s, q = model.B.shape
        if s + q == 0:
            raise InputError(
                where=f"{system.source}, {cls.name}",
                found="a model without states, and no [estimated] quantities",
                expected="something to estimate",
                remedy="add a table [estimated.NAME], or run the open loop: --estimator open_loop",
            )
        if constant := [quantity.name for quantity in system.estimated if quantity.walk == 0.0]:
            raise InputError(
                where=f"{system.source}, [estimated.{constant[0]}] walk, {cls.name}",
                found="0: a constant, on which a gain that stays must be zero",
                expected="quantities that walk",
                remedy="give it a walk, or estimate with a Kalman filter: --estimator ekf",
            )
        decay = np.array([-1.0 / quantity.memory for quantity in system.estimated])
        extended = np.block([[model.A, model.B], [np.zeros((q, s)), np.diag(decay)]])
        of_states = dict(zip(fmu.states, walks(fmu, system), strict=True))
        process = np.array(
            [
                *(of_states[name] for name in names),
                *(quantity.walk for quantity in system.estimated),
            ]
        )
        # White noise of a continuous signal that, sampled, has the given variance.
        noise = np.array([output.noise_at_scale for output in system.outputs])
        measurement = noise * np.sqrt(system.sample_time)
        # In units of the noise, both noise matrices are the identity and the equation well scaled.
        A = extended * process / process[:, None]
        C = np.hstack([model.C, model.D]) * process / measurement[:, None]
        try:
            covariance = solve_continuous_are(A.T, C.T, np.eye(s + q), np.eye(len(C)))
        except LinAlgError:
            estimated = (*names, *(quantity.name for quantity in system.estimated))
            hidden = " and ".join(_hidden(A, C, estimated)) or "a state or quantity"
            raise DesignPointError.of(fmu, hidden) from None
        gain = process[:, None] * (covariance @ C.T) / measurement
        L = np.hstack([gain, np.zeros_like(gain)])
        source = "stationary Kalman gain of the linearised model"
        return cls.of(L, decay, effects(fmu, system, model), system, source)

    @classmethod
    def space(
        cls, fmu: FMU, system: System, gains: Gains, slowest: float, fastest: float
    ) -> SearchSpace:
        """Bounds by the loops that gains close; a deviation does not grow by itself."""
        model = linearised(fmu, system).of(corrected_states(fmu, system))
        q = len(system.estimated)
        # A gain of an output on a state: the state's own share in it, or their sizes.
        sizes = np.abs(model.C) @ model.nominal
        own = np.abs(model.C).T
        on_states = np.where(own > 0.0, own, sizes[None, :] / model.nominal[:, None])
        orders, on_quantities = loops(model)
        order = np.vstack([np.ones_like(on_states), orders])
        effect = np.vstack([on_states, on_quantities])
        orders = np.append(np.hstack([order, order + 1.0]), np.ones(q))
        effects = np.append(np.hstack([effect, effect]), np.ones(q))
        space = feedback_space(orders, effects, slowest, fastest, gains.values)
        space.upper[space.upper.size - q :] = (
            0.0  # a deviation that grows by itself is no disturbance model
        )
        return space.starting_at(gains.values)

    @classmethod
    def error_dynamics(
        cls, A: Matrix, B: Matrix, C: Matrix, gains: Gains
    ) -> tuple[Matrix, Matrix] | None:
        """Errors of states, estimated quantities, integrals of dy, true quantities."""
        (s, q), outputs = B.shape, len(C)
        L = gains.values[: gains.values.size - q].reshape(s + q, 2 * outputs)
        direct, integrated = L[:, :outputs] @ C, L[:, outputs:]
        square, tall = np.zeros((q, q)), np.zeros((outputs, q))
        dynamics = np.block(
            [
                [A - direct[:s], -B, -integrated[:s], B],
                [
                    direct[s:],
                    np.diag(gains.values[gains.values.size - q :]),
                    integrated[s:],
                    square,
                ],
                [C, tall, np.zeros((outputs, outputs)), tall],
                [np.zeros((q, s)), square, tall.T, square],
            ]
        )
        error = np.hstack([np.zeros((q, s)), -np.eye(q), tall.T, np.eye(q)])
        return dynamics, error


def effects(fmu: FMU, system: System, model: LinearModel) -> Vector:
    """Effect of each quantity on the rate or output that shows it, at the design point, (q,).

    Raises
    ------
    InputError
        If a quantity has none there, to which that elsewhere could be compared.
    """
    shown = dict(zip((output.name for output in system.outputs), model.D, strict=True))
    shown |= dict(zip(model.states, model.B, strict=True))
    effect = np.array(
        [
            shown[quantity.acts_on][i] if quantity.acts_on else 1.0
            for i, quantity in enumerate(system.estimated)
        ]
    )
    moves = np.vstack([model.B, model.D]).any(axis=0) & (effect != 0.0)
    if not moves.all():
        hidden = [system.estimated[i].name for i in np.flatnonzero(~moves)]
        raise DesignPointError.of(fmu, " and ".join(hidden))
    return effect
