"""The truth that the virtual rig writes beside a recording, which no estimator sees."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.arrays import Vector
from workbench.errors import InputError
from workbench.machines.wheelset.rig import TRUTH
from workbench.recordings.case import Case
from workbench.recordings.csv import read_columns
from workbench.system.system import System

_DISCS = ("muDC1", "muDC2", "muDC3")
_READ = ("Fx", "slip", "omegaW", "omegaR", "muWR", "pads", *_DISCS)
_PADS_TOUCH = 25e3  # [Pa] 0.25 bar balance the return springs, data sheet
BUILT_UP = (3.0, 6.0)  # [s] after the first contact


@dataclass(frozen=True, eq=False)
class Truth:
    """True signals at the times of a recording."""

    Fx: Vector  # (n,) contact force [N]
    slip: Vector  # (n,) velocity [m/s]
    # omegaW, omegaR: (n,) speeds of the wheelset and of the roller [rad/s]
    omegaW: Vector
    omegaR: Vector
    muWR: Vector  # (n,) friction of the contact at zero slip velocity [1]
    # (n,) friction of the pads [1]. The mean of the discs is what an axle can show; they are
    # pressed with the same force.
    muDC: Vector
    contact: float  # [s] when the pads first touch the discs


def rolling_speed(system: System, omegaR: Vector) -> Vector:
    """Rolling velocity of a nominal roller [m/s], (n,)."""
    return np.abs(system.signal("speed", {"omegaR": omegaR}))


def lowest_speed(system: System) -> float:
    """Rolling velocity down to which estimates count [m/s]."""
    ends = system.objective.ends
    return ends.level if ends else 0.0


def read_truth(case: Case, system: System) -> Truth:
    """Read the truth beside a recording, at the times of the recording.

    Raises
    ------
    InputError
        If there is none, or the stop ends before the force is built up.
    """
    path = case.source.parent / "truth.csv"
    if not path.exists():
        raise InputError(
            where=str(case.source.parent),
            found="no truth.csv beside the recording",
            expected="a case of the simulated rig, which writes the truth that scores estimators",
            remedy="make cases with 'workbench rig --out DIR' and score these; recordings without "
            "truth are for 'workbench simulate'",
        )
    columns = _read_si(path)
    # The rig may have kept the truth of every Nth sample only.
    signals = {name: np.interp(case.time, columns["time"], columns[name]) for name in _READ}
    contact = _first_contact(case, signals, system)
    muDC: Vector = np.mean([signals[name] for name in _DISCS], axis=0)
    return Truth(
        Fx=signals["Fx"],
        slip=signals["slip"],
        omegaW=signals["omegaW"],
        omegaR=signals["omegaR"],
        muWR=signals["muWR"],
        muDC=muDC,
        contact=contact,
    )


def _read_si(path: Path) -> dict[str, Vector]:
    """Columns of truth.csv, which the rig writes in SI units, (m,) each."""
    units = {"time": "s"} | {name: TRUTH[name] for name in _READ}
    columns = read_columns(path, list(units))
    for name, unit in units.items():
        if columns[name].unit != unit:
            raise InputError(
                where=f"{path}, line 1, column '{name}'",
                found=f"unit [{columns[name].unit}]",
                expected=f"[{unit}], as the rig writes it",
                remedy="make the case anew with 'workbench rig'",
            )
    return {name: column.values for name, column in columns.items()}


def _first_contact(case: Case, signals: Mapping[str, Vector], system: System) -> float:
    """Time of the first contact [s]."""
    touching = signals["pads"] > _PADS_TOUCH
    contact = float(case.time[np.argmax(touching)])
    fast = rolling_speed(system, signals["omegaR"]) > lowest_speed(system)
    if not (touching & fast & (case.time >= contact + BUILT_UP[0])).any():
        raise InputError(
            where=str(case.source.parent / "truth.csv"),
            found="a stop that ends before its force is built up",
            expected=f"{BUILT_UP[0]:g} s or more from the first contact of the pads to "
            f"{lowest_speed(system):g} m/s",
            remedy="leave this case out, or make one that begins faster",
        )
    return contact
