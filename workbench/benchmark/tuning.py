"""Times and memory of the tuning: an evaluation beside FMPy's methods, workers, a Dask cluster."""

import functools
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from workbench.benchmark.memory import watch_command
from workbench.benchmark.observers import by_fmpy, in_turns
from workbench.observers import Estimate, Estimator, choose
from workbench.observers.score import samples
from workbench.recordings.case import Case
from workbench.system.registry import open_model
from workbench.system.system import System
from workbench.tuning import (
    LIMIT,
    Candidate,
    Evaluator,
    Job,
    Workers,
    evaluate_all,
    evaluators,
    recording,
    tunable,
)

WORKERS = 2
CANDIDATES = 270  # a generation: 15 for each of 18 gains
_REPEATS = 3
_EVALUATIONS = 15  # of ours, in each repeat of one by FMPy
_VARIATION = 0.01  # of gains: candidates differ, and all of them are stable
_SEED = 1
# Rounding, grown 1e4 times by an estimator, of signals a thousand times as large as their errors.
_AGREEMENT = 1e-9


@dataclass(frozen=True)
class EvaluationTimes:
    """One candidate over one recording, from its gains to z; medians over repeats."""

    estimator: str
    steps: int  # of the recording
    ours: float  # by the tuning [s]
    fmpy: float  # by the same method written with FMPy's methods and numpy [s]
    z: float  # objective that both find

    def ratios(self) -> Mapping[str, float]:
        """How many times as long FMPy's methods take."""
        return {"fmpy": self.fmpy / self.ours}


@dataclass(frozen=True)
class WorkerRates:
    """Candidates per second over all cases in full, by workers that are ready; medians."""

    cases: int
    candidates: int
    # one, two: by so many processes
    one: float
    two: float
    dask: float | None  # by two processes of a local Dask cluster; None without the extra [cluster]

    def ratios(self) -> Mapping[str, float]:
        """Two processes over one, and Dask's two over these."""
        dask = {} if self.dask is None else {"dask": self.dask / self.two}
        return {"two": self.two / self.one, **dask}


@dataclass(frozen=True)
class TuningMemory:
    """Peaks of resident memory in a run of the command with two workers [bytes]."""

    master: int  # of the process that searches
    worker: int  # of the largest process that it starts
    total: int  # of all processes


def time_evaluations(case: Case, system: System) -> list[EvaluationTimes]:
    """Time reasoned gains on one recording, of the standard observers whose feedback is tuned."""
    times = []
    for estimator in (estimator for estimator in choose(system, []).values() if estimator.tunable):
        job = tuning_job(estimator, system, [case])
        if estimator.adapts:
            continue  # a filter makes its feedback as it goes
        with (
            open_model(system, estimator.role) as fmu,
            by_fmpy(estimator.name, fmu, system, job.gains) as loop,
        ):
            if loop is not None:
                by_loop = functools.partial(evaluate_by_loop, loop, case, system)
                times.append(time_evaluation(job, by_loop))
    return times


def tuning_job(estimator: type[Estimator], system: System, cases: Sequence[Case]) -> Job:
    """What is to be evaluated, about the reasoned gains."""
    with open_model(system, estimator.role) as fmu:
        gains, model = estimator.default_gains(fmu, system), fmu.path.read_bytes()
    recordings = tuple(recording(case, system) for case in cases)
    return Job(estimator.name, system, model, gains, recordings)


def evaluate_by_loop(loop: Callable[..., Estimate], case: Case, system: System) -> float:
    """The z of a recording by a loop written another way, and numpy."""
    return objective(loop(case.time, case.u, case.y), case, system)


def objective(estimate: Estimate, case: Case, system: System) -> float:
    """z_k, equation (12) of Schwarz et al. (2018), of deviations below the bandwidth."""
    names, columns = list(system.objective.weights), list(system.columns)
    estimated = np.asarray(estimate.values)[:, [columns.index(name) for name in names]]
    deviations = estimated - np.column_stack([case[name] for name in names])
    steps, shares = samples(case.time)
    # Two equal poles, which together are down by 3 dB at the bandwidth.
    corner = 2 * np.pi * system.objective.bandwidth / np.sqrt(np.sqrt(2) - 1)
    gains = np.where(steps > 0.0, 1.0 - np.exp(-corner * steps), 1.0)
    smooth = np.empty_like(deviations)
    first = second = np.zeros(len(names))
    for k, gain in enumerate(gains):
        first = first + gain * (deviations[k] - first)
        second = second + gain * (first - second)
        smooth[k] = second
    return float(shares @ np.abs(smooth) @ np.array(list(system.objective.weights.values())))


def time_evaluation(job: Job, by_loop: Callable[[], float]) -> EvaluationTimes:
    """Time the reasoned gains over the first recording of a job, in turns with another way.

    Raises
    ------
    ArithmeticError
        If the other way finds another z, because then it does other work.
    """
    values = job.gains.values
    ours, theirs = [], []
    with threadpool_limits(1), Evaluator(job) as evaluator:  # as a worker has it
        for _ in range(_REPEATS):
            for _ in range(_EVALUATIONS):
                begin = time.perf_counter()
                evaluation = evaluator.evaluate(Candidate(values, np.inf, (0,)))
                ours.append(time.perf_counter() - begin)
            begin = time.perf_counter()
            z = by_loop()
            theirs.append(time.perf_counter() - begin)
            if not abs(z - evaluation.z) <= _AGREEMENT * evaluation.z:
                raise ArithmeticError(
                    f"{job.estimator}: z is {evaluation.z} by the tuning and {z} by FMPy's "
                    "methods, so their times are not those of the same evaluation"
                )
    median = statistics.median
    return EvaluationTimes(
        job.estimator, evaluation.samples, median(ours), median(theirs), evaluation.z
    )


def first_tuned(system: System) -> str:
    """The standard estimator that workers and memory are measured with."""
    return next(name for name, estimator in choose(system, []).items() if estimator.tunable)


def time_workers(
    cases: Sequence[Case], system: System, candidates: int = CANDIDATES
) -> WorkerRates:
    """Evaluate candidates of the first tunable estimator by one worker, by two, and with Dask.

    Raises
    ------
    ArithmeticError
        If they do not find the same z, or any fails, which takes less than a full evaluation.
    """
    job = tuning_job(tunable(system, first_tuned(system)), system, cases)
    rng = np.random.default_rng(_SEED)
    reasoned, order = job.gains.values, tuple(range(len(cases)))
    changed = reasoned * (1.0 + _VARIATION * rng.standard_normal((candidates, reasoned.size)))
    changes = [Candidate(values, np.inf, order) for values in changed]
    with evaluators(job, 1) as alone, evaluators(job, WORKERS) as together:
        z = [_evaluate(pool, changes) for pool in (alone, together)]
        one, two = _rates([alone, together], changes)
    dask = None
    if find_spec("distributed"):
        # Not in turns with the others: a cluster that waits takes 4 % of two processors.
        with _cluster(job) as pool:
            z.append(_evaluate(pool, changes))
            [dask] = _rates([pool], changes)
    if not np.isfinite(z).all() or any(other != z[0] for other in z):
        raise ArithmeticError("candidates failed, or workers disagree about their z")
    return WorkerRates(len(cases), candidates, one, two, dask)


@contextmanager
def _cluster(job: Job) -> Iterator[Workers]:
    from distributed import LocalCluster

    from workbench.runtime.cluster import DaskPool

    # Workers need a third of a gigabyte each, which nobody has to watch ten times a second.
    size = {"n_workers": WORKERS, "threads_per_worker": 1, "memory_limit": 0}
    with (
        LocalCluster(**size, dashboard_address=":0") as cluster,
        closing(DaskPool(cluster.scheduler_address, Evaluator, job, LIMIT)) as pool,
    ):
        yield pool


def _evaluate(pool: Workers, candidates: Sequence[Candidate]) -> list[float]:
    """The z of candidates; the first time that a pool is asked, it starts its workers."""
    return [evaluation.z for evaluation in evaluate_all(pool, candidates, len(candidates[0].order))]


def _rates(pools: Sequence[Workers], candidates: Sequence[Candidate]) -> list[float]:
    calls = [functools.partial(_evaluate, pool, candidates) for pool in pools]
    return [len(candidates) / spent for spent in in_turns(calls, _REPEATS)]


def observe_memory(folders: Sequence[Path], system: System) -> TuningMemory:
    """Tune an estimator with the command, as briefly as it goes."""
    command = [sys.executable, "-m", "workbench", "tune", first_tuned(system)]
    brief = ["--workers", str(WORKERS), "--budget", "1", "--population", "1"]
    with tempfile.TemporaryDirectory() as out:
        where = ["--out", out, "--cases", *map(str, folders)]
        peaks = watch_command([*command, *brief, *where])
    _, master, *others = peaks  # the first is beside the command, to clear up after it
    return TuningMemory(master, max(others), sum(peaks))


def format_tuning(
    evaluations: Sequence[EvaluationTimes], rates: WorkerRates, memory: TuningMemory
) -> str:
    """The measurements as a table."""
    lines = [
        "tuning: a candidate over a recorded stop at 200 Hz, from its gains to z",
        f"{'estimator':<21} {'steps':>6} {'ms':>6} {'FMPy':>6}",
    ]
    for row in evaluations:
        ratio = f"{row.ratios()['fmpy']:.0f}x"
        lines.append(f"{row.estimator:<21} {row.steps:>6} {1e3 * row.ours:>6.2f} {ratio:>6}")
    ratios = rates.ratios()
    cluster = (
        "no Dask cluster measured, because there is no package 'distributed'"
        if rates.dask is None
        else f"{rates.dask:.1f} by {WORKERS} of a Dask cluster, {ratios['dask']:.2f} times as many"
    )
    lines += [
        "FMPy: how many times as long the same evaluation takes with FMPy's methods and numpy",
        f"candidates of the first estimator over {rates.cases} cases, in full: "
        f"{rates.one:.1f} per second by one worker, {rates.two:.1f} by {WORKERS}, "
        f"{ratios['two']:.2f} times as many; {cluster}",
        f"peak memory of the command with {WORKERS} workers: {memory.master / 1e6:.0f} MB in the "
        f"master, {memory.worker / 1e6:.0f} MB in the largest worker, "
        f"{memory.total / 1e6:.0f} MB in all processes",
    ]
    return "\n".join(lines)
