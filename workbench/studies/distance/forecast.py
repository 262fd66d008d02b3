"""Distribution of an untested stop: Monte Carlo over the model.

What past stops know of the machine's levels, how far it differs from stop to stop, and what the
model left of the distances of past stops are drawn together.
"""

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr, stdtr, stdtrit

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError, InputError
from workbench.models.fmu import FMU
from workbench.studies.distance.past import MachineLevels, places
from workbench.studies.distance.rare_events import Descent, descend
from workbench.studies.distance.recorded import Stop, beyond
from workbench.studies.distance.simulation import DrivingInputs, StopResult, StopSimulation
from workbench.system.registry import open_model
from workbench.system.stopping import Difference, Stopping
from workbench.system.system import System

_STEPPED = 8  # draws that choose the step: all are much alike in what a step leaves
_SAME = 1e-4  # of a distance: what it is measured to, ten centimetres in a kilometre


@dataclass(frozen=True, eq=False)
class Question:
    """What is drawn."""

    stop: Stop  # what is asked
    known: MachineLevels  # levels of the machine
    left: float  # root mean square of the logarithms of past distances over the model's
    freedom: int  # number of these, whose scatter is as unsure as so few are (Student's t)

    def addend(self, x: Vector) -> Vector:
        """Cumulative distribution of what the model leaves of a logarithm, (n,) of (n,)."""
        share: Vector = stdtr(self.freedom, x / self.left)
        return share

    def certain(self) -> "Question":
        """The same if the machine and its model were known, so that it only differs by nature."""
        sure = replace(self.known, covariance=np.zeros_like(self.known.covariance))
        return replace(self, known=sure, left=0.0)


class Forecaster:
    """The model of a system, in one process.

    Parameters
    ----------
    fmu : it must outlive this.
    """

    def __init__(self, fmu: FMU, system: System, stopping: Stopping) -> None:
        self._fmu, self._system, self._stopping = fmu, system, stopping
        self._stops = StopSimulation(fmu, system, stopping)
        self._stepped: tuple[Question, int] | None = None

    def stop(self, stop: Stop, values: Mapping[str, float]) -> StopResult:
        """Stop with values of parameters, SI, and nothing that differs."""
        return self._stops.run(self._drive(stop), {**self._start(stop), **values})

    def sample(self, question: Question, points: Matrix) -> tuple[Matrix, float]:
        """Draw distances, and the share of them outside the validity range.

        Parameters
        ----------
        points : (n, d) of independent standard normal variables.

        Returns
        -------
        distances : (2, n) as asked, and with all that is known but by nature [m].
        outside : share of the first that is outside the validity range.
        """
        names = [output.name for output in self._system.outputs]
        distances, outside = [], []
        for drive, values, factor in self._draws(question, points):
            result = self._stops.run(drive, values)
            readings = dict(zip(names, result.outputs.T, strict=True))
            distances.append(result.distance * factor)
            outside.append(beyond(readings, self._system, self._stopping))
        certain = self.distances(question.certain(), points)
        return np.array([distances, certain]), float(np.mean(outside))

    def distances(self, question: Question, points: Matrix) -> Vector:
        """Distances for points (n, d), (n,) [m]."""
        stride, distances = self._stride(question), []
        for drive, values, factor in self._draws(question, points):
            try:
                result = self._stops.run(drive, values, stride)
            except FMUError:  # this draw fails at a step that serves the others
                result = self._stops.run(drive, values)
            distances.append(result.distance * factor)
        return np.array(distances)

    def sample_plainly(self, question: Question, samples: int, seed: Sequence[int]) -> Vector:
        """Minus the logarithm of so many distances [m], (n,), each drawn by itself."""
        count = dimension(question, self._system, self._stopping)
        points = np.random.default_rng(seed).standard_normal((samples, count))
        return -np.log(self.distances(question, points))

    def descent(
        self, question: Question, decades: int, samples: int, seed: int
    ) -> tuple[Descent, float]:
        """Lower tail of minus the logarithm of the distance, but for what the model leaves.

        Returns
        -------
        run : see `descend`.
        spent : processor time of it all [s].
        """
        begin, bare = time.process_time(), replace(question, left=0.0)

        def shortness(points: Matrix) -> Vector:
            return -np.log(self.distances(bare, points))

        count = dimension(question, self._system, self._stopping)
        return descend(shortness, count, decades, samples, seed), time.process_time() - begin

    def _stride(self, question: Question) -> int:
        """Samples to a step: doubled while the distances of a few draws stay the same.

        A sample is as long as sensors need, which are far quicker than a machine that stops.
        """
        if self._stepped is None or self._stepped[0] is not question:
            count = dimension(question, self._system, self._stopping)
            points = np.random.default_rng(0).standard_normal((_STEPPED, count))
            most = self._stopping.longest / self._system.sample_time
            stride, finest = 1, self._stepped_distances(question, points, 1)
            while 2 * stride <= most:
                coarse = self._stepped_distances(question, points, 2 * stride)
                if not np.abs(np.log(coarse / finest)).max() < _SAME:
                    break
                stride *= 2
            self._stepped = question, stride
        return self._stepped[1]

    def _stepped_distances(self, question: Question, points: Matrix, stride: int) -> Vector:
        """Distances at a step, NaN if the model cannot take it."""
        try:
            results = [
                self._stops.run(drive, values, stride)
                for drive, values, _ in self._draws(question, points)
            ]
        except FMUError:
            return np.full(len(points), np.nan)
        return np.array([result.distance for result in results])

    def _draws(
        self, question: Question, points: Matrix
    ) -> Iterator[tuple[DrivingInputs, dict[str, float], float]]:
        """What drives each stop, values of parameters and states, and what the model leaves."""
        system, stop, known = self._system, question.stop, question.known
        tolerances = system.comparison.tolerances
        first, second = len(known.keys), len(known.keys) + len(tolerances)
        at = places(known.keys, system, stop.conditions)
        levels = known.mean + points[:, :first] @ known.root().T
        factors = np.exp(question.left * _student(points[:, -1], question.freedom))
        start, drive = self._start(stop), self._drive(stop)
        for point, level, factor in zip(points, levels, factors, strict=True):
            values = start | {name: level[j] for name, j in at.items()}
            for (name, spread), u in zip(tolerances.items(), point[first:second], strict=True):
                values[name] = self._usual(name, values) * (1.0 + spread * u)
            differing = replace(drive, to=drive.to.copy(), along=drive.along.copy())
            for difference, u in zip(self._stopping.differences, point[second:-1], strict=True):
                self._move(difference, float(u), values, differing)
            yield differing, values, float(factor)

    def _start(self, stop: Stop) -> dict[str, float]:
        """States at the command, and parameters that conditions set."""
        start = {name: float(value(stop.asked)) for name, value in self._stopping.start.items()}
        return {**self._system.set_by(stop.conditions), **start}

    def _usual(self, name: str, values: Mapping[str, float]) -> float:
        return values[name] if name in values else self._fmu.defaults[name]

    def _drive(self, stop: Stop) -> DrivingInputs:
        driven = self._stopping.driven
        length = max([2, *(values.size for values in stop.along.values())])
        along = np.zeros((len(driven), length))
        to = np.zeros(len(driven))
        for j, signal in enumerate(driven):
            if signal.name in stop.along:
                values = stop.along[signal.name]
                along[j] = np.pad(values, (0, length - values.size), "edge")
            else:
                to[j] = signal.formula(stop.asked)
        delays, lags = np.array([[signal.delay, signal.lag] for signal in driven]).T
        return DrivingInputs(to, np.ascontiguousarray(delays), np.ascontiguousarray(lags), along)

    def _move(
        self, difference: Difference, u: float, values: dict[str, float], drive: DrivingInputs
    ) -> None:
        """Let what differs be u standard deviations off."""
        inputs = [driven.name for driven in self._stopping.driven]
        for name in difference.of:
            if name not in inputs:
                usual = self._usual(name, values)
                values[name] = usual + difference.spread * u * (
                    usual if difference.relative else 1.0
                )
            elif difference.relative:
                drive.to[inputs.index(name)] *= 1.0 + difference.spread * u
                drive.along[inputs.index(name)] *= 1.0 + difference.spread * u
            else:
                drive.to[inputs.index(name)] += difference.spread * u


def dimension(question: Question, system: System, stopping: Stopping) -> int:
    """Number of variables that a question draws."""
    differ = len(system.comparison.tolerances) + len(stopping.differences)
    return len(question.known.keys) + differ + 1


def _student(u: Vector, freedom: int) -> Vector:
    """Values of Student's t that are as likely as those of a standard normal variable, (n,)."""
    far: Vector = np.copysign(stdtrit(freedom, ndtr(-np.abs(u))), u)
    return far


@contextmanager
def open_forecaster(system: System) -> Iterator[Forecaster]:
    """Open a forecaster of a system that says how it stops."""
    with open_model(system) as fmu:
        yield Forecaster(fmu, system, stopping_of(system))


def stopping_of(system: System) -> Stopping:
    """How a system stops."""
    if system.stopping is None:
        raise InputError(
            where=str(system.source),
            found="no table [distance]",
            expected="how the machine comes to rest",
            remedy="write it, see docs/distance.md",
        )
    return system.stopping
