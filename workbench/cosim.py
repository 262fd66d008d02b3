"""An estimator beside a recording, stage 4."""

import enum
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.case import Case
from workbench.errors import FMUError
from workbench.fmu import Matrix, Vector
from workbench.observers import ESTIMATE, MODELLED_CONTACT, Estimate, Estimator, PeakForce


class Outcome(enum.Enum):
    """How a run ended; the value is the sentence for people."""

    OK = "ran to the end"
    NOT_FINITE = "the estimate left the finite numbers; the gains may be unstable"
    FMU_FAILED = "the FMU refused a call"


@dataclass(frozen=True)
class Run:
    """What one estimator made of one case.

    Attributes
    ----------
    case, estimator : names.
    time : (n,) [s].
    estimate : (n, 8) columns as in ESTIMATE, NaN where not estimated, and after a failure.
    sigma : (n, 8) standard deviations, NaN where the method has none.
    nis : (n,) normalised innovation squared, NaN where the method has none.
    outcome : how it ended.
    message : what the FMU said, empty if nothing.
    seconds : wall time of the estimator.
    muWR_claimed : (n,) whether muWR is an estimate; elsewhere it is a guess that fits as well as
        any other, see PeakForce.claims, or stands in for a contact that the model has not.
    """

    case: str
    estimator: str
    time: Vector
    estimate: Matrix
    sigma: Matrix
    nis: Vector
    outcome: Outcome
    message: str
    seconds: float
    muWR_claimed: NDArray[np.bool_]

    def signal(self, name: str) -> Vector:
        """One column of the estimate, (n,)."""
        return self.estimate[:, list(ESTIMATE).index(name)]


def observe(case: Case, estimator: Estimator) -> Run:
    """Feed a recording to an estimator, sample by sample; a failure is a value of the run."""
    begin = time.perf_counter()
    blank = np.full((case.time.size, len(ESTIMATE)), np.nan)
    estimate = Estimate(blank, blank, blank[:, 0])
    claimed = np.zeros(case.time.size, bool)
    outcome, message = Outcome.OK, ""
    try:
        estimate = estimator.run(case.time, case.u, case.y)
        force = estimate.values[:, list(ESTIMATE).index("Fx")]
        if (lost := np.flatnonzero(~np.isfinite(force))).size:
            outcome = Outcome.NOT_FINITE
            message = f"at t = {case.time[lost[0]]:.3f} s"
        seconds = time.perf_counter() - begin
        if case.conditions.wheel_rail == MODELLED_CONTACT:
            claimed = PeakForce(estimator.fmu).claims(estimate.values)
    except FMUError as error:
        seconds = time.perf_counter() - begin
        outcome, message = Outcome.FMU_FAILED, str(error)
    return Run(
        case=case.name,
        estimator=estimator.name,
        time=case.time,
        estimate=estimate.values,
        sigma=estimate.sigma,
        nis=np.asarray(estimate.nis),
        outcome=outcome,
        message=message,
        seconds=seconds,
        muWR_claimed=claimed,
    )
