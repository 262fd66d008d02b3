"""Times of the observers: compiled laws beside FMPy's methods and plain C, in one run.

The model alone is there for any system as a loop of FMPy's own methods and numpy; a system's plugin
may have more.
"""

import json
import math
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from ctypes import POINTER, c_double
from dataclasses import dataclass, replace
from functools import partial
from types import ModuleType
from typing import Any

import numpy as np
from fmpy import extract, instantiate_fmu, read_model_description

from workbench.arrays import Matrix, Vector
from workbench.benchmark.memory import peak_memory
from workbench.models.fmu import FMU
from workbench.observers import Estimator, Gains, choose
from workbench.observers.estimators.open_loop import OpenLoop
from workbench.recordings.case import Case
from workbench.runtime.pool import Pool
from workbench.system.plugins import find_plugin, load
from workbench.system.registry import open_model
from workbench.system.system import FULL, OBSERVER, System

Loop = Callable[..., object]  # of time, u and y, as Estimator.run


@contextmanager
def by_fmpy(
    estimator: str, fmu: FMU, system: System, gains: Gains
) -> Iterator[Callable[..., Any] | None]:
    """The loop of an estimator with FMPy's methods and numpy; None where there is none.

    That of the model alone is there for any system.
    """
    if estimator == OpenLoop.name:
        with open_loop(fmu, system) as alone:
            yield alone
        return
    module = _loops(system)
    if module is None or estimator not in module.LOOPS:
        yield None
        return
    with module.by_fmpy(estimator, fmu, system, gains) as loop:
        yield loop


def by_c(estimator: str, fmu: FMU, system: System, gains: Gains) -> Loop | None:
    """The loop of an estimator in C without FMI; None where there is none."""
    module = _loops(system)
    return module.by_c(estimator, fmu, system, gains) if module else None


def _loops(system: System) -> ModuleType | None:
    module: ModuleType | None = load(find_plugin(system.plugin).loops)
    return module


@contextmanager
def open_loop(fmu: FMU, system: System) -> Iterator[Callable[[Vector, Matrix, Matrix], Matrix]]:
    """A loop like that of `OpenLoop`, over time, u and y; it returns outputs and reported, (n, k).

    Parameters
    ----------
    fmu : of FMI 2.0, whose file is loaded a second time.
    """
    description = read_model_description(str(fmu.path))
    known = {v.name: v.valueReference for v in description.modelVariables}
    rates = [unknown.variable for unknown in description.derivatives]
    states = [known[rate.derivative.name] for rate in rates]
    rows, n = [rate.valueReference for rate in rates], len(rates)

    def references(*names: str) -> list[int]:
        return [known[fmu.names.get(name, name)] for name in names]

    inputs = references(*(signal.name for signal in system.inputs))
    read = references(*(output.name for output in system.outputs), *system.reported)
    given = references(*system.given)
    places = [j for j, output in enumerate(system.outputs) if output.name in fmu.states]
    seen = references(*(system.outputs[j].name for j in places))
    x, dx = np.zeros(n), np.zeros(n)
    at_x, at_dx = (buffer.ctypes.data_as(POINTER(c_double)) for buffer in (x, dx))
    folder = extract(str(fmu.path))
    model = instantiate_fmu(folder, description, "ModelExchange")

    def begin(y: Vector) -> None:
        model.reset()
        model.setupExperiment()
        model.setReal([*given, *seen], [*system.given.values(), *y[places]])
        model.enterInitializationMode()
        model.exitInitializationMode()
        model.newDiscreteStates()
        model.enterContinuousTimeMode()
        model.getContinuousStates(at_x, n)

    def run(time: Vector, u: Matrix, y: Matrix) -> Matrix:
        begin(y[0])
        values = np.empty((time.size, len(read)))
        for k, h in enumerate(np.diff(time, prepend=time[0])):
            model.setReal(inputs, u[k])
            if h > 0.0:
                model.getDerivatives(at_dx, n)
                columns = [model.getDirectionalDerivative(rows, [j], [1.0]) for j in states]
                x[:] += np.linalg.solve(np.eye(n) - h * np.array(columns).T, h * dx)
                model.setContinuousStates(at_x, n)
            values[k] = model.getReal(read)
        return values

    try:
        yield run
    finally:
        model.terminate()
        model.freeInstance()
        shutil.rmtree(folder, ignore_errors=True)


RATES = (200.0, 1000.0, 5000.0)  # Hz
LENGTH = 4  # times the recording, for the growth with length
_RATE = 1000.0
_REPEATS = 15
_FEW = 3  # where one run is long
_FMPY_STEPS = 1500
_PROCESSES = 2
_PROCESS_REPEATS = 5

Samples = tuple[Vector, Matrix, Matrix]


@dataclass(frozen=True)
class ObserverTimes:
    """Medians over repeats, of whole runs per step [s]."""

    observer: str
    states: int  # of the model
    step: float  # at 1 kHz
    times_real_time: float  # 1 ms over `step`
    by_rate: dict[float, float]  # as `step` at each of RATES
    long: float  # as `step` with a recording LENGTH times as long
    # of the same method written with FMPy's methods; None where it is not measured
    fmpy: float | None
    c: float | None  # of the same method in C without FMI; None where there is none


@dataclass(frozen=True)
class ProcessTimes:
    """All observers over all cases at 1 kHz, in workers that have loaded their FMUs."""

    cases: int
    # one, two: medians with one worker and with two [s]
    one: float
    two: float
    peak_memory: int  # of one worker [bytes]


def resample(case: Case, rate: float, stretch: float = 1.0) -> Samples:
    """Time, u and y of a recording at even steps of 1/rate, by linear interpolation.

    Parameters
    ----------
    rate : [Hz].
    stretch : how many times as long the recording is to last.
    """
    recorded = (case.time - case.time[0]) * stretch
    t = np.arange(0.0, recorded[-1], 1.0 / rate)
    u, y = (
        np.column_stack([np.interp(t, recorded, column) for column in signals.T])
        for signals in (case.u, case.y)
    )
    return t, u, y


@contextmanager
def opened(system: System, names: Sequence[str], role: str = "") -> Iterator[list[Estimator]]:
    """Estimators by name with reasoned gains, the standard ones if none is named.

    Parameters
    ----------
    role : of the model that all run on; empty: each on its own.
    """
    with ExitStack() as stack:
        ready = []
        for estimator in choose(system, names).values():
            fmu = stack.enter_context(open_model(system, role or estimator.role))
            ready.append(estimator.untuned(fmu, system))
        yield ready


def plain_filters(system: System) -> System:
    """The same system for filters as in a textbook, which what they are measured against are.

    They begin at nominal quantities, learn no noise levels, and say what they know as they know it.
    """
    estimated = [
        replace(quantity, start=math.nan, relative_error=0.0) for quantity in system.estimated
    ]
    return replace(system, estimated=tuple(estimated), learns=math.inf, bands={})


def tuned_names(system: System) -> list[str]:
    """Estimators that are measured: standard ones with gains, the others do little."""
    return [name for name, estimator in choose(system, []).items() if estimator.tunable]


def time_observers(case: Case, system: System) -> list[ObserverTimes]:
    """Time the model alone and all observers on one recording, on the full model too.

    What they are measured against is written for FMUs of FMI 2.0 with C sources.
    """
    names = tuned_names(system)
    known = choose(system, names)
    times = []
    with opened(plain_filters(system), [OpenLoop.name, *names]) as estimators:
        for estimator in estimators:
            with by_fmpy(estimator.name, estimator.fmu, system, estimator.gains) as loop:
                plain = by_c(estimator.name, estimator.fmu, system, estimator.gains)
                times.append(_time(case, estimator, loop, plain))
    larger = [name for name, chosen in known.items() if chosen.role == OBSERVER]
    if FULL in system.models and larger:
        with opened(system, larger, FULL) as estimators:
            for estimator in estimators:
                times.append(_time(case, estimator, None, None))
    return times


def _time(case: Case, estimator: Estimator, loop: Loop | None, plain: Loop | None) -> ObserverTimes:
    estimator.run(*resample(case, _RATE))
    runs: list[Loop] = [estimator.run, *([plain] if plain else [])]
    step, *c = _per_step(runs, resample(case, _RATE))
    by_rate = {rate: _per_step([estimator.run], resample(case, rate), _FEW)[0] for rate in RATES}
    fmpy = None
    if loop is not None:
        t, u, y = resample(case, _RATE)
        # From the middle of the recording on, where every law does its full work.
        part = slice(t.size // 3, t.size // 3 + _FMPY_STEPS)
        fmpy = _per_step([loop], (t[part], u[part], y[part]), _FEW)[0]
    return ObserverTimes(
        observer=estimator.name,
        states=len(estimator.fmu.states),
        step=step,
        times_real_time=1.0 / (_RATE * step),
        by_rate=by_rate,
        long=_per_step([estimator.run], resample(case, _RATE, LENGTH), _FEW)[0],
        fmpy=fmpy,
        c=c[0] if c else None,
    )


def in_turns(calls: Sequence[Callable[[], object]], repeats: int) -> list[float]:
    """Median time of each call [s]; in turns, so that they meet the same load."""
    spent: list[list[float]] = [[] for _ in calls]
    for _ in range(repeats):
        for call, times in zip(calls, spent, strict=True):
            begin = time.perf_counter()
            call()
            times.append(time.perf_counter() - begin)
    return list(map(statistics.median, spent))


def _per_step(runs: Sequence[Loop], samples: Samples, repeats: int = _REPEATS) -> list[float]:
    times = in_turns([partial(run, *samples) for run in runs], repeats)
    return [spent / samples[0].size for spent in times]


def time_compilation(system: System, case: Case) -> dict[str, float]:
    """Time of the first call of each observer [s], in a process with an empty cache."""
    recording = str(case.source.parent)
    with tempfile.TemporaryDirectory() as cache:
        run = subprocess.run(
            [
                *(sys.executable, "-m", "workbench.benchmark.first_calls"),
                *(str(system.source), recording),
            ],
            env={**os.environ, "XDG_CACHE_HOME": cache},
            capture_output=True,
            text=True,
            check=True,
        )
    seconds: dict[str, float] = json.loads(run.stdout)
    return seconds


def time_processes(cases: Sequence[Case], system: System) -> ProcessTimes:
    """Time all cases with one worker and with two."""
    one, memory = _time_workers(1, cases, system)
    two, _ = _time_workers(_PROCESSES, cases, system)
    return ProcessTimes(len(cases), one, two, memory)


def _time_workers(workers: int, cases: Sequence[Case], system: System) -> tuple[float, int]:
    """Median time of all cases [s], and the largest memory of a worker [bytes]."""
    # The longest first, so that no worker is left with a long one at the end.
    order = sorted(range(len(cases)), key=lambda k: -cases[k].time[-1])
    spent, memory = [], 0
    with Pool(workers, _prepared, (list(cases), system), isolated=True) as pool:
        pool.map(_run, order)  # until all workers are ready
        for _ in range(_PROCESS_REPEATS):
            begin = time.perf_counter()
            memory = max(memory, *pool.map(_run, order))
            spent.append(time.perf_counter() - begin)
    return statistics.median(spent), memory


_Prepared = tuple[list[Estimator], list[Samples]]


@contextmanager
def _prepared(given: tuple[Sequence[Case], System]) -> Iterator[_Prepared]:
    cases, system = given
    with opened(system, tuned_names(system)) as estimators:
        samples = [resample(case, _RATE) for case in cases]
        for estimator in estimators:
            estimator.run(*(part[:2] for part in samples[0]))
        yield estimators, samples


def _run(prepared: _Prepared, number: int) -> int:
    estimators, samples = prepared
    for estimator in estimators:
        estimator.run(*samples[number])
    return peak_memory()


def format_observers(
    observers: Sequence[ObserverTimes], processes: ProcessTimes, compilation: Mapping[str, float]
) -> str:
    """The measurements as a table."""
    rates = "".join(f" {rate:>7.0f} Hz" for rate in RATES)
    lines = [
        "us per step of the observers, a recording at 1 kHz",
        f"{'observer':<21} {'states':>6} {'us':>6} {'real time':>10} {'FMPy':>6} {'C':>5}"
        f"{rates} {LENGTH:>3}x long",
    ]
    for row in observers:
        growth = "".join(f" {1e6 * row.by_rate[rate]:>10.2f}" for rate in RATES)
        fmpy = row.fmpy / row.step if row.fmpy else math.nan
        plain = row.step / row.c if row.c else math.nan
        lines.append(
            f"{row.observer:<21} {row.states:>6} {1e6 * row.step:>6.2f} "
            f"{row.times_real_time:>9.0f}x {_ratio(fmpy, 5, 0)} {_ratio(plain, 4, 2)}"
            f"{growth} {1e6 * row.long:>8.2f}"
        )
    lines += [
        "FMPy: how many times as long the same method takes with FMPy's methods and numpy; "
        "C: how many times as long as plain C without FMI",
        "compiled once, on the first call: "
        + ", ".join(f"{name} {seconds:.1f} s" for name, seconds in compilation.items()),
        f"{processes.cases} cases, all observers: {processes.one:.2f} s in one process, "
        f"{processes.two:.2f} s in two, {processes.one / processes.two:.2f} times as fast; "
        f"peak memory of a process {processes.peak_memory / 1e6:.0f} MB",
    ]
    return "\n".join(lines)


def _ratio(value: float, width: int, digits: int) -> str:
    return " " * (width + 1) if math.isnan(value) else f"{value:>{width}.{digits}f}x"
