"""Diagnosis: what a simulation gets wrong, the physical cause, and a better model.

    recordings -> samples -> prediction errors -> evidence -> fit -> search -> verdict -> extension

One FMU holds the observer model with every effect of the catalogue at size zero; an effect is
switched on by a parameter.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from workbench.case import Case
from workbench.cosim import observe
from workbench.diagnosis.catalogue import Effect, choose, read_effects
from workbench.diagnosis.evidence import FORCE_DELAY, Bench, Court
from workbench.diagnosis.extension import build, source, variables
from workbench.diagnosis.fit import TOLERANCES, Fit
from workbench.diagnosis.residuals import Dependence, Residuals, dependences, residuals
from workbench.diagnosis.search import Reporter
from workbench.diagnosis.verdict import Cause, Diagnosis, Gain, Interval, judge
from workbench.errors import InputError
from workbench.files import write_whole
from workbench.fmu import FMU
from workbench.modelica import Library
from workbench.objective import Weights, score
from workbench.observers import DisturbanceObserver, ExtendedKalmanFilter
from workbench.observers.disturbance import stationary_gains
from workbench.observers.kalman import FilterNoise

__all__ = [
    "TOLERANCES",
    "Cause",
    "Dependence",
    "Diagnosis",
    "Effect",
    "Extension",
    "Gain",
    "Interval",
    "Outcome",
    "Residuals",
    "choose",
    "diagnose",
    "read_effects",
]

EXTENDED = "Extended"

_ASKED = ("rW", "rR", "rB", "JW", "JR", "Fz", "muDC", "actuation.kappa", "actuation.p0")


@dataclass(frozen=True)
class Extension:
    """The extended model: its source, its FMU, and how far its predictions are from the fit's.

    Attributes
    ----------
    difference : largest, in standard deviations of the noise of a sample mean.
    """

    modelica: Path
    fmu: Path
    difference: float


@dataclass(frozen=True, eq=False)
class Outcome:
    """A diagnosis and all that shows it.

    Attributes
    ----------
    levels : calibrated values by quantity and surface, such as ("muDC", "dry"): (value, unit).
    deviations : by stop and quantity, in standard deviations of its tolerance.
    set_aside : number of samples by stop and reason.
    has_force : whether Fx was measured.
    observers : by observer and stop, error of the creep force (rms over mean [1]) with the model
        before and after; empty where nothing was extended or Fx was not measured, and for effects
        that turn with the wheel, whose phase an observer does not know.
    """

    diagnosis: Diagnosis
    residuals: Sequence[Residuals]
    dependences: Sequence[Dependence]
    levels: dict[tuple[str, str], tuple[float, str]]
    deviations: dict[str, dict[str, float]]
    set_aside: dict[str, dict[str, int]]
    has_force: bool
    observers: dict[str, dict[str, tuple[float, float]]]
    extension: Extension | None


def diagnose(
    cases: Sequence[Case],
    effects: Sequence[Effect],
    library: Library,
    base: str,
    model: Path,
    out: Path,
    workers: int,
    report: Reporter,
    *,
    every_platform: bool = False,
) -> Outcome:
    """Find what an observer model lacks, from recorded stops; write the extended model.

    Parameters
    ----------
    cases : Fx is used if all of them have it.
    effects : of the library, that are considered.
    base : name of the model of the library whose slots they fill.
    model : FMU of the base model, or of an extension of it: its values are kept.
    out : folder of the extended model.
    report : takes a line on what is being done.
    every_platform : whether the extended FMU is for all platforms, or only for this machine's.

    Raises
    ------
    InputError
        If there are too few stops, or one has too little that counts; if the library cannot be
        compiled, or the model is none of this library.
    """
    if len(cases) < 2:
        raise InputError(
            where="recorded stops",
            found=str(len(cases)),
            expected="two or more, because a cause is judged on stops it was not fitted to",
            remedy="give the folder that holds all stops of one rig",
        )
    if any(case.Fx is None for case in cases):
        cases = [replace(case, Fx=None) for case in cases]
    with tempfile.TemporaryDirectory() as scratch:
        everything = Path(scratch) / "AllEffects.fmu"
        report(f"compiling {len(effects)} effects")
        about = "Observer model with every effect, at zero"
        text = source(library, base, "AllEffects", effects, {}, {}, about)
        build(library, "AllEffects", text, everything, every_platform=False)
        given = _given(everything, model, base)
        with Court(everything, given, cases, workers) as court:
            fit = Fit(court, effects)
            diagnosis = judge(fit, effects, report)
            best = diagnosis.best
            found = residuals(court, fit, diagnosis.base.linearised, best.linearised)
            extension = _extend(
                *(court, fit, diagnosis, effects, library, base, out, report),
                every_platform=every_platform,
            )
            observers: dict[str, dict[str, tuple[float, float]]] = {}
            turning = any(effect.order_locked for effect in best.active)
            if extension is not None and cases[0].Fx is not None and not turning:
                report("observers with both models")
                observers = _observers(cases, model, extension.fmu)
            units = {"muDC": "1", "muWR": "1", FORCE_DELAY: "s"}
            return Outcome(
                diagnosis=diagnosis,
                residuals=found,
                dependences=dependences(court, found),
                levels={
                    key: (float(value), units[key[0]]) for key, value in best.point.levels.items()
                },
                deviations={
                    name: dict(zip(TOLERANCES, map(float, row), strict=True))
                    for name, row in zip(fit.names, best.point.deviations, strict=True)
                },
                set_aside={stop.name: stop.set_aside for stop in court.stops},
                has_force=cases[0].Fx is not None,
                observers=observers,
                extension=extension,
            )


def _given(everything: Path, model: Path, base: str) -> dict[str, float]:
    """Parameters of the diagnosed model that differ from the library's defaults.

    Raises
    ------
    InputError
        If the model is no observer model of this library.
    """
    with FMU(everything) as extended, FMU(model) as diagnosed:
        if missing := [name for name in _ASKED if name not in diagnosed.defaults]:
            raise InputError(
                where=str(model),
                found=f"no parameter '{missing[0]}'",
                expected=f"the FMU of {base}, or of a model that extends it",
                remedy="give such an FMU with --model",
            )
        return {
            name: value
            for name, value in diagnosed.defaults.items()
            if name in extended.parameters and value != extended.defaults[name]
        }


def _extend(
    court: Court,
    fit: Fit,
    diagnosis: Diagnosis,
    effects: Sequence[Effect],
    library: Library,
    base: str,
    out: Path,
    report: Reporter,
    *,
    every_platform: bool,
) -> Extension | None:
    """Write the extended model, compile it, compare its predictions with those of the fit."""
    if not diagnosis.causes:
        return None
    report("compiling the extended model")
    point = diagnosis.best.point
    values: dict[str, dict[str, float]] = {}
    for effect in effects:
        for variable, value in court.given.items():
            slot, _, parameter = variable.rpartition(".")
            if slot == variables(effect, parameter)[0].rpartition(".")[0]:
                values.setdefault(effect.name, {})[parameter] = value
    for (name, parameter), value in point.sizes.items():
        # An order-locked effect has another phase in each stop; the model turns from angle zero.
        known = values.setdefault(name, {})
        part = "cosine" if parameter == "amplitude" else parameter
        is_size = part in next(one for one in effects if one.name == name).sizes
        known[part] = (known.get(part, 0.0) if is_size else 0.0) + value
    present = [effect for effect in effects if effect.name in values]
    own = {name: value for name, value in court.given.items() if "." not in name}
    own |= {
        name: value
        for (name, surface), value in point.levels.items()
        if surface == "dry" and name == "muDC"
    }
    about = f"{base} with {', '.join(effect.name for effect in present)}"
    text = source(library, base, EXTENDED, present, values, own, about)
    folder = out / "model"
    folder.mkdir(parents=True, exist_ok=True)
    modelica, path = folder / f"{EXTENDED}.mo", folder / f"{EXTENDED}.fmu"
    write_whole(modelica, text)
    build(library, EXTENDED, text, path, every_platform=every_platform)
    bench = Bench(path, court.stops)
    difference = 0.0
    for k, evidence in enumerate(diagnosis.best.linearised.evidence):
        given = {
            name: value
            for name, value in fit.values(point)[k].items()
            if name in bench.parameters or name == FORCE_DELAY
        }
        errors = bench.at(k, given).errors
        difference = max(difference, float(np.abs(errors - evidence.errors).max()))
    bench.close()
    return Extension(modelica, path, difference)


def _observers(
    cases: Sequence[Case], before: Path, after: Path
) -> dict[str, dict[str, tuple[float, float]]]:
    """Errors of the creep force, with the gains of the nominal model in both."""
    errors: dict[str, dict[str, list[float]]] = {}
    with FMU(before) as nominal, FMU(after) as extended:
        gains = stationary_gains(nominal)
        for fmu in (nominal, extended):
            for estimator in (
                DisturbanceObserver(fmu, gains),
                ExtendedKalmanFilter(fmu, FilterNoise()),
            ):
                by_stop = errors.setdefault(estimator.name, {})
                for case in cases:
                    run = observe(case, estimator)
                    error = score(case, run, fmu.defaults["rR"], Weights()).Fx_nrmse
                    by_stop.setdefault(case.name, []).append(np.nan if error is None else error)
    return {
        name: {stop: (pair[0], pair[1]) for stop, pair in by_stop.items()}
        for name, by_stop in errors.items()
    }
