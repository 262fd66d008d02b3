"""How far a proposed law is from the true one, along recordings that neither was fitted to."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from workbench.arrays import Vector
from workbench.diagnosis import Outcome, Problem, given_values
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.effects.extension import ExtendedModel, build
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.search import FittedModel
from workbench.diagnosis.laws import Proposal
from workbench.diagnosis.laws.scan import watching
from workbench.diagnosis.laws.writing import extended_library
from workbench.diagnosis.simulation.residual_model import ResidualModel


def function_error(
    problem: Problem, known: Outcome, proposal: Proposal, effect: Effect
) -> float | None:
    """Error of the first law that is proposed, over the range of what the true cause does.

    Both are what the output of their slot becomes, as each was fitted, with the levels that were
    calibrated beside it.

    Parameters
    ----------
    problem : whose recordings were not fitted.
    known : of the diagnosis with the true cause in its catalogue.
    effect : that cause, of the library.

    Returns
    -------
    error : root mean square over range; None where the law acts elsewhere, the true cause was not
        found, or phases are free in each recording.
    """
    if not proposal.laws or proposal.outcome is None:
        return None
    law = proposal.forms[proposal.laws[0].effect.name].law
    true, proposed = known.diagnosis.best, proposal.outcome.diagnosis.best
    every = {effect.name: effect for effect in (*true.active, *proposed.active)}
    elsewhere = law.place.slot.name not in effect.slots or effect not in true.active
    if elsewhere or any(effect.order_locked for effect in every.values()):
        return None
    with tempfile.TemporaryDirectory() as scratch:
        written = [proposal.forms[cause.effect.name].written for cause in proposal.laws]
        extended = extended_library(problem.library, written, Path(scratch))
        effects, path = list(every.values()), Path(scratch) / "Both.fmu"
        about = "With the law and the true cause"
        text = ExtendedModel(extended, problem.base, "Both", effects, about).source()
        output = f"{law.place.slot.name}.{law.place.output.name}"
        build(extended, "Both", watching(text, [output]), path, every_platform=False)
        both = ModelSource(path, problem.system, given_values(path, problem.system))
        with ResidualModel(both, problem.cases) as simulations:
            fit = Fit(simulations, effects)
            without, right, seen = (
                _along(simulations, fit, model) for model in (known.diagnosis.base, true, proposed)
            )
    return float(np.sqrt(np.mean((seen - right) ** 2)) / np.ptp(right - without))


def _along(simulations: ResidualModel, fit: Fit, fitted: FittedModel) -> Vector:
    """What is watched, along all recordings, as a model was fitted, each recording as usual."""
    usual = np.zeros((fit.unknowns.count, fitted.point.deviations.shape[1]))
    point = replace(fitted.point, deviations=usual)
    tables = simulations.along(fit.unknowns.values(point), ["watched0"])
    return np.concatenate([table[:, 0] for table in tables])
