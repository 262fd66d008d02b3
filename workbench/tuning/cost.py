"""What a candidate costs, equation (12) of Schwarz et al. (2018): no more than decides."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple, Protocol, Self

import numpy as np
from scipy.linalg import expm

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError, InputError, WorkerError
from workbench.models.fmu import FMU
from workbench.observers import Estimator, Gains, estimators_of
from workbench.observers.operating import linearised
from workbench.observers.score import (
    corner,
    integrate,
    references,
    samples,
    scored_column,
    weights,
)
from workbench.recordings.case import Case, Value
from workbench.runtime.pool import Pool
from workbench.system.registry import open_file
from workbench.system.system import System

PIECES = 4  # of a recording; a call of a compiled loop costs as much as 200 of its samples
LATER = 4  # times the time that is allowed, when what a leak takes shows
DIVERGED = 1e3  # z of mean deviations that weigh a thousand times one: no estimate


class Recording(NamedTuple):
    """A case as the loop reads it."""

    name: str  # of the case, and how it differs from what was recorded
    case: str  # its name
    steps: Vector  # (n,) from the sample before [s]
    # u, y: (n, m) and (n, l) measured inputs and outputs
    u: Matrix
    y: Matrix
    reference: Matrix  # (n, w) measured signals that the objective weighs
    shares: Vector  # (n,) weight of each sample in the time average (trapezoidal rule) [1]
    conditions: Mapping[str, Value]  # of the case

    @property
    def sampled(self) -> tuple[Vector, Matrix, Matrix, Matrix, Vector]:
        """Steps, inputs, outputs, what scores, and shares."""
        return self.steps, self.u, self.y, self.reference, self.shares

    def part(self, samples: slice) -> "Recording":
        """A piece of it."""
        steps, u, y, reference, shares = (values[samples] for values in self.sampled)
        return self._replace(steps=steps, u=u, y=y, reference=reference, shares=shares)


def recordings(
    cases: Sequence[Case], system: System, scale_errors: Mapping[str, float]
) -> tuple[Recording, ...]:
    """Prepare cases, each as it is and with outputs whose scale is not quite as in the model.

    Without the latter gains come to trust the difference of two outputs to the last digit, and fail
    on a machine that is not known as well.

    Parameters
    ----------
    scale_errors : by output, relative [1]; alternately too small and too large.
    """
    prepared = [recording(case, system) for case in cases]
    for output, error in scale_errors.items():
        signs = (error if i % 2 == 0 else -error for i in range(len(cases)))
        prepared += [
            _rescale(recording, case, output, sign, system)
            for recording, case, sign in zip(prepared, cases, signs, strict=False)
        ]
    return tuple(prepared)


def recording(case: Case, system: System) -> Recording:
    """Prepare a case; see `recordings`."""
    names = list(system.objective.weights)
    if missing := [name for name in names if name not in case]:
        raise InputError(
            where=str(case.source),
            found=f"no column '{missing[0]}'",
            expected="all measured signals by which gains are scored",
            remedy="leave this case out of the tuning with --cases",
        )
    steps, shares = samples(case.time)
    signals = case.u.copy(), case.y.copy(), references(case, system)
    return Recording(case.name, case.name, steps, *signals, shares, case.conditions)


def _rescale(
    original: Recording, case: Case, output: str, error: float, system: System
) -> Recording:
    """The recording of a sensor whose scale is wrong by a share."""
    scaled = recording(case.with_signals({output: case[output] * (1.0 + error)}), system)
    return scaled._replace(name=f"{original.case}, {output} {error:+.2%}")


@dataclass(frozen=True, eq=False)
class Job:
    """All that a worker needs to evaluate candidates, on any machine."""

    estimator: str  # its name
    system: System  # whose signals are judged, as its objective says
    fmu: bytes  # the model file's bytes
    gains: Gains  # reasoned gains; what is not tuned is taken from them
    recordings: tuple[Recording, ...]
    follows: bool = True  # whether gains must find a step of a quantity in time, as the system says


def load_model(job: Job) -> FMU:
    """Open the model of a job, on any machine."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "model.fmu"
        path.write_bytes(job.fmu)
        return open_file(path, job.system)


def job_estimator(job: Job, fmu: FMU, gains: Gains) -> Estimator:
    """The estimator of a job with some gains."""
    return estimators_of(job.system)[job.estimator](fmu, job.system, gains)


class Settling:
    """Error of a quantity after a step of it, from the model linearised at the design point.

    z judges what is measured. An observer may have that right by correcting its states directly,
    while its quantities drift behind, and they are what it is asked for. Such candidates are
    refused.

    Parameters
    ----------
    fmu : the estimator's model; its state is left at the operating point.
    estimator : its class.
    """

    def __init__(self, fmu: FMU, system: System, estimator: type[Estimator]) -> None:
        self._model = linearised(fmu, system).of(estimator.acts_on(fmu, system))
        self._estimator, self._asked = estimator, system.following
        self._names = [quantity.name for quantity in system.estimated]

    def left(self, gains: Gains) -> float:
        """Share of the step that is not found after the time allowed or later, the larger [1].

        A method that makes its gains as it goes is not judged.
        """
        model, asked = self._model, self._asked
        error_model = self._estimator.error_dynamics(model.A, model.B, model.C, gains)
        if error_model is None or asked is None:
            return 0.0
        dynamics, error = error_model
        quantity = self._names.index(asked.quantity)
        transition = expm(dynamics * asked.within)
        later = np.linalg.matrix_power(transition, LATER)
        column = quantity - len(self._names)
        return max(abs(float(error[quantity] @ power[:, column])) for power in (transition, later))

    def follows(self, gains: Gains) -> bool:
        """Whether a step is found in time, as the system asks."""
        return self._asked is None or self.left(gains) < self._asked.left


class Candidate(NamedTuple):
    """Gains to be evaluated."""

    values: Vector  # (n,) gains
    limit: float  # z beyond which the candidate has lost
    order: tuple[int, ...]  # cases to be evaluated on, the one that decides most often first


class Evaluation(NamedTuple):
    """What became of one candidate."""

    # worst of z_k; infinite if the candidate has lost, failed or finds a quantity too slowly
    z: float
    z_k: Vector  # (k,) of all cases of the job; infinite where not known
    samples: int  # how many were evaluated
    unstable: int  # case in which the estimate diverged or the FMU failed; -1 if none
    crashed: bool = False  # whether it killed its worker, or took too long


class Evaluator:
    """A model and its recordings, ready for one candidate after the other."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._fmu = load_model(job)
        estimator = estimators_of(job.system)[job.estimator]
        names = list(estimator.fed(job.system).columns)
        self._settling = Settling(self._fmu, job.system, estimator) if job.follows else None
        scored = [scored_column(job.system, names, n) for n in job.system.objective.weights]
        self._scored = [names.index(name) for name in scored]
        # The loop is compiled here, so that no candidate's time is spent on it.
        start = job.recordings[0].part(slice(PIECES))
        self._evaluate_case(job_estimator(job, self._fmu, job.gains), start, np.inf)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        """Free the model."""
        self._fmu.close()

    def evaluate(self, candidate: Candidate) -> Evaluation:
        """Evaluate a candidate until it has lost, or to the end, and then how fast it follows.

        The integral of equation (12) only grows, piece by piece and in floating point too, so what
        is dropped has lost for certain.
        """
        job = self._job
        gains = job.gains.with_values(candidate.values)
        z_k = np.full(len(job.recordings), np.inf)
        estimator = job_estimator(job, self._fmu, gains)
        samples = 0
        limit = min(candidate.limit, DIVERGED)
        for k in candidate.order:
            z, done = self._evaluate_case(estimator, job.recordings[k], limit)
            samples += done
            if not z <= limit:
                nothing = np.full(z_k.size, np.inf)
                return Evaluation(np.inf, nothing, samples, -1 if z <= DIVERGED else k)
            z_k[k] = z
        # Last, because few candidates come this far.
        if self._settling is not None and not self._settling.follows(gains):
            return Evaluation(np.inf, np.full(z_k.size, np.inf), samples, -1)
        return Evaluation(float(z_k[list(candidate.order)].max()), z_k, samples, -1)

    def _evaluate_case(
        self, estimator: Estimator, case: Recording, limit: float
    ) -> tuple[float, int]:
        """The z of one case, or the part of it that is beyond the limit, and samples evaluated."""
        z, size = 0.0, case.steps.size
        edges = [size * i // PIECES for i in range(PIECES + 1)]
        objective = self._job.system.objective
        shares = weights(objective)
        low_pass, pole = np.zeros((2, shares.size)), corner(objective)
        end = 0
        try:
            estimator.set_conditions(case.conditions)
            estimator.start(case.u[0], case.y[0])
            for begin, end in pairwise(edges):
                part = slice(begin, end)
                steps, y = case.steps[part], case.y[part]
                values = estimator.advance_values(steps, case.u[part], y)
                deviations = values[:, self._scored] - case.reference[part]
                z = integrate(z, low_pass, deviations, shares, steps, case.shares[part], pole)
                if not z <= limit:
                    break
        except FMUError:
            self._fmu.renew(reload=False)
            return np.nan, end
        return z, end


LIMIT = 60.0  # [s] for one candidate, which takes about 0.1 s


class Workers(Protocol):
    """Who evaluates candidates: a `workbench.runtime.pool.Pool`, or one like it."""

    def submit_all(
        self,
        function: Callable[[Evaluator, Candidate], Evaluation],
        calls: Sequence[tuple[Candidate]],
        /,
    ) -> "list[Future[Evaluation]]":
        """Have workers evaluate candidates.

        WorkerError of one that they cannot, NoWorkersError if there is none.
        """


def evaluators(job: Job, workers: int, limit: float = LIMIT) -> Pool[Evaluator]:
    """Processes of this machine that evaluate candidates of a job.

    Parameters
    ----------
    limit : for one candidate [s].
    """
    return Pool(workers, Evaluator, job, limit=limit)


def evaluate_all(pool: Workers, candidates: Sequence[Candidate], cases: int) -> list[Evaluation]:
    """Evaluate candidates; one that kills its workers, or takes too long, is infinitely bad."""
    tasks: list[Future[Evaluation]] = []
    evaluations = []
    try:
        tasks = pool.submit_all(Evaluator.evaluate, [(candidate,) for candidate in candidates])
        for candidate, task in zip(candidates, tasks, strict=True):
            try:
                evaluations.append(task.result())
            except WorkerError:
                lost = np.full(cases, np.inf)
                evaluations.append(Evaluation(np.inf, lost, 0, candidate.order[0], crashed=True))
    finally:
        # After Ctrl-C nobody waits for the others.
        for task in tasks:
            task.cancel()
    return evaluations
