"""Machines whose recordings others published: what is diagnosed of them, and their table."""

from dataclasses import dataclass
from typing import Literal

from figure import Summary, Table
from figure_tables import verdict

from workbench.system.units import si_factor


@dataclass(frozen=True)
class Machine:
    """One machine of a published set.

    Attributes
    ----------
    said : what it is, and which error is told.
    published : errors of free runs as they were published, of recordings that were not fitted.
    system : that models it.
    source : folder of the publisher's files.
    unit : in which the error is told.
    held_out : recordings that are not fitted; the error is theirs, if there are any.
    cases : that are diagnosed; all of the set if none is named.
    channel : whose error is told, where there are several.
    """

    label: str
    published: str
    system: str
    source: str
    unit: str
    held_out: tuple[str, ...] = ()
    cases: tuple[str, ...] = ()
    measure: Literal["rms", "mean_absolute"] = "rms"
    channel: str = ""

    @property
    def prepare(self) -> str:
        """The command that makes cases of the publisher's files."""
        return (
            f"prepare {self.system} --from {{recordings}}/real/{self.source} --out {self._folder}"
        )

    def diagnose(self, name: str) -> str:
        """The command that diagnoses it."""
        cases = " ".join(f"{self._folder}/{case}" for case in self.cases) or self._folder
        held_out = " --held-out " + " ".join(self.held_out) if self.held_out else ""
        return f"diagnose --system {self.system} {cases}{held_out} --out {{out}}/real/{name}"

    @property
    def _folder(self) -> str:
        return f"{{out}}/cases/{self.system}"

    def errors(self, summary: Summary) -> tuple[float, float]:
        """Of the nominal and of the extended model [unit]."""
        some = [
            error
            for error in summary["errors"]
            if error["held_out"] == bool(self.held_out) and self.channel in ("", error["channel"])
        ]
        power = 2 if self.measure == "rms" else 1
        samples = sum(error["samples"] for error in some)
        nominal, extended = (
            (sum(error["samples"] * error[self.measure][k] ** power for error in some) / samples)
            ** (1 / power)
            / si_factor(self.unit, some[0]["unit"], self.label)
            for k in (0, 1)
        )
        return nominal, extended


def _seal(label: str, published: str, name: str) -> Machine:
    cases = tuple(f"{name}_{pressure}bar" for pressure in (1, 3, 5, 7))
    return Machine(label, published, "seal_friction", "pneumatic_cylinder", "N", cases[2:3], cases)


def _chamber(label: str, published: str, *cases: str) -> Machine:
    names = "leaking_chamber", "pneumatic_cylinder"
    return Machine(label, published, *names, "mbar", cases[1:], cases)


MACHINES = {
    "cascaded_tanks": Machine(
        "two tanks, rms of the level",
        "linear 0.59 to 0.75 V, best grey box 0.18 to 0.19 V",
        *("cascaded_tanks", "cascaded_tanks", "V", ("test",)),
    ),
    "servo_pendulum": Machine(
        "servo with a pendulum, mean absolute of the position",
        "107 mrad without friction, 54 dry and viscous, 36 at best",
        *("servo_pendulum", "servo_pendulum", "mrad", ("'kp200_*'",)),
        measure="mean_absolute",
    ),
    "O-ring": _seal("O-ring, rms of the force at 5 bar", "6.6 N nominal, 1.2 at best", "O-ring"),
    "NAPN": _seal("NAPN seal, the same", "9.0 N nominal, 1.2 at best", "NAPN"),
    "Ultimaker_020": _chamber(
        "leaking chamber `Ultimaker_020`, rms below 2 bar",
        "laminar 70 mbar, orifice 173",
        *("Ultimaker_020_above", "Ultimaker_020_below"),
    ),
    "Ultimaker_015": _chamber(
        "`Ultimaker_015`, the same", "", "Ultimaker_015_above", "Ultimaker_015_below"
    ),
    **{
        name: _chamber(f"`{name}`, rms above 2 bar, to which it is fitted", "", f"{name}_above")
        for name in ("Aluminium", "Formlabs", "Prusa")
    },
    "air_supply": Machine(
        "air supply of a train, rms of the pressure",
        "622 mbar without leak, 85 with one, 51 at best",
        *("air_supply", "metro_air_supply", "mbar", ("cycle_4", "cycle_5")),
    ),
    "positioning_stage": Machine(
        "carriage on a ball screw (EMPS), rms of the command under pulses, of 1.66 V",
        "0.148 V (8.9 %), dry and viscous friction and an offset",
        *("positioning_stage", "positioning_stage", "V", ("motion_with_pulses",)),
        channel="command",
    ),
    "electronic_oscillator": Machine(
        "circuit that swings (Silverbox), rms of the growing noise",
        "physical model 0.96 mV (H. Hjalmarsson, J. Schoukens 2004), black boxes from 0.26 "
        "(J. Paduart et al. 2010)",
        *("electronic_oscillator", "electronic_oscillator", "mV", ("arrow",)),
    ),
    "heated_house": Machine(
        "office with electric heaters (FlexHouse), rms of the temperature over 45 h after 96 h "
        "that were fitted",
        "0.58 K, parameters from all 141 h, of one-step predictions; 0.66 K, the same structure "
        "fitted to the 96 h",
        *("heated_house", "heated_house", "K", ("rest",)),
    ),
    "heated_house_all": Machine(
        "the same, all 141 h fitted, as those who published it did: rms but for the first 12 h",
        "0.66 K (0.58 over the last 45 h)",
        *("heated_house", "heated_house", "K", (), ("four_days", "rest")),
    ),
}


def machines(*summaries: Summary) -> Table:
    """What is found in each, and what that is worth on recordings that were not fitted."""
    error = "machine, error on recordings that were not fitted"
    rows: Table = [[error, "published", "nominal", "extended", "named"]]
    for machine, summary in zip(MACHINES.values(), summaries, strict=True):
        nominal, extended = (
            f"{float(f'{error:.3g}'):g} {machine.unit}" for error in machine.errors(summary)
        )
        after = extended if summary["causes"] else ""
        rows.append([machine.label, machine.published, nominal, after, verdict(summary)])
    return rows
