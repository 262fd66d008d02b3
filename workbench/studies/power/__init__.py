"""Power of the diagnosis: how often it is right, by Monte Carlo over a virtual rig.

plan -> sets of recordings by the virtual rig -> verdicts -> statistics
"""

from workbench.studies.power.journal import Journal as Journal
from workbench.studies.power.journal import NamedCause as NamedCause
from workbench.studies.power.journal import SetVerdict as SetVerdict
from workbench.studies.power.planting import Plantable as Plantable
from workbench.studies.power.planting import Planting as Planting
from workbench.studies.power.planting import Repertoire as Repertoire
from workbench.studies.power.planting import Scale as Scale
from workbench.studies.power.planting import plan as plan
from workbench.studies.power.run import PowerStudy as PowerStudy
from workbench.studies.power.run import diagnose_sets as diagnose_sets
from workbench.studies.power.statistics import CLEAR as CLEAR
from workbench.studies.power.statistics import share as share
from workbench.studies.power.statistics import summarise as summarise
from workbench.studies.power.virtual_rig import VirtualRig as VirtualRig
from workbench.studies.power.virtual_rig import open_virtual_rig as open_virtual_rig
from workbench.studies.power.virtual_rig import read_recorded_sets as read_recorded_sets
