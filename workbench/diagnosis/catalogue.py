"""The physical effects that the workbench knows: one Modelica class each, and its entry here.

Units, bounds and defaults of the parameters stand in the Modelica classes alone. What an entry
adds is where the effect is plugged in and how large it must be to matter. Of effects that nothing
in the data tells apart, the usual one stands first.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from workbench.errors import InputError, closest


@dataclass(frozen=True)
class Effect:
    """One entry of the catalogue.

    Attributes
    ----------
    name : of the Modelica class, also used in results.
    package : of the library that holds the class.
    slots : of the observer model that the class is plugged into.
    size : parameter that is zero in the nominal model; of an order-locked effect, which has the
        pair `cosine` and `sine`, "cosine".
    step : change of `size` that is small and clearly visible, in its SI unit.
    matters : least size worth a finding, in the same unit: what tolerances, or differences between
        an observer model and a real rig, may fake.
    shapes : other parameters that are fitted once the effect is found, each with values to try.
    hidden : why recorded stops cannot show the effect; empty if they can.
    text : what it is, for people.
    separation : the experiment that tells it from its likely twins.
    """

    name: str
    package: str
    slots: tuple[str, ...]
    size: str
    step: float
    matters: float
    text: str
    separation: str
    shapes: tuple[tuple[str, tuple[float, ...]], ...] = ()
    hidden: str = ""

    @property
    def order_locked(self) -> bool:
        """Whether the effect turns with the wheel, with a phase of its own in each stop."""
        return self.size == "cosine"

    @property
    def sizes(self) -> tuple[str, ...]:
        """Parameters that are zero in the nominal model."""
        return ("cosine", "sine") if self.order_locked else (self.size,)

    @property
    def label(self) -> str:
        """Name of the size in results."""
        return "amplitude" if self.order_locked else self.size


_DRAG = "drag braking at constant roller speed, with a staircase of pressure up and down"
_HOT = "stops repeated without cooling, then one after 20 minutes"
_UNITS = "venting the brake units one by one"
_COAST = "a long coast-down without brake, in both directions"
_LIFTED = "a run-up with the wheelset lifted, and dead weights on the load cells"
_LOAD = "a step of the vertical load by 10 %"
_SLIP = "a slip sweep by the drive at constant speed, up and down"
_RUNDOWN = "order tracking in a slow run-down, with and without brake"
_STEP = "a step of the drive's torque, compared with steady braking"
_SINE = "a sine on the pressure at constant speed"

_PADS, _CYLINDER, _FORCE = ("padFriction",), ("cylinder",), ("forceSensor",)
_WHEEL, _ROLLER = ("speedSensorW",), ("speedSensorR",)
_FILM = (("E0", (0.1e6, 0.3e6, 0.45e6, 1.0e6)),)

CATALOGUE: tuple[Effect, ...] = (
    Effect("SpeedDependentPadFriction", "Effects", _PADS, "slope", 0.02, 0.01,
           "pad friction that falls with sliding speed", _DRAG),
    Effect("PressureDependentPadFriction", "Effects", _PADS, "exponent", 0.005, 0.004,
           "pad friction that falls with the normal force", _DRAG),
    Effect("BrakeFade", "Effects", _PADS, "fade", 3e-5, 3e-5,
           "pad friction that falls with the temperature of the disc", _HOT),
    Effect("WaterFilm", "Effects", _PADS, "film", 0.03, 0.02,
           "water on all discs, until their friction has dried it", _UNITS, _FILM),
    Effect("SingleDiscWaterFilm", "Effects", _PADS, "film", 0.1, 0.05,
           "water on one disc, until its friction has dried it", _UNITS, _FILM),
    Effect("BeddingIn", "Effects", _PADS, "loss", 0.01, 0.01,
           "pad friction that is low in the first seconds of contact", "dry stops from two "
           "pressures: time against energy", (("tau", (0.7, 1.4, 2.0, 3.0)),)),
    Effect("DiscThicknessVariation", "Effects", _PADS, "cosine", 0.002, 0.001,
           "discs of uneven thickness", _RUNDOWN),
    Effect("CylinderLag", "Effects", _CYLINDER, "lag", 0.005, 0.003,
           "pads that lag behind the measured pressure", _SINE),
    Effect("CaliperHysteresis", "Effects", _CYLINDER, "share", 0.01, 0.02,
           "friction in the caliper", _DRAG),
    Effect("ReturnSpringPressure", "Effects", _CYLINDER, "increase", 500.0, 500.0,
           "a stiffer return spring", "the pressure of first contact, read at standstill"),
    Effect("PressureSensorOffset", "Effects", _CYLINDER, "offset", 500.0, 500.0,
           "a pressure sensor whose zero is wrong", "its reading on a vented cylinder"),
    Effect("WheelRadius", "Effects", ("wheelRadius",), "delta", 1e-4, 5e-5,
           "a wheel radius other than entered", "a tape measure on wheel and roller"),
    Effect("OutOfRoundWheel", "Effects", ("wheelRadius",), "cosine", 2e-5, 1e-5,
           "a wheel that is out of round", _RUNDOWN),
    Effect("RollerRadius", "Effects", ("rollerRadius",), "delta", 2e-4, 1e-4,
           "a roller radius other than entered", "a tape measure on wheel and roller"),
    Effect("WheelLoad", "Effects", ("wheelLoad",), "gain", 0.01, 0.02,
           "a wheel load other than nominal", _LOAD),
    Effect("CreepStiffness", "Effects", ("creepStiffness",), "gain", 0.01, 0.02,
           "a contact softer or stiffer than Kalker's theory", _LOAD),
    Effect("WheelInertia", "Effects", ("wheelInertia",), "gain", 0.05, 0.2,
           "an inertia of the wheelset other than nominal", "a lifted spin-down",
           hidden="stops without slides show less of it than noise of the torque fakes"),
    Effect("DriveTorqueGain", "Effects", ("driveTorque",), "gain", 0.002, 0.002,
           "a torque measurement with a wrong gain", _LIFTED),
    Effect("AdhesionRecovery", "Effects", ("adhesion",), "gain", 0.05, 0.05,
           "a rail that slip cleans", _SLIP, (("Er", (0.1e6, 0.25e6, 0.5e6)),)),
    Effect("WheelsetLosses", "Effects", ("wheelsetLoss",), "gain", 0.1, 0.15,
           "losses of the wheelset other than nominal", _COAST),
    Effect("RollerLosses", "Effects", ("rollerLoss",), "gain", 0.1, 0.1,
           "losses of the roller other than nominal", _COAST),
    Effect("FxGain", "Sensors", _FORCE, "gain", 0.002, 0.002,
           "load cells with a wrong gain", _LIFTED),
    Effect("FxOffset", "Sensors", _FORCE, "offset", 20.0, 20.0,
           "load cells whose zero is wrong", "their reading with the wheelset lifted"),
    Effect("ApexOffset", "Effects", _FORCE, "offset", 2e-4, 1.5e-4,
           "a wheelset that stands beside the apex of the roller", _LOAD),
    Effect("SpeedSignalDelay", "Sensors", _WHEEL, "delay", 1e-3, 1e-3,
           "a speed sensor of the wheelset that reads late", _STEP),
    Effect("PoleRingEccentricity", "Sensors", _WHEEL, "cosine", 1e-4, 5e-5,
           "an eccentric pole ring of the wheelset's speed sensor", _RUNDOWN),
    Effect("LoggerTimeSkew", "Sensors", (*_WHEEL, *_ROLLER), "skew", 1e-3, 1e-3,
           "a logger of the speeds whose clock is late", _STEP),
)  # fmt: skip


def choose(names: Sequence[str]) -> tuple[Effect, ...]:
    """Effects by name, in the catalogue's order; all of them if none is named.

    Raises
    ------
    InputError
        If there is no effect of a name.
    """
    known = {effect.name: effect for effect in CATALOGUE}
    for name in names:
        if name not in known:
            raise InputError(
                where=f"--effects {name}",
                found=f"no effect of this name{closest(name, known)}",
                expected=f"some of {', '.join(known)}",
                remedy="correct the name",
            )
    return tuple(effect for effect in CATALOGUE if not names or effect.name in names)
