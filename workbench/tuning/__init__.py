"""Tuning, a stage after the objective: gains that minimise z = max_k z_k over recorded cases.

Equations (11) and (12) of Schwarz, Brembeck, Heckmann (2018), by differential evolution.
"""

from workbench.runtime.pool import NoWorkersError
from workbench.tuning.checkpoint import Generation
from workbench.tuning.cost import (
    LIMIT,
    Candidate,
    Evaluation,
    Evaluator,
    Job,
    Workers,
    evaluate_all,
    evaluators,
    recording,
    recordings,
)
from workbench.tuning.recipe import (
    Lines,
    Problem,
    Progress,
    TuningResult,
    pose,
    summarise_tuning,
    tunable,
    tune,
    tuned_gains,
)
from workbench.tuning.search import Checkpointing, Plan, Search, search
from workbench.tuning.validation import (
    Fold,
    Sensitivity,
    cross_validate,
    evaluate_gains,
    sensitivities,
    untuned_filters,
)

__all__ = [
    "LIMIT",
    "Candidate",
    "Checkpointing",
    "Evaluation",
    "Evaluator",
    "Fold",
    "Generation",
    "Job",
    "Lines",
    "NoWorkersError",
    "Plan",
    "Problem",
    "Progress",
    "Search",
    "Sensitivity",
    "TuningResult",
    "Workers",
    "cross_validate",
    "evaluate_all",
    "evaluate_gains",
    "evaluators",
    "pose",
    "recording",
    "recordings",
    "search",
    "sensitivities",
    "summarise_tuning",
    "tunable",
    "tune",
    "tuned_gains",
    "untuned_filters",
]
