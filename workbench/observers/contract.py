"""What every estimator does, and what they share."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from workbench.case import MODEL_VARIABLES
from workbench.errors import InputError
from workbench.fmu import FMU, Matrix, Vector
from workbench.kernel import checked, inlined, plant, read, set_inputs, set_states
from workbench.units import si_factor

# Columns of an estimate, with units; NaN where a method does not estimate the quantity.
ESTIMATE = {
    "omegaW": "rad/s",
    "omegaR": "rad/s",
    "dmuWR": "1",
    "dmuDC": "1",
    "muWR": "1",
    "muDC": "1",
    "Fx": "N",
    "slip": "m/s",
}
WIDTH = len(ESTIMATE)

INPUTS = ("pB", "tauR", "dmuWR", "dmuDC")
OUTPUTS = ("Fx", "slip")
FRICTIONS = ("muWR", "muDC")

# Wheel-rail from very low to dry adhesion (Polach 2005), disc-pad as in Schwarz et al. (2018).
FRICTION_RANGE = np.array([[0.03, 0.55], [0.10, 0.45]])

# Rolling velocity [m/s] at which feedback is down to half: noise of 0.003 rad/s in omegaR is then
# a creepage of 0.4 %, as much as a braked wheel has.
FADING_SPEED = 0.5


@dataclass(frozen=True)
class Estimate:
    """Estimates at one time, (8,), or at all times, (n, 8).

    Attributes
    ----------
    values : columns as in ESTIMATE.
    sigma : standard deviations, NaN where the method has none.
    nis : normalised innovation squared, () or (n,), NaN where the method has none.
    """

    values: Vector | Matrix
    sigma: Vector | Matrix
    nis: Vector | float


class Estimator(ABC):
    """Feeds on u = [pB, tauR] (Pa, N.m) and y = [omegaW, omegaR] (rad/s), sample by sample.

    A method provides `_begin`, which fills its memory, and two compiled functions: `_law` advances
    by one sample, `_loop` runs the law over a recording.

    Parameters
    ----------
    fmu : model with states omegaW, omegaR, inputs as in INPUTS and outputs as in OUTPUTS.

    Raises
    ------
    InputError
        If the model lacks one of MODEL_VARIABLES or has it in another unit.
    """

    name: str
    _law: ClassVar[Any]
    _loop: ClassVar[Any]

    def __init__(self, fmu: FMU) -> None:
        check_model(fmu)
        self.fmu = fmu
        self._plant = plant(fmu, INPUTS, OUTPUTS)
        self._order = np.array([fmu.states.index("omegaW"), fmu.states.index("omegaR")])
        self._nominal = np.array([fmu.defaults[name] for name in FRICTIONS])
        self._radius = fmu.defaults["rR"]
        self._t = 0.0
        self._row = np.empty(2 * WIDTH + 1)

    @abstractmethod
    def _begin(self, u: Vector, y: Vector) -> None:
        """Set the memory to the first sample."""

    @abstractmethod
    def _arguments(self) -> tuple[Any, Any]:
        """Settings and memory of the law."""

    def start(self, u: Vector, y: Vector) -> None:
        """Start FMU and memory from the first sample; `advance` takes it again, after no time."""
        self.fmu.start({"omegaW": y[0], "omegaR": y[1]})
        self._plant.u[:] = 0.0
        self._begin(u, y)

    def init(self, t: float, u: Vector, y: Vector) -> Estimate:
        """Start at time t [s] with the first sample: measured speeds, nominal friction."""
        self._t = t
        self.start(u, y)
        settings, memory = self._arguments()
        self._row[:] = np.nan
        checked(self._law(self._plant, settings, memory, 0.0, u, y, self._row), self.fmu)
        return _split(self._row.copy())

    def step(self, t: float, u: Vector, y: Vector) -> Estimate:
        """Advance to time t [s] with the sample taken there."""
        settings, memory = self._arguments()
        h, self._t = t - self._t, t
        self._row[:] = np.nan
        checked(self._law(self._plant, settings, memory, h, u, y, self._row), self.fmu)
        return _split(self._row.copy())

    def run(self, time: Vector, u: Matrix, y: Matrix) -> Estimate:
        """The same as `init` and `step` over a whole recording, in one compiled loop.

        Parameters
        ----------
        time : (n,) [s].
        u, y : (n, 2) measured inputs and outputs.

        Raises
        ------
        FMUError
            If the FMU refuses a call.
        """
        self.start(u[0], y[0])
        return self.advance(np.diff(time, prepend=time[0]), u, y)

    def advance(self, steps: Vector, u: Matrix, y: Matrix) -> Estimate:
        """Run over a piece of a recording, from where the piece before it ended, or from `start`.

        Parameters
        ----------
        steps : (n,) from the sample before [s].
        u, y : (n, 2) measured inputs and outputs.

        Raises
        ------
        FMUError
            If the FMU refuses a call.
        """
        rows = np.full((steps.size, 2 * WIDTH + 1), np.nan)
        settings, memory = self._arguments()
        inputs, outputs = np.ascontiguousarray(u), np.ascontiguousarray(y)
        checked(self._loop(self._plant, settings, memory, steps, inputs, outputs, rows), self.fmu)
        return _split(rows)


def check_model(fmu: FMU) -> None:
    """Refuse a model that estimators cannot work on; a variable without a unit is taken as SI.

    Raises
    ------
    InputError
        If the model lacks one of MODEL_VARIABLES, has a speed that is no state, a parameter
        without a value, or a variable in another unit.
    """
    fmu.variables(tuple(MODEL_VARIABLES))
    for ours, unit in MODEL_VARIABLES.items():
        theirs = fmu.names.get(ours, ours)
        where = f"{fmu.path}, variable '{theirs}'"
        if ours in ("omegaW", "omegaR") and ours not in fmu.states:
            raise InputError(
                where=where,
                found="a variable that is no state",
                expected=f"a continuous state for {ours}, because estimators set it",
                remedy=f"choose the speed as state in the model, or map another: --map {ours}=NAME",
            )
        if ours in (*FRICTIONS, "rW", "rR", "JR") and ours not in fmu.defaults:
            raise InputError(
                where=where,
                found="no start value",
                expected=f"a parameter with a value for {ours}",
                remedy=f"make it a parameter of the model, or map another: --map {ours}=NAME",
            )
        declared = fmu.units.get(ours)
        # Coefficients and inertias are hardly ever in any other unit; spellings of kg.m2 abound.
        if declared and unit not in ("1", "kg.m2") and si_factor(declared, unit, where) != 1.0:
            raise InputError(
                where=where,
                found=f"unit [{declared}]",
                expected=f"[{unit}] for {ours}; nothing is converted silently",
                remedy=f"export the model with this variable in {unit}",
            )


def rolling_ratio(fmu: FMU) -> float:
    """Speed of a wheelset that rolls over that of the roller [1], by the model's own slip.

    It is rR/rW, unless the radius that acts in the model is another. The FMU is started anew.
    """
    slip = fmu.variables(["slip"])
    fmu.start({"omegaW": 0.0, "omegaR": 0.0})
    rest = fmu.get_states()
    slips = []
    for name in ("omegaR", "omegaW"):
        turning = rest.copy()
        turning[fmu.states.index(name)] = 1.0
        fmu.set_states(turning)
        slips.append(float(fmu.get(slip)[0]))
    fmu.set_states(rest)
    return -slips[0] / slips[1]


def _split(rows: Any) -> Estimate:
    return Estimate(rows[..., :WIDTH], rows[..., WIDTH : 2 * WIDTH], rows[..., -1])


@inlined
def fading(speed):  # type: ignore[no-untyped-def]
    """Share of the feedback at a rolling velocity [m/s]: none at rest, all of it at speed."""
    return speed * speed / (speed * speed + FADING_SPEED**2)


@inlined
def clip(value, low, high):  # type: ignore[no-untyped-def]
    """Limit to low..high; a NaN stays."""
    return min(max(value, low), high)


@inlined
def slipping(x, wheelset, roller, ratio):  # type: ignore[no-untyped-def]
    """Speed of a wheelset that rolls minus that of this one [rad/s]; ratio: `rolling_ratio`."""
    return ratio * x[roller] - x[wheelset]


@inlined
def stick(x, wheelset, roller, ratio, radius, before):  # type: ignore[no-untyped-def]
    """Let the wheelset roll where a step would reverse its slip close to standstill.

    Creep is saturated there from 1 mm/s on, and a tangent to the saturated force leads to the other
    side, and back in the next step.

    Parameters
    ----------
    before : `slipping` before the step.
    """
    if abs(radius * x[roller]) < FADING_SPEED and (
        before * slipping(x, wheelset, roller, ratio) < 0.0
    ):
        x[wheelset] = ratio * x[roller]


@inlined
def measure(plant, u):  # type: ignore[no-untyped-def]
    """Set the measured inputs, u = [pB, tauR]; returns a status."""
    plant.u[0], plant.u[1] = u[0], u[1]
    return set_inputs(plant, 0, 2)


@inlined
def correct(plant, dmuWR, dmuDC):  # type: ignore[no-untyped-def]
    """Set the states plant.x and the friction deviations; returns a status."""
    plant.u[2], plant.u[3] = dmuWR, dmuDC
    return set_inputs(plant, 2, 2) or set_states(plant)


@inlined
def report(plant, order, nominal, row):  # type: ignore[no-untyped-def]
    """Write the estimate that the FMU is at into a row; returns a status."""
    status = read(plant)
    row[0], row[1] = plant.x[order[0]], plant.x[order[1]]
    row[2], row[3] = plant.u[2], plant.u[3]
    row[4], row[5] = nominal[0] + plant.u[2], nominal[1] + plant.u[3]
    row[6], row[7] = plant.y[0], plant.y[1]
    return status
