"""What must not be claimed: friction that the creep force does not show.

A creep force well below its peak hardly depends on the friction coefficient (to first order of
utilisation cubed, by Polach's law), so that any muWR explains it. Such a muWR is a guess.

Nor can two speeds tell a slippery contact from a soft one. A film of water softens the contact, so
that a model with the law of a dry one takes wet rails for slippery ones.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from workbench.case import Surface
from workbench.fmu import FMU, Matrix, Vector
from workbench.kernel import checked, compiled, place, plant, read
from workbench.observers.contract import (
    ESTIMATE,
    FADING_SPEED,
    FRICTION_RANGE,
    INPUTS,
    OUTPUTS,
)

# From here on 0.01 in muWR changes the force of a wheel by some 100 N, the noise of a load cell.
LEAST_UTILISATION = 0.6

# Contact whose law the observer models have (Polach 2005, kA = 1.0, kS = 0.4, B = 0.6 s/m).
MODELLED_CONTACT: Surface = "dry"

_SPEEDS = np.geomspace(FADING_SPEED, 100.0, 14)  # [m/s]
_FRICTIONS = np.linspace(FRICTION_RANGE[0, 0], FRICTION_RANGE[0, 1], 10)
_CREEPAGES = np.geomspace(1e-4, 1.0, 80)  # from elastic creep to a locked wheel


@compiled
def _scan(plant, order, radii, nominal, grid, peaks):  # type: ignore[no-untyped-def]
    """Force and slip at the peak into peaks, (speeds, frictions, 2); returns a status."""
    speeds, frictions, creepages = grid
    plant.u[:] = 0.0
    for i in range(speeds.size):
        plant.x[order[1]] = speeds[i] / radii[1]
        for j in range(frictions.size):
            plant.u[2] = frictions[j] - nominal
            for creepage in creepages:
                plant.x[order[0]] = (1.0 - creepage) * speeds[i] / radii[0]
                status = place(plant) or read(plant)
                if status:
                    return status
                if plant.y[0] > peaks[i, j, 0]:
                    peaks[i, j, 0], peaks[i, j, 1] = plant.y[0], plant.y[1]
    return 0


class PeakForce:
    """Largest creep force of a model over rolling velocity and friction, scanned once.

    Parameters
    ----------
    fmu : as for an estimator; it is started anew.
    """

    def __init__(self, fmu: FMU) -> None:
        fmu.start({"omegaW": 0.0, "omegaR": 0.0})
        model = plant(fmu, INPUTS, OUTPUTS)
        model.x[:] = fmu.get_states()
        order = np.array([fmu.states.index(name) for name in ("omegaW", "omegaR")])
        self._radii = np.array([fmu.defaults[name] for name in ("rW", "rR")])
        nominal = fmu.defaults["muWR"]
        peaks = np.zeros((_SPEEDS.size, _FRICTIONS.size, 2))
        grid = (_SPEEDS, _FRICTIONS, _CREEPAGES)
        checked(_scan(model, order, self._radii, nominal, grid, peaks), fmu)
        self._peaks = RegularGridInterpolator(
            (np.log(_SPEEDS), _FRICTIONS), peaks, bounds_error=False
        )

    def utilisation(self, values: Matrix) -> Vector:
        """Share of the peak force that is used, 1 beyond the peak.

        Parameters
        ----------
        values : (n, 8) estimates, columns as in ESTIMATE.

        Returns
        -------
        utilisation : (n,) [1], from 0 to 1; NaN where force or friction are not estimated.
        """
        omegaR, muWR, force, slip = (
            values[:, list(ESTIMATE).index(name)] for name in ("omegaR", "muWR", "Fx", "slip")
        )
        speed = np.clip(self._radii[1] * np.abs(omegaR), _SPEEDS[0], _SPEEDS[-1])
        friction = np.clip(muWR, _FRICTIONS[0], _FRICTIONS[-1])
        peak, slip_at_peak = self._peaks(np.column_stack([np.log(speed), friction])).T
        used = np.minimum(np.abs(force) / peak, 1.0)
        return np.where(np.abs(slip) > slip_at_peak, 1.0, used)

    def claims(self, values: Matrix) -> NDArray[np.bool_]:
        """Where muWR may be claimed: much of the adhesion is used, and the wheelset rolls.

        A muWR that is still exactly the nominal one has not been estimated.

        The condition is necessary, not sufficient: the claim is as good as the shape of the
        model's creep law. Where that is the plant's, claims err by 2 to 4 % (rms; 6 % by the
        parameter estimator at 0.12). On wet rails of the virtual rig, which `observe` excludes,
        they would be 14 to 79 % too low (median of a stop), and 46 % too high in a slide, where
        wet friction falls less than that of the dry law.

        Parameters
        ----------
        values : (n, 8) estimates, columns as in ESTIMATE.
        """
        speed = self._radii[1] * np.abs(values[:, list(ESTIMATE).index("omegaR")])
        learned = values[:, list(ESTIMATE).index("dmuWR")] != 0.0
        used: NDArray[np.bool_] = self.utilisation(values) > LEAST_UTILISATION
        claimed: NDArray[np.bool_] = used & learned & (speed > FADING_SPEED)
        return claimed
