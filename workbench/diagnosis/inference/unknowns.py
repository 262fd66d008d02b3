"""Unknowns of a fit: sizes of effects, levels, and what differs between recordings by nature.

In each recording, parameters may differ from their common value within the tolerances of the
machine, and states may start elsewhere.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from workbench.diagnosis.data.cleaning import ALONG
from workbench.diagnosis.data.samples import Samples
from workbench.diagnosis.data.sensors import step_of
from workbench.diagnosis.effects.candidates import own_bounds
from workbench.diagnosis.effects.catalogue import Effect, Unless, Where
from workbench.diagnosis.effects.extension import variables
from workbench.diagnosis.inference.linearized import Point
from workbench.diagnosis.inference.quadratic import Key
from workbench.diagnosis.inference.thresholds import SOUND
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.diagnosis.simulation.simulator import delay
from workbench.errors import InputError
from workbench.recordings.case import Case, Value
from workbench.system.system import System

# --- where effects can be ---


class Presence:
    """Of effects, in one set of recordings.

    Parameters
    ----------
    recordings : the cases, made ready.
    beside : others of the same machine.
    """

    def __init__(
        self, cases: Sequence[Case], recordings: Sequence[Samples], beside: Sequence[Case]
    ) -> None:
        self._cases = [*cases, *beside]
        self._recordings = recordings

    def at(self, effect: Effect, k: int) -> bool:
        """Whether recording k can have an effect: where the conditions say, if those of any do."""
        where = effect.where
        return where is None or not self.is_stated(where) or self.share(where, k) > 0.0

    def share(self, rule: Where | Unless, k: int) -> float:
        """Share of what a condition of recording k says that is one state."""
        states = self._cases[k].conditions.get(rule.condition)
        if states is None:
            raise InputError(
                where=f"conditions of {self._cases[k].name}",
                found=f"no '{rule.condition}', which an effect of the library asks for",
                expected="a condition that recordings have",
                remedy="correct the annotation of the effect",
            )
        entries = states if isinstance(states, tuple) else (states,)
        return entries.count(rule.state) / len(entries)

    def is_stated(self, rule: Where | Unless) -> bool:
        """Whether the conditions of any recording say so."""
        return any(self.share(rule, k) > 0.0 for k in range(len(self._cases)))

    def unseen(self, effect: Effect) -> str:
        """Why these recordings cannot show an effect; empty if they can."""
        unless, falling = effect.unless, effect.falling
        if unless is not None and self.is_stated(unless):
            return unless.because
        if falling is not None and not any(
            recording.falls(falling.signal) for recording in self._recordings
        ):
            return falling.because
        if effect.restarted and not any(
            recording.restarted.any() for recording in self._recordings
        ):
            return effect.restarted
        return effect.hidden


SENSOR = "sensor"  # in place of a choice, of a sensor's delay
ALL = "all"  # in place of a choice, of a level that no condition changes


class Unknowns:
    """Of one set of recordings.

    Parameters
    ----------
    simulations : of the recordings.
    effects : that may be asked for.
    beside : other recordings of the machine, whose conditions say what it has too.
    """

    def __init__(
        self, simulations: ResidualModel, effects: Sequence[Effect], beside: Sequence[Case]
    ) -> None:
        self._simulations = simulations
        self._compare = simulations.system.comparison
        self.effects = {effect.name: effect for effect in effects}  # by name
        # bounds in place of those of the model, by effect and parameter
        self.opened: dict[Key, tuple[float, float]] = {}
        # of structures before sensors, by the name of their delay
        self.modes = {
            delay(signal.name): signal.mode
            for signal in simulations.system.reference_signals + simulations.system.outputs
            if signal.mode is not None and signal.name in simulations.recordings[0].signals
        }
        self.presence = Presence(simulations.cases, simulations.recordings, beside)  # of effects
        self.count = len(simulations.cases)

    @property
    def names(self) -> list[str]:
        """Names of the recordings."""
        return [case.name for case in self._simulations.cases]

    @cached_property
    def local(self) -> dict[str, float]:
        """Standard deviation of what differs between recordings, by name.

        Relative of a parameter, in its unit of a state at the start.
        """
        return {**self._compare.tolerances, **self.starting}

    @cached_property
    def starting(self) -> dict[str, float]:
        """Standard deviation of states at the start, in their units.

        What an output shows is as sure as the line that its first value is read from; a simulation
        does not forget that unless it is led.
        """
        system, begin = self._simulations.system, self._simulations.begin[0]
        led = self._compare.leading is not None and not self._simulations.free
        # What rolls along a measured state may have no sensor of its own.
        seen = [] if led else [name for name in begin if name in system.signals]
        shown = {name: ALONG * self._deviation(name) for name in seen}
        return {**shown, **self.stated_starts}

    @property
    def stated_starts(self) -> dict[str, float]:
        """Standard deviation of states at the start that the system or the model states."""
        spreads = self._simulations.system.spreads
        return {name: spread for name, spread in spreads.items() if spread > 0.0}

    def _deviation(self, signal: str) -> float:
        """Standard deviation of a first reading: that of rounding if it goes in coarser steps.

        Where a recording begins at the end of what a sensor reads, it begins anywhere beyond.
        """
        recordings, own = self._simulations.recordings, self._simulations.system.signals[signal]
        read = [r.read[:, r.signals.index(signal)] for r in recordings if signal in r.signals]
        if not read or self._simulations.system.library.is_file():
            return own.noise_at_scale
        every = np.concatenate(read)
        for end in (every.min(), every.max()):
            if any(values[0] == end for values in read) and (every == end).sum() > 2 * SOUND.stuck:
                return own.scale
        return max(own.noise_at_scale, step_of(every) / float(np.sqrt(12.0)))

    def level_unit(self, key: Key) -> str:
        """Unit of a level, or of a delay."""
        return "s" if key[1] == SENSOR else self._simulations.units.get(key[0], "1")

    def unit(self, effect: Effect, parameter: str) -> str:
        """Unit of a parameter, "1" if it has none; "" of an FMU's own that says none."""
        none = "" if effect.parameter else "1"
        return self._simulations.units.get(variables(effect, parameter)[0], none)

    def bounds(self, effect: Effect, parameter: str) -> tuple[float, float]:
        """Least and greatest value of a parameter, SI."""
        variable = variables(effect, parameter)[0]
        declared = self._simulations.bounds[variable]
        if effect.parameter in self.starting:
            middle = self._simulations.nominal.get(variable, 0.0)
            declared = declared[0] - middle, declared[1] - middle
        elif effect.parameter and parameter in effect.sizes:
            declared = own_bounds(self._simulations.nominal[variable], declared)
        low, high = self.opened.get((effect.name, parameter), declared)
        # An amplitude has no sign: its phase has.
        return (0.0, high) if parameter == "cosine" else (low, high)

    def nominal(self, effect: Effect, size: str) -> float:
        """Size of an effect in the model that is diagnosed, SI; zero of what it lacks."""
        name = variables(effect, size)[0]
        usual = self._simulations.nominal[name] if effect.parameter else 0.0
        return float(self._simulations.given.get(name, usual))

    def start(self) -> Point:
        """The nominal model."""
        levels: dict[Key, float] = {(name, SENSOR): 0.0 for name in self.modes}
        for case in self._simulations.cases:
            for name in self._compare.levels:
                levels[name, self.choice(name, case)] = self._usual(name, case)
        return Point({}, levels, np.zeros((self.count, len(self.local))), {})

    def choice(self, level: str, case: Case) -> str:
        """Which level of a parameter a recording has."""
        return choice_of(self._simulations.system, level, case.conditions)

    def _usual(self, name: str, case: Case) -> float:
        """What a parameter is by the conditions of a recording, or else nominally."""
        return self._simulations.system.set_by(case.conditions).get(
            name, self._simulations.nominal[name]
        )

    def values(self, point: Point) -> list[dict[str, float]]:
        """Values of the FMU's variables, and of delays, in each recording."""
        return [self._values(point, k) for k in range(self.count)]

    def starts(self, point: Point) -> dict[str, dict[str, float]]:
        """All that a simulation of each recording starts with: states as they were, and `values`.

        They are what sensors measured, unless an effect at this point says that one read wrong.
        """
        return dict(zip(self.names, self._simulations.started(self.values(point)), strict=True))

    def _values(self, point: Point, k: int) -> dict[str, float]:
        case = self._simulations.cases[k]
        values = {**self._simulations.given, **self._simulations.system.set_by(case.conditions)}
        values |= {name: point.levels[name, SENSOR] for name in self.modes}
        values |= {
            name: point.levels[name, self.choice(name, case)] for name in self._compare.levels
        }
        for j, (name, spread) in enumerate(self.local.items()):
            values[name] = self._middle(point, name, k) + (
                self.spread(point, name, k, spread) * point.deviations[k, j]
            )
        for effect in self.effects.values():
            where = effect.where
            if where is not None and where.share and self.presence.is_stated(where):
                values |= dict.fromkeys(
                    variables(effect, where.share), self.presence.share(where, k)
                )
        for (name, parameter), size in point.sizes.items():
            effect = self.effects[name]
            if parameter == "amplitude":
                phase = point.phases[name][k]
                parts = {"cosine": size * np.cos(phase), "sine": size * np.sin(phase)}
            elif parameter == effect.size:
                parts = {parameter: size if self.presence.at(effect, k) else 0.0}
            else:
                parts = {parameter: size}
            for part, value in parts.items():
                names = variables(effect, part)
                start = 0.0
                if names[0] in self.starting:
                    start = values[names[0]]
                elif part in effect.sizes:
                    start = self.nominal(effect, part)
                values |= dict.fromkeys(names, start + float(value))
        return values

    def _middle(self, point: Point, name: str, k: int) -> float:
        """Value of what differs between recordings, without the deviation of this one."""
        case = self._simulations.cases[k]
        if name in self._compare.levels:
            return point.levels[name, self.choice(name, case)]
        if name in self.starting:
            return self._simulations.begin[k].get(name, self._simulations.nominal.get(name, 0.0))
        return self._usual(name, case)

    def spread(self, point: Point, name: str, k: int, spread: float) -> float:
        """Standard deviation of a local deviation, in the parameter's or state's unit."""
        return spread if name in self.starting else spread * self._middle(point, name, k)

    def shared(self, point: Point, name: str, k: int) -> float:
        """By how much a recording's own value moves with the common level."""
        if name not in self._compare.tolerances:
            return 1.0
        deviation = point.deviations[k, list(self.local).index(name)]
        return float(1.0 + self._compare.tolerances[name] * deviation)

    @property
    def false_alarms(self) -> float:
        """Rate of false alarms that the system allows."""
        return self._compare.false_alarms

    def sheet(self, key: Key) -> tuple[float, float]:
        """What conditions or the model say of a level, and its standard deviation, SI.

        That of the level itself, or else from recording to recording; infinite where neither is
        declared.
        """
        name, choice = key
        case = next(c for c in self._simulations.cases if self.choice(name, c) == choice)
        level, usual = self._compare.levels[name], self._usual(name, case)
        if np.isfinite(level.deviation):
            return usual, level.deviation
        share = level.spread
        if not np.isfinite(share):
            share = self._compare.tolerances.get(name, np.inf)
        return usual, share * abs(usual)

    def expected(self, key: Key) -> tuple[float, float]:
        """What is expected of a level, and its standard deviation, infinite for anything."""
        name, choice = key
        if choice == SENSOR:
            return 0.0, self.modes[name].late
        if self._compare.levels[name].free:
            return 0.0, np.inf
        return self.sheet(key)


def choice_of(system: System, level: str, conditions: Mapping[str, Value]) -> str:
    """Which level of a parameter conditions have: of a list, by the entry that is not usual."""
    by = system.comparison.levels[level].by
    if not by:
        return ALL
    states = conditions[by]
    entries = states if isinstance(states, tuple) else (states,)
    usual = system.condition(by).choices[0]
    return str(next((entry for entry in entries if entry != usual), usual))
