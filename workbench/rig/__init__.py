"""The virtual rig: recordings from the multibody model, its drive, its brake and its sensors.

Nothing here reads an estimator, and no estimator reads the truth that is written here.
"""

from workbench.rig.effects import CONSTANT_PADS, ORDINARY_PADS, Effects, plant
from workbench.rig.files import check_files, write_recording
from workbench.rig.run import TRUTH, Drawn, Phases, Stop, simulate
from workbench.rig.scenarios import SCENARIOS, STANDARD, Scenario, select
from workbench.rig.sensors import MEASURED, measure, received

__all__ = [
    "CONSTANT_PADS",
    "MEASURED",
    "ORDINARY_PADS",
    "SCENARIOS",
    "STANDARD",
    "TRUTH",
    "Drawn",
    "Effects",
    "Phases",
    "Scenario",
    "Stop",
    "check_files",
    "measure",
    "plant",
    "received",
    "select",
    "simulate",
    "write_recording",
]
