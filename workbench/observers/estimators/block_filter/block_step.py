"""Step of a filter whose unknowns fall into blocks, after which its covariance is one of blocks.

`settings` and `state` are those of the filter in `arrow`, which says what is approximated.
"""

import numpy as np

from workbench.models.native import compiled, evaluate, inlined, solve, solve_part
from workbench.observers.estimators.block_filter.block_slopes import slopes
from workbench.observers.layout import lag, put, stick

_ROUNDING = 1e-12  # share of a variance below which what is left of it is rounding


@compiled
def eliminate(settings, state, i, h):  # type: ignore[no-untyped-def]
    """Solve block i of the implicit step for its states, given the shared ones; returns a status.

    Writes (I - h A_ii)^-1 of the block's unknowns, in rows of its states: those of quantities are
    of a unit matrix; and `passed`, what the shared unknowns take from it, M_si M_ii^-1.
    """
    parts, slopes, inverse, solved = settings.blocks, state.slopes, state.inverse, state.solved
    count, begin, n = parts.first.size - 2, parts.first[i], parts.states[i]
    size, shared = parts.first[i + 1] - begin, parts.states[count]
    for r in range(n):
        for c in range(n):
            solved[r, c] = -h * slopes[begin + c, r]
            solved[r, n + c] = 0.0
        solved[r, r] += 1.0
        solved[r, n + r] = 1.0
        for c in range(n, size):
            solved[r, n + c] = h * slopes[begin + c, r]
    status = solve_part(solved, n, n + size)
    for r in range(n):
        for c in range(size):
            inverse[begin + r, c] = solved[r, n + c]
    for c in range(size):
        for a in range(shared):
            total = -h * slopes[begin + c, n + a] if c >= n else 0.0
            for r in range(n):
                total -= h * slopes[begin + r, n + a] * inverse[begin + r, c]
            state.passed[begin + c, a] = total
    return status


@compiled
def gather(model, settings, state, h, fade):  # type: ignore[no-untyped-def]
    """Step of the shared unknowns, of what all blocks pass to them; returns a status.

    With M = I - h A and z' = M^-1 z, blocks b_i and shared s: S s' = r, r = s - sum of L_i b_i,
    L_i = M_si M_ii^-1. Writes S^-1 and the change of the mean to `system`, the covariance R of r to
    `known`, and C_i L_i' of each block to `tied`.
    """
    parts, walk, P, G, C = settings.blocks, settings.filter.walk, state.P, state.G, state.C
    passed, tied, system, common = state.passed, state.tied, state.system, state.common
    kept, moved, known, order = state.kept, state.moved, state.known, parts.order
    count, status, (s, width) = parts.first.size - 2, 0, kept.shape
    last, shared = parts.first[count], parts.states[count]
    for a in range(s):
        own = order[last + a]
        for b in range(width):
            kept[a, b] = 1.0 if a == b else 0.0
        for b in range(s):
            known[a, b] = 0.0
            system[a, b] = -h * common[b, own] if a < shared else 0.0
        system[a, a] += 1.0
        # Model noise enters before the step, whose implicit form damps it as it damps the state.
        known[a, a] = h * (fade * walk[own]) ** 2
        system[a, s] = h * model.dx[own] if a < shared else 0.0
    for i in range(count):
        begin, n = parts.first[i], parts.states[i]
        size = parts.first[i + 1] - begin
        status = status or eliminate(settings, state, i, h)
        for c in range(size):
            C[begin + c, c] += h * (fade * walk[order[begin + c]]) ** 2
            for a in range(shared):
                total = 0.0
                for d in range(size):
                    total += C[begin + c, d] * passed[begin + d, a]
                tied[begin + c, a] = total
        for c in range(size):
            for a in range(shared):
                factor = passed[begin + c, a]
                for b in range(width):
                    kept[a, b] -= factor * G[begin + c, b]
                for b in range(shared):
                    known[a, b] += factor * tied[begin + c, b]
        for r in range(n):
            row = order[begin + r]
            for a in range(shared):
                factor = h * passed[begin + r, a]
                for b in range(s):
                    system[a, b] += factor * common[b, row]
                system[a, s] -= factor * model.dx[row]
    for a in range(s):
        for b in range(s):
            state.step[a, b] = system[a, b]
            system[a, s + 1 + b] = 1.0 if a == b else 0.0
        for b in range(width):
            moved[a, b] = 0.0
        for c in range(width):
            factor = kept[a, c]
            for b in range(width):
                moved[a, b] += factor * P[c, b]
    for a in range(s):
        for b in range(a + 1):
            total = known[a, b]
            for c in range(width):
                total += moved[a, c] * kept[b, c]
            known[a, b] = known[b, a] = total
    return status or solve(system)


@compiled
def invert(known, before):  # type: ignore[no-untyped-def]
    """Invert a covariance in place, but for unknowns that follow from those before them.

    By sweeps. Source: J. H. Goodnight (1979), A tutorial on the SWEEP operator, Amer. Statist. 33.

    Parameters
    ----------
    before : (s,) work space.
    """
    size = known.shape[0]
    for k in range(size):
        before[k] = known[k, k]
    for k in range(size):
        left = known[k, k]
        inverse = 1.0 / left if left > _ROUNDING * before[k] else 0.0
        for i in range(size):
            for j in range(size):
                if i != k and j != k:
                    known[i, j] -= known[i, k] * inverse * known[k, j]
        for i in range(size):
            known[i, k] *= inverse
            known[k, i] = known[i, k]
        known[k, k] = -inverse
    for i in range(size):
        for j in range(size):
            known[i, j] = -known[i, j]


@compiled
def share(state):  # type: ignore[no-untyped-def]
    """Covariance of the shared unknowns after a step, S^-1 R S^-T; `known` becomes R^-1."""
    kept, system, known, after = state.kept, state.system, state.known, state.after
    s = known.shape[0]
    for a in range(s):
        for b in range(s):
            kept[a, b] = 0.0
            for c in range(s):
                kept[a, b] += system[a, s + 1 + c] * known[c, b]
    for a in range(s):
        for b in range(a + 1):
            total = 0.0
            for c in range(s):
                total += kept[a, c] * system[b, s + 1 + c]
            after[a, b] = after[b, a] = total
    invert(known, state.row)


@compiled
def transform(block, X, begin, n, size):  # type: ignore[no-untyped-def]
    """X B X' of a block in place, whose X is a unit matrix in the rows of quantities.

    Parameters
    ----------
    block : (m + k, m) B in the first rows, the others are work space.
    X : (b, m) see `eliminate`; rows of the block's states from `begin` on.
    """
    for r in range(n):
        for c in range(size):
            block[size + r, c] = 0.0
        for k in range(size):
            factor = X[begin + r, k]
            for c in range(size):
                block[size + r, c] += factor * block[k, c]
    for r in range(n):
        for c in range(r + 1):
            total = 0.0
            for k in range(size):
                total += block[size + r, k] * X[begin + c, k]
            block[r, c] = block[c, r] = total
        for c in range(n, size):
            block[r, c] = block[c, r] = block[size + r, c]


@inlined
def forward(rows, X, begin, n, size, left):  # type: ignore[no-untyped-def]
    """X of a block times rows of an array, in place; left, (m, ...), is work space."""
    width = rows.shape[1]
    for k in range(size):
        for b in range(width):
            left[k, b] = rows[begin + k, b]
    for r in range(n):
        for b in range(width):
            rows[begin + r, b] = 0.0
        for k in range(size):
            factor = X[begin + r, k]
            for b in range(width):
                rows[begin + r, b] += factor * left[k, b]


@compiled
def whiten(state, begin, size):  # type: ignore[no-untyped-def]
    """Add what a block tells of the covariance between blocks to its sums, in units of its root.

    `block`, the covariance of its unknowns given the shared ones, becomes its root T (Cholesky), of
    which columns without a rest of variance are zero. In these units the covariance of any two
    blocks is less than a unit matrix.
    """
    root, G, weighed, tied = state.block, state.G, state.weighed, state.tied
    along, against, between = state.along, state.against, state.between
    s, width = state.kept.shape
    for k in range(size):
        least = _ROUNDING * root[k, k]
        for c in range(k + 1):
            total = root[k, c]
            for d in range(c):
                total -= root[k, d] * root[c, d]
            if c < k:
                root[k, c] = total * state.column[c]
            elif total > least:
                root[k, k] = np.sqrt(total)
                state.column[k] = 1.0 / root[k, k]
            else:
                root[k, k] = state.column[k] = 0.0
        inverse = state.column[k]
        for d in range(k):
            factor = root[k, d]
            for a in range(width):
                G[begin + k, a] -= factor * G[begin + d, a]
                weighed[k, a] -= factor * weighed[d, a]
            for a in range(s):
                tied[begin + k, a] -= factor * tied[begin + d, a]
        for a in range(width):
            G[begin + k, a] *= inverse
            weighed[k, a] *= inverse
            along[0, k, a] += G[begin + k, a]
            along[1, k, a] += weighed[k, a]
        for a in range(s):
            tied[begin + k, a] *= inverse
            state.row[a] = 0.0
        for b in range(s):
            for a in range(s):
                state.row[a] += tied[begin + k, b] * state.known[b, a]
        for a in range(s):
            against[0, k, a] += tied[begin + k, a]
            against[1, k, a] += state.row[a]
        for c in range(k + 1):
            total = 0.0
            for a in range(width):
                total += weighed[k, a] * G[begin + c, a]
            for a in range(s):
                total -= state.row[a] * tied[begin + c, a]
            between[k, c] -= total


@compiled
def distribute(model, settings, state, i, h):  # type: ignore[no-untyped-def]
    """Mean of block i after a step, and its covariance given the shared unknowns.

    b_i' = X (b_i - M_is s') with X = M_ii^-1, and s' = S^-1 r: b_i given r, moved by X. What makes
    the covariance between blocks is summed up for `liken`.
    """
    parts, G, C, X = settings.blocks, state.G, state.C, state.inverse
    tied, block, left, weighed = state.tied, state.block, state.left, state.weighed
    common, system, order, known = state.common, state.system, parts.order, state.known
    count, begin, n = parts.first.size - 2, parts.first[i], parts.states[i]
    size, shared, (s, width) = parts.first[i + 1] - begin, parts.states[count], state.kept.shape
    for k in range(size):
        for c in range(size):
            block[k, c] = C[begin + k, c]
    transform(block, X, begin, n, size)
    for k in range(size):
        for c in range(size):
            C[begin + k, c] = block[k, c]
        for a in range(s):
            total = -tied[begin + k, a] if a < shared else 0.0
            for b in range(width):
                total += state.moved[a, b] * G[begin + k, b]
            tied[begin + k, a] = total
    forward(G, X, begin, n, size, left)
    forward(tied, X, begin, n, size, left)
    # From here on G is X G_i, tied is X Cov(b_i, r), and C what is the block's own.
    for k in range(size):
        for a in range(width):
            weighed[k, a] = 0.0
        for b in range(width):
            factor = G[begin + k, b]
            for a in range(width):
                weighed[k, a] += factor * state.P[b, a]
        for a in range(s):
            left[k, a] = 0.0
            for b in range(s):
                left[k, a] += tied[begin + k, b] * known[b, a]
        for c in range(k + 1):
            total = 0.0
            for a in range(width):
                total += weighed[k, a] * G[begin + c, a]
            for a in range(s):
                total -= left[k, a] * tied[begin + c, a]
            block[k, c] = block[c, k] = total
    for k in range(size):
        for c in range(size):
            C[begin + k, c] += block[k, c]
            block[k, c] = C[begin + k, c]
    whiten(state, begin, size)
    for k in range(size):
        for b in range(s):
            G[begin + k, b] = 0.0
        for a in range(s):
            for b in range(s):
                G[begin + k, b] += left[k, a] * state.step[a, b]
        for c in range(size):
            G[begin + k, s + c] = block[k, c] if c <= k else 0.0
    for r in range(n):
        state.change[begin + r] = 0.0
        for k in range(n):
            at = order[begin + k]
            factor, moves = h * X[begin + r, k], model.dx[at]
            for b in range(s):
                G[begin + r, b] += factor * common[b, at]
                moves += common[b, at] * system[b, s]
            state.change[begin + r] += factor * moves
    for k in range(n, size):
        state.change[begin + k] = 0.0


@compiled
def liken(settings, state):  # type: ignore[no-untyped-def]
    """Take the covariance between two blocks, given the shared unknowns, for that of all pairs.

    In units of their roots, on average over the pairs, which makes a covariance of any blocks: the
    mean lies between a unit matrix and -1/(N - 1) of it, as the sum of N blocks has no variance
    less than zero. It is that of a common factor; what is known of each block stays as it is.
    """
    P, G, C, between, first = state.P, state.G, state.C, state.between, settings.blocks.first
    along, against, left = state.along, state.against, state.left
    count, s = first.size - 2, state.known.shape[0]
    width, size = P.shape[0], P.shape[0] - s
    pairs = count * (count - 1.0)
    for k in range(size):
        for c in range(k + 1):
            for a in range(width):
                between[k, c] += along[1, k, a] * along[0, c, a]
            for a in range(s):
                between[k, c] -= against[1, k, a] * against[0, c, a]
    for a in range(s):
        for b in range(s):
            P[a, b] = state.after[a, b]
        for k in range(size):
            P[a, s + k] = P[s + k, a] = 0.0
    for k in range(size):
        for c in range(k + 1):
            P[s + k, s + c] = P[s + c, s + k] = between[k, c] / pairs
    for i in range(count):
        begin = first[i]
        for k in range(size):
            for c in range(size):
                left[k, c] = 0.0
            for d in range(k + 1):
                factor = G[begin + k, s + d]
                for c in range(size):
                    left[k, c] += factor * P[s + d, s + c]
            for c in range(k + 1):
                total = C[begin + k, c]
                for d in range(c + 1):
                    total -= left[k, d] * G[begin + c, s + d]
                C[begin + k, c] = C[begin + c, k] = total


@compiled
def predict(model, settings, state, h, fade):  # type: ignore[no-untyped-def]
    """Advance mean and covariance by one linearly implicit step; returns a status."""
    z, parts, layout = state.z, settings.blocks, settings.filter.layout
    status = put(model, z) or evaluate(model) or slopes(model, parts, state)
    status = status or gather(model, settings, state, h, fade)
    if status:
        return status
    share(state)
    count, size = parts.first.size - 2, state.between.shape[0]
    for k in range(size):
        for c in range(size):
            state.between[k, c] = 0.0
        for a in range(state.P.shape[0]):
            state.along[0, k, a] = state.along[1, k, a] = 0.0
        for a in range(state.known.shape[0]):
            state.against[0, k, a] = state.against[1, k, a] = 0.0
    for i in range(count):
        distribute(model, settings, state, i, h)
    liken(settings, state)
    for a in range(state.known.shape[0]):
        state.change[parts.first[count] + a] = state.system[a, state.known.shape[0]]
    before = lag(layout, z)
    for k in range(z.size):
        z[parts.order[k]] += state.change[k]
    stick(layout, z, before)
    return 0
