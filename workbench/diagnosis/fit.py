"""Fit of effects to all stops at once, with what differs from stop to stop by nature.

In each stop, levels of friction, wheel load and inertias may differ from their common value within
the tolerances of the rig; these local deviations have priors, and are eliminated stop by stop. What
is left of a stop is a small quadratic form in the common unknowns, which sums and leaves-one-out
are made of.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from workbench.case import Case, Surface
from workbench.diagnosis.catalogue import Effect, Unless, Where
from workbench.diagnosis.evidence import FORCE_DELAY, Column, Court, Evidence
from workbench.diagnosis.extension import variables
from workbench.diagnosis.quadratic import Quadratic, add, minimum
from workbench.errors import InputError
from workbench.fmu import Matrix, Vector

# Relative standard deviation from stop to stop, data sheet of the rig.
TOLERANCES = {"muDC": 0.02, "muWR": 0.02, "JW": 0.01, "JR": 0.002, "Fz": 0.003}

# Polach's parameters and friction at zero slip, data sheet of the rig.
_RAIL: Mapping[Surface, Mapping[str, float]] = {
    "dry": {"muWR": 0.40, "polach.kA": 1.0, "polach.kS": 0.4, "polach.A": 0.4, "polach.B": 0.6},
    "wet": {"muWR": 0.28, "polach.kA": 0.3, "polach.kS": 0.1, "polach.A": 0.4, "polach.B": 0.2},
}
_RAIL_SPREAD = 0.2  # relative, of the common level of muWR, which dry stops hardly show
_FORCE_DELAY = 1e-3  # [s] standard deviation: filters of the amplifier, uncertain damping
_NOISE = 1.3  # mean square of whitened errors that an estimate of noise may leave
_WORSE = 1.0  # of deviance, which no step is worth
_HALVED = 4  # times: after that a step is given up
_SECOND = 20  # blocks
_FURTHEST = 5.0  # standard deviations that no tolerance goes beyond
_FURTHEST_LEVEL = 3.0  # the same of what differs by nature

# (effect, parameter), (quantity, surface) of a level, (STOP, quantity) of a tolerance.
Key = tuple[str, str]
_STOP = ""
_LATE: Key = (FORCE_DELAY, "load cell")


@dataclass(frozen=True)
class Point:
    """Values of all unknowns.

    Attributes
    ----------
    sizes : by effect and parameter, SI; an order-locked effect has its "amplitude" here.
    levels : common level by quantity and surface, as ("muDC", "dry"), or sensor.
    deviations : of each stop from the common values, in standard deviations, (K, 5).
    phases : [rad] of order-locked effects, (K,) by effect.
    """

    sizes: Mapping[Key, float]
    levels: Mapping[Key, float]
    deviations: Matrix
    phases: Mapping[str, Vector]


@dataclass(frozen=True, eq=False)
class Linearised:
    """Evidence of all stops about a point.

    Attributes
    ----------
    keys : of the columns of each jacobian: TOLERANCES, then (effect, parameter).
    inflation : (m,) variance of slow errors over that of white noise, by channel, at least 1.
    away : chi-squared of levels and deviations against what tolerances say of them.
    """

    point: Point
    keys: tuple[Key, ...]
    evidence: tuple[Evidence, ...]
    inflation: Vector
    away: float

    @property
    def misfit(self) -> float:
        """Chi-squared of all stops at the point, in units of the noise."""
        return float(sum(one.residual @ one.residual for one in self.evidence))

    @property
    def _squares(self) -> tuple[int, Vector]:
        """Number of blocks, and mean square of their errors by channel (m,)."""
        errors = np.concatenate([one.errors for one in self.evidence])
        return len(errors), np.square(errors).mean(axis=0)

    @property
    def deviance(self) -> float:
        """What a fit makes least: minus twice the log likelihood, up to a constant.

        Of a channel that is wrong, the variance is unknown, and errors that last count once in a
        second: its logarithm counts. To spoil one channel for another is no gain then.
        Source: Y. Bard, Nonlinear Parameter Estimation, 1974, section 4-8.
        """
        count, mean = self._squares
        noise = count * np.minimum(mean, _NOISE)
        wrong = count / _SECOND * np.log(self.spread)
        rest = sum(one.rest**2 for one in self.evidence)
        return float((noise + wrong).sum()) + rest + self.away

    @property
    def spread(self) -> Vector:
        """(m,) By what chi-squared of each channel is divided, for a step to lower the deviance."""
        spread: Vector = 1.0 + _SECOND * np.maximum(0.0, self._squares[1] - _NOISE)
        return spread

    def weighed(self, inflation: Vector) -> float:
        """Chi-squared, each channel in units of what is wrong with it, (m,)."""
        return float(sum((one.errors**2 / inflation).sum() + one.rest**2 for one in self.evidence))


class Fit:
    """Unknowns, evidence and least squares of one set of stops.

    Parameters
    ----------
    court : that gathers the evidence.
    effects : that may be asked for.
    """

    def __init__(self, court: Court, effects: Sequence[Effect]) -> None:
        self._court = court
        self._effects = {effect.name: effect for effect in effects}
        self.count = len(court.cases)

    @property
    def names(self) -> list[str]:
        """Names of the stops."""
        return [case.name for case in self._court.cases]

    def unit(self, effect: Effect, parameter: str) -> str:
        """Unit of a parameter, "1" if it has none."""
        return self._court.units.get(variables(effect, parameter)[0], "1")

    def bounds(self, effect: Effect, parameter: str) -> tuple[float, float]:
        """Least and greatest value of a parameter, SI."""
        low, high = self._court.bounds[variables(effect, parameter)[0]]
        # An amplitude has no sign: its phase has.
        return (0.0, high) if parameter == "cosine" else (low, high)

    def start(self) -> Point:
        """The nominal model."""
        levels: dict[Key, float] = {_LATE: 0.0}
        for case in self._court.cases:
            levels["muDC", _discs(case)] = self._court.nominal["muDC"]
            rail = case.conditions.wheel_rail
            levels["muWR", rail] = _RAIL[rail]["muWR"]
        return Point({}, levels, np.zeros((self.count, len(TOLERANCES))), {})

    def present(self, effect: Effect, k: int) -> bool:
        """Whether stop k can have an effect: where the conditions say, if those of any stop do."""
        where = effect.where
        return where is None or not self._told(where) or self._share(where, k) > 0.0

    def _share(self, said: Where | Unless, k: int) -> float:
        """Share of what a condition of stop k says that is one state."""
        states = getattr(self._court.cases[k].conditions, said.condition, None)
        if states is None:
            raise InputError(
                where=f"conditions of {self._court.cases[k].name}",
                found=f"no '{said.condition}', which an effect of the library asks for",
                expected="a condition that stops have",
                remedy="correct the annotation of the effect",
            )
        entries = states if isinstance(states, tuple) else (states,)
        return entries.count(said.state) / len(entries)

    def _told(self, said: Where | Unless) -> bool:
        """Whether the conditions of any stop say so."""
        return any(self._share(said, k) > 0.0 for k in range(self.count))

    def unseen(self, effect: Effect) -> str:
        """Why these stops cannot show an effect; empty if they can."""
        unless, falling = effect.unless, effect.falling
        if unless is not None and self._told(unless):
            return unless.because
        if falling is not None and not any(s.falls(falling.signal) for s in self._court.stops):
            return falling.because
        return effect.hidden

    def values(self, point: Point) -> list[dict[str, float]]:
        """Values of the FMU's variables in each stop."""
        return [self._values(point, k) for k in range(self.count)]

    def _values(self, point: Point, k: int) -> dict[str, float]:
        case = self._court.cases[k]
        values = {
            **_RAIL[case.conditions.wheel_rail],
            FORCE_DELAY: point.levels[_LATE],
        }
        for j, (name, tolerance) in enumerate(TOLERANCES.items()):
            common = self._common(point, name, case)
            values[name] = common * (1.0 + tolerance * point.deviations[k, j])
        for effect in self._effects.values():
            where = effect.where
            if where is not None and where.share and self._told(where):
                values |= dict.fromkeys(variables(effect, where.share), self._share(where, k))
        for (name, parameter), size in point.sizes.items():
            effect = self._effects[name]
            if parameter == "amplitude":
                phase = point.phases[name][k]
                parts = {"cosine": size * np.cos(phase), "sine": size * np.sin(phase)}
            elif parameter == effect.size:
                parts = {parameter: size if self.present(effect, k) else 0.0}
            else:
                parts = {parameter: size}
            for part, value in parts.items():
                names = variables(effect, part)
                start = self._court.given.get(names[0], 0.0) if part in effect.sizes else 0.0
                values |= dict.fromkeys(names, start + float(value))
        return values

    def _common(self, point: Point, name: str, case: Case) -> float:
        if name == "muDC":
            return point.levels[name, _discs(case)]
        if name == "muWR":
            return point.levels[name, case.conditions.wheel_rail]
        return self._court.nominal[name]

    def linearise(
        self,
        point: Point,
        active: Sequence[Effect],
        candidates: Sequence[tuple[Effect, Mapping[str, float]]] = (),
    ) -> Linearised:
        """Gather evidence about a point.

        Parameters
        ----------
        active : effects that the point has.
        candidates : others, each with the shape it is tried with.
        """
        columns = [
            Column((name,), 0.5 * tolerance * self._court.nominal[name])
            for name, tolerance in TOLERANCES.items()
        ]
        columns.append(Column((FORCE_DELAY,), _FORCE_DELAY))
        keys: list[Key] = [(_STOP, name) for name in (*TOLERANCES, FORCE_DELAY)]
        for effect in active:
            for parameter in (*effect.sizes, *(name for name, _ in effect.shapes)):
                names = variables(effect, parameter)
                is_shape = parameter not in effect.sizes
                step = 0.05 * point.sizes[effect.name, parameter] if is_shape else effect.step
                high = self._court.bounds[names[0]][1]
                if not is_shape and point.sizes[effect.name, effect.label] + step > high:
                    step = -step
                columns.append(Column(names, step))
                keys.append((effect.name, parameter))
        for effect, shape in candidates:
            setting = {
                name: value
                for parameter, value in shape.items()
                for name in variables(effect, parameter)
            }
            for parameter in effect.sizes:
                columns.append(Column(variables(effect, parameter), effect.step, setting))
                keys.append((variant(effect, shape), parameter))
        evidence = self._court.hear(self.values(point), [columns] * self.count)
        away = float(np.square(point.deviations).sum()) + self._prior(point, list(point.levels)).c
        return Linearised(point, tuple(keys), tuple(evidence), slowness(evidence), away)

    def quadratics(self, lin: Linearised, extra: Sequence[Key] = ()) -> "Joint":
        """Every stop over the common unknowns, local ones eliminated.

        Parameters
        ----------
        extra : columns of candidates that join the common unknowns as they are.
        """
        shared = [*lin.point.sizes, *lin.point.levels, *extra]
        systems = [self._system(lin, k, shared) for k in range(self.count)]
        known = tuple(shared[: len(shared) - len(extra)])
        levels = tuple(lin.point.levels)
        return Joint(tuple(shared), known, levels, tuple(systems), self._prior(lin.point, shared))

    def _system(self, lin: Linearised, k: int, shared: Sequence[Key]) -> "StopSystem":
        point, case = lin.point, self._court.cases[k]
        evidence = lin.evidence[k]
        b, m = evidence.errors.shape
        weight = np.append(np.tile(1.0 / np.sqrt(lin.inflation), b), 1.0)
        at = {key: evidence.jacobian[:, j] * weight for j, key in enumerate(lin.keys)}
        J, P = np.zeros((b * m + 1, len(shared))), []
        for j, key in enumerate(shared):
            if key == _LATE:
                J[:, j] = at[_STOP, FORCE_DELAY]
            elif key in point.levels:
                name, surface = key
                mine = _discs(case) if name == "muDC" else case.conditions.wheel_rail
                if surface == mine:
                    deviation = point.deviations[k, list(TOLERANCES).index(name)]
                    J[:, j] = at[_STOP, name] * (1.0 + TOLERANCES[name] * deviation)
            elif key[1] == "amplitude":
                cosine, sine, phase = (
                    at[key[0], "cosine"],
                    at[key[0], "sine"],
                    point.phases[key[0]][k],
                )
                J[:, j] = np.cos(phase) * cosine + np.sin(phase) * sine
                P.append(point.sizes[key] * (np.cos(phase) * sine - np.sin(phase) * cosine))
            else:
                effect = self._effects[key[0].partition(" ")[0]]
                J[:, j] = at[key] * float(self.present(effect, k))
        tolerances = [
            at[_STOP, name] * tolerance * self._common(point, name, case)
            for name, tolerance in TOLERANCES.items()
        ]
        local = np.column_stack(tolerances + P)
        return StopSystem(evidence.residual * weight, J, local, point.deviations[k])

    def _prior(self, point: Point, shared: Sequence[Key]) -> Quadratic:
        """What is known of the common unknowns beforehand: muWR to a fifth, the rest freely."""
        N, g, c = np.zeros((len(shared),) * 2), np.zeros(len(shared)), 0.0
        for j, key in enumerate(shared):
            if key in point.levels and key[0] != "muDC":
                middle, sigma = self._expected(key)
                away = (point.levels[key] - middle) / sigma
                N[j, j], g[j], c = 1.0 / sigma**2, away / sigma, c + away**2
        return Quadratic(N, g, c, 0)

    @staticmethod
    def _expected(key: Key) -> tuple[float, float]:
        """What is expected of a level, and its standard deviation; of pads, anything."""
        if key == _LATE:
            return 0.0, _FORCE_DELAY
        if key[0] == "muDC":
            return 0.0, np.inf
        middle = _RAIL["wet" if key[1] == "wet" else "dry"]["muWR"]
        return middle, _RAIL_SPREAD * middle

    def refine(
        self, point: Point, active: Sequence[Effect], rounds: int, spread: Vector | None = None
    ) -> Linearised:
        """Gauss-Newton over all unknowns, with channels weighed by what is wrong with them.

        Parameters
        ----------
        point : where to begin.
        rounds : most evaluations; a step that made things worse is halved, which costs one.
        spread : (m,) for the first step, if not that of the point: an effect that has only just
            been put beside levels fitted without it makes all channels wrong.

        Returns
        -------
        best : about the best point that was met.
        """
        best = self.linearise(point, active)
        point, halved = self._stepped(best, best.spread if spread is None else spread), 0
        for _ in range(rounds):
            tried = self.linearise(point, active)
            fall = best.deviance - tried.deviance
            if fall > -_WORSE:
                best, point, halved = tried, self._stepped(tried, tried.spread), 0
            else:
                point, halved = _between(best.point, point), halved + 1
            if abs(fall) < _WORSE or halved > _HALVED:
                break
        return best

    def _stepped(self, lin: Linearised, spread: Vector) -> Point:
        joint = self.quadratics(replace(lin, inflation=spread))
        return self._moved(lin.point, joint, joint.solve())

    def _moved(self, point: Point, joint: "Joint", step: Vector) -> Point:
        sizes, levels = dict(point.sizes), dict(point.levels)
        for key, change in zip(joint.shared, step, strict=True):
            if key in levels:
                middle, sigma = self._expected(key)
                reach = _FURTHEST_LEVEL * sigma
                levels[key] = float(np.clip(levels[key] + change, middle - reach, middle + reach))
            elif key in sizes:
                sizes[key] = self._bounded(key, sizes[key], sizes[key] + change)
        locals_ = [system.local(step) for system in joint.systems]
        count = len(TOLERANCES)
        deviations = point.deviations + np.array([one[:count] for one in locals_])
        deviations = np.clip(deviations, -_FURTHEST, _FURTHEST)
        phases = {}
        locked = [name for name, parameter in joint.shared if parameter == "amplitude"]
        for j, name in enumerate(locked):
            change = np.array([one[count + j] for one in locals_])
            phases[name] = point.phases[name] + np.clip(change, -0.5, 0.5)
        return Point(sizes, levels, deviations, phases)

    def _bounded(self, key: tuple[str, str], old: float, new: float) -> float:
        """Within the bounds of the Modelica class; a shape changes by half at most in a step."""
        effect = self._effects[key[0]]
        parameter = effect.size if key[1] == "amplitude" else key[1]
        low, high = self.bounds(effect, parameter)
        if parameter not in effect.sizes:
            low, high = max(low, 0.5 * old), min(high, 2.0 * old)
        return float(np.clip(new, low, high))


@dataclass(frozen=True, eq=False)
class StopSystem:
    """Whitened errors of one stop, r + J z + P l, with l ~ N(-prior, 1) where `prior` has entries.

    Attributes
    ----------
    r : (n,); J : (n, p); P : (n, q).
    deviations : (5,) of the present point, of the first unknowns in l; phases are free.
    """

    r: Vector
    J: Matrix
    P: Matrix
    deviations: Vector

    def _local(self) -> tuple[Matrix, Matrix, Vector]:
        """Normal matrix of l, its coupling to z, its gradient."""
        count, q = self.deviations.size, self.P.shape[1]
        prior = np.zeros(q)
        prior[:count] = 1.0
        normal = self.P.T @ self.P + np.diag(prior + 1e-9)
        gradient = self.P.T @ self.r
        gradient[:count] += self.deviations
        return normal, self.P.T @ self.J, gradient

    def eliminated(self) -> Quadratic:
        """Chi-squared over z alone."""
        normal, coupling, gradient = self._local()
        both = np.column_stack([coupling, gradient])
        solved: Matrix = np.asarray(np.linalg.solve(normal, both), np.float64)
        N: Matrix = self.J.T @ self.J - coupling.T @ solved[:, :-1]
        g: Vector = self.J.T @ self.r - coupling.T @ solved[:, -1]
        c = self.r @ self.r + self.deviations @ self.deviations - gradient @ solved[:, -1]
        return Quadratic(N, g, float(c), self.r.size)

    def local(self, z: Vector) -> Vector:
        """Best l for a step z of the common unknowns."""
        normal, coupling, gradient = self._local()
        step: Vector = np.asarray(np.linalg.solve(normal, -coupling @ z - gradient), np.float64)
        return step


@dataclass(frozen=True, eq=False)
class Joint:
    """All stops over the common unknowns.

    Attributes
    ----------
    shared : names of the unknowns.
    known : those that the point has; the others are candidates.
    levels : those that differ by nature, in no need of a cause.
    """

    shared: tuple[Key, ...]
    known: tuple[Key, ...]
    levels: tuple[Key, ...]
    systems: tuple[StopSystem, ...]
    prior: Quadratic

    def stops(self) -> list[Quadratic]:
        """Chi-squared of each stop."""
        return [system.eliminated() for system in self.systems]

    def total(self) -> Quadratic:
        """Chi-squared of all stops and the prior."""
        return add([*self.stops(), self.prior])

    def solve(self) -> Vector:
        """Best step of the common unknowns."""
        return minimum(self.total())


def seconds(errors: Matrix) -> Matrix:
    """Mean squares over seconds of whitened errors (b, m), times blocks, (s, m): noise leaves 1."""
    count = len(errors) // _SECOND * _SECOND
    means = errors[:count].reshape(-1, _SECOND, errors.shape[1]).mean(axis=1)
    squares: Matrix = _SECOND * means**2
    return squares


def slowness(evidence: Sequence[Evidence]) -> Vector:
    """Variance of errors that last a second over that of white noise, by channel, at least 1.

    What a model lacks leaves more than noise does, and then priors and tolerances must be weighed
    against that, not against the noise.
    """
    lasting = np.concatenate([seconds(one.errors) for one in evidence])
    slow: Vector = np.maximum(1.0, lasting.mean(axis=0))
    return slow


def _between(one: Point, other: Point) -> Point:
    """Half way; nothing that one of them lacks."""

    def half(a: Mapping[Any, Any], b: Mapping[Any, Any]) -> dict[Any, Any]:
        return {key: 0.5 * (value + b[key]) for key, value in a.items()}

    return Point(
        half(one.sizes, other.sizes),
        half(one.levels, other.levels),
        0.5 * (one.deviations + other.deviations),
        half(one.phases, other.phases),
    )


def _discs(case: Case) -> Surface:
    return "wet" if "wet" in case.conditions.discs else "dry"


def variant(effect: Effect, shape: Mapping[str, float]) -> str:
    """Name of a candidate with a shape, such as 'BeddingIn tau=1.4'."""
    return " ".join([effect.name, *(f"{name}={value:g}" for name, value in shape.items())])
