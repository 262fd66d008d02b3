"""The virtual rig: recordings from the multibody model, its drive, its brake and its sensors.

Nothing here reads an estimator, and no estimator reads the truth that is written here.
"""

from workbench.machines.wheelset.rig.effects import CONSTANT_PADS, ORDINARY_PADS, Effects, plant
from workbench.machines.wheelset.rig.files import check_files, write_recording
from workbench.machines.wheelset.rig.proposed import proposed_stop, stop_of
from workbench.machines.wheelset.rig.run import TRUTH, Drawn, Phases, StopTruth, simulate
from workbench.machines.wheelset.rig.scenarios import (
    SCENARIOS,
    STANDARD,
    Conditions,
    Scenario,
    select,
)
from workbench.machines.wheelset.rig.sensors import MEASURED, received, sample

__all__ = [
    "CONSTANT_PADS",
    "MEASURED",
    "ORDINARY_PADS",
    "SCENARIOS",
    "STANDARD",
    "TRUTH",
    "Conditions",
    "Drawn",
    "Effects",
    "Phases",
    "Scenario",
    "StopTruth",
    "check_files",
    "plant",
    "proposed_stop",
    "received",
    "sample",
    "select",
    "simulate",
    "stop_of",
    "write_recording",
]
