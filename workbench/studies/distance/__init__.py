"""Distance of an untested stop, from past stops.

past stops -> levels and how sure they are -> the model, drawn many times -> distance, deceleration,
    safety level; each past stop beside what the others predict of it
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, wait
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from workbench.errors import InputError
from workbench.observers.trajectory import doubts_along
from workbench.recordings.case import Case
from workbench.runtime.engine import Engine, ProgressReporter, Reporter
from workbench.runtime.pool import Pool
from workbench.studies.distance.forecast import (
    Forecaster,
    Question,
    dimension,
    open_forecaster,
    stopping_of,
)
from workbench.studies.distance.outcome import Distance, Forecast, PastStop, Safety
from workbench.studies.distance.past import PastFit, fit_past_stops, places
from workbench.studies.distance.rare_events import PlainSampling, Tail
from workbench.studies.distance.recorded import RecordedStop, Stop, asked_stop, read_stop
from workbench.studies.distance.standard import NominalRate
from workbench.system.registry import open_model
from workbench.system.stopping import SPEED
from workbench.system.system import System

__all__ = ["Distance", "Effort", "distance_of_stop"]

_T = TypeVar("_T")

_PART, _PLAIN = 2000, 7  # plain samples of a task, and their stream of random numbers
_RUNS = 8  # of subset simulation: the scatter of fewer says little, and processors share them


@dataclass(frozen=True)
class Effort:
    """How much is drawn.

    Attributes
    ----------
    samples : of the distribution that is asked for.
    decades : down to which the safety level goes; 0: none is asked for.
    seed : the same of which gives the same numbers.
    plain : samples beside the safety level, each drawn by itself; 0: none.
    """

    samples: int = 4000
    decades: int = 9
    seed: int = 1
    plain: int = 0

    @property
    def checked(self) -> int:
        """Samples of a past stop by the others: there are many, and 95 % need fewer than tails."""
        return max(1, self.samples // 4)

    @property
    def per_decade(self) -> int:
        """Samples of a decade of a run of subset simulation, a multiple of ten."""
        return max(1, self.samples // 20) * 10


def distance_of_stop(
    system: System,
    cases: Sequence[Case],
    asked: Mapping[str, Any],
    effort: Effort,
    engine: Engine,
) -> Distance:
    """Predict the distance of a stop from past stops of the same machine.

    Parameters
    ----------
    cases : past stops.
    asked : quantities and conditions, as people write them, by name; others are usual.

    Raises
    ------
    InputError
        If the system does not say how it stops, what is asked is none of it, a recording holds no
        stop, or fewer than two are within the validity range of the model.
    """
    stopping = stopping_of(system)
    stop = asked_stop(asked, system, stopping)
    stops = [read_stop(case, system, stopping) for case in cases]
    valid = sum(not recorded.outside for recorded in stops)
    if valid < 2:
        raise InputError(
            where="recordings",
            found=f"{valid} within what the model claims",
            expected="two stops or more, which say what the model leaves",
            remedy="give more recordings of this machine",
        )
    with open_model(system) as fmu:
        doubts = doubts_along(fmu, system, cases)
    engine.report(f"fit to {len(cases)} stops")
    past = fit_past_stops(system, cases, engine)
    with Pool(engine.workers, open_forecaster, system) as pool:
        distance = _Prediction(system, stops, past, effort, pool, engine.report).of(stop)
    return replace(distance, warned="; ".join(filter(None, (doubts, distance.warned))))


class _Prediction:
    """What a set of past stops says of stops."""

    def __init__(
        self,
        system: System,
        stops: Sequence[RecordedStop],
        past: PastFit,
        effort: Effort,
        pool: Pool[Forecaster],
        report: Reporter,
    ) -> None:
        self._system, self._stopping = system, stopping_of(system)
        self._stops, self._past, self._effort = stops, past, effort
        self._pool, self._report = pool, report
        tasks = []
        for recorded, tolerances in zip(stops, past.own, strict=True):
            at = places(past.joint.shared, system, recorded.stop.conditions)
            values = {**{name: float(past.mean[j]) for name, j in at.items()}, **tolerances}
            tasks.append(pool.submit(Forecaster.stop, recorded.stop, values))
        results = [task.result() for task in tasks]
        self._model = np.array([result.distance for result in results])
        self._warned = [result.warned for result in results]
        measured = np.array([recorded.distance for recorded in stops])
        self._left = np.log(measured / self._model)

    def of(self, stop: Stop) -> Distance:
        """Predict a stop, and each past stop from the others."""
        progress = ProgressReporter(self._report, "distributions").part(len(self._stops) + 1)
        questions = [self._question(past.stop, k) for k, past in enumerate(self._stops)]
        asked = self._question(stop, None)
        samples = [self._effort.checked] * len(questions) + [self._effort.samples]
        tasks = []
        for number, question in enumerate([*questions, asked]):
            rng = np.random.default_rng([self._effort.seed, number])
            count = dimension(question, self._system, self._stopping)
            points = rng.standard_normal((samples[number], count))
            tasks.append(self._pool.submit(Forecaster.sample, question, points))
        for task in tasks:
            task.add_done_callback(progress)
        forecasts = []
        for task in tasks:
            (distances, certain), outside = task.result()
            forecasts.append(Forecast(np.sort(distances), np.sort(certain), outside))
        *others, ahead = forecasts
        sheet = self._pool.submit(Forecaster.stop, stop, {}).result()
        rate = NominalRate(stop.asked[SPEED], self._stopping.response, sheet.distance)
        safety, interrupted = self._safety(asked, rate)
        plain, short = self._plain(asked, rate)
        return Distance(
            system=self._system,
            stop=stop,
            ahead=ahead,
            nominal=sheet.distance,
            past=tuple(
                PastStop(recorded, float(model), forecast)
                for recorded, model, forecast in zip(self._stops, self._model, others, strict=True)
            ),
            safety=safety,
            plain=plain,
            interrupted=interrupted or short,
            warned=next(filter(None, [sheet.warned, *self._warned]), ""),
        )

    def _question(self, stop: Stop, without: int | None) -> Question:
        """Ask of a stop by all past stops, or by all but one."""
        valid = [k for k, past in enumerate(self._stops) if not past.outside and k != without]
        left = float(np.sqrt(np.square(self._left[valid]).mean()))
        return Question(stop, self._past.known(without), left, len(valid))

    def _safety(self, question: Question, nominal: NominalRate) -> tuple[Safety | None, bool]:
        """The safety level; and whether Ctrl-C ended it, which keeps the runs that are done."""
        effort = self._effort
        if not effort.decades:
            return None, False
        calls = [
            (question, effort.decades, effort.per_decade, 1000 * effort.seed + number)
            for number in range(_RUNS)
        ]
        runs, interrupted = self._run("runs of subset simulation", Forecaster.descent, calls)
        if len(runs) < 2:
            return None, interrupted
        tail = Tail(tuple(run for run, _ in runs), question.addend)
        spent = sum(seconds for _, seconds in runs) / tail.evaluations
        return Safety.of(tail, effort.decades, nominal, spent), interrupted

    def _plain(self, question: Question, nominal: NominalRate) -> tuple[PlainSampling | None, bool]:
        """Plain samples; and whether Ctrl-C left some out."""
        effort = self._effort
        sizes = [_PART] * (effort.plain // _PART) + [effort.plain % _PART]
        calls = [(question, n, (effort.seed, _PLAIN, k)) for k, n in enumerate(sizes) if n]
        if not calls:
            return None, False
        noun = "parts of the plain samples"
        parts, interrupted = self._run(noun, Forecaster.sample_plainly, calls)
        shortness = np.concatenate([np.empty(0), *parts])
        return PlainSampling.of(shortness, effort.decades, nominal), interrupted

    def _run(
        self, noun: str, function: Callable[..., _T], calls: Sequence[tuple[Any, ...]]
    ) -> tuple[list[_T], bool]:
        """Results of calls; and whether Ctrl-C came, which keeps those that are done."""
        progress = ProgressReporter(self._report, noun).part(len(calls))
        tasks: list[Future[_T]] = []
        interrupted = False
        try:
            for call in calls:
                tasks.append(self._pool.submit(function, *call))
                tasks[-1].add_done_callback(progress)
            wait(tasks)
        except KeyboardInterrupt:
            interrupted = True
            for task in tasks:
                task.cancel()
        return [t.result() for t in tasks if t.done() and not t.cancelled()], interrupted
