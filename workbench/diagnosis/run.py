"""A diagnosis, from recordings to the extended model and what it gains."""

import tempfile
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from workbench.arrays import Vector
from workbench.diagnosis.data.clocks import DELAY, case_in_time, late_signals
from workbench.diagnosis.data.counting import refuse_too_few
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.data.sensors import (
    case_by_sensors,
    fitting_recordings,
    sensor_errors,
)
from workbench.diagnosis.effects.candidates import (
    COEFFICIENT,
    LAG,
    of_moving_states,
    rate_terms,
    with_starts,
    zero,
)
from workbench.diagnosis.effects.catalogue import Effect
from workbench.diagnosis.effects.extension import (
    ExtendedModel,
    build,
    parameter_of,
    variables,
)
from workbench.diagnosis.inference.certainty import assess
from workbench.diagnosis.inference.coupling import coupling
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.residuals import dependences, residuals
from workbench.diagnosis.inference.rivals import gathered
from workbench.diagnosis.inference.sample_errors import errors_of, held_out_errors
from workbench.diagnosis.inference.verdict import Diagnosis, conclude
from workbench.diagnosis.outcome import Extension, Outcome
from workbench.diagnosis.problem import Problem
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.diagnosis.simulation.simulator import delay, simulating
from workbench.errors import InputError
from workbench.models.added import write_extended
from workbench.models.description import MODEL_EXCHANGE
from workbench.models.fmu import FMU
from workbench.models.instance import EventError
from workbench.models.modelica import Library
from workbench.observers.estimators.disturbance import DisturbanceObserver
from workbench.observers.estimators.kalman import ExtendedKalmanFilter
from workbench.observers.replay import replay
from workbench.observers.score import score
from workbench.observers.trajectory import doubts_along
from workbench.runtime.engine import Engine, ProgressReporter
from workbench.runtime.files import write_whole
from workbench.system.reader import with_model
from workbench.system.registry import open_file, open_model
from workbench.system.system import OBSERVER, System

Result = TypeVar("Result")

EVERYTHING, EXTENDED = "AllEffects", "Extended"
# Observers that are tried with both models: one with a gain for all, one that makes it as it goes.
_TRIED = (DisturbanceObserver, ExtendedKalmanFilter)


def diagnose(
    problem: Problem, engine: Engine, *, every_platform: bool = False, certainty: bool = False
) -> Outcome:
    """Find what an observer model lacks, from recordings; write the extended model.

    Parameters
    ----------
    every_platform : whether the extended FMU is for all platforms, or only for this machine's.
    certainty : whether it is asked how sure the sizes are, by fits of their own.

    Raises
    ------
    InputError
        If there are too few recordings, or one has too little that counts; if the library cannot be
        compiled, or the model is none of this library.
    """
    refuse_too_few(problem.cases, problem.system, len(problem.held_out))
    with open_model(problem.system) as fmu:
        doubts = doubts_along(fmu, problem.system, problem.cases, moved=fmu.parameters)
    outcome = _with_effects(problem, engine, every_platform, certainty)
    return replace(outcome, warned="; ".join(filter(None, (problem.doubt, doubts, outcome.warned))))


def _with_effects(
    problem: Problem, engine: Engine, every_platform: bool, certainty: bool
) -> Outcome:
    """Build an FMU that has all effects, and diagnose with it."""
    with tempfile.TemporaryDirectory() as scratch:
        problem, everything = with_effects(problem, Path(scratch), engine.report)
        source = ModelSource(everything, problem.system, given_values(everything, problem.system))
        ask = partial(_outcome, engine, every_platform=every_platform, certainty=certainty)
        return ask_fit(problem, source, engine, ask)


def ask_fit(
    problem: Problem,
    source: ModelSource,
    engine: Engine,
    ask: Callable[[Problem, ResidualModel, Fit], Result],
) -> Result:
    """Ask a fit of recordings; its problem has those effects that they can show.

    An FMU alone that has events at other values is simulated as a whole.

    Parameters
    ----------
    source : an FMU that has all effects.
    """
    try:
        with ResidualModel(source, problem.cases, engine) as simulations:
            shown = shown_effects(problem, simulations)
            return ask(shown, simulations, Fit(simulations, shown.effects))
    except EventError:
        if problem.library is not None or source.free:
            raise
        engine.report("events of the model at other values: whole simulations instead")
        return ask_fit(problem, source._replace(free=True), engine, ask)


def shown_effects(problem: Problem, simulations: ResidualModel) -> Problem:
    """The problem with those effects of an FMU alone that its recordings can show.

    Raises
    ------
    InputError
        If only terms beside rates are asked for, of an FMU that nothing corrects.
    """
    if problem.library is not None:
        return problem
    system, effects = problem.system, problem.effects
    if simulations.free:
        # Terms of several forms explain a run that nothing corrects as one parameter does.
        effects = [effect for effect in effects if effect.size != COEFFICIENT]
        if not effects:
            raise InputError(
                where=f"{system.source}, [candidates]",
                found="only terms beside rates, of an FMU that runs freely",
                expected="parameters or sensors",
                remedy="choose some of 'workbench diagnose --list'",
            )
    begun = simulations.begin[0]  # by what was measured, in each recording
    effects = [effect for effect in effects if effect.parameter not in begun]
    if not simulations.free:
        runs = _of_temperatures(simulations)
        effects = list(of_moving_states(effects, runs, system.candidates.matters))
    return replace(problem, effects=tuple(fitting_recordings(effects, system, problem.cases)))


def _of_temperatures(simulations: ResidualModel) -> dict[str, list[tuple[Vector, Vector]]]:
    """Time and nominal course of states in each recording, of those that are temperatures.

    What they are by themselves says nothing of how fast they change: no machine is at 0 K.
    """
    names = [name for name in simulations.states if simulations.units.get(name) == "K"]
    if not names:
        return {}
    recordings = simulations.recordings
    courses = simulations.along([{} for _ in recordings], names)
    runs = {
        name: [(own.time, course[:, j]) for own, course in zip(recordings, courses, strict=True)]
        for j, name in enumerate(names)
    }
    return {
        name: run
        for name, run in runs.items()
        if zero("K", max(float(np.abs(values).max()) for _, values in run))
    }


def _outcome(
    engine: Engine,
    problem: Problem,
    simulations: ResidualModel,
    fit: Fit,
    *,
    every_platform: bool,
    certainty: bool,
) -> Outcome:
    """Conclude, and write the extended model."""
    system, effects, report = problem.system, problem.effects, engine.report
    diagnosis = conclude(fit, effects, report)
    base, best = diagnosis.base, diagnosis.best
    if diagnosis.verdict != "nothing":
        coupled = coupling(simulations, fit, base)
        sizes = {cause.effect.size for cause in diagnosis.causes}
        # No parameter alone does what a step does to inputs so well that it leaves noise.
        if coupled is not None and (coupled.hold or not sizes or {DELAY, LAG} & sizes):
            diagnosis = diagnosis.within(coupled)
    asked = certainty and bool(diagnosis.causes) and not diagnosis.interrupted
    assessed = assess(fit, best, report) if asked else None
    answer = _Conclusion(problem, engine, simulations, fit, diagnosis)
    extension = answer.extend(every_platform=every_platform)
    errors = errors_of(simulations, fit, base.linearised, best.linearised, held_out=False)
    starts = fit.unknowns.starts(best.point)
    if problem.held_out:
        report("errors on recordings that were held out")
        more, their_starts = held_out_errors(
            simulations, effects, (base, best), problem.held_out, engine.workers
        )
        errors, starts = errors + more, starts | their_starts
    shown = residuals(simulations, fit, base.linearised, best.linearised)
    return Outcome(
        system=system,
        cases=tuple(simulations.cases),
        diagnosis=diagnosis,
        residuals=shown,
        dependences=dependences(simulations, shown),
        levels={
            key: (float(value), fit.unknowns.level_unit(key))
            for key, value in best.point.levels.items()
        },
        deviations={
            name: dict(zip(fit.unknowns.local, map(float, row), strict=True))
            for name, row in zip(fit.unknowns.names, best.point.deviations, strict=True)
        },
        set_aside={recording.name: recording.set_aside for recording in simulations.recordings},
        observers=answer.observers(extension),
        extension=extension,
        errors=tuple(errors),
        starts=_differing(system, extension, starts),
        rivals=gathered(simulations, fit, base, diagnosis.rivals) if diagnosis.rivals else None,
        certainty=assessed,
        unsure=dict(simulations.unsure) if simulations.free else None,
        warned=simulations.take_warning(),
    )


def with_effects(
    problem: Problem, folder: Path, report: Callable[[str], None]
) -> tuple[Problem, Path]:
    """The problem, with starts that nobody declared, and an FMU with all its effects, at zero.

    Parameters
    ----------
    folder : where that is written; an FMU alone that needs no terms beside rates serves itself.
    """
    everything = folder / f"{EVERYTHING}.fmu"
    if problem.library is None:
        # Nobody has said how states begin, which an FMU tells only by their nominal values.
        with open_model(problem.system) as model:
            problem = replace(problem, system=with_starts(problem.system, model))
            asked = {effect.parameter for effect in problem.effects}
            terms = [term for term in rate_terms(model, problem.system) if term.name in asked]
        if terms:
            report(f"building an FMU around {model.path.name} with {len(terms)} terms")
            # Under its name: it is the user's FMU that a refusal is about.
            everything = folder / model.path.name
            write_extended(model.path, everything, terms, {}, {})
        return problem, everything if terms else model.path
    report(f"compiling {len(problem.effects)} effects")
    build_everything(problem.system, problem.library, problem.effects, everything)
    return problem, everything


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
    text = ExtendedModel(library, base, EVERYTHING, effects, about).source()
    build(library, EVERYTHING, text, path, every_platform=False)


def given_values(everything: Path, system: System) -> dict[str, float]:
    """Parameters of the diagnosed model that differ from the library's defaults."""
    with open_file(everything, system, {}) as extended, open_model(system) as diagnosed:
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
            if name in extended.parameters and value != extended.defaults.get(name)
        }


@dataclass(frozen=True, eq=False)
class _Conclusion:
    """What was found, and with what."""

    problem: Problem
    engine: Engine
    simulations: ResidualModel
    fit: Fit
    diagnosis: Diagnosis

    def extend(self, *, every_platform: bool) -> Extension | None:
        """Write the extended model, compile it, compare its predictions with those of the fit."""
        if not self.diagnosis.causes:
            return None
        if (library := self.problem.library) is None:
            return self._extend_alone()
        base = self.problem.base
        self.engine.report("compiling the extended model")
        simulations = self.simulations
        values = self._values()
        present = [e for e in self.problem.effects if e.name in values and e.of_library]
        own = {name: value for name, value in simulations.given.items() if "." not in name}
        own |= self._usual_levels()
        arrays = {name.partition("[")[0] for name in own if "[" in name}
        every = {n: v for n, v in simulations.nominal.items() if n.partition("[")[0] in arrays}
        own = {**every, **own}
        added = ", ".join(effect.name for effect in present) or "calibrated levels"
        part = ", a part of what is missing" * (self.diagnosis.verdict == "partly explained")
        about = f"{base} with {added}{part}"
        text = ExtendedModel(library, base, EXTENDED, present, about, values, own).source()
        folder = self.engine.out / "model"
        folder.mkdir(parents=True, exist_ok=True)
        modelica, path = folder / f"{EXTENDED}.mo", folder / f"{EXTENDED}.fmu"
        write_whole(modelica, text)
        build(library, EXTENDED, text, path, every_platform=every_platform)
        return Extension(modelica, path, self._difference(path, frozenset()))

    def _extend_alone(self) -> Extension | None:
        """Write an FMU around the one that is diagnosed, if a parameter or a rate is wrong."""
        with open_model(self.problem.system) as model:
            terms = {term.name: term for term in rate_terms(model, self.problem.system)}
            defaults, names, path = dict(model.defaults), model.names, model.path
            fit = MODEL_EXCHANGE in model.description.interfaces and model.version == "2.0"
        sizes = {
            effect.parameter: self.diagnosis.best.point.sizes[effect.name, effect.size]
            for effect in self.diagnosis.best.active
            if effect.parameter
        }
        if not sizes or not fit:
            return None
        self.engine.report("building the extended model")
        point = self.diagnosis.best.point
        speeds = {
            variables(effect, shape)[0]: float(point.sizes[effect.name, shape])
            for effect in self.diagnosis.best.active
            if effect.parameter in terms
            for shape, _ in effect.shapes
        }
        added = {name: float(size) for name, size in sizes.items() if name in terms}
        changed = {
            names.get(name, name): defaults[name] + float(size)
            for name, size in sizes.items()
            if name not in terms
        }
        given = self.problem.system.given
        changed = {**{names.get(n, n): v for n, v in given.items()}, **changed}
        folder = self.engine.out / "model"
        folder.mkdir(parents=True, exist_ok=True)
        extended = folder / f"{EXTENDED}.fmu"
        write_extended(path, extended, [terms[name] for name in added], added | speeds, changed)
        # A start differs between recordings beside.
        written = frozenset(sizes | speeds) - frozenset(self.fit.unknowns.local)
        return Extension(None, extended, self._difference(extended, written))

    def _difference(self, path: Path, own: Collection[str]) -> float:
        """How far an extended FMU's predictions are from those of the fit, at most.

        Parameters
        ----------
        own : variables that it has other values of, which are not set, of an FMU around another.
        """
        simulations, best = self.simulations, self.diagnosis.best
        difference, system = 0.0, self.problem.system
        read = {
            *(delay(name) for name in system.signals),
            *late_signals(system),
            *sensor_errors(system),
        }
        points = self.fit.unknowns.values(best.point)
        with simulating(simulations.simulated._replace(path=path, system=system)) as extended:
            for k, residuals in enumerate(best.linearised.residuals):
                known = {
                    name: value
                    for name, value in points[k].items()
                    if name not in own and (own or name in extended.parameters or name in read)
                }
                errors = extended.at(k, known).errors
                difference = max(difference, float(np.abs(errors - residuals.errors).max()))
        return difference

    def _values(self) -> dict[str, dict[str, float]]:
        """Parameters of the effects that the extended model has, by effect."""
        effects = {effect.name: effect for effect in self.problem.effects}
        values: dict[str, dict[str, float]] = {}
        for effect in effects.values():
            for variable, value in self.simulations.given.items():
                if parameter := parameter_of(effect, variable):
                    values.setdefault(effect.name, {})[parameter] = value
        for (name, parameter), value in self.diagnosis.best.point.sizes.items():
            # An order-locked effect has another phase in each recording; the model turns from zero.
            known = values.setdefault(name, {})
            part = "cosine" if parameter == "amplitude" else parameter
            known[part] = (known.get(part, 0.0) if part in effects[name].sizes else 0.0) + value
        return values

    def _usual_levels(self) -> dict[str, float]:
        """Calibrated levels of what is free, where conditions are the usual ones."""
        system, usual = self.problem.system, {}
        for (name, choice), value in self.diagnosis.best.point.levels.items():
            level = system.comparison.levels.get(name)
            if level is None or not level.free:
                continue
            if not level.by or choice == str(system.condition(level.by).choices[0]):
                usual[name] = value
        return usual

    def observers(self, extension: Extension | None) -> dict[str, dict[str, tuple[float, float]]]:
        """Errors of the judged signal, with the gains of the nominal model in both."""
        system, cases, best = self.problem.system, self.simulations.cases, self.diagnosis.best
        report = self.engine.report
        turning = any(effect.order_locked for effect in best.active)
        scored = all(system.objective.signal in case for case in cases)
        if extension is None or turning or not scored or self.simulations.free:
            return {}
        report("observers with both models")
        gains = {}
        with open_model(system) as nominal:
            for estimator in _TRIED:
                try:
                    gains[estimator] = estimator.default_gains(nominal, system)
                except InputError as refused:  # a model may be fit for this, and for no observer
                    report(f"no {estimator.label}: {refused.found}")
        errors: dict[str, dict[str, list[float]]] = {}
        counted = ProgressReporter(report, "runs of observers").part(2 * len(gains) * len(cases))
        extended, sizes = with_model(system, OBSERVER, extension.fmu), best.point.sizes
        if self.problem.library is None:
            extended = replace(extended, given={})  # of which the FMU has all
        in_time = [case_in_time(case, system, sizes) for case in cases]
        after = extended, [case_by_sensors(case, system, sizes) for case in in_time]
        for used, recorded in ((system, cases), after):
            with open_model(used) as fmu:
                for estimator, gain in gains.items():
                    observer = estimator(fmu, used, gain)
                    by_case = errors.setdefault(estimator.name, {})
                    for case in recorded:
                        error = score(case, replay(case, observer), used).nrmse
                        by_case.setdefault(case.name, []).append(np.nan if error is None else error)
                        counted(case)
        return {
            name: {case: (pair[0], pair[1]) for case, pair in by_case.items()}
            for name, by_case in errors.items()
        }
