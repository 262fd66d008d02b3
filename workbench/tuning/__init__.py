"""Tuning, a stage after the objective: gains that minimise z = max_k z_k over recorded cases.

Equations (11) and (12) of Schwarz, Brembeck, Heckmann (2018), by differential evolution.
"""

from workbench.tuning.checkpoint import Generation
from workbench.tuning.cost import Candidate, Evaluation, Evaluator, Job, recording, recordings
from workbench.tuning.figures import draw_cases, draw_convergence
from workbench.tuning.gains import (
    DEFAULTS,
    default_settings,
    format_gains,
    read_gains,
    with_tuned,
)
from workbench.tuning.recipe import RADIUS_ERROR, Problem, Progress, Tuned, prepare, tune
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
from workbench.tuning.summary import summarise, tuned_gains
from workbench.tuning.validation import (
    Fold,
    Sensitivity,
    cross_validate,
    evaluate_gains,
    sensitivities,
    untuned_filter,
)
from workbench.tuning.workers import LIMIT, Workers, evaluate_all, evaluators

__all__ = [
    "DEFAULTS",
    "LIMIT",
    "RADIUS_ERROR",
    "TUNABLE",
    "Candidate",
    "Evaluation",
    "Evaluator",
    "Fold",
    "Gains",
    "Generation",
    "Job",
    "Plan",
    "Problem",
    "Progress",
    "Search",
    "SearchSpace",
    "Sensitivity",
    "Tuned",
    "Workers",
    "(",
    ")",
    "cross_validate",
    "default_settings",
    "draw_cases",
    "draw_convergence",
    "evaluate_all",
    "evaluate_gains",
    "evaluators",
    "format_gains",
    "from",
    "from_vector",
    "gain_names",
    "import",
    "prepare",
    "read_gains",
    "reasoned_gains",
    "recording",
    "recordings",
    "search",
    "search_space",
    "sensitivities",
    "summarise",
    "to_vector",
    "tune",
    "tuned_gains",
    "untuned_filter",
    "with_tuned",
    "workbench.tuning.cost",
    "workbench.tuning.figures",
    "workbench.tuning.gains",
    "workbench.tuning.recipe",
    "workbench.tuning.search",
    "workbench.tuning.space",
    "workbench.tuning.summary",
    "workbench.tuning.validation",
    "workbench.tuning.workers",
]
