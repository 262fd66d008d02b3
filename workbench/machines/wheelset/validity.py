"""Validity of muWR: where the creep force shows the friction of the contact.

A creep force well below its peak hardly depends on the friction coefficient (to first order of
utilisation cubed, by Polach's law), so that any muWR explains it. Such a muWR is a guess.

Nor can two speeds tell a slippery contact from a soft one. A film of water softens the contact, so
that a model with the law of a dry one takes wet rails for slippery ones: the system file claims
muWR on dry rails only.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from workbench.arrays import Matrix, Vector
from workbench.models.fmu import FMU
from workbench.models.native import compiled, instance, place, raise_on_failure, read
from workbench.system.system import System

# From here on 0.01 in muWR changes the force of a wheel by some 100 N, the noise of a load cell.
LEAST_UTILISATION = 0.6

_FASTEST = 100.0  # [m/s]
_CREEPAGES = np.geomspace(1e-4, 1.0, 80)  # from elastic creep to a locked wheel


@compiled
def _scan(model, order, radii, nominal, grid, peaks):  # type: ignore[no-untyped-def]
    """Force and slip at the peak into peaks, (speeds, frictions, 2); returns a status."""
    speeds, frictions, creepages = grid
    model.u[:] = 0.0
    for i in range(speeds.size):
        model.x[order[1]] = speeds[i] / radii[1]
        for j in range(frictions.size):
            model.u[model.u.size - 1] = frictions[j] - nominal
            for creepage in creepages:
                model.x[order[0]] = (1.0 - creepage) * speeds[i] / radii[0]
                status = place(model) or read(model)
                if status:
                    return status
                if model.y[0] > peaks[i, j, 0]:
                    peaks[i, j, 0], peaks[i, j, 1] = model.y[0], model.y[1]
    return 0


class PeakForce:
    """Largest creep force of a model over rolling velocity and friction, scanned once.

    Parameters
    ----------
    fmu : as for an estimator; it is started anew.
    """

    def __init__(self, fmu: FMU, system: System) -> None:
        fmu.start({"omegaW": 0.0, "omegaR": 0.0})
        rail = next(quantity for quantity in system.estimated if quantity.name == "muWR")
        assert system.fading is not None
        self._slowest = system.fading.half
        self._columns = list(system.columns)
        self._speeds = np.geomspace(self._slowest, _FASTEST, 14)
        self._frictions = np.linspace(rail.low, rail.high, 10)
        model = instance(fmu, [], [rail.correction], ["Fx", "slip"])
        model.x[:] = fmu.get_states()
        order = np.array([fmu.states.index(name) for name in ("omegaW", "omegaR")])
        self._radii = np.array([fmu.defaults[name] for name in ("rW", "rR")])
        peaks = np.zeros((self._speeds.size, self._frictions.size, 2))
        grid = (self._speeds, self._frictions, _CREEPAGES)
        raise_on_failure(_scan(model, order, self._radii, fmu.defaults["muWR"], grid, peaks), fmu)
        self._peaks = RegularGridInterpolator(
            (np.log(self._speeds), self._frictions), peaks, bounds_error=False
        )

    def utilisation(self, values: Matrix) -> Vector:
        """Share of the peak force that is used, 1 beyond the peak.

        Parameters
        ----------
        values : (n, w) estimates, columns as in `System.columns`.

        Returns
        -------
        utilisation : (n,) [1], from 0 to 1; NaN where force or friction are not estimated.
        """
        omegaR, muWR, force, slip = (
            values[:, self._columns.index(name)] for name in ("omegaR", "muWR", "Fx", "slip")
        )
        speed = np.clip(self._radii[1] * np.abs(omegaR), self._speeds[0], self._speeds[-1])
        friction = np.clip(muWR, self._frictions[0], self._frictions[-1])
        peak, slip_at_peak = self._peaks(np.column_stack([np.log(speed), friction])).T
        used = np.minimum(np.abs(force) / peak, 1.0)
        return np.where(np.abs(slip) > slip_at_peak, 1.0, used)

    def valid(self, values: Matrix) -> NDArray[np.bool_]:
        """Where an estimate of muWR is valid: much of the adhesion is used, the wheelset rolls.

        A muWR that is still exactly the nominal one has not been estimated.

        The condition is necessary, not sufficient: the estimate is as good as the shape of the
        model's creep law. Where that is the plant's, estimates err by 2 to 4 % (rms; 6 % by the
        parameter estimator at 0.12). On wet rails of the virtual rig, which the system file
        excludes, they would be 14 to 79 % too low (median of a stop), and 46 % too high in a slide,
        where wet friction falls less than that of the dry law.

        Parameters
        ----------
        values : (n, w) estimates, columns as in `System.columns`.
        """
        speed = self._radii[1] * np.abs(values[:, self._columns.index("omegaR")])
        learned = values[:, self._columns.index("dmuWR")] != 0.0
        used = self.utilisation(values) > LEAST_UTILISATION
        valid: NDArray[np.bool_] = used & learned & (speed > self._slowest)
        return valid


def _adhesion(fmu: FMU, system: System, values: Matrix) -> NDArray[np.bool_]:
    return PeakForce(fmu, system).valid(values)


# By estimated quantity: where an estimate, (n, w), is one, (n,).
VALIDITY = {"muWR": _adhesion}
