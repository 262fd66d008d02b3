"""Scenarios of the virtual rig that take less time than the standard ones."""

from dataclasses import replace

from workbench.machines.wheelset.rig import SCENARIOS, Scenario


def short(name: str, speed: float) -> Scenario:
    """A standard stop from a lower speed [km/h]."""
    usual = SCENARIOS[name]
    return replace(usual, conditions=replace(usual.conditions, initial_speed=speed / 3.6))
