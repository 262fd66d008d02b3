"""Diagnosis: what a simulation gets wrong, the physical cause, and a better model.

    recordings -> samples -> prediction errors -> evidence -> fit -> search -> verdict -> extension
        -> errors on recordings that were held out

One FMU holds the observer model with every effect of the catalogue at size zero; an effect is
switched on by a parameter.
"""

from workbench.diagnosis.effects.catalogue import Effect, choose, read_effects
from workbench.diagnosis.inference.causes import Cause, Interval
from workbench.diagnosis.inference.residuals import Dependence, Residuals
from workbench.diagnosis.inference.sample_errors import Errors
from workbench.diagnosis.inference.verdict import Diagnosis, Gain
from workbench.diagnosis.outcome import Extension, Outcome
from workbench.diagnosis.problem import Problem, catalogue, library_of, problem_of
from workbench.diagnosis.run import build_everything, diagnose, given_values

__all__ = [
    "Cause",
    "Dependence",
    "Diagnosis",
    "Effect",
    "Errors",
    "Extension",
    "Gain",
    "Interval",
    "Outcome",
    "Problem",
    "Residuals",
    "build_everything",
    "catalogue",
    "choose",
    "diagnose",
    "given_values",
    "library_of",
    "problem_of",
    "read_effects",
]
