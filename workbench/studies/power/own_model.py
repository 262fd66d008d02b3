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

from workbench.arrays import Vector
from workbench.diagnosis import Effect
from workbench.diagnosis.data.clocks import late_signals, lateness, moved
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.data.samples import Samples, standardised
from workbench.diagnosis.effects.extension import variables
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.inference.quadratic import Key
from workbench.diagnosis.inference.score_test import shapes
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.errors import InputError
from workbench.models.fmu import CoSimulation
from workbench.models.native import co_simulation_instance, raise_on_failure
from workbench.recordings.case import Case, Value, read_cases
from workbench.runtime.files import write_whole
from workbench.studies.design.simulation import step_block
from workbench.studies.power.planting import Plantable, SheetError
from workbench.system.system import System

Readings = tuple[int, list[dict[str, Vector]]]
"""Seed of the noise, and what is read by signal (n,) in each recording."""


@dataclass(frozen=True)
class OwnModel:
    """Sets of recordings by the system's own model, a `VirtualRig`."""

    system: System
    everything: Path  # FMU of the observer model with every effect
    effects: tuple[Effect, ...]  # that it has
    # recordings of the machine, whose inputs, times and conditions are those of a set
    templates: tuple[Case, ...]
    plantables: tuple[Plantable, ...]  # all effects
    # share of its effect by which a law is wrong: its size goes with a quantity that is drawn, see
    # `quantities`
    form_error: float = 0.0

    sheet_errors: tuple[SheetError, ...] = ()

    @property
    def about(self) -> str:
        """What makes the recordings, for people."""
        form = "have their exact form: on the machine itself the diagnosis is right less often"
        if self.form_error:
            form = (
                "are wrong in form: the size of each changes with a quantity that is drawn, by "
                f"{self.form_error:.0%} rms"
            )
        return (
            "the system's own model, solved by the Co-Simulation of its FMU instead of the steps "
            "of the diagnosis, with the tolerances, levels, noise and resolution of the system "
            f"file. Laws {form}"
        )

    @property
    def recordings(self) -> tuple[str, ...]:
        """Names of the recordings."""
        return tuple(case.name for case in self.templates)

    @property
    def identity(self) -> Mapping[str, Any]:
        """Model and recordings."""
        data = b"".join(column.tobytes() for c in self.templates for column in (c.time, c.u, c.y))
        return {
            "machine": self.about,
            "recordings": list(self.recordings),
            "model": hashlib.sha256(self.everything.read_bytes()).hexdigest(),
            "data": hashlib.sha256(data).hexdigest(),
        }

    def simulate(self, seed: int, gains: Mapping[str, float]) -> "Readings":
        """Readings of each recording, without noise."""
        rng = np.random.default_rng(seed)
        source = ModelSource(self.everything, self.system, self.system.given)
        with ResidualModel(source, self.templates) as simulations:
            unknowns = Fit(simulations, self.effects).unknowns
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
            recordings = simulations.recordings
            wrong = [
                variable
                for name in gains
                for size in unknowns.effects[name].sizes
                for variable in variables(unknowns.effects[name], size)
                if variable in simulations.nominal and self.form_error
            ]
        courses = standardised(recordings)
        quantity, sign = rng.integers(courses[0].shape[1]), rng.choice([-1.0, 1.0])
        sets = []
        with CoSimulation(self.everything) as model:
            for recording, start, course in zip(recordings, starts, courses, strict=True):
                factor = 1.0 + sign * self.form_error * course[:, quantity]
                varied = {name: start[name] * factor for name in wrong}
                sets.append(self._recorded(model, recording, start, varied))
        return seed, sets

    def write(self, simulated: "Readings", gains: Mapping[str, float], folder: Path) -> None:
        """Write readings with noise, rounded to the resolution of their sensors."""
        seed, sets = simulated
        for number, (case, readings) in enumerate(zip(self.templates, sets, strict=True), 1):
            rng, columns = np.random.default_rng([seed, number]), {"time [s]": case.time}
            for name, values in readings.items():
                if name not in case:
                    continue
                signal = self.system.signals[name]
                read = values + signal.deviation(values) * rng.standard_normal(values.size)
                if step := signal.resolution:
                    read = step * np.round(read / step)
                columns[f"{name} [{signal.unit}]"] = read
            rows = np.column_stack(list(columns.values())).tolist()
            lines = [",".join(columns), *(",".join(f"{v:.9g}" for v in row) for row in rows)]
            write_whole(folder / case.name / "measured.csv", "\n".join(lines) + "\n")
            write_whole(folder / case.name / "case.toml", self._description(case))

    def _recorded(
        self,
        model: CoSimulation,
        recording: Samples,
        start: Mapping[str, float],
        varied: Mapping[str, Vector],
    ) -> dict[str, Vector]:
        """Readings of one recording, (n,) by signal: structures and loggers included.

        Parameters
        ----------
        varied : parameters that change in time, (n,).
        """
        system, states = self.system, set(model.states)
        known = {name: value for name, value in start.items() if name in model.defaults}
        model.start(
            {name: value for name, value in known.items() if name in states},
            {name: value for name, value in known.items() if name not in states},
        )
        inputs = [signal.name for signal in system.inputs]
        model.set(model.variables(inputs), recording.u[0])
        outputs = [system.signals[name].reading for name in recording.signals]
        driven = np.column_stack([recording.u, *varied.values()])
        holds = np.append(self.system.holds, np.zeros(len(varied)))
        running = co_simulation_instance(model, [*inputs, *varied], outputs)
        y = np.zeros((recording.time.size, len(outputs)))
        for k, h in enumerate(np.diff(recording.time)):
            pair = slice(k, k + 2)
            raise_on_failure(step_block(running, float(h), holds, driven[pair], y[pair]), model)
        late = lateness(late_signals(system), start)
        readings = dict(zip(inputs, recording.u.T, strict=True))
        for j, name in enumerate(recording.signals):
            readings[name] = recording.behind_structure(j, y[:, j])
        return {
            name: moved(recording.time, values, late[name]) if name in late else values.copy()
            for name, values in readings.items()
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


def own_model(
    system: System,
    effects: Sequence[Effect],
    everything: Path,
    templates: Sequence[Case],
    form_error: float = 0.0,
) -> OwnModel:
    """The virtual machine of a system.

    Parameters
    ----------
    everything : FMU of its observer model with all effects.
    templates : recordings of the machine, see `template_cases`.
    form_error : see `OwnModel`.
    """
    with CoSimulation(everything) as model:
        least = {v.name: v.minimum for v in model.description.variables if v.minimum is not None}
        units = dict(model.units)
    plantables = []
    for effect in effects:
        variable = variables(effect, effect.size)[0]
        low = 0.0 if effect.order_locked else least.get(variable, -np.inf)
        plantables.append(
            Plantable(
                name=effect.name,
                unit="s" if effect.late else units.get(variable, "1"),
                effect=effect.name,
                least=low,
                signed=low < 0.0,
                shapes=_middle_shape(effect),
            )
        )
    machine = OwnModel(system, everything, tuple(effects), tuple(templates), tuple(plantables))
    return replace(machine, form_error=form_error)
