"""How verdicts depend on thresholds of the diagnosis: half and twice of each, same recordings."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Matrix
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.thresholds import Soundness, Thresholds, of_system
from workbench.diagnosis.inference.verdict import conclude
from workbench.diagnosis.run import shown_effects
from workbench.diagnosis.simulation.prediction import Variation
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.diagnosis.simulation.simulator import WhitenedResiduals
from workbench.errors import InputError, WorkerError
from workbench.recordings.case import Case
from workbench.runtime.engine import Engine, StepReporter, silent
from workbench.studies.power.planting import Planting
from workbench.studies.power.run import PowerStudy, Setup, work_off
from workbench.system.system import System

FACTORS = (0.5, 2.0)
_SAMPLES = "samples"


@dataclass(frozen=True)
class VerdictChange:
    """What another threshold makes of a set."""

    # threshold, factor, value: which one, times what, and what it is then
    threshold: str
    factor: float
    value: float
    said: tuple[str, ...]  # verdict, and names of causes, strongest first


@dataclass(frozen=True)
class ThresholdSensitivity:
    """What was said of one set, by the usual thresholds and by others."""

    planting: Planting
    said: tuple[str, ...]  # verdict, and names of causes, strongest first
    # thresholds by which the verdict or the first name is another
    changed: tuple[VerdictChange, ...]


def threshold_values(thresholds: Thresholds) -> dict[str, float]:
    """Each threshold by its name."""
    by_name = dataclasses.asdict(thresholds)
    samples = by_name.pop(_SAMPLES)
    return {**by_name, **samples}


def scaled(thresholds: Thresholds, name: str, factor: float) -> Thresholds:
    """Multiply one threshold by a factor; a count stays a whole number, above 0."""
    old = threshold_values(thresholds)[name]
    new = max(1, round(factor * old)) if isinstance(old, int) else factor * old
    change: dict[str, Any] = {name: new}
    if name in {field.name for field in dataclasses.fields(Soundness)}:
        change = {_SAMPLES: dataclasses.replace(thresholds.samples, **change)}
    return dataclasses.replace(thresholds, **change)


class CachedResidualModel(ResidualModel):
    """Simulates each point once: most thresholds lead a diagnosis along the same points."""

    def __init__(
        self, path: Path, system: System, cases: Sequence[Case], samples: Soundness
    ) -> None:
        super().__init__(ModelSource(path, system, system.given), cases, sound=samples)
        self._points: dict[Any, list[WhitenedResiduals]] = {}
        self._columns: dict[Any, list[Matrix]] = {}

    def at(self, points: Sequence[Mapping[str, float]]) -> list[WhitenedResiduals]:
        """Errors of every recording at its own point."""
        key = _key(points)
        if key not in self._points:
            self._points[key] = super().at(points)
        return self._points[key]

    def derivatives(
        self,
        points: Sequence[Mapping[str, float]],
        columns: Sequence[Variation],
        sizes: Mapping[str, Sequence[str]] | None = None,
    ) -> list[Matrix]:
        """Derivatives of every recording's errors by the columns."""
        point = _key(points)
        keys = [(point, column.variables, _key([column.setting])) for column in columns]
        new = [i for i, key in enumerate(keys) if key not in self._columns]
        if new:
            computed = super().derivatives(points, [columns[i] for i in new], sizes)
            for j, i in enumerate(new):
                self._columns[keys[i]] = [matrix[:, j : j + 1] for matrix in computed]
        matrices = [self._columns[key] for key in keys]
        return [np.hstack([matrix[k] for matrix in matrices]) for k in range(len(self.cases))]


def _key(points: Sequence[Mapping[str, float]]) -> tuple[frozenset[tuple[str, float]], ...]:
    return tuple(frozenset(point.items()) for point in points)


def vary(setup: Setup, planting: Planting, names: Sequence[str]) -> ThresholdSensitivity:
    """Make one set of recordings, and diagnose it by half and twice of each threshold named."""
    cases = setup.record(planting, setup.rig.simulate(planting.seed, planting.gains))
    usual = of_system(setup.system.comparison, len(setup.problem.effects))
    variants = {(name, factor): scaled(usual, name, factor) for name in names for factor in FACTORS}
    by_samples: dict[Soundness, list[Thresholds]] = {}
    for thresholds in (usual, *variants.values()):
        by_samples.setdefault(thresholds.samples, []).append(thresholds)
    verdicts: dict[Thresholds, tuple[str, ...]] = {}
    for samples, alike in by_samples.items():
        verdicts |= _verdicts(setup, cases, samples, alike)
    return ThresholdSensitivity(
        planting,
        verdicts[usual],
        tuple(
            VerdictChange(name, factor, threshold_values(variant)[name], verdicts[variant])
            for (name, factor), variant in variants.items()
            if verdicts[variant][:2] != verdicts[usual][:2]
        ),
    )


def _verdicts(
    setup: Setup, cases: Sequence[Case], samples: Soundness, variants: Sequence[Thresholds]
) -> dict[Thresholds, tuple[str, ...]]:
    """Verdict and causes by each of thresholds that take the same samples."""
    verdicts: dict[Thresholds, tuple[str, ...]] = {}
    try:
        with CachedResidualModel(setup.everything, setup.system, cases, samples) as simulations:
            effects = shown_effects(setup.problem_of(cases), simulations).effects
            for variant in variants:
                diagnosis = conclude(Fit(simulations, effects, variant), effects, silent)
                causes = (cause.effect.name for cause in diagnosis.causes)
                verdicts[variant] = diagnosis.verdict, *causes
    except InputError:  # too few samples are left
        return dict.fromkeys(variants, ("refused",))
    return verdicts


def vary_sets(
    plantings: Sequence[Planting], study: PowerStudy, engine: Engine
) -> tuple[list[ThresholdSensitivity], bool]:
    """Diagnose sets of recordings by half and twice of each threshold.

    Returns
    -------
    results : of the sets that were diagnosed; one that failed is reported and left out.
    interrupted : whether Ctrl-C ended the run; sets that were under way are in the results.
    """
    results: list[ThresholdSensitivity] = []
    progress = StepReporter(engine.report, len(plantings))

    def collect(planting: Planting, result: ThresholdSensitivity | WorkerError) -> None:
        if isinstance(result, WorkerError):
            text = f"failed: {result}"
        else:
            results.append(result)
            text = f"{', '.join(result.said)}; {len(result.changed)} changes"
        progress.step(f"{planting.options}: {text}")

    names = list(threshold_values(of_system(study.system.comparison, len(study.effects))))
    with study.setup() as setup:
        return results, work_off(setup, engine, partial(vary, names=names), plantings, collect)
