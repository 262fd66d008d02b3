"""Fit of effects to all recordings at once, with what differs between them by nature.

In each recording, parameters may differ from their common value within the tolerances of the
machine, and states may start elsewhere; these local deviations have priors, and are eliminated one
recording after the other. What is left of a recording is a small quadratic form in the common
unknowns, which sums and leaves-one-out are made of.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from workbench.case import Case
from workbench.diagnosis.catalogue import Effect, variant
from workbench.diagnosis.evidence import Item, Result, Simulations, Variation, delay
from workbench.diagnosis.extension import variables
from workbench.diagnosis.linearised import Linearised, Point, between, slowness
from workbench.diagnosis.presence import Presence
from workbench.diagnosis.quadratic import Joint, Key, Quadratic, RecordingSystem
from workbench.diagnosis.thresholds import Thresholds, thresholds
from workbench.fmu import Vector

_HALVED = 4  # times: after that a step is given up

_LOCAL = ""  # in place of an effect, of what differs between recordings
_SENSOR = "sensor"  # in place of a choice, of a sensor's delay
_LEVEL_STEP = 0.02  # relative, twice the step of a level that has no tolerance
_ALL = "all"  # in place of a choice, of a level that no condition changes


class Fit:
    """Unknowns, evidence and least squares of one set of recordings.

    Parameters
    ----------
    simulations : that give the evidence.
    effects : that may be asked for.
    decides : thresholds, those of the usual rate of false alarms if none are given.
    beside : other recordings of the machine, whose conditions say what it has too.
    """

    def __init__(
        self,
        simulations: Simulations,
        effects: Sequence[Effect],
        decides: Thresholds | None = None,
        beside: Sequence[Case] = (),
    ) -> None:
        self._simulations = simulations
        self._compare = simulations.system.comparison
        self.decides = decides or thresholds(len(effects), left=self._compare.left)
        self._effects = {effect.name: effect for effect in effects}
        self._modes = {
            delay(one.name): one.mode
            for one in simulations.system.judged + simulations.system.outputs
            if one.mode is not None and one.name in simulations.recordings[0].signals
        }
        self.presence = Presence(simulations.cases, simulations.recordings, beside)
        self.count = len(simulations.cases)

    @cached_property
    def local(self) -> dict[str, float]:
        """Standard deviation of what differs between recordings, by name.

        Relative of a parameter, in its unit of a state at the start.
        """
        spreads = self._simulations.system.spreads
        return {**self._compare.tolerances, **spreads}

    @property
    def delays(self) -> tuple[Key, ...]:
        """Keys of the derivatives that cost no simulation."""
        return tuple((_LOCAL, name) for name in self._modes)

    @property
    def lasting(self) -> int:
        """Blocks from which on an error is no noise."""
        return max(1, round(self._compare.lasting / self._compare.block))

    @property
    def names(self) -> list[str]:
        """Names of the recordings."""
        return [case.name for case in self._simulations.cases]

    def unit(self, effect: Effect, parameter: str) -> str:
        """Unit of a parameter, "1" if it has none."""
        return self._simulations.units.get(variables(effect, parameter)[0], "1")

    def level_unit(self, key: Key) -> str:
        """Unit of a level, or of a delay."""
        return "s" if key[1] == _SENSOR else self._simulations.units.get(key[0], "1")

    def bounds(self, effect: Effect, parameter: str) -> tuple[float, float]:
        """Least and greatest value of a parameter, SI."""
        low, high = self._simulations.bounds[variables(effect, parameter)[0]]
        # An amplitude has no sign: its phase has.
        return (0.0, high) if parameter == "cosine" else (low, high)

    def start(self) -> Point:
        """The nominal model."""
        levels: dict[Key, float] = {(name, _SENSOR): 0.0 for name in self._modes}
        for case in self._simulations.cases:
            for name in self._compare.levels:
                levels[name, self._choice(name, case)] = self._usual(name, case)
        return Point({}, levels, np.zeros((self.count, len(self.local))), {})

    def _choice(self, level: str, case: Case) -> str:
        """Which level of a parameter a recording has: of a list, the entry that is not usual."""
        by = self._compare.levels[level].by
        if not by:
            return _ALL
        said = case.conditions[by]
        entries = said if isinstance(said, tuple) else (said,)
        usual = self._simulations.system.condition(by).choices[0]
        return str(next((entry for entry in entries if entry != usual), usual))

    def _usual(self, name: str, case: Case) -> float:
        """What a parameter is by the conditions of a recording, or else nominally."""
        return self._set_by(case).get(name, self._simulations.nominal[name])

    def _set_by(self, case: Case) -> dict[str, float]:
        """Parameters that the conditions of a recording set."""
        found: dict[str, float] = {}
        for condition in self._simulations.system.conditions:
            found |= condition.parameters.get(str(case.conditions[condition.name]), {})
        return found

    def values(self, point: Point) -> list[dict[str, float]]:
        """Values of the FMU's variables, and of delays, in each recording."""
        return [self._values(point, k) for k in range(self.count)]

    def _values(self, point: Point, k: int) -> dict[str, float]:
        case = self._simulations.cases[k]
        values = {**self._simulations.given, **self._set_by(case)}
        values |= {name: point.levels[name, _SENSOR] for name in self._modes}
        values |= {
            name: point.levels[name, self._choice(name, case)] for name in self._compare.levels
        }
        for j, (name, spread) in enumerate(self.local.items()):
            values[name] = self._middle(point, name, k) + (
                self._spread(point, name, k, spread) * point.deviations[k, j]
            )
        for effect in self._effects.values():
            where = effect.where
            if where is not None and where.share and self.presence.told(where):
                values |= dict.fromkeys(
                    variables(effect, where.share), self.presence.share(where, k)
                )
        for (name, parameter), size in point.sizes.items():
            effect = self._effects[name]
            if parameter == "amplitude":
                phase = point.phases[name][k]
                parts = {"cosine": size * np.cos(phase), "sine": size * np.sin(phase)}
            elif parameter == effect.size:
                parts = {parameter: size if self.presence.at(effect, k) else 0.0}
            else:
                parts = {parameter: size}
            for part, value in parts.items():
                names = variables(effect, part)
                start = self._simulations.given.get(names[0], 0.0) if part in effect.sizes else 0.0
                values |= dict.fromkeys(names, start + float(value))
        return values

    def _middle(self, point: Point, name: str, k: int) -> float:
        """Value of what differs between recordings, without the deviation of this one."""
        case = self._simulations.cases[k]
        if name in self._compare.levels:
            return point.levels[name, self._choice(name, case)]
        if name in self._simulations.system.spreads:
            return self._simulations.begin[k].get(name, self._simulations.nominal.get(name, 0.0))
        return self._usual(name, case)

    def _spread(self, point: Point, name: str, k: int, spread: float) -> float:
        """Standard deviation of a local deviation, in the parameter's or state's unit."""
        absolute = name in self._simulations.system.spreads
        return spread if absolute else spread * self._middle(point, name, k)

    def at(self, point: Point) -> Linearised:
        """Gather errors at a point; of derivatives, only what costs no simulation."""
        evidence = self._simulations.at(self.values(point))
        away = float(np.square(point.deviations).sum()) + self._prior(point, list(point.levels)).c
        slow, excess = slowness(evidence, self.lasting), self.decides.excess
        return Linearised(point, self.delays, tuple(evidence), self.lasting, slow, away, excess)

    def linearise(
        self,
        lin: Linearised,
        active: Sequence[Effect],
        candidates: Sequence[tuple[Effect, Mapping[str, float]]] = (),
    ) -> Linearised:
        """Add the derivatives that are not there yet.

        Parameters
        ----------
        active : effects that the point has.
        candidates : others, each with the shape it is tried with.
        """
        columns = self._tolerances() | self._present(lin.point, active)
        for effect, shape in candidates:
            setting = {
                name: value
                for parameter, value in shape.items()
                for name in variables(effect, parameter)
            }
            for parameter in effect.sizes:
                column = Variation(variables(effect, parameter), effect.step, setting)
                columns[variant(effect, shape), parameter] = column
        missing = {key: column for key, column in columns.items() if key not in lin.keys}
        if not missing:
            return lin
        values = self.values(lin.point)
        return lin.extended(
            missing, self._simulations.derivatives(values, list(missing.values()), lin.evidence)
        )

    def _tolerances(self) -> dict[Key, Variation]:
        """Columns of what differs from stop to stop."""
        start = self.start()
        spreads = {**dict.fromkeys(self._compare.levels, _LEVEL_STEP), **self.local}
        return {
            (_LOCAL, name): Variation((name,), 0.5 * self._spread(start, name, 0, spread))
            for name, spread in spreads.items()
        }

    def _present(self, point: Point, active: Sequence[Effect]) -> dict[Key, Variation]:
        """Columns of the effects that a point has."""
        columns = {}
        for effect in active:
            for parameter in (*effect.sizes, *(name for name, _ in effect.shapes)):
                names = variables(effect, parameter)
                is_shape = parameter not in effect.sizes
                step = 0.05 * point.sizes[effect.name, parameter] if is_shape else effect.step
                high = self._simulations.bounds[names[0]][1]
                if not is_shape and point.sizes[effect.name, effect.label] + step > high:
                    step = -step
                columns[effect.name, parameter] = Variation(names, step)
        return columns

    def quadratics(self, lin: Linearised, extra: Sequence[Key] = ()) -> Joint:
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

    def _system(self, lin: Linearised, k: int, shared: Sequence[Key]) -> RecordingSystem:
        point, case = lin.point, self._simulations.cases[k]
        evidence = lin.evidence[k]
        b, m = evidence.errors.shape
        weight = np.append(np.tile(1.0 / np.sqrt(lin.inflation), b), 1.0)
        at = {key: evidence.jacobian[:, j] * weight for j, key in enumerate(lin.keys)}
        J, P = np.zeros((b * m + 1, len(shared))), []
        for j, key in enumerate(shared):
            if key in point.levels and key[1] == _SENSOR:
                J[:, j] = at[_LOCAL, key[0]]
            elif key in point.levels:
                if key[1] == self._choice(key[0], case):
                    J[:, j] = at[_LOCAL, key[0]] * self._shared(point, key[0], k)
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
                J[:, j] = at[key] * float(self.presence.at(effect, k))
        tolerances = [
            at[_LOCAL, name] * self._spread(point, name, k, spread)
            for name, spread in self.local.items()
        ]
        free = np.zeros((b * m + 1, 0))
        local = np.column_stack([free, *tolerances, *P])
        return RecordingSystem(evidence.residual * weight, J, local, point.deviations[k])

    def _prior(self, point: Point, shared: Sequence[Key]) -> Quadratic:
        """What is known of the common unknowns beforehand."""
        N, g, c = np.zeros((len(shared),) * 2), np.zeros(len(shared)), 0.0
        for j, key in enumerate(shared):
            if key not in point.levels:
                continue
            middle, sigma = self._expected(key)
            if np.isfinite(sigma):
                away = (point.levels[key] - middle) / sigma
                N[j, j], g[j], c = 1.0 / sigma**2, away / sigma, c + away**2
        return Quadratic(N, g, c, 0)

    def _shared(self, point: Point, name: str, k: int) -> float:
        """By how much a recording's own value moves with the common level."""
        if name not in self._compare.tolerances:
            return 1.0
        deviation = point.deviations[k, list(self.local).index(name)]
        return float(1.0 + self._compare.tolerances[name] * deviation)

    def _expected(self, key: Key) -> tuple[float, float]:
        """What is expected of a level, and its standard deviation, infinite for anything."""
        name, choice = key
        if choice == _SENSOR:
            return 0.0, self._modes[name].late
        spread = self._compare.levels[name].spread
        if not np.isfinite(spread):
            return 0.0, np.inf
        case = next(c for c in self._simulations.cases if self._choice(name, c) == choice)
        middle = self._usual(name, case)
        return middle, spread * abs(middle)

    def refine(
        self,
        best: Linearised,
        active: Sequence[Effect],
        rounds: int,
        spread: Vector | None = None,
        *,
        common: bool = True,
    ) -> Linearised:
        """Gauss-Newton over all unknowns, with channels weighed by what is wrong with them.

        Parameters
        ----------
        best : where to begin.
        rounds : most evaluations; a step that made things worse is halved, which costs one.
        spread : (m,) for the first step, if not that of the point: an effect that has only just
            been put beside levels fitted without it makes all channels wrong.
        common : whether common unknowns are fitted, or only what differs between recordings.

        Returns
        -------
        best : the best point that was met; derivatives may be missing.
        """
        best = self.linearise(best, active)
        first = best.spread if spread is None else spread
        point, halved = self._stepped(best, first, common=common), 0
        worse = self.decides.worse
        for left in reversed(range(rounds)):
            tried = self.at(point)
            fall = best.deviance - tried.deviance
            if better := fall > -worse:
                best, halved = tried, 0
            if left == 0 or abs(fall) < worse or halved == _HALVED:
                break
            if better:
                best = self.linearise(best, active)
                point = self._stepped(best, best.spread, common=common)
            else:
                point, halved = between(best.point, point), halved + 1
        return best

    def _stepped(self, lin: Linearised, spread: Vector, *, common: bool) -> Point:
        joint = self.quadratics(replace(lin, inflation=spread))
        step = joint.solve() if common else np.zeros(len(joint.shared))
        return self._moved(lin.point, joint, step)

    def together(self, job: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
        """Results of a job that fits, by item."""
        return self._simulations.together(job, items)

    def _moved(self, point: Point, joint: Joint, step: Vector) -> Point:
        sizes, levels = dict(point.sizes), dict(point.levels)
        for key, change in zip(joint.shared, step, strict=True):
            if key in levels:
                middle, sigma = self._expected(key)
                reach = self.decides.furthest_level * sigma
                low, high = self._simulations.bounds.get(key[0], (-np.inf, np.inf))
                least, most = max(low, middle - reach), min(high, middle + reach)
                levels[key] = float(np.clip(levels[key] + change, least, most))
            elif key in sizes:
                sizes[key] = self._bounded(key, sizes[key], sizes[key] + change)
        locals_ = [system.local(step) for system in joint.systems]
        count = len(self.local)
        deviations = point.deviations + np.array([one[:count] for one in locals_])
        furthest = self.decides.furthest
        deviations = np.clip(deviations, -furthest, furthest)
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
