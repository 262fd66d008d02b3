"""Derivatives of a model whose unknowns fall into blocks, of none that is zero by structure.

`parts` are `blocks.Blocks`, `settings` and `state` those of the filter in `arrow`.
"""

from workbench.models.native import compiled, direction, inlined, linearise


@compiled
def slopes(model, parts, state):  # type: ignore[no-untyped-def]
    """Derivatives of each block's rates and of the shared ones, by what acts on them; a status."""
    if model.directional_fmi[0] == 0:
        return slopes_by_differences(model, parts, state)
    count = parts.first.size - 2
    for i in range(count):
        asked = parts.states[i] + parts.states[count]
        for k in range(parts.first[i], parts.first[i + 1]):
            known = model.knowns[parts.order[k] :]
            out = state.slopes[k, :asked]
            if direction(model, parts.rates[i], known, model.seed, out):
                return 1
    for a in range(parts.first[count + 1] - parts.first[count]):
        known = model.knowns[parts.order[parts.first[count] + a] :]
        out = state.common[a, : model.x.size]
        if direction(model, model.unknowns, known, model.seed, out):
            return 1
    return 0


@compiled
def slopes_by_differences(model, parts, state):  # type: ignore[no-untyped-def]
    """The same of an FMU without directional derivatives, of which all are taken; a status."""
    status, count, order = linearise(model, model.x.size), parts.first.size - 2, parts.order
    last = parts.first[count]
    for i in range(count):
        for k in range(parts.first[i], parts.first[i + 1]):
            for r in range(parts.states[i]):
                state.slopes[k, r] = model.jacobian[order[k], order[parts.first[i] + r]]
            for a in range(parts.states[count]):
                state.slopes[k, parts.states[i] + a] = model.jacobian[order[k], order[last + a]]
    for a in range(parts.first[count + 1] - last):
        for r in range(model.x.size):
            state.common[a, r] = model.jacobian[order[last + a], r]
    return status


@inlined
def slope(model, column, known, out):  # type: ignore[no-untyped-def]
    """Derivative of the output of a column of the Jacobian by an unknown into out[0]; a status."""
    if model.directional_fmi[0] == 0:  # all of them were taken, see `slopes_of_fed`
        out[0] = model.jacobian[known, column]
        return 0
    own = model.unknowns[column:]
    return direction(model, own, model.knowns[known:], model.seed, out[:1])


@compiled
def slopes_of_fed(model, settings, state):  # type: ignore[no-untyped-def]
    """Derivatives of fed outputs that are no states, by block and shared unknowns; a status."""
    parts, seen, n = settings.blocks, settings.filter.layout.seen, model.x.size
    count, status = parts.first.size - 2, 0
    if model.directional_fmi[0] == 0:
        status = linearise(model, n + model.y.size)
    for j in range(seen.size):
        if seen[j] >= 0:
            continue
        i, column, size = parts.home[j], n - 1 - seen[j], 0
        if i < count:
            size = parts.first[i + 1] - parts.first[i]
        for k in range(size):
            known, out = parts.order[parts.first[i] + k], state.measured[j, k:]
            status = status or slope(model, column, known, out)
        for a in range(state.known.shape[0]):
            known, out = parts.order[parts.first[count] + a], state.measured[j, size + a :]
            status = status or slope(model, column, known, out)
    return status
