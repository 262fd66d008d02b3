"""Fit of effects to all stops at once, with what differs from stop to stop by nature.

In each stop, levels of friction, wheel load and inertias may differ from their common value within
the tolerances of the rig; these local deviations have priors, and are eliminated stop by stop. What
is left of a stop is a small quadratic form in the common unknowns, which sums and leaves-one-out
are made of.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from workbench.case import Case, Surface
from workbench.diagnosis.catalogue import Effect
from workbench.diagnosis.evidence import FORCE_DELAY, Column, Court, Item, Result
from workbench.diagnosis.extension import variables
from workbench.diagnosis.linearised import Linearised, Point, between, slowness
from workbench.diagnosis.quadratic import Joint, Key, Quadratic, StopSystem
from workbench.fmu import Vector

# Relative standard deviation from stop to stop, data sheet of the rig.
TOLERANCES = {"muDC": 0.02, "muWR": 0.02, "JW": 0.01, "JR": 0.002, "Fz": 0.003}

# Polach's parameters and friction at zero slip, data sheet of the rig.
_RAIL: Mapping[Surface, Mapping[str, float]] = {
    "dry": {"muWR": 0.40, "polach.kA": 1.0, "polach.kS": 0.4, "polach.A": 0.4, "polach.B": 0.6},
    "wet": {"muWR": 0.28, "polach.kA": 0.3, "polach.kS": 0.1, "polach.A": 0.4, "polach.B": 0.2},
}
_RAIL_SPREAD = 0.2  # relative, of the common level of muWR, which dry stops hardly show
_FORCE_DELAY = 1e-3  # [s] standard deviation: filters of the amplifier, uncertain damping
_WORSE = 1.0  # of deviance, which no step is worth
_HALVED = 4  # times: after that a step is given up
_FURTHEST = 5.0  # standard deviations that no tolerance goes beyond
_FURTHEST_LEVEL = 3.0  # the same of what differs by nature

_FILM, _SINGLE, _HYSTERESIS = "WaterFilm", "SingleDiscWaterFilm", "CaliperHysteresis"


_STOP = ""
_LATE: Key = (FORCE_DELAY, "load cell")
_DELAY: Key = (_STOP, FORCE_DELAY)


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
        self._soaked = any("wet" in case.conditions.discs for case in court.cases)
        self._released = any(stop.released for stop in court.stops)
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
        """Whether stop k can have an effect: water is where the conditions say, if they do."""
        return effect.name != _FILM or not self._soaked or self._wet(k) > 0.0

    def _wet(self, k: int) -> float:
        """Share of the discs that are wet, by the conditions of stop k."""
        discs = self._court.cases[k].conditions.discs
        return discs.count("wet") / len(discs)

    def unseen(self, effect: Effect) -> str:
        """Why these stops cannot show an effect; empty if they can."""
        if self._soaked and effect.name == _SINGLE:
            return "the conditions of the stops say which discs are wet"
        if effect.name == _HYSTERESIS and not self._released:
            return "brake pressure never falls in these stops"
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
        if self._soaked and _FILM in self._effects:
            for name in variables(self._effects[_FILM], "wet"):
                values[name] = self._wet(k)
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

    def at(self, point: Point) -> Linearised:
        """Gather errors at a point; of derivatives, only what costs no simulation."""
        evidence = self._court.at(self.values(point))
        away = float(np.square(point.deviations).sum()) + self._prior(point, list(point.levels)).c
        return Linearised(point, (_DELAY,), tuple(evidence), slowness(evidence), away)

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
                column = Column(variables(effect, parameter), effect.step, setting)
                columns[variant(effect, shape), parameter] = column
        missing = {key: column for key, column in columns.items() if key not in lin.keys}
        if not missing:
            return lin
        values = self.values(lin.point)
        return lin.extended(
            missing, self._court.derivatives(values, list(missing.values()), lin.evidence)
        )

    def _tolerances(self) -> dict[Key, Column]:
        """Columns of what differs from stop to stop."""
        return {
            (_STOP, name): Column((name,), 0.5 * tolerance * self._court.nominal[name])
            for name, tolerance in TOLERANCES.items()
        }

    def _present(self, point: Point, active: Sequence[Effect]) -> dict[Key, Column]:
        """Columns of the effects that a point has."""
        columns = {}
        for effect in active:
            for parameter in (*effect.sizes, *(name for name, _ in effect.shapes)):
                names = variables(effect, parameter)
                is_shape = parameter not in effect.sizes
                step = 0.05 * point.sizes[effect.name, parameter] if is_shape else effect.step
                high = self._court.bounds[names[0]][1]
                if not is_shape and point.sizes[effect.name, effect.label] + step > high:
                    step = -step
                columns[effect.name, parameter] = Column(names, step)
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

    def _system(self, lin: Linearised, k: int, shared: Sequence[Key]) -> StopSystem:
        point, case = lin.point, self._court.cases[k]
        evidence = lin.evidence[k]
        b, m = evidence.errors.shape
        weight = np.append(np.tile(1.0 / np.sqrt(lin.inflation), b), 1.0)
        at = {key: evidence.jacobian[:, j] * weight for j, key in enumerate(lin.keys)}
        J, P = np.zeros((b * m + 1, len(shared))), []
        for j, key in enumerate(shared):
            if key == _LATE:
                J[:, j] = at[_DELAY]
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
        self, best: Linearised, active: Sequence[Effect], rounds: int, spread: Vector | None = None
    ) -> Linearised:
        """Gauss-Newton over all unknowns, with channels weighed by what is wrong with them.

        Parameters
        ----------
        best : where to begin.
        rounds : most evaluations; a step that made things worse is halved, which costs one.
        spread : (m,) for the first step, if not that of the point: an effect that has only just
            been put beside levels fitted without it makes all channels wrong.

        Returns
        -------
        best : the best point that was met; derivatives may be missing.
        """
        best = self.linearise(best, active)
        point, halved = self._stepped(best, best.spread if spread is None else spread), 0
        for left in reversed(range(rounds)):
            tried = self.at(point)
            fall = best.deviance - tried.deviance
            if better := fall > -_WORSE:
                best, halved = tried, 0
            if left == 0 or abs(fall) < _WORSE or halved == _HALVED:
                break
            if better:
                best = self.linearise(best, active)
                point = self._stepped(best, best.spread)
            else:
                point, halved = between(best.point, point), halved + 1
        return best

    def _stepped(self, lin: Linearised, spread: Vector) -> Point:
        joint = self.quadratics(replace(lin, inflation=spread))
        return self._moved(lin.point, joint, joint.solve())

    def together(self, job: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
        """Results of a job that fits, by item."""
        return self._court.together(job, items)

    def _moved(self, point: Point, joint: Joint, step: Vector) -> Point:
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


def _discs(case: Case) -> Surface:
    return "wet" if "wet" in case.conditions.discs else "dry"


def variant(effect: Effect, shape: Mapping[str, float]) -> str:
    """Name of a candidate with a shape, such as 'BeddingIn tau=1.4'."""
    return " ".join([effect.name, *(f"{name}={value:g}" for name, value in shape.items())])
