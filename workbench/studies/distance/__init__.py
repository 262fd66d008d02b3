"""Distance of a stop that was not made, from stops that were.

past stops -> levels and how sure they are -> the model, drawn many times -> distance, deceleration,
    safety level; each past stop beside what the others say of it
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, wait
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from workbench.arrays import Matrix
from workbench.errors import InputError
from workbench.recordings.case import Case
from workbench.runtime.engine import Engine, Reporter
from workbench.runtime.pool import Pool
from workbench.runtime.progress import ProgressReporter
from workbench.studies.distance.forecast import (
    Forecaster,
    Question,
    dimension,
    forecasting,
    stopping_of,
)
from workbench.studies.distance.outcome import Distance, Forecast, PastStop, Safety
from workbench.studies.distance.past import PastFit, fitted, places
from workbench.studies.distance.plain import PlainSampling
from workbench.studies.distance.rare_events import Tail
from workbench.studies.distance.recorded import RecordedStop, Stop, asked_stop, recorded
from workbench.studies.distance.standard import NominalRate
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
    def each(self) -> int:
        """Samples of a decade of a run of subset simulation, a multiple of ten."""
        return max(1, self.samples // 20) * 10


def distance_of_stop(
    system: System,
    cases: Sequence[Case],
    said: Mapping[str, Any],
    effort: Effort,
    engine: Engine,
) -> Distance:
    """Predict the distance of a stop from past stops of the same machine.

    Parameters
    ----------
    cases : past stops.
    said : what is asked for and the conditions, as people write them, by name; what is not said is
        usual.

    Raises
    ------
    InputError
        If the system does not say how it stops, what is said is none of it, a recording holds no
        stop, or fewer than two are within what the model claims.
    """
    stopping = stopping_of(system)
    stop = asked_stop(said, system, stopping)
    made = [recorded(case, system, stopping) for case in cases]
    if sum(not stop.outside for stop in made) < 2:
        raise InputError(
            where="recordings",
            found=f"{sum(not one.outside for one in made)} within what the model claims",
            expected="two stops or more, which say what the model leaves",
            remedy="give more recordings of this machine",
        )
    engine.report(f"fit to {len(cases)} stops")
    past = fitted(system, cases, engine)
    with Pool(engine.workers, forecasting, system) as pool:
        return _Forecasts(system, made, past, effort, pool, engine.report).told(stop)


class _Forecasts:
    """Of one set of past stops."""

    def __init__(
        self,
        system: System,
        made: Sequence[RecordedStop],
        past: PastFit,
        effort: Effort,
        pool: Pool[Forecaster],
        report: Reporter,
    ) -> None:
        self._system, self._stopping = system, stopping_of(system)
        self._made, self._past, self._effort = made, past, effort
        self._pool, self._report = pool, report
        own = []
        for stop, values in zip(made, past.own, strict=True):
            at = places(past.joint.shared, system, stop.stop.conditions)
            own.append({**{name: float(past.mean[j]) for name, j in at.items()}, **values})
        tasks = [
            pool.submit(Forecaster.stop, stop.stop, values)
            for stop, values in zip(made, own, strict=True)
        ]
        self._model = np.array([task.result().distance for task in tasks])
        measured = np.array([stop.distance for stop in made])
        self._left = np.log(measured / self._model)

    def told(self, stop: Stop) -> Distance:
        """What is to be said of a stop, and of those that were made."""
        counted = ProgressReporter(self._report, "distributions").part(len(self._made) + 1)
        questions = [self._question(past.stop, k) for k, past in enumerate(self._made)]
        asked = self._question(stop, None)
        drawn = [
            self._drawn(question, self._effort.checked, k) for k, question in enumerate(questions)
        ]
        drawn.append(self._drawn(asked, self._effort.samples, len(questions)))
        for task in drawn:
            task.add_done_callback(counted)
        *each, ahead = [_forecast(task.result()) for task in drawn]
        nominal = self._pool.submit(Forecaster.stop, stop, {}).result().distance
        rate = NominalRate(stop.asked[SPEED], self._stopping.response, nominal)
        safety, interrupted = self._safety(asked, rate)
        plain, short = self._plain(asked, rate)
        return Distance(
            system=self._system,
            stop=stop,
            ahead=ahead,
            nominal=nominal,
            past=tuple(
                PastStop(stop, float(model), forecast)
                for stop, model, forecast in zip(self._made, self._model, each, strict=True)
            ),
            safety=safety,
            plain=plain,
            interrupted=interrupted or short,
        )

    def _question(self, stop: Stop, without: int | None) -> Question:
        """What the past stops, or all but one, say of a stop."""
        whole = [k for k, past in enumerate(self._made) if not past.outside and k != without]
        left = float(np.sqrt(np.square(self._left[whole]).mean()))
        return Question(stop, self._past.known(without), left, len(whole))

    def _drawn(
        self, question: Question, samples: int, number: int
    ) -> "Future[tuple[Matrix, float]]":
        rng = np.random.default_rng([self._effort.seed, number])
        count = dimension(question, self._system, self._stopping)
        points = rng.standard_normal((samples, count))
        return self._pool.submit(Forecaster.drawn, question, points)

    def _safety(self, question: Question, nominal: NominalRate) -> tuple[Safety | None, bool]:
        """The safety level; and whether Ctrl-C ended it, which keeps the runs that are done."""
        effort = self._effort
        if not effort.decades:
            return None, False
        each = question, effort.decades, effort.each
        calls = [(*each, 1000 * effort.seed + number) for number in range(_RUNS)]
        done, interrupted = self._done("runs of subset simulation", Forecaster.descent, calls)
        if len(done) < 2:
            return None, interrupted
        tail = Tail(tuple(run for run, _ in done), question.addend)
        spent = sum(seconds for _, seconds in done) / tail.evaluations
        return Safety.of(tail, effort.decades, nominal, spent), interrupted

    def _plain(self, question: Question, nominal: NominalRate) -> tuple[PlainSampling | None, bool]:
        """Plain samples; and whether Ctrl-C left some out."""
        effort = self._effort
        sizes = [_PART] * (effort.plain // _PART) + [effort.plain % _PART]
        calls = [(question, n, (effort.seed, _PLAIN, k)) for k, n in enumerate(sizes) if n]
        if not calls:
            return None, False
        done, interrupted = self._done("parts of the plain samples", Forecaster.plainly, calls)
        shortness = np.concatenate([np.empty(0), *done])
        return PlainSampling.of(shortness, effort.decades, nominal), interrupted

    def _done(
        self, noun: str, function: Callable[..., _T], calls: Sequence[tuple[Any, ...]]
    ) -> tuple[list[_T], bool]:
        """Results of calls; and whether Ctrl-C came, which keeps those that are done."""
        counted = ProgressReporter(self._report, noun).part(len(calls))
        tasks: list[Future[_T]] = []
        interrupted = False
        try:
            for call in calls:
                tasks.append(self._pool.submit(function, *call))
                tasks[-1].add_done_callback(counted)
            wait(tasks)
        except KeyboardInterrupt:
            interrupted = True
            for task in tasks:
                task.cancel()
        return [t.result() for t in tasks if t.done() and not t.cancelled()], interrupted


def _forecast(drawn: tuple[Matrix, float]) -> Forecast:
    (distances, certain), outside = drawn
    return Forecast(np.sort(distances), np.sort(certain), outside)
