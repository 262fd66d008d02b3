"""An estimator beside a recording, stage 4."""

import enum
import time
from dataclasses import dataclass

import numpy as np

from workbench.case import Case
from workbench.fmu import FMUError, Matrix, Vector
from workbench.observers import ESTIMATE, Estimator


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
    estimate : (n, 6) columns as in ESTIMATE, NaN where not estimated, and after a failure.
    outcome : how it ended.
    message : what the FMU said, empty if nothing.
    seconds : wall time.
    """

    case: str
    estimator: str
    time: Vector
    estimate: Matrix
    outcome: Outcome
    message: str
    seconds: float

    def signal(self, name: str) -> Vector:
        """One column of the estimate, (n,)."""
        return self.estimate[:, list(ESTIMATE).index(name)]


def observe(case: Case, estimator: Estimator) -> Run:
    """Feed a recording to an estimator, sample by sample; a failure is a value of the run."""
    begin = time.perf_counter()
    estimate = np.full((case.time.size, len(ESTIMATE)), np.nan)
    outcome, message = Outcome.OK, ""
    u, y = case.u, case.y
    force = list(ESTIMATE).index("Fx")
    try:
        estimate[0] = estimator.init(case.time[0], u[0], y[0])
        for k in range(1, case.time.size):
            estimate[k] = estimator.step(case.time[k], u[k], y[k])
            if not np.isfinite(estimate[k, force]):
                outcome = Outcome.NOT_FINITE
                message = f"at t = {case.time[k]:.3f} s"
                break
    except (FMUError, np.linalg.LinAlgError) as error:
        outcome, message = Outcome.FMU_FAILED, str(error)
    return Run(
        case=case.name,
        estimator=estimator.name,
        time=case.time,
        estimate=estimate,
        outcome=outcome,
        message=message,
        seconds=time.perf_counter() - begin,
    )
