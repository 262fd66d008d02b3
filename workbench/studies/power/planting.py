"""Which effects are injected, how large, and in which order: the plan of the Monte Carlo."""

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from workbench.diagnosis import Diagnosis, Effect
from workbench.diagnosis.inference.score_test import CandidateScore
from workbench.errors import InputError, require_known

_ALIKE = 0.2  # of a shape, within which it is the same: readings of each set have own noise

Kind = Literal["clean", "single", "pair", "outside", "sheet"]


@dataclass(frozen=True)
class Plantable:
    """An effect of the virtual rig, and what the library calls it."""

    name: str  # of the rig's effect
    unit: str  # of its gain, SI
    effect: str = ""  # of the library's; empty if the library has none
    # least, most: gains that make sense [unit]
    least: float = -math.inf
    most: float = math.inf
    signed: bool = True  # whether it is planted in both directions
    # whether it changes readings only, so that one simulation serves all sizes
    sensed: bool = False
    # what the rig's law has for other parameters of the library's, SI
    shapes: Mapping[str, float] = field(default_factory=dict)
    # unit of sizes [unit]; nan: what matters to the library, which has the effect
    unit_size: float = math.nan
    slot: str = ""  # of the base model where it acts, if the library lacks it

    def score_of(self, diagnosis: Diagnosis) -> CandidateScore | None:
        """Score of this effect about the nominal model, in its shape; None where there is none.

        Limits of sensors are tried where the readings of a set lie: the nearest is taken.
        """
        shape = dict(self.shapes)

        def apart(score: CandidateScore) -> float:
            ratios = [value / shape[name] for name, value in score.shape.items()]
            return max((abs(ratio - 1.0) for ratio in ratios), default=0.0)

        own = [s for s in diagnosis.scores if s.effect.name == self.effect]
        alike = [s for s in own if s.shape.keys() == shape.keys() and apart(s) <= _ALIKE]
        return min(alike, key=apart, default=None)


def assigned(assignments: Sequence[str], known: Mapping[str, Plantable]) -> dict[str, float]:
    """Sizes by name, of texts NAME=VALUE [SI]."""
    gains: dict[str, float] = {}
    for assignment in assignments:
        name, _, text = assignment.partition("=")
        where = f"--effect {assignment}"
        require_known([name], known, where=where, found="unknown effect '{}'")
        if name in gains:
            raise InputError(
                where=where,
                found=f"a second size for '{name}'",
                expected="one size for each effect",
                remedy="give it once",
            )
        try:
            gains[name] = float(text)
        except ValueError:
            gains[name] = math.nan
        if not (math.isfinite(gains[name]) and gains[name] >= known[name].least):
            raise InputError(
                where=where,
                found=repr(text),
                expected=f"a number in [{known[name].unit}]"
                + f", {known[name].least:g} or more" * math.isfinite(known[name].least),
                remedy=f"write for instance --effect {name}={known[name].unit_size:g}",
            )
    return gains


@dataclass(frozen=True)
class SheetError:
    """A way in which the machine differs from its data sheet, which the diagnosis is given."""

    # name, gain: of the rig's effect, and its size, SI
    name: str
    gain: float
    effect: str = ""  # of the library's which is this error; empty if the library has none


@dataclass(frozen=True)
class Scale:
    """In what sizes are measured."""

    unit: str = "the least size that is worth a finding"  # in words
    # size from which on a finding is expected [unit]
    visible: float = 2.0  # beyond what tolerances may hide
    # by size [unit], the chance that an oracle finds it; empty where nobody asked one
    chances: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Repertoire:
    """What can be planted, and what can be found."""

    plantables: tuple[Plantable, ...]  # of the virtual rig
    effects: tuple[Effect, ...]  # of the library
    scale: Scale = Scale()  # of all sizes

    def plantable(self, name: str) -> Plantable:
        """By the rig's name."""
        return next(plantable for plantable in self.plantables if plantable.name == name)

    def size(self, plantable: Plantable) -> float:
        """Unit of all sizes, in the unit of the effect: the rig's, or the least worth a finding."""
        if not math.isnan(plantable.unit_size):
            return plantable.unit_size
        return next((e.matters for e in self.effects if e.name == plantable.effect), math.nan)

    def label(self, effect: str) -> str:
        """Name of the size of an effect of the library in results."""
        return next(known.label for known in self.effects if known.name == effect)

    @property
    def hidden(self) -> frozenset[str]:
        """Effects of the library that recordings cannot show."""
        return frozenset(effect.name for effect in self.effects if effect.hidden)

    @property
    def able(self) -> tuple[Plantable, ...]:
        """What can be planted of the library's, and be shown by recordings."""
        known = (plantable for plantable in self.plantables if plantable.effect)
        return tuple(plantable for plantable in known if plantable.effect not in self.hidden)


@dataclass(frozen=True)
class Planting:
    """What one set of recordings hides."""

    kind: Kind
    seed: int  # of the rig, for all that it draws
    multiple: float  # size over that which matters, 0 of a clean set
    gains: Mapping[str, float]  # by the rig's names, SI
    # the library's names of these, empty for one that the library does not have
    effects: tuple[str, ...]

    @property
    def options(self) -> str:
        """Options of the rig's command, with which it makes the same recordings."""
        return " ".join(
            [f"--seed {self.seed}", *(f"--effect {n}={gain!r}" for n, gain in self.gains.items())]
        )


Group = tuple[Planting, ...]


def plan(
    repertoire: Repertoire,
    clean: int,
    sizes: Sequence[float],
    repeats: int,
    pairs: int,
    seed: int,
) -> list[Group]:
    """Plan sets of recordings; the sets of a group share their simulation.

    What a set is does not depend on how many others there are, so that a plan can be extended.

    Parameters
    ----------
    clean : number of sets without an effect.
    sizes : multiples of the size that matters.
    repeats : sets of each effect at each size.
    pairs : sets with two effects, at the largest size; none where there are no two.
    """
    largest_first = sorted(sizes, reverse=True)
    known = [plantable for plantable in repertoire.plantables if plantable.effect]
    pairs = pairs if len(repertoire.able) > 1 else 0
    unknown = [plantable for plantable in repertoire.plantables if not plantable.effect]
    kinds: list[list[Group]] = [
        [(Planting("clean", _seed(seed, "clean", n), 0.0, {}, ()),) for n in range(clean)],
        _singles(repertoire, known, largest_first, repeats, seed),
        [(_pair(repertoire, _seed(seed, "pair", n), largest_first[0]),) for n in range(pairs)],
        _singles(repertoire, unknown, largest_first, repeats, seed),
    ]
    # All kinds advance alike, so that a run that is cut short has something of each.
    ranked = [((i + 0.5) / len(sets), group) for sets in kinds for i, group in enumerate(sets)]
    return [group for _, group in sorted(ranked, key=lambda entry: entry[0])]


def plan_sheet_errors(errors: Sequence[SheetError], repeats: int, seed: int) -> list[Group]:
    """Plan sets of a rig that differs from its data sheet, each error alone, in so many sets."""
    groups: list[Group] = []
    for n in range(repeats):
        for error in errors:
            own = _seed(seed, f"{error.name} {error.gain:g}", n)
            groups.append((Planting("sheet", own, 1.0, {error.name: error.gain}, (error.effect,)),))
    return groups


def draw_sets(groups: Sequence[Group], count: int, seed: int) -> list[Planting]:
    """Draw sets of a plan, of all kinds alike."""
    order = np.random.default_rng(seed).permutation(len(groups))
    kinds: dict[Kind, list[Planting]] = {}
    for i in order:
        kinds.setdefault(groups[i][0].kind, []).append(groups[i][0])
    ranked = [(i, planting) for sets in kinds.values() for i, planting in enumerate(sets)]
    return [planting for _, planting in sorted(ranked, key=lambda entry: entry[0])[:count]]


def _singles(
    repertoire: Repertoire,
    plantables: Sequence[Plantable],
    sizes: Sequence[float],
    repeats: int,
    seed: int,
) -> list[Group]:
    groups: list[Group] = []
    for repeat in range(repeats):
        for plantable in plantables:
            if plantable.sensed:
                own = _seed(seed, plantable.name, repeat)
                groups.append(tuple(_single(repertoire, plantable, size, own) for size in sizes))
        for size in sizes:
            for plantable in plantables:
                if not plantable.sensed:
                    own = _seed(seed, f"{plantable.name} {size:g}", repeat)
                    groups.append((_single(repertoire, plantable, size, own),))
    return groups


def _single(repertoire: Repertoire, plantable: Plantable, multiple: float, seed: int) -> Planting:
    gain = _gain(plantable, multiple * repertoire.size(plantable), np.random.default_rng(seed))
    kind: Kind = "single" if plantable.effect else "outside"
    return Planting(kind, seed, multiple, {plantable.name: gain}, (plantable.effect,))


def _pair(repertoire: Repertoire, seed: int, multiple: float) -> Planting:
    rng = np.random.default_rng(seed)
    able = repertoire.able
    both = [able[i] for i in rng.choice(len(able), 2, replace=False)]
    gains = {
        plantable.name: _gain(plantable, multiple * repertoire.size(plantable), rng)
        for plantable in both
    }
    return Planting("pair", seed, multiple, gains, tuple(plantable.effect for plantable in both))


def _gain(plantable: Plantable, size: float, rng: np.random.Generator) -> float:
    gain = float(f"{size:.6g}")
    downwards = plantable.signed and (rng.random() < 0.5 or gain > plantable.most)
    negative = downwards and -gain >= plantable.least
    return -gain if negative else gain


def _seed(seed: int, name: str, number: int) -> int:
    """Seed of a set, apart from those of all others."""
    entropy = np.random.SeedSequence([seed, zlib.crc32(name.encode()), number])
    return int(entropy.generate_state(1)[0])
