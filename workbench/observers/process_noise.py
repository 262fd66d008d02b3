"""How far states and quantities move in a step beyond what the model says."""

import numpy as np

from workbench.kernel import compiled, evaluate, inlined, set_inputs
from workbench.observers.layout import measure, put


@inlined
def room(settings, P, i):  # type: ignore[no-untyped-def]
    """Share of a random walk that is left, where levels are learnt.

    Nothing is known less of a quantity than at the start: a walk within a range. States have none.
    """
    if settings.learning.within == np.inf or i < P.shape[0] - settings.layout.nominal.size:
        return 1.0
    return max(1.0 - P[i, i] / settings.spread[i] ** 2, 0.0)


@compiled
def drive(model, settings, memory, z, u, h):  # type: ignore[no-untyped-def]
    """Variances by which noise of the inputs moves the states in a step from z; returns a status.

    What is measured drives the model with its sensor's noise, (h df/du sigma)^2, in `memory.least`.
    Walks that are learnt hold that too, as far as outputs show it; where two bodies are pressed
    together, the force between them answers it and no speed does. So states move by what was learnt
    of them, or by what inputs make of them if that is more; the sum would count it twice.
    Source: S. Thrun, W. Burgard, D. Fox (2005), Probabilistic Robotics, table 7.2 (noise of inputs
    as noise of the step).
    """
    n, least, low = model.x.size, memory.least, memory.change
    for i in range(n):
        least[i] = 0.0
    status = measure(model, u) or put(model, z)
    for j in range(u.size):
        deviation = settings.driven[j] + settings.driven_relative[j] * abs(u[j])
        if deviation == 0.0:
            continue
        model.u[j] = u[j] - deviation
        status = status or set_inputs(model, j, 1) or evaluate(model)
        for i in range(n):
            low[i] = model.dx[i]
        model.u[j] = u[j] + deviation
        status = status or set_inputs(model, j, 1) or evaluate(model)
        for i in range(n):
            least[i] += (0.5 * h * (model.dx[i] - low[i])) ** 2
        model.u[j] = u[j]
        status = status or set_inputs(model, j, 1)
    return status


@inlined
def process_noise(settings, memory, fade, h, i):  # type: ignore[no-untyped-def]
    """Variance by which state or quantity i moves in a step, after `drive`.

    Walks fade with feedback; the noise of a sensor does not.
    """
    share = room(settings, memory.P, i) * memory.levels.walk[i]
    moves = h * share * (fade * settings.walk[i]) ** 2
    return max(moves, memory.least[i]) if i < memory.least.size else moves
