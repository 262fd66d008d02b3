"""Tuning, a stage after the objective: gains that minimise z = max_k z_k over recorded cases.

Equations (11) and (12) of Schwarz, Brembeck, Heckmann (2018), by differential evolution.
"""

from workbench.tuning.checkpoint import Generation, write_whole
from workbench.tuning.cost import Job, recording, recordings
from workbench.tuning.figures import draw_cases, draw_convergence
from workbench.tuning.gains import (
    DEFAULTS,
    default_settings,
    format_gains,
    read_gains,
    with_tuned,
)
from workbench.tuning.search import Plan, Search, search
from workbench.tuning.space import (
    TUNABLE,
    Gains,
    SearchSpace,
    from_vector,
    gain_names,
    reasoned_gains,
    search_space,
    to_vector,
)
from workbench.tuning.validation import (
    Fold,
    Sensitivity,
    cross_validate,
    judge_gains,
    sensitivities,
    untuned_filter,
)
from workbench.tuning.workers import Pool, ProcessPool

__all__ = [
    "DEFAULTS",
    "TUNABLE",
    "Fold",
    "Gains",
    "Generation",
    "Job",
    "Plan",
    "Pool",
    "ProcessPool",
    "Search",
    "SearchSpace",
    "Sensitivity",
    "cross_validate",
    "default_settings",
    "draw_cases",
    "draw_convergence",
    "format_gains",
    "from_vector",
    "gain_names",
    "judge_gains",
    "read_gains",
    "reasoned_gains",
    "recording",
    "recordings",
    "search",
    "search_space",
    "sensitivities",
    "to_vector",
    "untuned_filter",
    "with_tuned",
    "write_whole",
]
