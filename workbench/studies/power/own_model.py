"""A virtual machine of any system: its own model, driven as recordings of the machine were.

Laws have their exact form unless an error of form is asked for; a real machine is diagnosed less
well. What differs from the model that diagnoses is stated in `OwnModel.about`. Equations of a
plugin are better.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.diagnosis import Effect, Problem
from workbench.diagnosis.data.clocks import late_signals, lateness, moved
from workbench.diagnosis.data.counting import refuse_too_few
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.data.samples import Samples, standardised
from workbench.diagnosis.data.sensors import (
    SensorReading,
    lagged,
    readings,
    sensed,
    sensor_errors,
)
from workbench.diagnosis.effects.candidates import COEFFICIENT, STEP
from workbench.diagnosis.effects.extension import variables
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.quadratic import Key
from workbench.diagnosis.inference.score_test import shapes
from workbench.diagnosis.run import shown_effects
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.errors import InputError
from workbench.models.description import MODEL_EXCHANGE
from workbench.models.fmu import FMU, CoSimulation
from workbench.models.simulation import Drive, Simulation
from workbench.observers.trajectory import doubts_along
from workbench.recordings.case import Case, Value, read_cases
from workbench.runtime.files import write_whole
from workbench.studies.power.planting import Plantable, SheetError
from workbench.system.registry import open_file, open_model
from workbench.system.system import System

Readings = tuple[int, list[dict[str, Vector]]]
"""Seed of the noise, and what is read by signal (n,) in each recording."""


@dataclass(frozen=True)
class OwnModel:
    """Sets of recordings by the system's own model, a `VirtualRig`."""

    # of recordings of the machine, whose inputs, times and conditions are those of a set; with all
    # that can be planted
    problem: Problem
    everything: Path  # FMU of the observer model with every effect
    plantables: tuple[Plantable, ...]  # all effects
    free: bool  # whether the diagnosis simulates as a whole, too
    # share of its effect by which a law is wrong: its size goes with a quantity that is drawn, see
    # `standardised`
    form_error: float = 0.0
    doubt: str = ""  # about the model along the recordings, see `check_along`

    sheet_errors: tuple[SheetError, ...] = ()

    @property
    def system(self) -> System:
        """Whose model it is."""
        return self.problem.system

    @property
    def about(self) -> str:
        """What makes the recordings, for people."""
        alone = self.problem.library is None
        solved = "solved by the Co-Simulation of its FMU instead of the steps of the diagnosis"
        if alone:
            solved = "simulated at a tolerance of 1e-8 instead of by the steps of the diagnosis"
        if self.free:
            solved = "simulated as the diagnosis does"
        form = "Laws have their exact form"
        if alone:
            form = "The figures hold only as far as its form is right, since the same FMU diagnoses"
        form += ": on the machine itself the diagnosis is right less often"
        if self.form_error:
            form = (
                "Laws are wrong in form: the size of each changes with a quantity that is drawn, "
                f"by {self.form_error:.0%} rms"
            )
        return (
            f"the system's own model, {solved}, with the tolerances, levels, noise and resolution "
            f"of the system file. {form}{self.doubt and f'. Doubt: {self.doubt}'}"
        )

    @property
    def recordings(self) -> tuple[str, ...]:
        """Names of the recordings."""
        return tuple(case.name for case in self.problem.cases)

    @property
    def identity(self) -> Mapping[str, Any]:
        """Model and recordings."""
        cases = self.problem.cases
        data = b"".join(column.tobytes() for c in cases for column in (c.time, c.u, c.y))
        return {
            "machine": self.about,
            "recordings": list(self.recordings),
            "model": hashlib.sha256(self.everything.read_bytes()).hexdigest(),
            "data": hashlib.sha256(data).hexdigest(),
        }

    def simulate(self, seed: int, gains: Mapping[str, float]) -> "Readings":
        """Readings of each recording, without noise."""
        rng = np.random.default_rng(seed)
        with ResidualModel(_source(self.problem, self.everything), self.problem.cases) as model:
            unknowns = Fit(model, self.problem.effects).unknowns
            point, sizes = unknowns.start(), dict[Key, float]()
            phases = dict[str, Vector]()
            for name, gain in gains.items():
                effect = unknowns.effects[name]
                middle = _middle_shape(effect)
                sizes |= {(name, effect.label): gain, **{(name, k): v for k, v in middle.items()}}
                if effect.order_locked:
                    phases[name] = rng.uniform(-np.pi, np.pi, unknowns.count)
            levels = {
                key: value + unknowns.expected(key)[1] * rng.standard_normal()
                if np.isfinite(unknowns.expected(key)[1])
                else value
                for key, value in point.levels.items()
            }
            deviations = rng.standard_normal(point.deviations.shape)
            drawn = replace(point, sizes=sizes, levels=levels, deviations=deviations, phases=phases)
            starts = list(unknowns.starts(drawn).values())
            without = list(unknowns.starts(replace(drawn, sizes={}, phases={})).values())
            for start in starts:  # a state that is drawn stays where it can be
                start |= {
                    name: float(np.clip(start[name], *model.bounds.get(name, (-np.inf, np.inf))))
                    for name in unknowns.starting
                }
            recordings = model.recordings
            wrong = [
                variable
                for name in gains
                for size in unknowns.effects[name].sizes
                for variable in variables(unknowns.effects[name], size)
                if variable in model.nominal and self.form_error
            ]
        courses = standardised(recordings)
        quantity, sign = rng.integers(courses[0].shape[1]), rng.choice([-1.0, 1.0])
        sets = []
        with self._opened() as fmu:
            names = [*(signal.name for signal in self.system.inputs), *wrong]
            outputs = [self.system.signals[name].reading for name in recordings[0].signals]
            holds = np.append(self.system.holds, np.zeros(len(wrong)))
            simulation = Simulation(fmu, names, outputs, holds)
            for k, (recording, start) in enumerate(zip(recordings, starts, strict=True)):
                factor = 1.0 + sign * self.form_error * courses[k][:, quantity]
                usual = {name: without[k].get(name, 0.0) for name in wrong}
                varied = {
                    name: zero + (start[name] - zero) * factor for name, zero in usual.items()
                }
                sets.append(self._recorded(simulation, recording, start, varied))
        return seed, sets

    def write(self, simulated: "Readings", gains: Mapping[str, float], folder: Path) -> None:
        """Write readings with noise, rounded to the resolution of their sensors."""
        seed, sets = simulated
        effects = {effect.name: effect for effect in self.problem.effects}
        coarse = {
            effects[name].sensor: step
            for name, step in gains.items()
            if effects[name].sensor and effects[name].size == STEP
        }
        for number, (case, clean) in enumerate(zip(self.problem.cases, sets, strict=True), 1):
            rng, columns = np.random.default_rng([seed, number]), {"time [s]": case.time}
            for name, values in clean.items():
                if name not in case:
                    continue
                signal = self.system.signals[name]
                read = values + signal.deviation(values) * rng.standard_normal(values.size)
                for step in (coarse.get(name, 0.0), signal.resolution):
                    read = step * np.round(read / step) if step else read
                columns[f"{name} [{signal.unit}]"] = read
            rows = np.column_stack(list(columns.values())).tolist()
            lines = [",".join(columns), *(",".join(f"{v:.9g}" for v in row) for row in rows)]
            write_whole(folder / case.name / "measured.csv", "\n".join(lines) + "\n")
            write_whole(folder / case.name / "case.toml", self._description(case))

    def _opened(self) -> FMU:
        if self.problem.library is None:
            return open_file(self.everything, self.system, {})
        return CoSimulation(self.everything)

    def _recorded(
        self,
        simulation: Simulation,
        recording: Samples,
        start: Mapping[str, float],
        varied: Mapping[str, Vector],
    ) -> dict[str, Vector]:
        """Readings of one recording, (n,) by signal: structures, sensors and loggers included.

        Steps of a sensor come last, in `write`: it rounds what its noise moves.

        Parameters
        ----------
        varied : parameters that change in time, (n,).
        """
        system, time = self.system, recording.time
        wrong = {
            name: sensor._replace(step=0.0)
            for name, sensor in readings(sensor_errors(system), start).items()
        }
        inputs = dict(zip(recording.inputs, recording.u.T, strict=True))
        driving = [
            lagged(time, column, wrong.get(name, SensorReading()).lag)
            for name, column in inputs.items()
        ]
        u = np.reshape([*driving, *varied.values()], (-1, time.size)).T.copy()
        drive = Drive(time, _whole(simulation.fmu, recording.inputs, u), recording.model_time)
        y = simulation.run(drive, _able(simulation.fmu, start))
        for j in range(y.shape[1]):
            y[:, j] = recording.behind_structure(j, y[:, j])
        read = dict(zip(recording.signals, sensed(recording, y, wrong).T, strict=True))
        for name, column in inputs.items():
            sensor = wrong.get(name, SensorReading())
            read[name] = sensor.factor * column + sensor.offset
        late = lateness(late_signals(system), start)
        return {
            name: moved(time, read[name], late[name]) if name in late else read[name].copy()
            for name in (*inputs, *recording.signals)
        }

    def _description(self, case: Case) -> str:
        lines = [f"title = {json.dumps(f'{case.title}, simulated')}", "", "[conditions]"]
        lines += [f"{name} = {self._value(name, value)}" for name, value in case.conditions.items()]
        lines += ["", "[measurement]", 'file = "measured.csv"']
        if np.isfinite(case.counts_from):
            lines.append(f'counts_from = "{case.counts_from!r} s"')
        if case.model_time is not None:
            lines.append(f'model_time = "{case.model_time!r} s"')
        return "\n".join(lines) + "\n"

    def _value(self, name: str, value: Value) -> str:
        if isinstance(value, float):
            return json.dumps(f"{value!r} {self.system.condition(name).unit}")
        return json.dumps(list(value) if isinstance(value, tuple) else value)


def _middle_shape(effect: Effect) -> dict[str, float]:
    """The shape, of those that a diagnosis begins with, that is planted."""
    forms = shapes(effect)
    return dict(forms[len(forms) // 2])


def template_cases(system: System, names: Sequence[str]) -> list[Case]:
    """Recordings of the machine: folders, or those of this name that come with the system."""
    if system.cases is None and not all(Path(name).exists() for name in names or [""]):
        raise InputError(
            where=f"{system.source}, --case",
            found="neither a plugin that makes recordings, nor recordings that come with it",
            expected="recordings of the machine, whose inputs drive its own model",
            remedy="name folders of recordings with --case",
        )
    here = system.cases or Path()
    folders = [Path(name) if Path(name).exists() else here / name for name in names] or [here]
    return read_cases(folders, system)


def own_model(problem: Problem, everything: Path, form_error: float = 0.0) -> OwnModel:
    """The virtual machine of a system.

    Parameters
    ----------
    problem : of recordings of the machine, see `template_cases`, and all effects.
    everything : FMU of its observer model with all effects.
    form_error : see `OwnModel`.

    Raises
    ------
    InputError
        If a diagnosis of such recordings is refused, or an FMU alone has no law whose form could
        be wrong.
    """
    refuse_too_few(problem.cases, problem.system)
    with open_model(problem.system) as fmu:
        doubt = doubts_along(fmu, problem.system, problem.cases, moved=fmu.parameters)
    with ResidualModel(_source(problem, everything), problem.cases) as model:
        known = {effect.name: effect for effect in shown_effects(problem, model).effects}
        # Recordings of a sensor that does not go in steps may yet be made to.
        planted = [
            known.get(effect.name, effect)
            for effect in problem.effects
            if effect.name in known or (effect.size == STEP and _read(effect, problem.cases))
        ]
        if form_error and problem.library is None:
            planted = [effect for effect in planted if effect.size == COEFFICIENT]
            if not planted:
                raise InputError(
                    where="--form-error",
                    found="no term beside a rate, of an FMU alone",
                    expected="one or more: a value, a start, a sensor and a clock have no form "
                    "that could be wrong",
                    remedy="leave --form-error out",
                )
        if not planted:
            raise InputError(
                where=f"{problem.system.source}, [candidates]",
                found="none that the recordings could show",
                expected="one or more",
                remedy="choose some of 'workbench diagnose --list'",
            )
        unknowns = Fit(model, planted).unknowns
        plantables = []
        for effect in planted:
            low, high = unknowns.bounds(effect, effect.size)
            plantables.append(
                Plantable(
                    name=effect.name,
                    unit=unknowns.unit(effect, effect.size) or "1",
                    effect=effect.name,
                    least=low,
                    most=high,
                    signed=low < 0.0,
                    shapes=_middle_shape(effect),
                )
            )
        machine = replace(problem, effects=tuple(planted))
        return OwnModel(machine, everything, tuple(plantables), model.free, form_error, doubt)


def _source(problem: Problem, everything: Path) -> ModelSource:
    return ModelSource(everything, problem.system, problem.system.given)


def _able(fmu: FMU, start: Mapping[str, float]) -> dict[str, float]:
    """Start values that may be set: clocks and sensors are none of the FMU."""
    own = fmu.states if fmu.interface == MODEL_EXCHANGE else ()
    able = {v.name for v in fmu.description.variables if v.initial != "calculated"}
    return {name: value for name, value in start.items() if name in {*able, *own}}


def _whole(fmu: FMU, inputs: Sequence[str], u: Matrix) -> Matrix:
    """Inputs (n, m) in numbers that their types hold, of which noise makes others."""
    variables = fmu.description.by_name
    whole = [j for j, name in enumerate(inputs) if not variables[name].floats]
    u[:, whole] = np.round(u[:, whole])
    return u


def _read(effect: Effect, cases: Sequence[Case]) -> bool:
    """Whether any recording has what a sensor reads."""
    return any(effect.sensor in case and not np.isnan(case[effect.sensor]).all() for case in cases)
