"""What can be planted in a recording: one effect, one name, one gain, and zero is none."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

from workbench.studies.power.planting import Plantable, assigned


def _gain(unit: str, text: str, *, least: float = -math.inf) -> Any:
    """Field of an effect: its unit, its meaning, and the least gain that makes sense."""
    return dataclasses.field(default=0.0, metadata={"unit": unit, "text": text, "least": least})


@dataclasses.dataclass(frozen=True)
class Effects:
    """Gains of all effects; the metadata of each field holds its unit and its meaning.

    phiW is the angle of the wheelset; phases are drawn for each stop and effect.
    """

    speed_friction: float = _gain("1", "pad friction times 1 + gain*(1 - v/22 m/s)")
    fade: float = _gain("1/K", "pad friction times 1 - gain*(T - 100 degC), T of each disc")
    pressure_exponent: float = _gain("1", "pad friction times (normal force/35 kN)^-gain")
    bedding_in: float = _gain("1", "pad friction times 1 - gain*exp(-t/2 s) from first contact")
    water_film: float = _gain("1", "film on dry discs at the start, 1 on a wet disc", least=0.0)
    single_disc_film: float = _gain("1", "the same, on disc 2 alone", least=0.0)
    disc_thickness: float = _gain("1", "pad friction times 1 + gain*cos(phiW + phase)")
    caliper_hysteresis: float = _gain(
        "1", "pad force less by gain as pressure rises, more as it falls"
    )
    cylinder_lag: float = _gain("s", "lag of the pads behind the measured pressure", least=0.0)
    return_spring: float = _gain("Pa", "added to the pressure that balances the return spring")
    wheel_radius: float = _gain("m", "added to the wheel radius", least=-0.1)
    out_of_round: float = _gain("m", "wheel radius plus gain*cos(phiW + phase)")
    roller_radius: float = _gain("m", "added to the roller radius", least=-0.1)
    wheel_load: float = _gain("1", "wheel load times 1 + gain", least=-0.5)
    creep_stiffness: float = _gain("1", "Polach's kA and kS times 1 + gain", least=-0.9)
    adhesion_recovery: float = _gain(
        "1", "contact friction times 1 + gain*(1 - exp(-E/250 kJ)), E of slip"
    )
    falling_friction: float = _gain(
        "1", "contact friction times 1 + gain*(1 - exp(-slip/(5 m/s)))", least=-0.9
    )
    wheelset_losses: float = _gain("1", "losses of the wheelset times 1 + gain", least=-1.0)
    roller_losses: float = _gain("1", "losses of the roller times 1 + gain", least=-1.0)
    wheel_inertia: float = _gain("1", "inertia of the wheelset times 1 + gain", least=-0.9)
    roller_inertia: float = _gain(
        "1", "inertia of the roller times 1 + gain, unknown to the drive", least=-0.5
    )
    torque_gain: float = _gain("1", "measured torque times 1 + gain")
    fx_gain: float = _gain("1", "load cell times 1 + gain")
    fx_offset: float = _gain("N", "added to the load cell, in either direction")
    apex_offset: float = _gain("m", "wheel off the roller's crest: 138 N/mm more on the load cell")
    speed_delay: float = _gain("s", "delay of the measured wheel speed")
    pole_ring: float = _gain("1", "measured wheel speed times 1 + gain*cos(phiW + phase)")
    time_skew: float = _gain("s", "delay of both measured speeds, of a second logger")
    late_pB: float = _gain("s", "delay of the measured pressure, of its logger")
    late_tauR: float = _gain("s", "delay of the measured torque, of its logger")
    late_omegaR: float = _gain("s", "delay of the measured roller speed, of its logger")
    late_Fx: float = _gain("s", "delay of the load cell, of its logger")
    pressure_offset: float = _gain("Pa", "added to the measured pressure")
    # Outside the catalogue: a diagnosis should find no name for these.
    friction_step: float = _gain(
        "1", "not in the catalogue: pad friction times 1 + gain over 90 degC"
    )
    friction_ripple: float = _gain(
        "1", "not in the catalogue: pad friction times 1 + gain*sin(2 pi 0.3 Hz t)"
    )
    friction_deceleration: float = _gain(
        "s2/m", "not in the catalogue: pad friction times 1 + gain*deceleration, 0.2 s late"
    )
    drive_beat: float = _gain(
        "1", "not in the catalogue: measured torque times 1 + gain*sin(2 pi 0.2 Hz t)"
    )
    force_drift: float = _gain("N/s", "not in the catalogue: added to the load cell times t")
    # What the data sheet may have wrong besides.
    structure: float = _gain(
        "1", "sheet: frequency of the longitudinal mode times 1 + gain", least=-0.9
    )
    noise: float = _gain("1", "sheet: noise of all sensors times 1 + gain", least=-1.0)
    tolerances: float = _gain("1", "sheet: scatter of the stops times 1 + gain", least=-1.0)
    # Faults of the acquisition.
    spikes: float = _gain("1/s", "corrupts: isolated wrong samples in each channel", least=0.0)
    dropouts: float = _gain("1/s", "corrupts: samples that are missing", least=0.0)
    fx_limit: float = _gain("N", "corrupts: reading at which the load cell saturates", least=0.0)


# Organic pads: measured ranges are 0.1..0.4, 0..1e-3 /K and 0..0.10.
ORDINARY_PADS = Effects(speed_friction=0.20, fade=4e-4, pressure_exponent=0.04)
CONSTANT_PADS = Effects()


def plant(base: Effects, assignments: Sequence[str]) -> Effects:
    """Set gains by name.

    Parameters
    ----------
    base : gains of all effects that are not named.
    assignments : texts NAME=VALUE, with the value in the effect's SI unit.

    Examples
    --------
    >>> plant(CONSTANT_PADS, ["fx_gain=0.015"]).fx_gain
    0.015
    """
    known = {
        field.name: Plantable(
            field.name, field.metadata["unit"], least=field.metadata["least"], unit_size=0.01
        )
        for field in dataclasses.fields(Effects)
    }
    return dataclasses.replace(base, **assigned(assignments, known))
