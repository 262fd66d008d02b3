"""The tuning's benchmark compares what gives the same, and counts every process."""

import functools
import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

from workbench.benchmark.memory import peak_memory, watch_command
from workbench.benchmark.tuning import (
    EvaluationTimes,
    TuningMemory,
    WorkerRates,
    evaluate_by_loop,
    format_tuning,
    observe_memory,
    time_evaluation,
    time_evaluations,
    time_workers,
    tuning_job,
)
from workbench.machines.wheelset.benchmark import by_fmpy
from workbench.observers.estimators.disturbance import DisturbanceObserver
from workbench.recordings.case import Case
from workbench.system.registry import open_model

from .processes import python

SAMPLES = slice(700, 1300)  # 3 s: first pressure and the beginning of the stop
MB = 1e6


@pytest.fixture(scope="module")
def case(dry_case) -> Case:
    return dry_case.part(SAMPLES)


def test_evaluations_by_the_tuning_and_by_fmpy_agree_and_are_timed(system, case):
    rows = time_evaluations(case, system)
    assert [row.estimator for row in rows] == ["disturbance_observer", "parameter_estimator"]
    for row in rows:
        assert row.steps == 600
        assert row.z > 0.0
        # 600 calls of four or more methods from Python, beside one of a compiled loop.
        assert row.fmpy > row.ours > 0.0
        assert row.ratios() == {"fmpy": row.fmpy / row.ours}


def test_times_of_evaluations_that_disagree_are_refused(system, case):
    """The other counts the force a millionth more."""
    job = tuning_job(DisturbanceObserver, system, [case])
    weights = {**system.objective.weights, "Fx": 1.000001e-3}
    heavier = replace(system, objective=replace(system.objective, weights=weights))
    with (
        open_model(system) as fmu,
        by_fmpy(job.estimator, fmu, system, job.gains) as loop,
        pytest.raises(ArithmeticError, match="not those of the same evaluation"),
    ):
        time_evaluation(job, functools.partial(evaluate_by_loop, loop, case, heavier))


def test_rates_of_workers_are_measured(system, case):
    rates = time_workers([case], system, candidates=4)
    assert (rates.cases, rates.candidates) == (1, 4)
    assert min(rates.one, rates.two) > 0.0
    assert rates.ratios()["two"] == rates.two / rates.one
    if find_spec("distributed"):
        assert rates.ratios()["dask"] == rates.dask / rates.two
    else:
        assert rates.dask is None


@pytest.mark.long
def test_memory_of_master_and_workers_is_measured(root, system, monkeypatch):
    monkeypatch.chdir(root)
    memory = observe_memory([root / "cases" / "03_dry_120_3.6"], system)
    # numba and its compiler alone take 80 MB in each.
    assert min(memory.master, memory.worker) > 80 * MB
    # A worker as large as the other within a fifth, and Python's process that clears up.
    assert memory.total > memory.master + 1.8 * memory.worker


def test_a_process_does_not_have_the_peak_of_the_one_that_started_it():
    """It does by `getrusage`."""
    ballast = np.ones(50_000_000)  # 400 MB
    program = "from workbench.benchmark.memory import peak_memory; print(peak_memory())"
    run = python("-c", program)
    assert peak_memory() > ballast.nbytes
    assert int(run.stdout) < 100 * MB


def test_a_watched_command_counts_with_what_it_starts():
    """100 MB in a process that lives for half a second, 25 looks, beside 200 MB in the first."""
    program = (
        "import subprocess, sys, time\n"
        "kept = b'x' * int(sys.argv[1])\n"
        "if len(sys.argv) > 2:\n"
        "    subprocess.run([sys.executable, '-c', sys.argv[2], '100000000'], check=True)\n"
        "time.sleep(0.5)\n"
    )
    peaks = watch_command([sys.executable, "-c", program, "200000000", program])
    assert len(peaks) == 2
    # Python itself takes 10 MB.
    assert 200 * MB < peaks[0] < 230 * MB
    assert 100 * MB < peaks[1] < 130 * MB
    with pytest.raises(subprocess.CalledProcessError, match="status 3"):
        watch_command([sys.executable, "-c", "raise SystemExit(3)"])


def test_the_table_has_the_ratios_and_says_what_was_not_measured():
    evaluations = [EvaluationTimes("disturbance_observer", 6233, 0.003, 0.45, 0.1)]
    memory = TuningMemory(master=290_000_000, worker=270_000_000, total=840_000_000)
    rates = WorkerRates(cases=14, candidates=60, one=15.0, two=28.5, dask=27.0)
    table = format_tuning(evaluations, rates, memory)
    for said in ("150x", "1.90 times as many", "0.95 times as many", "840 MB in all processes"):
        assert said in table
    assert "no package 'distributed'" in format_tuning(
        evaluations, replace(rates, dask=None), memory
    )
