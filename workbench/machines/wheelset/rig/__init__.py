"""The virtual rig: recordings from the multibody model, its drive, its brake and its sensors.

Nothing here reads an estimator, and no estimator reads the truth that is written here.
"""

from workbench.machines.wheelset.rig.effects import CONSTANT_PADS as CONSTANT_PADS
from workbench.machines.wheelset.rig.effects import ORDINARY_PADS as ORDINARY_PADS
from workbench.machines.wheelset.rig.effects import Effects as Effects
from workbench.machines.wheelset.rig.effects import plant as plant
from workbench.machines.wheelset.rig.files import check_files as check_files
from workbench.machines.wheelset.rig.files import write_recording as write_recording
from workbench.machines.wheelset.rig.proposed import proposed_stop as proposed_stop
from workbench.machines.wheelset.rig.proposed import stop_of as stop_of
from workbench.machines.wheelset.rig.run import TRUTH as TRUTH
from workbench.machines.wheelset.rig.run import StopTruth as StopTruth
from workbench.machines.wheelset.rig.run import simulate as simulate
from workbench.machines.wheelset.rig.scenarios import SCENARIOS as SCENARIOS
from workbench.machines.wheelset.rig.scenarios import STANDARD as STANDARD
from workbench.machines.wheelset.rig.scenarios import Scenario as Scenario
from workbench.machines.wheelset.rig.scenarios import select as select
from workbench.machines.wheelset.rig.sensors import sample as sample
