"""Power of the diagnosis: how often it is right, by Monte Carlo over the virtual rig.

plan -> sets of stops by the reference model -> verdicts -> statistics
"""

from workbench.power.journal import Journal, Judged, Named
from workbench.power.planting import PLANTABLE, Plantable, Planting, plan
from workbench.power.run import measure_power
from workbench.power.statistics import CLEAR, VISIBLE, share, summarise

__all__ = [
    "CLEAR",
    "PLANTABLE",
    "VISIBLE",
    "Journal",
    "Judged",
    "Named",
    "Plantable",
    "Planting",
    "measure_power",
    "plan",
    "share",
    "summarise",
]
