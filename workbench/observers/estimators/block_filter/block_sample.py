"""What a sample tells a filter whose unknowns fall into blocks, and how much it knows.

`settings` and `state` are those of the filter in `arrow`.
"""

import numpy as np

from workbench.models.native import compiled, inlined
from workbench.observers.estimators.kalman import variance


@compiled
def measurement_update(model, settings, state, y, fade, estimate):  # type: ignore[no-untyped-def]
    """Correct mean and covariance by a sample, one output after the other.

    Given the shared unknowns and the common factor, an output tells of its own block alone: that is
    corrected by it, and what block and noise leave uncertain of it is the noise of what it says of
    the shared ones. Blocks stay independent given these, so that nothing is approximated.
    """
    z, P, G, C, parts = state.z, state.P, state.G, state.C, settings.blocks
    layout, d, v, change = settings.filter.layout, state.row, state.column, state.change
    count, width, s = parts.first.size - 2, P.shape[0], state.known.shape[0]
    last, measured = parts.first[count], state.measured
    estimate[estimate.size - 1] = 0.0
    for k in range(change.size):
        change[k] = 0.0
    for j in range(y.size):
        if np.isnan(y[j]):
            continue  # not measured
        i, at, place = parts.home[j], layout.seen[j], parts.place[j]
        begin = parts.first[i]
        size = parts.first[i + 1] - begin if i < count else 0
        total = variance(settings.filter, fade, y, j)
        innovation = y[j] - (z[at] if at >= 0 else model.y[-1 - at])
        if at >= 0 and i == count:
            for a in range(width):
                d[a] = 1.0 if last + a == place else 0.0
        elif at >= 0:
            innovation -= change[place]
            total += C[place, place - begin]
            for a in range(width):
                d[a] = G[place, a]
            for k in range(size):
                v[k] = C[place, k]
        else:
            for a in range(width):
                d[a] = measured[j, size + a] if a < s else 0.0
            for k in range(size):
                innovation -= measured[j, k] * change[begin + k]
                for a in range(width):
                    d[a] += measured[j, k] * G[begin + k, a]
                v[k] = 0.0
                for c in range(size):
                    v[k] += C[begin + k, c] * measured[j, c]
                total += measured[j, k] * v[k]
        inverse = 1.0 / total
        for k in range(size):
            gain = v[k] * inverse
            change[begin + k] += gain * innovation
            for a in range(width):
                G[begin + k, a] -= gain * d[a]
            for c in range(size):
                C[begin + k, c] -= gain * v[c]
        for a in range(width):
            innovation -= d[a] * change[last + a]
            state.told[a] = 0.0
            for b in range(width):
                state.told[a] += P[a, b] * d[b]
            total += d[a] * state.told[a]
        inverse = 1.0 / total
        estimate[estimate.size - 1] += innovation * innovation * inverse
        for a in range(width):
            gain = state.told[a] * inverse
            change[last + a] += gain * innovation
            for b in range(width):
                P[a, b] -= gain * state.told[b]
    for k in range(last):
        for a in range(width):
            change[k] += G[k, a] * change[last + a]
    for k in range(z.size):
        z[parts.order[k]] += change[k]


@inlined
def of_shared(P, d):  # type: ignore[no-untyped-def]
    """Variance of a sum of shared unknowns with factors d, (s,)."""
    total = 0.0
    for a in range(d.size):
        part = 0.5 * P[a, a] * d[a]
        for b in range(a):
            part += P[a, b] * d[b]
        total += 2.0 * d[a] * part
    return total


@inlined
def scatter(state, begin, k):  # type: ignore[no-untyped-def]
    """Variance of unknown k, in the order of blocks, of the block that begins at `begin`."""
    G, P, last = state.G, state.P, state.G.shape[0]
    if k >= last:
        return P[k - last, k - last]
    return state.C[k, k - begin] + of_shared(P, G[k])


@compiled
def reported_deviation(settings, state, r):  # type: ignore[no-untyped-def]
    """Standard deviation of reported output r, which may depend on all blocks, to first order."""
    parts, slope, d = settings.blocks, state.reported, state.row
    count, total = parts.first.size - 2, 0.0
    for a in range(d.size):
        d[a] = slope[parts.first[count] + a, r] if a < state.known.shape[0] else 0.0
    for i in range(count):
        begin = parts.first[i]
        for k in range(begin, parts.first[i + 1]):
            for a in range(d.size):
                d[a] += slope[k, r] * state.G[k, a]
            for c in range(parts.first[i + 1] - begin):
                total += slope[k, r] * state.C[k, c] * slope[begin + c, r]
    return np.sqrt(max(total + of_shared(state.P, d), 0.0))


@compiled
def fed_deviation(settings, state, j):  # type: ignore[no-untyped-def]
    """Standard deviation of fed output j, to first order."""
    parts, slope, d = settings.blocks, state.measured, state.row
    count, i = parts.first.size - 2, parts.home[j]
    begin = parts.first[i]
    if settings.filter.layout.seen[j] >= 0:
        return np.sqrt(scatter(state, begin, parts.place[j]))
    size, total = parts.first[i + 1] - begin if i < count else 0, 0.0
    for a in range(d.size):
        d[a] = slope[j, size + a] if a < state.known.shape[0] else 0.0
    for k in range(size):
        for a in range(d.size):
            d[a] += slope[j, k] * state.G[begin + k, a]
        for c in range(size):
            total += slope[j, k] * state.C[begin + k, c] * slope[j, c]
    return np.sqrt(max(total + of_shared(state.P, d), 0.0))
