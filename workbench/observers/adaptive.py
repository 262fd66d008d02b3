"""Noise levels of filters that follow innovations, and what surprises a filter.

Innovations of a filter with the right noise are white, and as large as it says. How samples scatter
tells the noise of sensors. Corrections that add up rather than cancel tell that something moves
faster than thought. A sample that is out of the question is left out; if the next one is so too,
quantities have jumped.

Sources: R. K. Mehra (1970), On the identification of variances and adaptive Kalman filtering, IEEE
Trans. Autom. Control 15, 175-184; D. H. Zhou, P. M. Frank (1996), Strong tracking filtering of
nonlinear time-varying stochastic systems, Int. J. Control 65, 295-307.
"""

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from workbench.fmu import Matrix, Vector
from workbench.kernel import compiled
from workbench.system import System

_OUTLYING = 9.0  # three standard deviations, squared: what is larger counts as this
_REACH = 1e4  # of levels, in variance
_RATE = 0.3  # change of a level within the filter's memory by its own evidence [1]


class Learning(NamedTuple):
    """How levels are learnt.

    Attributes
    ----------
    within : time in which the noise of samples is learnt [s], infinite: no level is.
    surprise : normalised innovation squared that chance makes once an hour.
    """

    within: float
    surprise: float


class Levels(NamedTuple):
    """Variances over those of the settings, and the evidence for them.

    Attributes
    ----------
    walk : (s,) of random walks, at most 1: what the settings say is the fastest.
    sample : (l,) of samples.
    moved, expected : (s,) corrections within the filter's memory, added up, and their variance.
    noise : (l,) variance of the last sample that the settings say.
    scatter : (l,) variance that the last sample speaks for.
    before : (s, s) covariance before the last sample.
    surprised : (1,) 1 where the last sample was left out.
    age : (1,) time for which levels were learnt [s].
    """

    walk: Vector
    sample: Vector
    moved: Vector
    expected: Vector
    noise: Vector
    scatter: Vector
    before: Matrix
    surprised: Vector
    age: Vector


def learning(system: System) -> Learning:
    """How filters of a system learn."""
    once = system.sample_time / 3600.0
    return Learning(system.learns, float(chi2.isf(once, len(system.outputs))))


def levels(size: int, outputs: int) -> Levels:
    """Levels of so many states and quantities; see `reset`."""
    walk, moved, expected = (np.zeros(size) for _ in range(3))
    sample, noise, scatter = (np.zeros(outputs) for _ in range(3))
    before = np.zeros((size, size))
    once = (np.zeros(1) for _ in range(2))
    return Levels(walk, sample, moved, expected, noise, scatter, before, *once)


@compiled
def reset(levels):  # type: ignore[no-untyped-def]
    """Levels of the settings, without evidence."""
    trust(levels)
    levels.surprised[0] = levels.age[0] = 0.0
    for j in range(levels.sample.size):
        levels.sample[j] = 1.0


@compiled
def trust(levels):  # type: ignore[no-untyped-def]
    """Let everything move as fast as the settings say, as after a jump."""
    for i in range(levels.walk.size):
        levels.walk[i] = 1.0
        levels.moved[i] = levels.expected[i] = 0.0


@compiled
def note(levels, j, innovation, explained, noise):  # type: ignore[no-untyped-def]
    """Note what a sample of output j speaks for; returns the variance of its noise.

    Parameters
    ----------
    innovation : [its unit]; explained: variance of it that is not noise.
    noise : variance that the settings say.
    """
    learnt = levels.sample[j] * noise
    square = min(innovation * innovation, _OUTLYING * (explained + learnt))
    levels.scatter[j] = (square - explained) / noise
    return learnt


@compiled
def learn(settings, memory, fade, h):  # type: ignore[no-untyped-def]
    """Change the levels by a sample; corrections are in `memory.change`.

    White innovations make corrections whose sum has the variance that they take from P.
    """
    levels, P, walk = memory.levels, memory.P, settings.walk
    levels.age[0] += h
    part = min(fade * h / settings.learning.within, 1.0)
    for j in range(levels.sample.size):
        level = levels.sample[j] + part * (levels.scatter[j] - levels.sample[j])
        levels.sample[j] = min(max(level, 1.0 / _REACH), _REACH)
    for i in range(walk.size):
        moves = h * levels.walk[i] * (fade * walk[i]) ** 2
        if not (moves > 0.0 and P[i, i] > 0.0):
            continue
        part = moves / (P[i, i] + moves)  # of the filter's memory
        levels.moved[i] = (1.0 - part) * levels.moved[i] + memory.change[i]
        lessened = max(levels.before[i, i] - P[i, i], 0.0)
        levels.expected[i] = (1.0 - part) ** 2 * levels.expected[i] + lessened
        if levels.expected[i] > 0.0:
            ratio = min(levels.moved[i] ** 2 / levels.expected[i], _OUTLYING)
            level = levels.walk[i] * np.exp(_RATE * part * (ratio - 1.0))
            levels.walk[i] = min(max(level, 1.0 / _REACH), 1.0)


@compiled
def surprises(settings, levels, nis):  # type: ignore[no-untyped-def]
    """Whether a sample is out of the question, once levels are learnt."""
    learns = settings.learning
    return levels.age[0] > learns.within and nis > learns.surprise


@compiled
def loosen(memory, F, q, jump):  # type: ignore[no-untyped-def]
    """Covariance before the sample, with a jump of a quantity within the last two steps.

    Parameters
    ----------
    F : (n, s) derivatives of the step, rows of states.
    q : column of the quantity.
    jump : its variance.
    """
    P, before, way = memory.P, memory.levels.before, memory.change
    n, size = F.shape
    for i in range(n):
        # On average it has acted on one step and a half: on the last, and on half of the first.
        way[i] = F[i, q]
        for k in range(n):
            way[i] += 0.5 * F[i, k] * F[k, q]
    for i in range(n, size):
        way[i] = 1.0 * (i == q)
    for i in range(size):
        for k in range(size):
            P[i, k] = before[i, k] + jump * way[i] * way[k]
