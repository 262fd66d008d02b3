"""The parameter estimator of Schwarz, Brembeck, Heckmann (2018), equation (7).

The estimated quantities of the model follow the measured outputs directly, dmu = L [dy; integral of
dy]: a PI controller that drives the model onto the measurement. The states are left alone.
"""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector, zeros
from workbench.models.fmu import FMU
from workbench.models.native import assign, compiled, evaluate, implicit, linearise, solve
from workbench.observers.contract import Estimator
from workbench.observers.estimators.disturbance import effects
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
    measure,
    measure_end,
    output,
    report,
)
from workbench.observers.operating import linearised, loops
from workbench.system.system import FULL, System

_SLOWEST = 2.0**-40  # of the fastest integral action, at which a design is given up


class _Settings(NamedTuple):
    layout: Layout
    places: NDArray[np.intp]  # (n + q,) of states among the unknowns; corrections are none
    L: Matrix
    effect: Vector


class _State(NamedTuple):
    integral: Annotated[Vector, "q"]  # of the gains times dy: the slow part of the corrections
    gains: Annotated[Matrix, "q, 2*l"]  # with authority
    z: Annotated[Vector, "q"]  # corrections
    system: Annotated[Matrix, "n, n + 1"]  # of the step, with its right-hand side
    innovation: Annotated[Vector, "l"]
    inputs: Annotated[Vector, "m"]  # the sample before, and what acts in the step, see `act`
    acting: Annotated[Vector, "m"]


@compiled
def _step(model, settings, state, h, u, y, estimate):  # type: ignore[no-untyped-def]
    """One linearly implicit Euler step of model and PI controller together."""
    layout, integral, gains = settings.layout, state.integral, state.gains
    z, system, innovation = state.z, state.system, state.innovation
    n, q, outputs = model.x.size, z.size, y.size
    status = 0
    if h > 0.0:
        act(layout, state.inputs, u, state.acting)
        status = measure(model, state.acting)
        for j in range(outputs):
            innovation[j] = y[j] - output(model, layout, j)
        status = status or linearise(model, layout.columns) or evaluate(model)
        for i in range(n):
            system[i, n] = h * model.dx[i]
        fade = fading(layout, y)
        for i in range(q):
            share = fade * authority(model, layout, settings.effect, i)
            for j in range(2 * outputs):
                gains[i, j] = share * settings.L[i, j]
        implicit(model, h, system)
        # The controller at the end of the step is part of the implicit equation.
        for k in range(q):
            wanted = integral[k] - z[k]
            for j in range(outputs):
                gain = gains[k, j] + h * gains[k, outputs + j]
                wanted += gain * innovation[j]
                for i in range(n):
                    effect = h * model.jacobian[n + k, i] * gain
                    add_slope(model, layout, j, effect, settings.places, system[i])
            for i in range(n):
                system[i, n] += h * model.jacobian[n + k, i] * wanted
        status = status or solve(system)
        if status:
            return status
        change = system[:, n]
        for i in range(n):
            model.x[i] += change[i]
        for j in range(outputs):
            innovation[j] -= explained(model, layout, j, settings.places, change)
        for k in range(q):
            direct = 0.0
            for j in range(outputs):
                integral[k] += h * gains[k, outputs + j] * innovation[j]
                direct += gains[k, j] * innovation[j]
            integral[k] = clip(integral[k], layout.low[k], layout.high[k])
            z[k] = clip(integral[k] + direct, layout.low[k], layout.high[k])
        status = correct(model, z) or measure_end(model, state.acting, u)
    else:
        status = measure(model, u)
    assign(state.inputs, u)
    return status or report(model, layout, estimate)


class ParameterEstimator(Estimator):
    """A model whose estimated quantities are set by a PI controller from measured outputs.

    As in the disturbance observer, a quantity is corrected in proportion to its authority, feedback
    fades, and quantities stay within their physical range; the integral stops at the same limits,
    so that it does not wind up.

    Parameters
    ----------
    fmu : any model with the inputs and outputs of the system.
    gains : L, (q, 2 l), rows corrections of quantities, columns dy and its integral; design:
        effect, (q,).
    """

    name = "parameter_estimator"
    by_quantities = True
    label = "parameter estimator"
    coarse_steps = True
    role = FULL
    rank = 30
    meaning = "L: rows corrections of quantities; columns dy, integral of dy"
    _step = staticmethod(_step)

    def __init__(self, fmu: FMU, system: System, gains: Gains) -> None:
        super().__init__(fmu, system, gains)
        n, q, outputs = len(fmu.states), len(system.estimated), len(system.outputs)
        self._settings = _Settings(
            layout=self._layout,
            places=np.append(np.arange(n), np.full(q, -1)),
            L=np.ascontiguousarray(gains.values.reshape(q, 2 * outputs)),
            effect=np.ascontiguousarray(gains.design["effect"]),
        )
        sizes = {"n": n, "m": len(system.inputs) + 1, "l": outputs, "q": q}
        self._state = zeros(_State, sizes)

    def _begin(self, u: Vector, y: Vector) -> None:
        self._model.x[:] = self.fmu.get_states()
        self._state.integral[:] = 0.0
        self._state.z[:] = 0.0

    @classmethod
    def meanings(cls, fmu: FMU, system: System, gains: Gains) -> dict[str, tuple[str, str]]:
        """See Estimator."""
        estimates = {quantity.correction: quantity.unit for quantity in system.estimated}
        return feedback_meanings(estimates, {output.name: output.unit for output in system.outputs})

    @classmethod
    def of(cls, L: Matrix, effect: Vector, source: str = "") -> Gains:
        """Gains of given matrices; see `ParameterEstimator`."""
        names = matrix_names("L", *L.shape)
        return Gains(cls.name, names, L.ravel(), {"effect": np.asarray(effect)}, source)

    @classmethod
    def default_gains(cls, fmu: FMU, system: System) -> Gains:
        """Integral action as fast as the linearised model bears.

        It is decoupled at its own frequency w by the inverse of the model's response there,
        L = w G(iw)^+, and slowed down from the rate of the samples until the loop is stable, as
        it always is in the end where a model is, and until noise moves no estimate by more than
        what is useful. Source: E. J. Davison (1976), IEEE Trans. Autom.
        Control 21, 35-47.
        """
        model = linearised(fmu, system)
        (n, q), outputs = model.B.shape, len(model.C)
        noise = np.array([output.noise_at_scale for output in system.outputs])
        useful = np.array([quantity.useful for quantity in system.estimated])
        effect = effects(fmu, system, model)
        fastest = 0.1 * np.pi / system.sample_time
        speed, L = fastest, np.zeros((q, 2 * outputs))
        slack = 1e-9 * np.abs(model.A).max(initial=0.0)
        bearable = float(np.linalg.eigvals(model.A).real.max(initial=0.0)) + slack
        while speed > _SLOWEST * fastest:
            response = model.C @ np.linalg.solve(1j * speed * np.eye(n) - model.A, model.B)
            scaled = (response + model.D) / noise[:, None]
            # The part in phase serves a model that settles, the other one that integrates.
            inverse = np.linalg.pinv(scaled, rcond=0.01) / noise
            L = np.hstack([inverse.imag, speed * inverse.real])
            dynamics = cls.error_dynamics(model.A, model.B, model.C, cls.of(L, effect))
            assert dynamics is not None
            kept = dynamics[0][: n + outputs, : n + outputs]
            quiet = np.abs(L[:, :outputs]) @ noise <= useful
            if np.linalg.eigvals(kept).real.max() <= bearable and quiet.all():
                break
            speed *= 0.5
        return cls.of(0.5 * L, effect, "integral action that the linearised model bears")

    @classmethod
    def space(
        cls, fmu: FMU, system: System, gains: Gains, slowest: float, fastest: float
    ) -> SearchSpace:
        """Bounds by the loops that gains close."""
        orders, effect = loops(linearised(fmu, system))
        orders = np.hstack([orders - 1.0, orders])
        effects = np.hstack([effect, effect])
        return feedback_space(orders, effects, slowest, fastest, gains.values)

    @classmethod
    def error_dynamics(
        cls, A: Matrix, B: Matrix, C: Matrix, gains: Gains
    ) -> tuple[Matrix, Matrix] | None:
        """Errors of states, integrals of dy, true quantities; the estimate is L [dy, integral]."""
        (n, q), outputs = B.shape, len(C)
        L = gains.values.reshape(q, 2 * outputs)
        estimate = np.hstack([L[:, :outputs] @ C, L[:, outputs:], np.zeros((q, q))])
        truth = np.hstack([np.zeros((q, n + outputs)), np.eye(q)])
        dynamics = np.zeros((n + outputs + q,) * 2)
        dynamics[:n, :n] = A
        dynamics[:n] += B @ (truth - estimate)
        dynamics[n : n + outputs, :n] = C
        return dynamics, truth - estimate
