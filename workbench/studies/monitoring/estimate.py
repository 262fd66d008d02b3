"""Estimate constant quantities from one recording: a value of each, with its covariance."""

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.counting import count
from workbench.diagnosis.data.samples import compared
from workbench.diagnosis.inference.thresholds import SOUND
from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.observers.estimators.unscented import UnscentedKalmanFilter
from workbench.observers.replay import replay
from workbench.observers.run import Ending
from workbench.recordings.case import UNKNOWN, Case
from workbench.system.parts import EstimatedQuantity
from workbench.system.registry import open_model
from workbench.system.system import System


@dataclass(frozen=True, eq=False)
class RecordingEstimate:
    """What one recording says."""

    values: Vector  # (q,) of the watched quantities, SI
    covariance: Matrix  # (q, q), by the noise of sensors alone
    work: Vector  # (w,) of friction along the whole recording, by the powers of the system [J]
    counted: float  # time that the values rest on [s]


def watched(system: System) -> tuple[EstimatedQuantity, ...]:
    """Quantities of the machine that no condition sets to a value of its own."""
    set_by = {
        name
        for condition in system.conditions
        for parameters in condition.parameters.values()
        for name in parameters
    } | {condition.sets for condition in system.conditions}
    return tuple(
        quantity
        for quantity in system.estimated
        if quantity.watched and quantity.name not in set_by
    )


def reach(estimated: EstimatedQuantity) -> float:
    """Standard deviation of what is known of a quantity before a recording: all of its range."""
    return float((estimated.high - estimated.low) / np.sqrt(12.0))


def _limits(estimated: EstimatedQuantity) -> tuple[float, float]:
    """As much beyond the range as it is wide, on a side where that has no other sign.

    A filter that is on its way to values within must not end at a limit: what else it estimates
    would have to make up for that.
    """
    low, high = estimated.range
    below, above = 2.0 * low - high, 2.0 * high - low
    return low if below < 0.0 <= low else below, high if high <= 0.0 < above else above


class RecordingEstimator:
    """Estimates the quantities of recordings as constants, by the system's model.

    A Kalman filter whose quantities do not walk is recursive least squares on the model, which
    weighs every sample by what it tells: D. Simon, Optimal State Estimation, Wiley 2006, section
    3.3. Nothing is known of them before but their ranges, so that no recording leans on another.
    Over a whole range a model is far from linear: points linearise it where derivatives, taken
    where a wheel seems to slide, say nothing of its radius.

    Parameters
    ----------
    model : of the system's observer.
    """

    def __init__(self, system: System, model: FMU) -> None:
        self.system = system  # whose recordings they are
        constant = [
            replace(quantity, walk=0.0, spread=reach(quantity), range=_limits(quantity))
            for quantity in system.estimated
            if quantity.watched
        ]
        # Recordings with an aid and without would be compared, and what wears as it should be told.
        self._constant = replace(
            system, estimated=tuple(constant), learns=math.inf, intermittent=()
        )
        self._model = model
        self.warned = ""  # by the FMU, in the recording that was estimated last
        self._filters: dict[tuple[tuple[str, float], ...], UnscentedKalmanFilter] = {}

    def __call__(self, case: Case) -> RecordingEstimate:
        """Estimate from one recording.

        Raises
        ------
        InputError
            If too little of it counts, nobody knows a condition that the model asks for, or the
            filter fails.
        """
        names = (*case.inputs, *compared(self._constant, [case]))
        samples = count(case, self._constant, names, SOUND, restarting=False)
        end = int(np.flatnonzero(samples.usable)[-1]) + 1
        clean = case.with_signals(samples.clean)
        estimator = self._filter(_parameters(case, self._constant))
        run = replay(clean.part(slice(0, end)), estimator)
        self.warned = run.message
        if run.ending is not Ending.OK:
            raise InputError(
                where=str(case.source),
                found=f"a recording on which the filter fails: {run.ending.value} {run.message}",
                expected="one that the model follows",
                remedy="leave it out; `workbench simulate` shows where it fails",
            )
        estimated = [quantity.name for quantity in self._constant.estimated]
        own = [estimated.index(quantity.name) for quantity in watched(self._constant)]
        values = {name: float(run.signal(name)[-1]) for name in estimated}
        system, known = self._constant, {**self._constant.values, **values}
        powers = [system.evaluate(wear.formula, clean.signals, known) for wear in system.work]
        return RecordingEstimate(
            values=np.array([values[estimated[column]] for column in own]),
            covariance=estimator.covariance[np.ix_(own, own)],
            work=np.array([np.trapezoid(power, clean.time) for power in powers]),
            counted=float(samples.usable.sum() * np.median(np.diff(case.time))),
        )

    def _filter(self, parameters: Mapping[str, float]) -> UnscentedKalmanFilter:
        key = tuple(sorted(parameters.items()))
        if key not in self._filters:
            model = self._model.variant(parameters)
            self._filters[key] = UnscentedKalmanFilter.untuned(model, self._constant)
        return self._filters[key]


@contextmanager
def open_estimator(system: System) -> Iterator[RecordingEstimator]:
    """Open the system's model, and estimate with it."""
    with open_model(system) as model:  # which closes its variants
        yield RecordingEstimator(system, model)


def _parameters(case: Case, system: System) -> dict[str, float]:
    """Parameters of the model that the conditions of a recording set, but for those estimated."""
    for condition in system.conditions:
        if (condition.parameters or condition.sets) and case.conditions.get(
            condition.name
        ) == UNKNOWN:
            raise InputError(
                where=str(case.source),
                found=f"{condition.label}: unknown",
                expected="what it was, because the model is another one by that",
                remedy=f"write {condition.name} into case.toml, if anybody knows",
            )
    estimated = {quantity.name for quantity in system.estimated}
    values = system.set_by(case.conditions)
    return {name: value for name, value in values.items() if name not in estimated}
