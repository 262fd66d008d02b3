"""How Kalman filters take a sample: its correction, and what they do with one that surprises."""

import numpy as np

from workbench.kernel import compiled
from workbench.observers.adaptive import learn, loosen, note, surprises, trust
from workbench.observers.layout import fading

_GROWTH = 4.0  # from one jump that is tried to the next, in variance


@compiled
def absorb(model, settings, memory, y, row):  # type: ignore[no-untyped-def]
    """Covariance after a sample, and the change of the mean, one output after the other.

    The noise of outputs is independent, so that their order does not matter and no matrix is
    inverted. The innovations are those of one linearisation.
    Source: D. Simon, Optimal State Estimation, Wiley 2006, section 6.1.

    Returns the logarithm of the determinant of the innovations' covariance.
    """
    z, P, layout, v = memory.z, memory.P, settings.layout, memory.column
    size, n, volume = z.size, model.x.size, 0.0
    row[row.size - 1] = 0.0
    for i in range(size):
        memory.change[i] = 0.0
    for j in range(y.size):
        if np.isnan(y[j]):  # not measured: its level stays
            memory.levels.scatter[j] = memory.levels.sample[j]
            continue
        at = layout.seen[j]
        if at >= 0:
            innovation = y[j] - z[at] - memory.change[at]
            for i in range(size):
                v[i] = P[i, at]
            total = v[at]
        else:
            innovation = y[j] - model.y[-1 - at]
            total = 0.0
            for i in range(size):
                v[i] = 0.0
                for k in range(size):
                    v[i] += P[i, k] * model.jacobian[k, n - 1 - at]
            for i in range(size):
                total += model.jacobian[i, n - 1 - at] * v[i]
                innovation -= model.jacobian[i, n - 1 - at] * memory.change[i]
        total += note(memory.levels, j, innovation, total, memory.levels.noise[j])
        volume += np.log(total)
        inverse = 1.0 / total
        row[row.size - 1] += innovation * innovation * inverse
        # (I - K C) P (I - K C)' + K R K', with the best gain K = v / total
        for i in range(size):
            gain = v[i] * inverse
            memory.change[i] += gain * innovation
            for k in range(i + 1):
                P[i, k] -= gain * v[k]
                P[k, i] = P[i, k]
    return volume


@compiled
def update(model, settings, memory, h, y, row):  # type: ignore[no-untyped-def]
    """Correct mean and covariance by a sample; returns the logarithm of its likelihood."""
    z, levels, surprise = memory.z, memory.levels, settings.learning.surprise
    fade = fading(settings.layout, y)
    for i in range(z.size):
        for k in range(z.size):
            levels.before[i, k] = memory.P[i, k]
    volume = absorb(model, settings, memory, y, row)
    nis = row[row.size - 1]
    if settings.learning.within == np.inf:
        for i in range(z.size):
            z[i] += memory.change[i]
        return -0.5 * (nis + volume)
    if not surprises(settings, levels, nis):
        levels.surprised[0] = 0.0
        learn(settings, memory, fade, h)
    elif levels.surprised[0] == 0.0:
        levels.surprised[0] = 1.0
        loosen(memory, memory.spread[:, model.x.size :], z.size - 1, 0.0)
        return -0.5 * (surprise + volume)
    else:
        levels.surprised[0] = 0.0
        trust(levels)
        volume = follow_jump(model, settings, memory, h, y, row)
    for i in range(z.size):
        z[i] += memory.change[i]
    likelihood = -0.5 * (min(row[row.size - 1], surprise) + volume)
    row[row.size - 1] = nis
    return likelihood


@compiled
def follow_jump(model, settings, memory, h, y, row):  # type: ignore[no-untyped-def]
    """Correct by a sample under the least jump of one quantity that lets it happen.

    At most as far as it may be at the start. Of several quantities, of that under which it is
    likeliest. Source: A. S. Willsky, H. L. Jones (1976), IEEE Trans. Autom. Control 21, 108-112,
    with a jump of unknown size.

    Returns the logarithm of the determinant of the innovations' covariance.
    """
    n, last, surprise = model.x.size, row.size - 1, settings.learning.surprise
    F, best, chosen, size = memory.spread[:, n:], np.inf, memory.z.size - 1, 0.0
    for q in range(n, memory.z.size):
        if settings.walk[q] == 0.0:
            continue  # nothing to begin with, and it does not move
        jump, farthest = h * settings.walk[q] ** 2, settings.spread[q] ** 2
        row[last] = np.inf
        while row[last] > surprise and jump < farthest:
            jump = min(_GROWTH * jump, farthest)
            loosen(memory, F, q, jump)
            volume = absorb(model, settings, memory, y, row)
        if row[last] + volume < best:
            best, chosen, size = row[last] + volume, q, jump
    loosen(memory, F, chosen, size)
    return absorb(model, settings, memory, y, row)
