"""Machines whose recordings others have published: a module for each set, and its plugin here."""

import tomllib
from pathlib import Path

from workbench.system.plugins import Plugin


def _set_of(module: str) -> Plugin:
    return Plugin(published=f"{__name__}.{module}:PUBLISHED")


AIR_SUPPLY = _set_of("air_supply")
CASCADED_TANKS = _set_of("cascaded_tanks")
ELECTRONIC_OSCILLATOR = _set_of("electronic_oscillator")
HEATED_HOUSE = _set_of("heated_house")
LEAKING_CHAMBER = _set_of("leaking_chamber")
POSITIONING_STAGE = _set_of("positioning_stage")
SEAL_FRICTION = _set_of("seal_friction")
SERVO_PENDULUM = _set_of("servo_pendulum")


def checksums(module: str) -> dict[str, list[str]]:
    """SHA-256 of the files of a set, by recording, as `checksums.toml` has them."""
    text = Path(__file__).with_name("checksums.toml").read_text(encoding="utf-8")
    listed: dict[str, list[str]] = tomllib.loads(text)[module]
    return listed
