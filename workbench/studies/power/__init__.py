"""Power of the diagnosis: how often it is right, by Monte Carlo over a virtual rig.

plan -> sets of recordings by the virtual rig -> verdicts -> statistics
"""

from workbench.studies.power.journal import Journal, NamedCause, SetVerdict
from workbench.studies.power.planting import Findable, Plantable, Planting, Repertoire, plan
from workbench.studies.power.run import PowerStudy, diagnose_sets
from workbench.studies.power.statistics import CLEAR, VISIBLE, share, summarise
from workbench.studies.power.virtual_rig import (
    RecordedSets,
    VirtualRig,
    open_virtual_rig,
    read_recorded_sets,
)

__all__ = [
    "CLEAR",
    "VISIBLE",
    "Findable",
    "Journal",
    "NamedCause",
    "Plantable",
    "Planting",
    "PowerStudy",
    "RecordedSets",
    "Repertoire",
    "SetVerdict",
    "VirtualRig",
    "diagnose_sets",
    "open_virtual_rig",
    "plan",
    "read_recorded_sets",
    "share",
    "summarise",
]
