"""Check a library of effects before a diagnosis relies on it.

Claims of its package `Tests` are simulated to the end. With all effects at zero the model must be
the nominal one; at the size that matters, each must change an output of a recording.

    check = check_library(system, cases)
    check.sound                           # whether all of it holds
"""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import fmpy
import numpy as np

from workbench.arrays import Matrix
from workbench.diagnosis import Effect, build_everything, given_values, read_effects
from workbench.diagnosis.data.samples import compared
from workbench.diagnosis.effects.extension import variables
from workbench.errors import FMUError, InputError
from workbench.models import fmu_cache
from workbench.models.description import read_description
from workbench.models.fmu import FMU
from workbench.models.modelica import Library, read_library
from workbench.observers.estimators.open_loop import OpenLoop
from workbench.observers.gains import usual_gains
from workbench.observers.replay import replay
from workbench.observers.run import Ending
from workbench.recordings.case import Case
from workbench.system.registry import open_file, open_model
from workbench.system.system import OBSERVER, System

_TESTS = "Tests"
_INTERVAL = 0.01  # [s] between outputs of a claim, which nobody reads
_SAME = 1e-9  # of the noise, below which rounding may be all that moves a signal


@dataclass(frozen=True)
class ClaimResult:
    """What came of a claim."""

    name: str  # of its model
    failures: tuple[str, ...]  # what its asserts, or the solver, said; none if it holds


@dataclass(frozen=True)
class EffectResult:
    """What came of an effect, alone in the model."""

    name: str  # of the effect
    size: float  # that was tried [`unit`], the one that matters
    unit: str
    case: str = ""
    signal: str = ""  # signal that shows it best, in the recording `case`; both empty if none does
    change: float = 0.0  # of this signal, its largest, over the standard deviation of its noise
    failure: str = ""  # why a diagnosis cannot use it; empty if it can
    doubt: str = ""  # what a reader should know; empty if nothing


@dataclass(frozen=True)
class LibraryCheck:
    """A library, checked."""

    library: str  # its name
    # claims, effects: in the order of the library
    claims: tuple[ClaimResult, ...]
    effects: tuple[EffectResult, ...]

    @property
    def sound(self) -> bool:
        """Whether all claims hold, and a diagnosis can use all effects."""
        claims = any(claim.failures for claim in self.claims)
        return not claims and not any(effect.failure for effect in self.effects)


def check_library(
    system: System, cases: Sequence[Case], report: Callable[[str], None] = lambda _: None
) -> LibraryCheck:
    """Check the claims and the effects of a system's library; needs the extra [compiler].

    Parameters
    ----------
    cases : recordings, whose inputs drive the effects.
    report : takes lines of progress.
    """
    if not system.library.is_file():
        raise InputError(
            where=str(system.source),
            found=f"no Modelica library {system.library.name} beside it",
            expected="a library of effects",
            remedy="put package.mo beside the system file",
        )
    library = read_library(system.library)
    effects = read_effects(library, system.models[OBSERVER].name)
    claims = []
    for name in claim_models(library):
        report(f"claim {name}")
        try:
            failures = failures_of_claim(library.file, name)
        except InputError as error:  # the other claims are of interest all the same
            failures = [str(error)]
        claims.append(ClaimResult(name, tuple(failures)))
    results = []
    with tempfile.TemporaryDirectory() as folder:
        report(f"compiling {len(effects)} effects")
        model = _all_at_zero(system, library, effects, cases, Path(folder))
        for effect in effects:
            report(f"effect {effect.name}")
            results.append(model.at_size(effect))
    return LibraryCheck(library.name, tuple(claims), tuple(results))


def _all_at_zero(
    system: System, library: Library, effects: Sequence[Effect], cases: Sequence[Case], folder: Path
) -> "_Model":
    """The model with all effects, which at zero is the nominal one.

    Raises
    ------
    InputError
        If it is another one, with the classes that make it so.
    """
    path = folder / "AllEffects.fmu"
    build_everything(system, library, effects, path)
    model = _Model(system, path, cases)
    with open_model(system) as fmu:
        nominal = open_loop(fmu, system, cases)
    if not (difference := model.difference(nominal)):
        return model
    classes = {effect.model: effect for effect in effects}
    blamed = []
    for name, effect in classes.items():
        alone = folder / f"{effect.class_name}.fmu"
        places = [other for other in effects if other.model == name]
        build_everything(system, library, places, alone)
        if _Model(system, alone, cases).difference(nominal):
            blamed.append(f"{name} ({library.classes[name].where})")
    raise InputError(
        where=", ".join(blamed) or str(library.file),
        found=f"another model than the nominal one, with all sizes at zero: {difference}",
        expected="the nominal model, as long as the size is zero",
        remedy="correct the equations of the class",
    )


# --- claims ---


def claim_models(library: Library) -> list[str]:
    """Dotted names of the models in the package `Tests` of a library, in its order."""
    package = f"{library.name}.{_TESTS}"
    return [
        cls.name
        for cls in library.classes.values()
        if cls.name.rpartition(".")[0] == package and cls.kind == "model" and not cls.partial
    ]


def failures_of_claim(package: Path, model: str) -> list[str]:
    """Simulate a claim to its StopTime; returns what its asserts and the solver said.

    Co-Simulation by the FMU's own integrator, then Model Exchange by CVODE: what holds at the
    accuracy of one integrator alone is no claim on the model. It is built once for each state of
    library and compiler.
    """
    from workbench.models import compiler  # an extra: everything else runs without it

    here = compiler.native()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{model}.fmu"
        fmu_cache.fetch(
            fmu_cache.key(package, model, "FMI 2", here),
            path,
            lambda file: compiler.build(package, model, file, platforms=[here]),
        )
        failures: list[str] = []

        def log(_: object, __: bytes, status: int, ___: bytes, message: bytes) -> None:
            if status >= 1:
                failures.append(message.decode())

        for interface in ("CoSimulation", "ModelExchange"):
            try:
                experiment = fmpy.read_model_description(str(path)).defaultExperiment
                fmpy.simulate_fmu(
                    str(path),
                    fmi_type=interface,
                    stop_time=float(experiment.stopTime),
                    relative_tolerance=float(experiment.tolerance),
                    output_interval=_INTERVAL,
                    logger=log,
                )
            except Exception as error:  # FMPy raises bare Exception when a call returns an error
                failures.append(str(error))
    return failures


# --- effects ---


class _Model:
    """The model with all effects, along recordings by the open loop."""

    def __init__(self, system: System, path: Path, cases: Sequence[Case]) -> None:
        self._system, self._path, self._cases = system, path, cases
        self._given = given_values(path, system)
        described = read_description(path).renamed(system.names).variables
        self._variables = {variable.name: variable for variable in described}
        self._signals = compared(system, cases)
        self._noise = np.array([system.signals[name].noise_at_scale for name in self._signals])
        self._zero = self._outputs({})

    def _outputs(self, sizes: Mapping[str, float]) -> list[Matrix]:
        """Outputs (n, c) along each recording, at these sizes."""
        with open_file(self._path, self._system, {**self._given, **sizes}) as fmu:
            return open_loop(fmu, self._system, self._cases)

    def difference(self, outputs: Sequence[Matrix]) -> str:
        """Say by how much outputs differ from those with all effects at zero; empty if not at all.

        A constant s/sqrt(n) is the standard deviation of the mean of n samples with noise s: no
        recording shows less.
        """
        for case, zero, other in zip(self._cases, self._zero, outputs, strict=True):
            shares = np.abs(other - zero).max(axis=0) / self._noise
            column = int(np.argmax(shares))
            if not shares[column] <= case.time.size**-0.5:
                signal = self._signals[column]
                return f"{signal} differs by {shares[column]:.2g} times its noise in {case.name}"
        return ""

    def at_size(self, effect: Effect) -> EffectResult:
        """Try an effect alone, at the size that matters."""
        names = variables(effect, effect.size)
        variable = self._variables[names[0]]
        low, high = variable.limits
        size = effect.matters if effect.matters <= high else -effect.matters
        result = EffectResult(effect.name, size, variable.unit or "1")
        if not low <= size <= high:
            reason = f"matters = {effect.matters:g} lies outside of the bounds, {low:g} to {high:g}"
            return replace(result, failure=reason)
        try:
            outputs = self._outputs(dict.fromkeys(names, size))
        except FMUError as error:
            return replace(result, failure=str(error))
        # (recordings, outputs): the largest change, over the noise
        changes = np.array(
            [
                np.abs(other - zero).max(axis=0) / self._noise
                for zero, other in zip(self._zero, outputs, strict=True)
            ]
        )
        k, column = map(int, np.unravel_index(int(np.argmax(changes)), changes.shape))
        case, change = self._cases[k], float(changes[k, column])
        if change > _SAME:
            signal = self._signals[column]
            result = replace(result, case=case.name, signal=signal, change=change)
        if change > case.time.size**-0.5:
            return result
        doubt = "these recordings do not show it"
        if effect.hidden:
            return replace(result, doubt=f"{doubt}: {effect.hidden}")
        if effect.where or effect.unless or effect.falling or effect.restarted:
            return replace(result, doubt=f"{doubt}; it asks for others")
        if change > _SAME:
            return replace(result, doubt=f"{doubt} at this size")
        return replace(result, failure="it changes no signal of these recordings")


def open_loop(fmu: FMU, system: System, cases: Sequence[Case]) -> list[Matrix]:
    """What sensors read of the signals that recordings have, (n, c), of a model along each.

    Raises
    ------
    FMUError
        If a simulation fails, or is not finite.
    """
    signals = [system.signals[name] for name in compared(system, cases)]
    readings = {s.reading: s.unit for s in signals if s.reading not in system.columns}
    system = replace(system, reported={**system.reported, **readings})
    runs = []
    for case in cases:
        run = replay(case, OpenLoop(fmu, system, usual_gains(OpenLoop, fmu, system)))
        if run.ending is not Ending.OK:
            raise FMUError(f"in {case.name} the simulation ends: {run.ending.value} {run.message}")
        runs.append(np.column_stack([run.signal(signal.reading) for signal in signals]))
    return runs
