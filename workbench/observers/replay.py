"""An estimator beside a recording, stage 4."""

import time
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError
from workbench.observers import Estimate, Estimator, Gains
from workbench.observers.gains import usual_gains
from workbench.observers.run import Ending, Run
from workbench.observers.trajectory import check_along
from workbench.recordings.case import Case
from workbench.system.plugins import find_plugin, load
from workbench.system.registry import open_model
from workbench.system.system import System

SURE = 0.95  # probability, that of a band


def run_on_model(
    case: Case, system: System, estimator: type[Estimator], gains: Gains | None = None
) -> Run:
    """Feed a recording to an estimator on the system's model, with its usual gains unless given."""
    with open_model(system, estimator.role) as fmu:
        return replay(case, estimator(fmu, system, gains or usual_gains(estimator, fmu, system)))


def replay(case: Case, estimator: Estimator) -> Run:
    """Feed a recording to an estimator, sample by sample; a failure is a value of the run."""
    begin = time.perf_counter()
    system = estimator.system
    blank = np.full((case.time.size, len(system.columns)), np.nan)
    estimate = Estimate(
        blank, blank, blank[:, 0], np.full((len(blank), len(estimator.modes)), np.nan)
    )
    validity: dict[str, NDArray[np.bool_]] = {}
    ending, message = Ending.OK, ""
    try:
        estimator.set_conditions(case.conditions)
        doubts = [check_along(model, system, case) for model in estimator.models]
        for model in estimator.models:
            model.begin_at(case.model_time)
        estimate = estimator.run(case.time, case.u, case.y)
        seconds = time.perf_counter() - begin
        values = np.asarray(estimate.values)
        given = np.isfinite(values[0])  # what the method estimates at all
        if not given.any():
            ending, message = Ending.NOT_FINITE, "from the start"
        elif (lost := np.flatnonzero(~np.isfinite(values[:, given]).all(axis=1))).size:
            ending = Ending.NOT_FINITE
            message = f"at t = {case.time[lost[0]]:.3f} s"
        validity = _claims(case, estimator, values, np.asarray(estimate.probability))
        warned = [*doubts, *(model.take_warning() for model in estimator.models)]
        message = message or "; ".join(filter(None, warned))
    except FMUError as error:
        seconds = time.perf_counter() - begin
        ending, message = Ending.FMU_FAILED, str(error)
    both = np.asarray(estimate.values), np.asarray(estimate.sigma)
    values, sigma = with_indirect(system.under(case.conditions), *both)
    return Run(
        case=case.name,
        estimator=estimator.name,
        columns={
            **system.columns,
            **{n: signal.unit for n, (signal, _) in system.indirect.items()},
        },
        time=case.time,
        estimate=values,
        sigma=sigma,
        nis=np.asarray(estimate.nis),
        ending=ending,
        message=message,
        seconds=seconds,
        claimed=validity
        or {
            name: np.zeros(case.time.size, bool) for name in quantities_with_rules(estimator.system)
        },
        probability=dict(zip(estimator.modes, np.asarray(estimate.probability).T, strict=True)),
    )


def with_indirect(system: System, values: Matrix, sigma: Matrix) -> tuple[Matrix, Matrix]:
    """Estimates and standard deviations, (n, w + d), with those of `System.indirect` behind them.

    Standard deviations to first order: by what a formula changes over both of its column's.
    """
    more, deviations = [values], [sigma]
    for signal, name in system.indirect.values():
        at = list(system.columns).index(name)
        value, reach = values[:, at], sigma[:, at]
        middle, high, low = (
            system.evaluate(signal.formula, {name: column})
            for column in (value, value + reach, value - reach)
        )
        more.append(middle[:, None])
        deviations.append(0.5 * np.abs(high - low)[:, None])
    return np.hstack(more), np.hstack(deviations)


def _rules(system: System) -> Mapping[str, object]:
    """Rules of the system's plugin on when a quantity is shown, by its name."""
    return load(find_plugin(system.plugin).validity) or {}


def quantities_with_rules(system: System) -> list[str]:
    """Estimated quantities that are not always shown, and of which the machine says where."""
    rules = _rules(system)
    return [
        quantity.name for quantity in system.estimated if quantity.claimed or quantity.name in rules
    ]


def _claims(
    case: Case, estimator: Estimator, values: Matrix, probability: Matrix
) -> dict[str, NDArray[np.bool_]]:
    """Where quantities may be claimed; of several models, by those that are hardly wrong.

    A rule judges by the estimate itself, which may pass through what the rule asks for: where a
    linearised filter first sees a quantity, a noisy sample may lead it far off, and makes it sure.
    So the rule must be met for as long as the quantity takes to walk as far as is useful.
    """
    rules, system = _rules(estimator.system), estimator.system
    validity = {}
    for name in quantities_with_rules(estimator.system):
        quantity = next(quantity for quantity in system.estimated if quantity.name == name)
        met = all(
            key in estimator.finds or case.conditions[key] == value
            for key, value in quantity.claimed.items()
        )
        if met and name in rules:
            shares = [rules[name](fmu, system, values) for fmu in estimator.models]  # type: ignore[operator]
            weights = probability if estimator.modes else np.ones((case.time.size, 1))
            sure = (np.column_stack(shares) * weights).sum(axis=1) > SURE
            span = (quantity.useful / quantity.walk) ** 2 if quantity.walk > 0.0 else 0.0
            validity[name] = lasting(sure, case.time, span)
        else:
            validity[name] = np.full(case.time.size, met)
    return validity


def lasting(met: NDArray[np.bool_], time: Vector, span: float) -> NDArray[np.bool_]:
    """Where a condition has been met for so long [s], (n,).

    >>> lasting(np.array([1, 0, 1, 1, 1], bool), np.arange(5.0), 2.0).tolist()
    [False, False, False, True, True]
    """
    unmet = np.maximum.accumulate(np.where(met, time[0], time))
    kept: NDArray[np.bool_] = met & (time - unmet >= span)
    return kept
