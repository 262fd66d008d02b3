"""Tuning, a stage after the objective: gains that minimise z = max_k z_k over recorded cases.

Equations (11) and (12) of Schwarz, Brembeck, Heckmann (2018), by differential evolution.
"""

from workbench.runtime.pool import NoWorkersError as NoWorkersError
from workbench.tuning.checkpoint import Generation as Generation
from workbench.tuning.cost import LIMIT as LIMIT
from workbench.tuning.cost import Candidate as Candidate
from workbench.tuning.cost import Evaluation as Evaluation
from workbench.tuning.cost import Evaluator as Evaluator
from workbench.tuning.cost import Job as Job
from workbench.tuning.cost import Workers as Workers
from workbench.tuning.cost import evaluate_all as evaluate_all
from workbench.tuning.cost import evaluators as evaluators
from workbench.tuning.cost import recording as recording
from workbench.tuning.recipe import Lines as Lines
from workbench.tuning.recipe import Problem as Problem
from workbench.tuning.recipe import Progress as Progress
from workbench.tuning.recipe import TuningResult as TuningResult
from workbench.tuning.recipe import cross_validate as cross_validate
from workbench.tuning.recipe import evaluate_gains as evaluate_gains
from workbench.tuning.recipe import pose as pose
from workbench.tuning.recipe import sensitivities as sensitivities
from workbench.tuning.recipe import summarise_tuning as summarise_tuning
from workbench.tuning.recipe import tunable as tunable
from workbench.tuning.recipe import tune as tune
from workbench.tuning.recipe import tuned_gains as tuned_gains
from workbench.tuning.search import Checkpointing as Checkpointing
from workbench.tuning.search import Plan as Plan
from workbench.tuning.search import Search as Search
from workbench.tuning.search import search as search
