"""The stops that the rig can make: fourteen standard cases, and some that are none."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

from workbench.errors import unknown_name
from workbench.machines.wheelset.rig.drive import TRAIN_INERTIA

Surface: TypeAlias = Literal["dry", "wet"]

FRICTION: Mapping[Surface, float] = {"dry": 0.40, "wet": 0.30}  # at zero slip velocity
WHEEL_LOAD = 80e3  # [N] usually
DISC_TEMPERATURE = 333.15  # [K] usually


@dataclass(frozen=True)
class Conditions:
    """What is set before a stop, as the system file declares it."""

    initial_speed: float  # [m/s]
    brake_pressure: float  # [Pa]
    wheel_rail: Surface  # surface of the rails
    discs: tuple[Surface, ...]  # surface of each disc
    direction: Literal[1, -1]  # of travel, 1 or -1
    wheel_load: float = WHEEL_LOAD  # [N] that the vertical cylinders are set to
    disc_temperature: float = DISC_TEMPERATURE  # [K]


@dataclass(frozen=True)
class Patch:
    """A spell of low adhesion, from `begin` to `end` [s] after the brake demand."""

    begin: float
    end: float
    muWR: float


@dataclass(frozen=True)
class Scenario:
    """One stop to be made."""

    name: str  # of the case, NN_noun
    conditions: Conditions  # what is set before the stop
    muWR: float  # friction of the contact at zero slip velocity
    patch: Patch | None  # spell of lower friction, or None
    protected: bool  # whether the wheel-slide protection is switched on
    # demands that follow the first, (time after that [s], pressure [Pa]) each
    steps: tuple[tuple[float, float], ...] = ()
    # inertia that the drive lets the roller have, 0 where it is off [kg.m2]
    imitated: float = TRAIN_INERTIA
    lasts: float = math.inf  # time after which a recording ends that does not end by standstill [s]
    sensors: tuple[str, ...] = ()  # that are fitted besides the usual ones, by name

    def demand(self, braking: float) -> float:
        """Brake pressure that is asked for [Pa], a time [s] after the first demand."""
        begun = [pressure for begin, pressure in self.steps if braking >= begin]
        return begun[-1] if begun else self.conditions.brake_pressure

    def friction(self, braking: float) -> float:
        """Friction of the contact at zero slip velocity, a time [s] after the first demand."""
        patch = self.patch
        low = patch is not None and patch.begin <= braking < patch.end
        return patch.muWR if patch is not None and low else self.muWR

    @property
    def number(self) -> int:
        """NN of the name."""
        return int(self.name[:2])

    @property
    def title(self) -> str:
        """One line for reports."""
        c = self.conditions
        wet = [str(i) for i, disc in enumerate(c.discs, start=1) if disc == "wet"]
        discs = {0: "dry", len(c.discs): "wet"}.get(len(wet), "wet:" + "+".join(wet))
        besides = f", wheel load {c.wheel_load / 1e3:g} kN" if c.wheel_load != WHEEL_LOAD else ""
        if c.disc_temperature != DISC_TEMPERATURE:
            besides += f", discs at {c.disc_temperature:g} K"
        return (
            f"{c.initial_speed * 3.6:g} km/h, {c.brake_pressure / 1e5:g} bar, "
            f"rail {c.wheel_rail}, discs {discs}, direction {c.direction:+d}{besides}"
        )


def _stop(
    name: str,
    speed: float,
    pressure: float,
    wheel_rail: Surface,
    wet_discs: tuple[int, ...],
    direction: Literal[1, -1],
    **changes: Any,
) -> Scenario:
    """One row of the table: speed in km/h, pressure in bar, numbers of the wet discs."""
    discs: tuple[Surface, ...] = tuple("wet" if i in wet_discs else "dry" for i in (1, 2, 3))
    conditions = Conditions(speed / 3.6, pressure * 1e5, wheel_rail, discs, direction)
    stop = Scenario(name, conditions, FRICTION[wheel_rail], patch=None, protected=True)
    return replace(stop, **changes)


def _stairs(*pressures: float) -> tuple[tuple[float, float], ...]:
    """Demands of so many bar, one after the other, for 5 s each."""
    return tuple((5.0 * i, pressure * 1e5) for i, pressure in enumerate(pressures, start=1))


# Polach's wet 0.30 carries the stop at 4.2 bar; case 9 takes less, so that the patch costs grip.
_STANDARD = (
    #     name                      km/h  bar  rail   wet discs  direction
    _stop("01_dry_80_1.5", 80, 1.5, "dry", (), +1),
    _stop("02_dry_100_2.7", 100, 2.7, "dry", (), +1),
    _stop("03_dry_120_3.6", 120, 3.6, "dry", (), +1),
    _stop("04_dry_160_4.2", 160, 4.2, "dry", (), +1),
    _stop("05_dry_120_2.7_rev", 120, 2.7, "dry", (), -1),
    _stop("06_dry_160_3.6_rev", 160, 3.6, "dry", (), -1),
    _stop("07_wet_80_1.5", 80, 1.5, "wet", (1, 2, 3), +1),
    _stop("08_wet_120_3.6", 120, 3.6, "wet", (1, 2, 3), +1),
    _stop(
        "09_wet_160_4.2_wsp", 160, 4.2, "wet", (1, 2, 3), +1, muWR=0.22, patch=Patch(8.0, 9.5, 0.09)
    ),
    _stop("10_wet_100_2.7_rev", 100, 2.7, "wet", (1, 2, 3), -1),
    _stop("11_brakewet_120_2.7_rev", 120, 2.7, "dry", (1, 2, 3), -1),
    _stop("12_brakewet_160_4.2", 160, 4.2, "dry", (1, 2, 3), +1),
    _stop("13_onedisc_100_2.7", 100, 2.7, "dry", (2,), +1),
    _stop("14_twodiscs_160_3.6_rev", 160, 3.6, "dry", (1, 3), -1),
)
# Full brake on a greasy rail without protection: the wheel locks, and stays locked to the end.
_DARING = (_stop("15_locked_wheel", 100, 4.2, "wet", (), +1, muWR=0.12, protected=False),)

# Pressure up and down: in a stop in which it only rises, calipers hide their hysteresis.
_STAIRCASES = (
    _stop("16_staircase_160", 160, 1.5, "dry", (), +1, steps=_stairs(3.0, 4.2, 2.4, 1.2, 3.6, 1.8)),
    _stop("17_staircase_120_rev", 120, 3.6, "dry", (), -1, steps=_stairs(1.8, 3.0, 1.2, 2.4)),
)

# Full brake on a wet rail that just does not carry it: the wheel slides, is caught, slides again.
_SLIPPERY = 0.24
_SLIDING = (
    _stop("18_slide_160_4.8", 160, 4.8, "wet", (), +1, muWR=_SLIPPERY),
    _stop("19_slide_160_4.4_rev", 160, 4.4, "wet", (), -1, muWR=_SLIPPERY),
    _stop("20_slide_120_4.6_rev", 120, 4.6, "wet", (), -1, muWR=_SLIPPERY),
    _stop("21_slide_120_4.9", 120, 4.9, "wet", (), +1, muWR=_SLIPPERY),
    _stop("22_slide_100_5", 100, 5.0, "wet", (), +1, muWR=_SLIPPERY),
    _stop("23_slide_140_4.6_rev", 140, 4.6, "wet", (), -1, muWR=_SLIPPERY),
)

# What two stops that differ in nothing but noise and tolerances leave open, a next one may tell.
_ALIKE = tuple(_stop(f"{number}_alike_80_2.7", 80, 2.7, "dry", (), +1) for number in (24, 25))

STANDARD = tuple(scenario.name for scenario in _STANDARD)
SCENARIOS = {
    scenario.name: scenario for scenario in _STANDARD + _DARING + _STAIRCASES + _SLIDING + _ALIKE
}


def select(names: Sequence[str]) -> list[Scenario]:
    """Scenarios by name, with or without its number; the standard ones if none is named.

    Examples
    --------
    >>> [scenario.name for scenario in select(["locked_wheel", "01_dry_80_1.5"])]
    ['01_dry_80_1.5', '15_locked_wheel']
    """
    chosen = set(STANDARD if not names else ())
    for name in names:
        matches = [full for full in SCENARIOS if name in (full, full[3:])]
        if not matches:
            raise unknown_name(
                name,
                SCENARIOS,
                where=f"--case {name}",
                found="no scenario of this name",
                expected=f"one of {', '.join(SCENARIOS)}",
            )
        chosen.update(matches)
    return [scenario for name, scenario in SCENARIOS.items() if name in chosen]
