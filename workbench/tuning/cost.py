"""What a candidate costs, equation (12) of Schwarz et al. (2018): no more than decides."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from workbench.case import Case
from workbench.errors import FMUError, InputError
from workbench.fmu import FMU, Matrix, Vector
from workbench.objective import Weights, integrate, samples
from workbench.observers import ESTIMATE, Estimator
from workbench.tuning.settling import SETTLED, Settling
from workbench.tuning.space import Gains, build, from_vector

PIECES = 4  # of a recording; a call of a compiled loop costs as much as 200 of its samples
DIVERGED = 1e3  # z of a mean error of 1000 rad/s or 1 MN: no estimate of a brake stop
_JUDGED = [list(ESTIMATE).index(name) for name in ("omegaW", "omegaR", "Fx")]


class Recording(NamedTuple):
    """A case as the loop reads it.

    Attributes
    ----------
    name : of the case, and how it differs from what was recorded.
    stop : name of the case.
    steps : (n,) from the sample before [s].
    u, y : (n, 2) measured inputs and outputs.
    judged : (n, 3) measured omegaW, omegaR [rad/s] and creep force [N].
    shares : (n,) weight of each sample in the time average (trapezoidal rule) [1].
    """

    name: str
    stop: str
    steps: Vector
    u: Matrix
    y: Matrix
    judged: Matrix
    shares: Vector


def recordings(cases: Sequence[Case], radius_error: float) -> tuple[Recording, ...]:
    """Prepare cases, each as it is and with a wheel that is not quite as large as the model's.

    Without the latter gains come to trust the difference of two speeds to the last digit, and fail
    on a rig whose radii are not known as well: 0.3 % of radius made 6 % of force.

    Parameters
    ----------
    radius_error : relative [1], alternately too small and too large; 0 for none.

    Raises
    ------
    InputError
        If a case has no measured force to judge by.
    """
    as_recorded = tuple(map(recording, cases))
    if radius_error == 0.0:
        return as_recorded
    signs = (radius_error if i % 2 == 0 else -radius_error for i in range(len(cases)))
    return (*as_recorded, *map(_with_wheel, as_recorded, signs))


def recording(case: Case) -> Recording:
    """Prepare a case; see `recordings`."""
    if case.Fx is None:
        raise InputError(
            where=str(case.source),
            found="no column 'Fx'",
            expected="the measured force, by which gains are judged",
            remedy="leave this case out of the tuning with --cases",
        )
    steps, shares = samples(case.time)
    judged = np.column_stack([case.y, case.Fx])
    return Recording(case.name, case.name, steps, case.u.copy(), case.y.copy(), judged, shares)


def _with_wheel(one: Recording, error: float) -> Recording:
    """The recording of a wheel whose radius is too small by a share, so that it turns faster."""
    y, judged = one.y.copy(), one.judged.copy()
    y[:, 0] *= 1.0 + error
    judged[:, 0] *= 1.0 + error
    return one._replace(name=f"{one.stop}, omegaW {error:+.2%}", y=y, judged=judged)


@dataclass(frozen=True, eq=False)
class Job:
    """All that a worker needs to judge candidates, on any machine.

    Attributes
    ----------
    estimator : its name.
    fmu : the file's bytes.
    names : our names of variables to those in the FMU.
    gains : reasoned gains; what is not tuned is taken from them.
    friction_left : share of a step of muDC from which on an observer finds friction too slowly [1],
        infinite to ask for no friction.
    """

    estimator: str
    fmu: bytes
    names: Mapping[str, str]
    gains: Gains
    recordings: tuple[Recording, ...]
    weights: Weights
    friction_left: float = SETTLED


def load_model(job: Job) -> FMU:
    """Open the model of a job, on any machine."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "model.fmu"
        path.write_bytes(job.fmu)
        return FMU(path, job.names)


class Candidate(NamedTuple):
    """Gains to be judged.

    Attributes
    ----------
    values : (n,) gains.
    limit : z beyond which the candidate has lost.
    order : cases to be judged by, the one that decides most often first.
    """

    values: Vector
    limit: float
    order: tuple[int, ...]


class Verdict(NamedTuple):
    """Judgement of one candidate.

    Attributes
    ----------
    z : worst of z_k; infinite if the candidate has lost, failed or finds friction too slowly.
    z_k : (k,) of all cases of the job; infinite where not known.
    samples : how many were evaluated.
    unstable : case in which the estimate diverged or the FMU failed; -1 if none.
    crashed : whether it killed its worker.
    """

    z: float
    z_k: Vector
    samples: int
    unstable: int
    crashed: bool = False


class Bench:
    """A model and its recordings, ready to judge one candidate after the other."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._fmu = load_model(job)
        self._settling = Settling(self._fmu) if np.isfinite(job.friction_left) else None
        # The loop is compiled here, so that no candidate's time is spent on it.
        start = Recording("", "", *(values[:PIECES] for values in job.recordings[0][2:]))
        self._judge_case(build(job.estimator, self._fmu, job.gains), start, np.inf)

    def close(self) -> None:
        """Free the model."""
        self._fmu.close()

    def judge(self, candidate: Candidate) -> Verdict:
        """Judge a candidate until it has lost, or to the end; none that finds no friction.

        The integral of equation (12) only grows, piece by piece and in floating point too, so what
        is dropped has lost for certain.
        """
        job = self._job
        gains = from_vector(job.gains, candidate.values)
        z_k = np.full(len(job.recordings), np.inf)
        estimator = build(job.estimator, self._fmu, gains)
        samples = 0
        limit = min(candidate.limit, DIVERGED)
        for k in candidate.order:
            z, done = self._judge_case(estimator, job.recordings[k], limit)
            samples += done
            if not z <= limit:
                nothing = np.full(z_k.size, np.inf)
                return Verdict(np.inf, nothing, samples, -1 if z <= DIVERGED else k)
            z_k[k] = z
        # Last, because few candidates come this far.
        slow = self._settling is not None and not self._settling.left(gains) < job.friction_left
        if slow:
            return Verdict(np.inf, np.full(z_k.size, np.inf), samples, -1)
        return Verdict(float(z_k[list(candidate.order)].max()), z_k, samples, -1)

    def _judge_case(self, estimator: Estimator, case: Recording, limit: float) -> tuple[float, int]:
        """The z of one case, or the part of it that is beyond the limit, and samples evaluated."""
        z, size = 0.0, case.steps.size
        edges = [size * i // PIECES for i in range(PIECES + 1)]
        weights, low_pass = self._job.weights.vector, np.zeros((2, 3))
        end = 0
        try:
            estimator.start(case.u[0], case.y[0])
            for begin, end in pairwise(edges):
                part = slice(begin, end)
                steps, y = case.steps[part], case.y[part]
                estimate = estimator.advance(steps, case.u[part], y)
                deviations = estimate.values[:, _JUDGED] - case.judged[part]
                z = integrate(z, low_pass, deviations, weights, steps, case.shares[part])
                if not z <= limit:
                    break
        except FMUError:
            self._fmu.renew(reload=False)
            return np.nan, end
        return z, end
