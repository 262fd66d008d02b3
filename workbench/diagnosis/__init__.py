"""Diagnosis: what a simulation gets wrong, the physical cause, and a better model.

    recordings -> samples -> prediction errors -> evidence -> fit -> search -> verdict -> extension
        -> errors on recordings that were held out

One FMU holds the observer model with every effect of the catalogue at size zero; an effect is
switched on by a parameter.
"""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from workbench.diagnosis.data.clocks import case_in_time, catalogue, late_signals
from workbench.diagnosis.data.counting import refuse_too_few
from workbench.diagnosis.effects.catalogue import Effect, choose, read_effects
from workbench.diagnosis.effects.extension import build, parameter_of, source
from workbench.diagnosis.inference.certainty import Certainty, assess
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.residuals import Dependence, Residuals, dependences, residuals
from workbench.diagnosis.inference.rivals import gathered
from workbench.diagnosis.inference.sample_errors import Errors, errors_of, held_out_errors
from workbench.diagnosis.inference.search import Reporter
from workbench.diagnosis.inference.verdict import Cause, Diagnosis, Gain, Interval, conclude
from workbench.diagnosis.outcome import Extension, Outcome
from workbench.diagnosis.simulation.evidence import Simulations
from workbench.diagnosis.simulation.simulator import delay, simulating
from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.models.modelica import Library
from workbench.observers.estimators.disturbance import DisturbanceObserver
from workbench.observers.estimators.kalman import ExtendedKalmanFilter
from workbench.observers.replay import replay
from workbench.observers.score import score
from workbench.recordings.case import Case
from workbench.runtime.files import write_whole
from workbench.runtime.progress import ProgressReporter
from workbench.system.reader import with_model
from workbench.system.registry import open_model
from workbench.system.system import OBSERVER, System

__all__ = [
    "Cause",
    "Dependence",
    "Diagnosis",
    "Effect",
    "Errors",
    "Extension",
    "Gain",
    "Interval",
    "Outcome",
    "Residuals",
    "catalogue",
    "choose",
    "diagnose",
    "given_values",
    "read_effects",
]

EVERYTHING, EXTENDED = "AllEffects", "Extended"
# Observers that are tried with both models: one with a gain for all, one that makes it as it goes.
_TRIED = (DisturbanceObserver, ExtendedKalmanFilter)


def diagnose(
    system: System,
    cases: Sequence[Case],
    library: Library,
    effects: Sequence[Effect],
    out: Path,
    workers: int,
    report: Reporter,
    *,
    held_out: Sequence[Case] = (),
    every_platform: bool = False,
    certainty: bool = False,
) -> Outcome:
    """Find what an observer model lacks, from recordings; write the extended model.

    Parameters
    ----------
    system : whose observer model is diagnosed, or an extension of it: its values are kept.
    cases : what is only there to judge by is compared if all of them have it. Of a single one,
        parts are held out, since a cause is judged on what it was not fitted to.
    library : of the system, which holds the effects.
    effects : that are considered.
    out : folder of the extended model.
    report : takes a line on what is being done.
    held_out : recordings on which only the errors of both models are measured: all that is common
        is as fitted to the others, only what differs between recordings is fitted.
    every_platform : whether the extended FMU is for all platforms, or only for this machine's.
    certainty : whether it is asked how sure the sizes are, by fits of their own.

    Raises
    ------
    InputError
        If there are too few recordings, or one has too little that counts; if the library cannot be
        compiled, or the model is none of this library.
    """
    refuse_too_few(cases, system)
    with tempfile.TemporaryDirectory() as scratch:
        everything = Path(scratch) / f"{EVERYTHING}.fmu"
        report(f"compiling {len(effects)} effects")
        build_everything(system, library, effects, everything)
        given = given_values(everything, system)
        with Simulations(
            *(everything, system, given, cases, workers), report=report
        ) as simulations:
            fit = Fit(simulations, effects)
            diagnosis = conclude(fit, effects, report)
            asked = certainty and bool(diagnosis.causes) and not diagnosis.interrupted
            assessed = assess(fit, diagnosis.best, report) if asked else None
            extension = _extend(
                *(simulations, fit, diagnosis, effects, library, out, report),
                every_platform=every_platform,
            )
            base, best = diagnosis.base, diagnosis.best
            errors = errors_of(simulations, base.linearised, best.linearised, held_out=False)
            starts = fit.unknowns.starts(best.point)
            if held_out:
                report("errors on recordings that were held out")
                fitted = (everything, simulations, effects, base, best)
                more, their_starts = held_out_errors(*fitted, held_out, workers)
                errors, starts = errors + more, starts | their_starts
            observers = _observers(simulations, diagnosis, extension, report)
            starts = _differing(system, extension, starts)
            found = (diagnosis, assessed, extension, observers, errors, starts)
            return _outcome(simulations, fit, *found)


def _outcome(
    simulations: Simulations,
    fit: Fit,
    diagnosis: Diagnosis,
    certainty: Certainty | None,
    extension: Extension | None,
    observers: Mapping[str, Mapping[str, tuple[float, float]]],
    errors: Sequence[Errors],
    starts: Mapping[str, Mapping[str, float]],
) -> Outcome:
    """All that was found, with what shows it."""
    unknowns, point = fit.unknowns, diagnosis.best.point
    found = residuals(simulations, fit, diagnosis.base.linearised, diagnosis.best.linearised)
    return Outcome(
        system=simulations.system,
        cases=tuple(simulations.cases),
        diagnosis=diagnosis,
        residuals=found,
        dependences=dependences(simulations, found),
        levels={
            key: (float(value), unknowns.level_unit(key)) for key, value in point.levels.items()
        },
        deviations={
            name: dict(zip(unknowns.local, map(float, row), strict=True))
            for name, row in zip(unknowns.names, point.deviations, strict=True)
        },
        set_aside={recording.name: recording.set_aside for recording in simulations.recordings},
        observers=observers,
        extension=extension,
        errors=tuple(errors),
        starts=starts,
        rivals=gathered(simulations, fit, diagnosis.base, diagnosis.rivals)
        if diagnosis.rivals
        else None,
        certainty=certainty,
    )


def _differing(
    system: System, extension: Extension | None, starts: Mapping[str, Mapping[str, float]]
) -> dict[str, dict[str, float]]:
    """Of start values by recording, those of the last model that it does not have itself."""
    with open_model(system) if extension is None else FMU(extension.fmu) as model:
        return {
            recording: {
                name: float(value)
                for name, value in values.items()
                if name in model.defaults and value != model.defaults[name]
            }
            for recording, values in starts.items()
        }


def build_everything(
    system: System, library: Library, effects: Sequence[Effect], path: Path
) -> None:
    """Write the FMU of the observer model with every effect at zero."""
    about = "Observer model with every effect, at zero"
    base = system.models[OBSERVER].name
    text = source(library, base, EVERYTHING, effects, {}, {}, about)
    build(library, EVERYTHING, text, path, every_platform=False)


def given_values(everything: Path, system: System) -> dict[str, float]:
    """Parameters of the diagnosed model that differ from the library's defaults.

    Raises
    ------
    InputError
        If the model is no observer model of this library.
    """
    with FMU(everything) as extended, open_model(system) as diagnosed:
        compare = system.comparison
        asked = [*compare.tolerances, *compare.levels, *sorted(system.constants)]
        if missing := [name for name in asked if name not in diagnosed.defaults]:
            raise InputError(
                where=str(diagnosed.path),
                found=f"no parameter '{missing[0]}'",
                expected=f"the FMU of {system.models[OBSERVER].name}, or of one that extends it",
                remedy="give such an FMU with --model",
            )
        return {
            name: value
            for name, value in diagnosed.defaults.items()
            if name in extended.parameters and value != extended.defaults[name]
        }


def _extend(
    simulations: Simulations,
    fit: Fit,
    diagnosis: Diagnosis,
    effects: Sequence[Effect],
    library: Library,
    out: Path,
    report: Reporter,
    *,
    every_platform: bool,
) -> Extension | None:
    """Write the extended model, compile it, compare its predictions with those of the fit."""
    if not diagnosis.causes:
        return None
    report("compiling the extended model")
    system, base = simulations.system, simulations.system.models[OBSERVER].name
    values = _values(simulations, diagnosis, effects)
    present = [effect for effect in effects if effect.name in values and not effect.late]
    own = {name: value for name, value in simulations.given.items() if "." not in name}
    own |= _usual_levels(simulations, diagnosis)
    arrays = {name.partition("[")[0] for name in own if "[" in name}
    every = {n: v for n, v in simulations.nominal.items() if n.partition("[")[0] in arrays}
    own = {**every, **own}
    added = ", ".join(effect.name for effect in present) or "calibrated levels"
    about = f"{base} with {added}"
    text = source(library, base, EXTENDED, present, values, own, about)
    folder = out / "model"
    folder.mkdir(parents=True, exist_ok=True)
    modelica, path = folder / f"{EXTENDED}.mo", folder / f"{EXTENDED}.fmu"
    write_whole(modelica, text)
    build(library, EXTENDED, text, path, every_platform=every_platform)
    point, difference = diagnosis.best.point, 0.0
    read = {*(delay(name) for name in system.signals), *late_signals(system)}
    with simulating(simulations.simulated._replace(path=path, system=system)) as extended:
        for k, evidence in enumerate(diagnosis.best.linearised.evidence):
            known = {
                name: value
                for name, value in fit.unknowns.values(point)[k].items()
                if name in extended.parameters or name in read
            }
            errors = extended.at(k, known).errors
            difference = max(difference, float(np.abs(errors - evidence.errors).max()))
    return Extension(modelica, path, difference)


def _values(
    simulations: Simulations, diagnosis: Diagnosis, effects: Sequence[Effect]
) -> dict[str, dict[str, float]]:
    """Parameters of the effects that the extended model has, by effect."""
    values: dict[str, dict[str, float]] = {}
    for effect in effects:
        for variable, value in simulations.given.items():
            if parameter := parameter_of(effect, variable):
                values.setdefault(effect.name, {})[parameter] = value
    for (name, parameter), value in diagnosis.best.point.sizes.items():
        # An order-locked effect has another phase in each recording; the model turns from zero.
        known = values.setdefault(name, {})
        part = "cosine" if parameter == "amplitude" else parameter
        is_size = part in next(effect for effect in effects if effect.name == name).sizes
        known[part] = (known.get(part, 0.0) if is_size else 0.0) + value
    return values


def _usual_levels(simulations: Simulations, diagnosis: Diagnosis) -> dict[str, float]:
    """Calibrated levels of what is free, where conditions are the usual ones."""
    system = simulations.system
    found = {}
    for (name, choice), value in diagnosis.best.point.levels.items():
        level = system.comparison.levels.get(name)
        if level is None or np.isfinite(level.spread):
            continue
        if not level.by or choice == str(system.condition(level.by).choices[0]):
            found[name] = value
    return found


def _observers(
    simulations: Simulations,
    diagnosis: Diagnosis,
    extension: Extension | None,
    report: Reporter,
) -> dict[str, dict[str, tuple[float, float]]]:
    """Errors of the judged signal, with the gains of the nominal model in both."""
    system, cases = simulations.system, simulations.cases
    turning = any(effect.order_locked for effect in diagnosis.best.active)
    judged = all(system.objective.signal in case for case in cases)
    if extension is None or turning or not judged:
        return {}
    report("observers with both models")
    gains = {}
    with open_model(system) as nominal:
        for kind in _TRIED:
            try:
                gains[kind.name] = kind.reasoned(nominal, system)
            except InputError as refused:  # a model may be fit for this, and for no observer
                report(f"no {kind.label}: {refused.found}")
    errors: dict[str, dict[str, list[float]]] = {}
    counted = ProgressReporter(report, "runs of observers").part(2 * len(gains) * len(cases))
    sizes = diagnosis.best.point.sizes
    after = (
        with_model(system, OBSERVER, extension.fmu),
        [case_in_time(case, system, sizes) for case in cases],
    )
    for one, recorded in ((system, cases), after):
        with open_model(one) as fmu:
            for kind in (kind for kind in _TRIED if kind.name in gains):
                estimator = kind(fmu, one, gains[kind.name])
                by_case = errors.setdefault(kind.name, {})
                for case in recorded:
                    error = score(case, replay(case, estimator), one).nrmse
                    by_case.setdefault(case.name, []).append(np.nan if error is None else error)
                    counted(case)
    return {
        name: {case: (pair[0], pair[1]) for case, pair in by_case.items()}
        for name, by_case in errors.items()
    }
