"""Candidates about a point that is fitted: what each would explain, linearised."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.effects.catalogue import Effect, variant
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.linearized import LinearizedPoint
from workbench.diagnosis.inference.quadratic import (
    Joint,
    Key,
    Quadratic,
    add,
    beside,
    covariance,
    minimum,
)

_LARGEST = 1e4  # times what matters, up to which a size is sought
_DETERMINED = 1e-3  # share of what a candidate explains alone, from which on it is told from others
_UNSEEN = 1e-12  # share of all information on an unknown, which stops that do not show it have
Candidate = tuple[Effect, Mapping[str, float]]


@dataclass(frozen=True, eq=False)
class CandidateScore:
    """What one effect would explain, linearised."""

    # effect, shape: the candidate, and the shape it was tried with
    effect: Effect
    shape: Mapping[str, float]
    # size, sigma: estimate of its size and standard deviation
    size: float
    sigma: float
    alone: float  # estimate of its size beside no companions
    units: Mapping[str, str]  # of the size and of the parameters of the shape, by name
    gain: float  # fall of chi-squared when it is fitted to all stops, beside immaterial companions
    # what of it is that levels, or the one recording's own, are less far from expected
    by_levels: float
    least: float  # the same fall without any one of the stops, the least
    # (K,) rise of twice the log density of each stop, as the others predict it, when it is fitted
    # alone
    held_out: Vector
    phases: Vector  # (K,) [rad] of an order-locked effect

    @property
    def like_levels(self) -> bool:
        """Whether it is mostly how far levels are from expected that tells of it.

        They explain a held-out stop as well as the effect does, which tells nothing then.
        """
        return self.by_levels > 0.5 * self.gain

    @property
    def score(self) -> float:
        """By what fall of chi-squared it is ranked."""
        return self.gain if self.like_levels else float(self.held_out.sum())


def shapes(effect: Effect) -> list[dict[str, float]]:
    """Shapes with which an effect is tried."""
    tried: list[dict[str, float]] = [{}]
    for name, values in effect.shapes:
        tried = [{**point, name: value} for point in tried for value in values]
    return tried


def score_test(fit: Fit, lin: LinearizedPoint, candidates: Sequence[Candidate]) -> "ScoreTest":
    """Put candidates to the trial about a point that is fitted, with derivatives by all of them."""
    return ScoreTest(fit, fit.apart(lin, signatures(candidates)), candidates)


def signatures(candidates: Sequence[Candidate]) -> list[Key]:
    """Columns of the derivatives by the sizes of candidates."""
    return [
        (variant(effect, shape), parameter)
        for effect, shape in candidates
        for parameter in effect.sizes
    ]


class ScoreTest:
    """All candidates about one point.

    The others may be present at a size that does not matter: a candidate must explain what all of
    them together, too small to matter, do not. That it is there at all is significant at the rate
    of false alarms; whether it matters, its size says. Effects that were found bend to much that is
    neither: beside them, it must also explain what it does not at such a size. Where levels can
    stand for one, their spread says already how much of it does not matter. On held-out stops it is
    judged alone, since what companions cost, by their size, shows only where they are fitted.
    """

    def __init__(
        self,
        fit: Fit,
        joint: Joint,
        candidates: Sequence[Candidate],
    ) -> None:
        self._fit, self.joint, self.candidates = fit, joint, candidates
        self._stops = joint.stops()
        self._known = list(range(len(joint.known)))
        self.levels = joint.levels
        middle: dict[str, tuple[int, float]] = {}
        for effect, shape in candidates:
            if not effect.order_locked:
                at = joint.shared.index((variant(effect, shape), effect.size))
                middle[effect.name] = (at, effect.matters)
        share = self._beside_levels()
        # Of twins, by their cosine, levels take all but 1 - (1 - twin)^2.
        self._immaterial = {
            name: form for name, form in middle.items() if share[form[0]] > 2.0 * fit.decides.twin
        }
        alone = self._select({}, alone=True)
        self._without, self._prior = predictive_deviance(*alone), alone[1]
        base = self._select({})
        total = add([*base[0], base[1]])
        self._reference = total.at(minimum(total))
        self._base = [total, *_without_each(total, base[0])]
        self._alone = set(joint.known) <= {*joint.levels}

    @property
    def wrong(self) -> float:
        """Chi-squared of errors where known unknowns do their best."""
        return self._reference

    def _far(self, z: Vector) -> float:
        """Chi-squared of known unknowns against what is expected of them."""
        return self._prior.at(z[: len(self._known)])

    def _beside_levels(self) -> Vector:
        """(p,) Share of what stops say of each unknown that levels with a spread do not take.

        Beside levels of which nothing is expected; what these take is nobody's.
        """
        levels = [self.joint.shared.index(key) for key in self.levels]
        expected = np.diag(self.joint.prior.N) > 0.0
        free = self._beside([j for j in levels if not expected[j]])
        every = self._beside(levels)
        return np.divide(every, free, out=np.ones_like(free), where=free > 0.0)

    def _beside(self, at: Sequence[int]) -> Vector:
        """(p,) What stops say of each unknown, where others are fitted freely."""
        left: Vector = np.diag(beside(add(self._stops).N, at))
        return left

    def _select(
        self, own: Mapping[int, Matrix], name: str = "", *, alone: bool = False
    ) -> tuple[list[Quadratic], Quadratic]:
        """Stops and prior over known unknowns, immaterial ones and, last, the candidate."""
        others = [form for key, form in self._immaterial.items() if key != name and not alone]
        columns = [*self._known, *(at for at, _ in others)]
        count = len(columns) + bool(own)
        transforms = []
        for k in range(len(self._stops)):
            transform = np.zeros((len(self.joint.shared), count))
            transform[columns, range(len(columns))] = 1.0
            for at, direction in own.items():
                transform[at, -1] = direction[k]
            transforms.append(transform)
        stops = [stop.columns(t) for stop, t in zip(self._stops, transforms, strict=True)]
        prior = self.joint.prior.columns(transforms[0])
        for j, (_, matters) in enumerate(others, start=len(self._known)):
            prior.N[j, j] += (self._fit.decides.immaterial / matters) ** 2
        return stops, prior

    def covariance(self) -> Matrix:
        """Of the known unknowns, while all candidates may be present immaterially, (p, p)."""
        stops, prior = self._select({})
        count = len(self._known)
        known: Matrix = covariance(add([*stops, prior]).N)[:count, :count]
        return known

    def moved(self, twins: Collection[str] = ()) -> Vector:
        """(p,) How far known unknowns move beside a candidate that is no cause, at most.

        Of those that matter and are significant. What forms of laws may fake is no cause, but may
        be there; then what was found stands for a part of it.

        Parameters
        ----------
        twins : names of effects that explain in place of a cause, and are named so: beside it, one
            would share its size with it in any way.
        """
        count, furthest = len(self._known), np.zeros(len(self._known))
        stops, prior = self._select({})
        alone = minimum(add([*stops, prior]))[:count]
        for effect, shape in self.candidates:
            if effect.order_locked or effect.name in twins:
                continue
            at = self.joint.shared.index((variant(effect, shape), effect.size))
            stops, prior = self._select({at: np.ones(len(self._stops))}, effect.name)
            total = add([*stops, prior])
            best, sigma = minimum(total), float(np.sqrt(covariance(total.N)[-1, -1]))
            low, high = self._fit.unknowns.bounds(effect, effect.size)
            least = max(effect.matters, self._fit.decides.significant * sigma)
            if low <= best[-1] <= high and abs(best[-1]) > least:
                furthest = np.maximum(furthest, np.abs(best[:count] - alone))
        return furthest

    def lack_of_fit(self) -> tuple[float, int]:
        """Fall of chi-squared by all candidates together, of any size, and how many they are.

        By those that what is known does not stand for but for a thousandth, which derivatives may
        be wrong by. Source: C. R. Rao (1948), Proc. Camb. Phil. Soc. 44, 50-57.
        """
        total, known = self.joint.total(), len(self._known)
        whole = np.block([[total.N, total.g[:, None]], [total.g[None, :], total.c]])
        left = beside(whole, self._known)[known:, known:]
        scale = 1.0 / np.sqrt(np.maximum(np.diag(total.N)[known:], 1e-100))
        values, vectors = np.linalg.eigh(left[:-1, :-1] * np.outer(scale, scale))
        determined = values > _DETERMINED
        falls = (vectors.T @ (scale * left[:-1, -1]))[determined] ** 2 / values[determined]
        return float(falls.sum()), falls.size

    def explained(self, sizes: Mapping[Key, float]) -> float:
        """Rise of chi-squared, with what is expected of levels, without effects of these sizes."""
        known = self.joint.known
        at = [j for j, key in enumerate(known) if key in sizes]
        size = np.array([sizes[known[j]] for j in at])
        own = covariance(self.joint.total().N[: len(known), : len(known)])[np.ix_(at, at)]
        return float(size @ np.linalg.solve(own, size))

    def scores(self) -> list[CandidateScore]:
        """All candidates, best first."""
        scores = [self._score(effect, shape) for effect, shape in self.candidates]
        return sorted(scores, key=lambda score: -score.score)

    def _score(self, effect: Effect, shape: Mapping[str, float]) -> CandidateScore:
        at = [self.joint.shared.index((variant(effect, shape), name)) for name in effect.sizes]
        phases = np.zeros(len(self._stops))
        own = {at[0]: np.ones(len(self._stops))}
        if effect.order_locked:
            phases = np.array([_phase(stop, at) for stop in self._stops])
            own = {at[0]: np.cos(phases), at[1]: np.sin(phases)}
        low, high = self._fit.unknowns.bounds(effect, effect.size)
        stops, prior = self._select(own, effect.name)
        total = add([*stops, prior])
        best = minimum(total)
        sigma = float(np.sqrt(covariance(total.N)[-1, -1]))
        size = float(best[-1])
        forms = [total, *_without_each(total, stops)]
        absent, *absent_without = [_fixed(f, 0.0) for f in forms] if self._alone else self._base
        none = minimum(absent)
        if not low <= size <= high:
            # What its bounds allow of it: the rest of the unknowns do their best beside that.
            size = float(np.clip(size, low, high))
            stops, prior = [_fixed(stop, size) for stop in stops], _fixed(prior, size)
            total = add([*stops, prior])
            best = minimum(total)
        without = zip(absent_without, _without_each(total, stops), strict=True)
        alone, own_prior = self._select(own, alone=True)
        own_prior.N[-1, -1] += (_LARGEST * effect.matters) ** -2
        single = float(minimum(add([*alone, own_prior]))[-1])
        if not low <= single <= high:
            single = float(np.clip(single, low, high))
            alone, own_prior = [_fixed(stop, single) for stop in alone], _fixed(own_prior, single)
        return CandidateScore(
            effect=effect,
            shape=shape,
            size=size,
            sigma=sigma,
            alone=single,
            units={name: self._fit.unknowns.unit(effect, name) for name in (effect.size, *shape)},
            gain=absent.at(none) - total.at(best),
            by_levels=self._far(none) - self._far(best),
            least=min(a.at(minimum(a)) - form.at(minimum(form)) for a, form in without),
            held_out=self._without - predictive_deviance(alone, own_prior),
            phases=phases,
        )


def _phase(stop: Quadratic, at: Sequence[int]) -> float:
    """Phase of an order-locked effect in one stop [rad], everything else as it is."""
    amplitude = -np.linalg.lstsq(stop.N[np.ix_(at, at)], stop.g[at], rcond=None)[0]
    return float(np.arctan2(amplitude[1], amplitude[0]))


def _fixed(quadratic: Quadratic, last: float) -> Quadratic:
    """Chi-squared over the other unknowns, the last one held."""
    N = quadratic.N[:-1, :-1]
    g = quadratic.g[:-1] + last * quadratic.N[:-1, -1]
    c = quadratic.c + 2.0 * last * quadratic.g[-1] + last**2 * quadratic.N[-1, -1]
    return Quadratic(N, g, float(c), quadratic.rows)


def _without_each(total: Quadratic, stops: Sequence[Quadratic]) -> list[Quadratic]:
    return [
        Quadratic(total.N - stop.N, total.g - stop.g, total.c - stop.c, total.rows - stop.rows)
        for stop in stops
    ]


def predictive_deviance(stops: Sequence[Quadratic], prior: Quadratic) -> Vector:
    """-2 log of the density of each stop as all others predict it, (K,), up to a constant.

    It counts how sure the others are: what one stop alone tells is no failure of these.
    Source: S. Geisser, W. F. Eddy (1979), J. Am. Stat. Assoc. 74, 153-160.
    """
    total = add([*stops, prior])
    scale = 1.0 / np.sqrt(np.maximum(np.diag(total.N), 1e-100))
    unseen = _UNSEEN * np.eye(scale.size)

    def evidence(form: Quadratic) -> float:
        information = form.N * scale[:, None] * scale[None, :] + unseen
        return form.at(minimum(form)) + float(np.linalg.slogdet(information)[1])

    whole = evidence(total)
    return np.array([whole - evidence(others) for others in _without_each(total, stops)])
