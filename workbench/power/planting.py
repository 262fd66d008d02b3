"""What is planted, how much of it, and in which order: the plan of the Monte Carlo."""

import dataclasses
import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from workbench.diagnosis import Effect
from workbench.rig import CONSTANT_PADS, Effects, plant

Kind = Literal["clean", "single", "pair", "outside"]

_LEAST = {one.name: one.metadata["least"] for one in dataclasses.fields(Effects)}


@dataclass(frozen=True)
class Plantable:
    """An effect of the rig, and what the library calls it.

    Attributes
    ----------
    name : of the rig's effect.
    effect : of the library's; empty if the library has none.
    signed : whether it is planted in both directions.
    sensed : whether it changes readings only, so that one simulation serves all sizes.
    shapes : what the rig's law has for other parameters of the library's, SI.
    outside : unit of sizes of an effect that the library does not have, SI.
    """

    name: str
    effect: str = ""
    signed: bool = True
    sensed: bool = False
    shapes: Mapping[str, float] = field(default_factory=dict)
    outside: float = math.nan

    def size(self, effects: Sequence[Effect]) -> float:
        """Unit of all sizes, in the SI unit of the effect: the least that is worth a finding."""
        return next((one.matters for one in effects if one.name == self.effect), self.outside)


_FILM = {"E0": 0.45e6}

PLANTABLE = (
    Plantable("speed_friction", "SpeedDependentPadFriction"),
    Plantable("pressure_exponent", "PressureDependentPadFriction"),
    Plantable("fade", "BrakeFade"),
    Plantable("water_film", "WaterFilm", signed=False, shapes=_FILM),
    Plantable("single_disc_film", "SingleDiscWaterFilm", signed=False, shapes=_FILM),
    Plantable("bedding_in", "BeddingIn", shapes={"tau": 2.0}),
    Plantable("disc_thickness", "DiscThicknessVariation", signed=False),
    Plantable("cylinder_lag", "CylinderLag", signed=False),
    Plantable("caliper_hysteresis", "CaliperHysteresis", signed=False),
    Plantable("return_spring", "ReturnSpringPressure"),
    Plantable("pressure_offset", "PressureSensorOffset", sensed=True),
    Plantable("wheel_radius", "WheelRadius"),
    Plantable("roller_radius", "RollerRadius"),
    Plantable("out_of_round", "OutOfRoundWheel", signed=False),
    Plantable("wheel_load", "WheelLoad"),
    Plantable("creep_stiffness", "CreepStiffness"),
    Plantable("wheel_inertia", "WheelInertia"),
    Plantable("torque_gain", "DriveTorqueGain", sensed=True),
    Plantable("adhesion_recovery", "AdhesionRecovery", shapes={"Er": 250e3}),
    Plantable("wheelset_losses", "WheelsetLosses"),
    Plantable("roller_losses", "RollerLosses"),
    Plantable("fx_gain", "FxGain", sensed=True),
    Plantable("fx_offset", "FxOffset", sensed=True),
    Plantable("apex_offset", "ApexOffset", sensed=True),
    Plantable("speed_delay", "SpeedSignalDelay", sensed=True),
    Plantable("pole_ring", "PoleRingEccentricity", signed=False, sensed=True),
    Plantable("time_skew", "LoggerTimeSkew", sensed=True),
    # Sizes that disturb the balances about as much as those above.
    Plantable("friction_step", outside=0.01),
    Plantable("friction_ripple", outside=0.01),
    Plantable("drive_beat", sensed=True, outside=0.005),
    Plantable("force_drift", sensed=True, outside=2.0),
)
BY_NAME = {one.name: one for one in PLANTABLE}


@dataclass(frozen=True)
class Planting:
    """What one set of stops hides.

    Attributes
    ----------
    seed : of the rig, for tolerances, phases and noise.
    multiple : size over `Plantable.size`, 0 of a clean set.
    gains : by the rig's names, SI.
    """

    kind: Kind
    seed: int
    multiple: float
    gains: Mapping[str, float]

    @property
    def effects(self) -> Effects:
        """For the rig, on constant pads."""
        return plant(CONSTANT_PADS, [f"{name}={gain!r}" for name, gain in self.gains.items()])

    @property
    def options(self) -> str:
        """With these, `workbench rig --pads constant` makes the same recordings."""
        return " ".join(
            [f"--seed {self.seed}", *(f"--effect {n}={gain!r}" for n, gain in self.gains.items())]
        )


Group = tuple[Planting, ...]


def plan(
    effects: Sequence[Effect],
    clean: int,
    sizes: Sequence[float],
    repeats: int,
    pairs: int,
    seed: int,
) -> list[Group]:
    """Plan sets of stops; the sets of a group share their simulation.

    What a set is does not depend on how many others there are, so that a plan can be extended.

    Parameters
    ----------
    effects : of the library: how large they must be to matter, and which are hidden.
    clean : number of sets without an effect.
    sizes : multiples of the size that matters.
    repeats : sets of each effect at each size.
    pairs : sets with two effects, at the largest size.
    """
    largest_first = sorted(sizes, reverse=True)
    kinds: list[list[Group]] = [
        [(Planting("clean", _seed(seed, "clean", n), 0.0, {}),) for n in range(clean)],
        _each(effects, [one for one in PLANTABLE if one.effect], largest_first, repeats, seed),
        [(_pair(effects, _seed(seed, "pair", n), largest_first[0]),) for n in range(pairs)],
        _each(effects, [one for one in PLANTABLE if not one.effect], largest_first, repeats, seed),
    ]
    # All kinds advance alike, so that a run that is cut short has something of each.
    ranked = [((i + 0.5) / len(kind), group) for kind in kinds for i, group in enumerate(kind)]
    return [group for _, group in sorted(ranked, key=lambda one: one[0])]


def _each(
    effects: Sequence[Effect],
    plantables: Sequence[Plantable],
    sizes: Sequence[float],
    repeats: int,
    seed: int,
) -> list[Group]:
    groups: list[Group] = []
    for repeat in range(repeats):
        for one in plantables:
            if one.sensed:
                own = _seed(seed, one.name, repeat)
                groups.append(tuple(_single(effects, one, size, own) for size in sizes))
        for size in sizes:
            for one in plantables:
                if not one.sensed:
                    own = _seed(seed, f"{one.name} {size:g}", repeat)
                    groups.append((_single(effects, one, size, own),))
    return groups


def _single(effects: Sequence[Effect], one: Plantable, size: float, seed: int) -> Planting:
    gain = _gain(one, size * one.size(effects), np.random.default_rng(seed))
    return Planting("single" if one.effect else "outside", seed, size, {one.name: gain})


def _pair(effects: Sequence[Effect], seed: int, size: float) -> Planting:
    """Two effects, drawn from those that stops can show."""
    rng = np.random.default_rng(seed)
    seen = {effect.name for effect in effects if not effect.hidden}
    able = [one for one in PLANTABLE if one.effect in seen]
    both = [able[i] for i in rng.choice(len(able), 2, replace=False)]
    gains = {one.name: _gain(one, size * one.size(effects), rng) for one in both}
    return Planting("pair", seed, size, gains)


def _gain(one: Plantable, size: float, rng: np.random.Generator) -> float:
    gain = float(f"{size:.6g}")
    negative = one.signed and rng.random() < 0.5 and -gain >= _LEAST[one.name]
    return -gain if negative else gain


def _seed(seed: int, name: str, number: int) -> int:
    """Seed of a set, apart from those of all others."""
    entropy = np.random.SeedSequence([seed, zlib.crc32(name.encode()), number])
    return int(entropy.generate_state(1)[0])
