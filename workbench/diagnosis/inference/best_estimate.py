"""The best estimate of a recording: what the smoother makes of it, on each model."""

from typing import Any

import numpy as np

from workbench.diagnosis.data.cleaning import Mask
from workbench.diagnosis.data.clocks import case_in_time
from workbench.diagnosis.outcome import Outcome
from workbench.observers.run import Run
from workbench.observers.score import judged_window, score
from workbench.observers.simulation import CaseResult, hidden, smoother_run
from workbench.system.reader import with_model
from workbench.system.system import OBSERVER
from workbench.system.units import BAND


def best_estimate(outcome: Outcome, recording: str) -> CaseResult | None:
    """Estimates of what no sensor reads, by model, from inputs and outputs alone.

    None where no model explains the recordings, or by effects that turn with a shaft, whose phase
    an estimator does not know; and where no model is fit for a smoother.
    """
    if outcome.diagnosis.verdict == "unexplained" or outcome.turns:
        return None
    system, extension = outcome.system, outcome.extension
    case = next(case for case in outcome.cases if case.name == recording)
    in_time = case_in_time(case, system, outcome.diagnosis.best.point.sizes)
    models = {"nominal_model": (system, case)}
    if extension is not None:
        models["extended_model"] = (with_model(system, OBSERVER, extension.fmu), in_time)
    smoothed_runs = {
        name: smoother_run(recorded, model) for name, (model, recorded) in models.items()
    }
    runs = {name: run for name, run in smoothed_runs.items() if run is not None}
    scores = {name: score(in_time, run, system) for name, run in runs.items()}
    return CaseResult(system, in_time, runs, scores, None) if runs else None


def bands(result: CaseResult) -> dict[str, dict[str, dict[str, Any]]]:
    """Numbers of what is hidden, by model and quantity; see `_band`."""
    system, window = result.system, judged_window(result.case, result.system)
    counted = np.zeros(result.case.time.size, np.bool_)
    counted[window if window.stop else slice(None)] = True
    bands: dict[str, dict[str, dict[str, Any]]] = {}
    for model, run in result.runs.items():
        bands[model] = {}
        for name in hidden(system):
            kept = counted & run.claimed.get(name, True) & np.isfinite(run.deviation(name))
            if kept.any():
                bands[model][name] = _band(result, run, name, kept)
    return bands


def _band(result: CaseResult, run: Run, name: str, kept: Mask) -> dict[str, Any]:
    """Means of an estimate and of the ends of its 95 % band, over samples that are kept.

    `inside` is the share of means over a block, of a sensor that only judges, which lie in the band
    with the sensor's own noise; None without such a sensor.
    """
    case, system = result.case, result.system
    value, sigma = run.signal(name)[kept], run.deviation(name)[kept]
    mean, reach, inside = float(value.mean()), BAND * float(sigma.mean()), None
    if name in case:
        sensor, read = system.signals[name], case[name][kept]
        noise = sensor.noise + sensor.relative_noise * np.abs(read)
        block = np.floor((case.time[kept] - case.time[0]) / system.comparison.block)
        _, at, counts = np.unique(block, return_inverse=True, return_counts=True)
        error, sigma, noise = (np.bincount(at, v) / counts for v in (read - value, sigma, noise))
        band = BAND * np.hypot(sigma, noise / np.sqrt(counts))
        inside = float((np.abs(error) < band).mean())
    ends = {"value": mean, "low": mean - reach, "high": mean + reach}
    return {**ends, "unit": run.columns[name], "inside": inside}
