"""Experiments that may be run next: conditions, and profiles of the inputs."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from workbench.arrays import Vector
from workbench.system.experiments import (
    RELEASE,
    SINE,
    STAIRCASE,
    STEP,
    Experiments,
    Setting,
    VariedInput,
)
from workbench.system.system import System
from workbench.system.units import si_factor

_STAIRS = 3  # from the least to the largest demand
_GRID = 48  # settings, which two cores predict in a quarter of a minute


@dataclass(frozen=True)
class Profile:
    """Demand on an input."""

    input: VariedInput
    shape: str
    # of a step or staircase, one after the other and again; of a sine its ends; of what is
    # released, before it is [unit]
    levels: tuple[float, ...]
    # [s] that a stair lasts, and the period of a sine; after it, a demand is released
    period: float

    def demand(self, time: Vector) -> Vector:
        """Demand at each time, (n,) [unit]."""
        begun = time - self.input.begins
        if self.shape == SINE:
            low, high = self.levels
            wave = np.sin(2.0 * np.pi * begun / self.period)
            return np.where(begun >= 0.0, 0.5 * (low + high) + 0.5 * (high - low) * wave, 0.0)
        if self.shape == RELEASE:
            return np.where((begun >= 0.0) & (begun < self.period), self.levels[0], 0.0)
        stair = np.floor(np.maximum(begun, 0.0) / self.period).astype(int) % len(self.levels)
        return np.where(begun >= 0.0, np.array(self.levels)[stair], 0.0)

    def signal(self, time: Vector) -> Vector:
        """Input at each time, (n,) [unit]: the demand behind its lags."""
        from scipy.signal import lfilter  # takes its time, and little else needs it

        values, h = self.demand(time), float(time[1] - time[0])
        for lag in self.input.lags:
            pole = np.exp(-h / lag)
            values = lfilter([1.0 - pole], [1.0, -pole], values)
        return values

    def text(self, system: System) -> str:
        """For people, in the unit of figures."""
        signal = system.signals[self.input.name]
        factor = si_factor(signal.shown, signal.unit, signal.name)
        unit = "" if signal.shown == "1" else f" {signal.shown}"
        shown = [f"{level / factor:.3g}" for level in self.levels]
        if self.shape == SINE:
            return f"{signal.name} sine {shown[0]} to {shown[1]}{unit}, period {self.period:g} s"
        if self.shape == STEP:
            return f"{signal.name} step to {shown[0]}{unit}"
        if self.shape == RELEASE:
            return f"{signal.name} step to {shown[0]}{unit}, released after {self.period:g} s"
        return f"{signal.name} staircase {', '.join(shown)}{unit}, {self.period:g} s each"


@dataclass(frozen=True)
class Experiment:
    """One recording that could be made."""

    settings: Mapping[str, Setting]  # of conditions and of what is set besides, by name
    profiles: tuple[Profile, ...]  # of the inputs that are varied

    @property
    def numbers(self) -> dict[str, float]:
        """Settings that are numbers, SI."""
        values = {name: setting.value for name, setting in self.settings.items()}
        return {name: v for name, v in values.items() if isinstance(v, int | float)}

    def text(self, system: System) -> str:
        """For people."""
        assert system.experiments is not None
        besides = system.experiments.labels
        settings = [
            f"{besides[name] if name in besides else system.condition(name).label} {setting.text}"
            for name, setting in self.settings.items()
        ]
        return "; ".join([*settings, *(profile.text(system) for profile in self.profiles)])


def all_settings(experiments: Experiments) -> list[Experiment]:
    """Every setting, each with the profiles that sweep most of their ranges."""
    followed = tuple(_profiles(varied)[0] for varied in experiments.varied)
    names = list(experiments.settings)
    return [
        Experiment(dict(zip(names, settings, strict=True)), followed)
        for settings in product(*experiments.settings.values())
    ]


def settings_fraction(experiments: Experiments) -> list[Experiment]:
    """Every setting, or a fraction of a grid that is large.

    The fraction is regular, each value being in it as often as any other: of settings whose values
    are numbered, those whose numbers add up to a multiple (G. E. P. Box, J. S. Hunter, 1961,
    Technometrics 3, 311-351). `other_settings` has what is next to them.
    """
    plan = all_settings(experiments)
    parts = -(-len(plan) // _GRID)
    numbers = product(*(range(len(values)) for values in experiments.settings.values()))
    return [
        experiment for experiment, at in zip(plan, numbers, strict=True) if sum(at) % parts == 0
    ]


def other_settings(experiments: Experiments, experiment: Experiment) -> list[Experiment]:
    """All that differ from an experiment in one setting."""
    return [
        replace(experiment, settings={**experiment.settings, name: value})
        for name, values in experiments.settings.items()
        for value in values
        if value != experiment.settings[name]
    ]


def other_profiles(experiments: Experiments, experiment: Experiment) -> list[Experiment]:
    """All other profiles, with the settings of an experiment."""
    return [
        replace(experiment, profiles=profiles)
        for profiles in product(*map(_profiles, experiments.varied))
        if profiles != experiment.profiles
    ]


def draw_experiment(experiments: Experiments, rng: np.random.Generator) -> Experiment:
    """An experiment drawn at random: each of all that may be run is as likely."""
    settings = {
        name: values[rng.integers(len(values))] for name, values in experiments.settings.items()
    }
    choices = [_profiles(varied) for varied in experiments.varied]
    return Experiment(settings, tuple(options[rng.integers(len(options))] for options in choices))


def _profiles(varied_input: VariedInput) -> list[Profile]:
    """Stairs begun at either end; sines; steps to the ends of the range and between them.

    What is released was so from the upper end, and between them.
    """
    low, high = varied_input.low, varied_input.high
    rising = np.linspace(low, high, _STAIRS + 1).tolist()
    stairs = (*rising, *rising[-2:0:-1])
    falling = (*stairs[_STAIRS:], *stairs[:_STAIRS])
    middle, period = 0.5 * (low + high), varied_input.every
    profiles = [
        *((STAIRCASE, levels, period) for levels in (stairs, falling)),
        *((SINE, (low, high), times * period) for times in (1.0, 2.0)),
        *((STEP, (to,), period) for to in (low, middle, high)),
        *((RELEASE, (to,), period) for to in (middle, high)),
    ]
    return [
        Profile(varied_input, shape, levels, duration)
        for shape, levels, duration in profiles
        if shape in varied_input.profiles
    ]
