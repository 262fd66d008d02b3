"""The open loop of an FMU against FMPy with CVode: right, or refused in words."""

import io
import re
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError, InputError
from workbench.models.description import (
    CO_SIMULATION,
    MODEL_EXCHANGE,
    Description,
    Variable,
    read_description,
)
from workbench.observers.estimators.open_loop import OpenLoop
from workbench.observers.gains import Gains
from workbench.system.reader import system_of
from workbench.system.registry import open_model
from workbench.system.system import System

LIMIT = 1e-4  # of a signal's range: below what sensors tell
_TOLERANCE = 1e-8  # of CVode
# Of CVode where that is off: an output that is a small difference of states takes up what they are
# wrong by. From the first to the second, CVode's own error shows.
_TIGHT = 1e-11, 1e-12
# Intervals between samples: a prime, so that samples do not fall on events at round times.
_INTERVALS = 487
_DURATION = 10.0  # [s] where the FMU names none
_TIMEOUT = 120.0  # [s] of FMPy
_FINER = 50
RIGHT, OFF, REFUSED, NO_REFERENCE = "right", "OFF", "refused", "no reference"


@dataclass(frozen=True)
class FMUComparison:
    """What a comparison found."""

    file: str  # name of the FMU's file
    fmi: str  # version; empty where the file is no FMU
    verdict: str  # RIGHT, OFF, REFUSED or NO_REFERENCE, where FMPy does not run the FMU
    # the largest, over the range of its signal; None where nothing was compared
    difference: float | None = None
    # signal, time: where it is, [s]
    signal: str = ""
    time: float | None = None
    # of what was not compared, or how sure the reference is where that is less than usual
    reason: str = ""


def compare_with_fmpy(path: Path) -> FMUComparison:
    """Simulate an FMU over its default experiment, by the open loop and by FMPy, and compare.

    Real inputs jump at a third and at two thirds; all other inputs keep their start values. A
    Co-Simulation is compared with that of FMPy, at the same communication points.
    Outputs that are scalar numbers are compared; where there are none states, or local variables.
    Outputs that FMPy gives otherwise when it repeats a run are left out, and named.
    """
    fmi = ""
    try:
        description = read_description(path)
        fmi = description.version
        problem = _Problem(description)
        with open_model(problem.system(None)):  # an unknown one is tried in its own process
            pass
    except (InputError, FMUError) as error:
        return FMUComparison(path.name, fmi, REFUSED, reason=_sentence(error, path))
    other = ""
    try:
        try:
            reference = problem.by_fmpy(1)
        except Exception:  # bare; of CVode that takes no more than 500 steps between two samples
            reference = problem.by_fmpy(_FINER)
        reference, other = problem.repeatable(reference)
    except Exception as error:
        reference, doubt = None, re.sub(r"/\S+/", "", str(error))  # folders it was built in
    else:
        doubt = "it ends before the experiment does"
    if not problem.outputs:
        reason = f"FMPy: the same run gives other results when it is repeated, of {other}"
        return FMUComparison(path.name, fmi, NO_REFERENCE, reason=reason)
    noise = None if reference is None else _sizes(reference) * LIMIT
    try:
        estimates = problem.by_workbench(noise)
    except (InputError, FMUError) as error:
        return FMUComparison(path.name, fmi, REFUSED, reason=_sentence(error, path))
    if reference is None or len(reference) != len(estimates):
        return FMUComparison(path.name, fmi, NO_REFERENCE, reason=f"FMPy: {doubt}")
    errors, unsure = _errors(estimates, reference), np.zeros(len(problem.outputs))
    if errors.max() > LIMIT and (tight := problem.by_tight_fmpy()) is not None:
        errors, unsure = _errors(estimates, tight[1]), _errors(*tight).max(axis=0)
    beyond = errors - unsure
    verdict = RIGHT if beyond.max() <= LIMIT else OFF
    row, column = np.unravel_index((errors if verdict == RIGHT else beyond).argmax(), errors.shape)
    place = problem.outputs[column], float(problem.time[row])
    own = f"{unsure[column]:.0e} is FMPy's own, at {_TIGHT[1]:g}" if unsure.any() else ""
    if other:
        own = f"but for {other}, which FMPy gives otherwise at each run"
    return FMUComparison(path.name, fmi, verdict, float(errors[row, column]), *place, own)


def _errors(estimates: Matrix, reference: Matrix) -> Matrix:
    """Share of each signal's range by which estimates are off, (n, l); inf where they are lost."""
    errors = np.abs(estimates - reference) / _sizes(reference)
    errors[~np.isfinite(estimates) & np.isfinite(reference)] = np.inf
    return np.nan_to_num(errors, nan=0.0, posinf=np.inf)


def _sizes(signals: Matrix) -> Vector:
    """Range of each signal; of one that rests its size, or 1."""
    size = np.ptp(signals, axis=0)
    size = np.where(size > 0.0, size, np.abs(signals).max(axis=0))
    return np.where(size > 0.0, size, 1.0)


def _sentence(error: Exception, path: Path) -> str:
    """The message of a refusal, without the folder of the file."""
    return str(error).replace(str(path.resolve()), path.name).replace(str(path), path.name)


class _Problem:
    """An experiment on an FMU."""

    def __init__(self, description: Description) -> None:
        self._description = description
        self._begin = description.start or 0.0
        stop = description.stop
        if stop is None or stop <= self._begin:
            stop = self._begin + _DURATION
        self._step = (stop - self._begin) / _INTERVALS
        self._alone = MODEL_EXCHANGE not in description.interfaces
        offered = description.interfaces.get(CO_SIMULATION)
        if self._alone and offered and not offered.variable_steps:
            self._step = description.step or self._step  # FMPy steps from sample to sample
        self.time = self._begin + self._step * np.arange(_INTERVALS + 1)
        self._inputs = [
            v
            for v in description.variables
            if v.real and v.causality == "input" and v.variability == "continuous"
        ]
        outputs = [
            v.name
            for v in description.variables
            if v.causality == "output" and v.holds_number and not v.array
        ]
        # Those of AMESim are local all.
        shown = [
            v.name
            for v in description.variables
            if v.causality == "local" and v.real and not v.array and v.variability == "continuous"
        ]
        self.outputs = outputs or list(description.states) or shown
        variables = description.by_name
        self._places = {
            name: (variables[name].of, variables[name].element) for name in self.outputs
        }
        if not self.outputs:
            raise InputError(
                where=str(description.path),
                found="no output and no state that is a number",
                expected="a model with a signal that can be measured",
                remedy="export the model with an output that is a scalar number",
            )
        self._u = np.column_stack(
            [self._jumping_input(v) for v in self._inputs] or [np.zeros((_INTERVALS + 1, 0))]
        )

    def _jumping_input(self, variable: Variable) -> Vector:
        """An input that jumps twice, by 0.3 and -0.5 of its nominal value.

        Of a Co-Simulation it rests at 0.3: FMPy reads its outputs before a jump, not after it.
        """
        size = variable.nominal or 1.0
        share = np.arange(_INTERVALS + 1) / _INTERVALS
        if self._alone:
            share[:] = 0.5
        return float(variable.start or 0.0) + size * (0.3 * (share > 1 / 3) - 0.5 * (share > 2 / 3))

    def repeatable(self, reference: Matrix) -> tuple[Matrix, str]:
        """Leave out outputs of a Co-Simulation that FMPy gives otherwise when it repeats a run.

        Returns
        -------
        The others of the reference, (n, l), and the names of those that are left out.
        """
        if not self._alone:
            return reference, ""
        again = self.by_fmpy(1)
        if again.shape != reference.shape:  # an end of its own
            return reference, ""
        same = ((reference == again) | np.isnan(reference)).all(axis=0)
        others = [name for name, kept in zip(self.outputs, same, strict=True) if not kept]
        self.outputs = [name for name in self.outputs if name not in others]
        self._places = {name: self._places[name] for name in self.outputs}
        return reference[:, same], ", ".join(f"`{name}`" for name in others)

    def by_tight_fmpy(self) -> tuple[Matrix, Matrix] | None:
        """The same at two tighter tolerances; None where CVode cannot keep them, or has no say."""
        if self._alone:
            return None
        try:
            first, second = (self.by_fmpy(_FINER, tolerance) for tolerance in _TIGHT)
        except Exception:  # bare; of CVode that takes no more than 500 steps between two samples
            return None
        return (first, second) if len(first) == len(second) == self.time.size else None

    def by_fmpy(self, finer: int, tolerance: float = _TOLERANCE) -> Matrix:
        """Outputs along the experiment, (n, l), of which FMPy tells `finer` times as many."""
        rows = []
        for k, (t, u) in enumerate(zip(self.time, self._u, strict=True)):
            if k and (u != self._u[k - 1]).any():  # two rows of one time: before and after a jump
                rows.append((t, *self._u[k - 1]))
            rows.append((t, *u))
        types = [("time", float), *((v.name, float) for v in self._inputs)]
        driven = np.array(rows, dtype=types)
        with redirect_stdout(io.StringIO()):  # it prints of inputs that keep their start values
            result = fmpy.simulate_fmu(
                str(self._description.path),
                validate=False,
                fmi_type="CoSimulation" if self._alone else "ModelExchange",
                solver="CVode",
                relative_tolerance=tolerance,
                start_time=self._begin,
                stop_time=float(self.time[-1]),
                output_interval=self._step / finer,
                output=list(dict.fromkeys(of or name for name, (of, _) in self._places.items())),
                input=driven if self._inputs else None,
                record_events=False,
                timeout=_TIMEOUT,
            )
        columns = [
            result[of or name].reshape(len(result), -1)[::finer, element].astype(float)
            for name, (of, element) in self._places.items()
        ]
        return np.column_stack(columns)

    def by_workbench(self, noise: Vector | None) -> Matrix:
        """The same by the open loop; `noise` (l,) of the sensors that its steps must not exceed."""
        system = self.system(noise)
        with open_model(system) as fmu:
            loop = OpenLoop(fmu, system, Gains(OpenLoop.name, (), np.zeros(0), {}, ""))
            unmeasured = np.full((self.time.size, len(self.outputs)), np.nan)
            estimate = loop.run(
                self._step * np.arange(self.time.size, dtype=float), self._u, unmeasured
            )
        columns = list(system.columns)
        return np.asarray(estimate.values)[:, [columns.index(name) for name in self.outputs]]

    def system(self, noise: Vector | None) -> System:
        """A machine whose sensors are the outputs, in the FMU's units."""
        sizes = np.ones(len(self.outputs)) if noise is None else noise
        content: dict[str, Any] = {
            "title": self._description.name,
            "sample_time": f"{self._step} s",
            "shortest": "0 s",
            "models": {"observer": {"fmu": str(self._description.path.resolve())}},
            "outputs": {
                name: _signal(noise=float(size), scale=float(size) / LIMIT)
                for name, size in zip(self.outputs, sizes, strict=True)
            },
        }
        if self._inputs:
            content["inputs"] = {v.name: _signal(0.0, held=True) for v in self._inputs}
        return system_of(content, self._description.path)


def _signal(noise: float, scale: float = 1.0, **more: Any) -> dict[str, Any]:
    return {"unit": "1", "noise": noise, "scale": scale, **more}


def heading() -> str:
    """The head of a table of comparisons, in Markdown."""
    return "| FMU | FMI | largest difference | verdict |\n|---|---|---|---|"


def row(comparison: FMUComparison) -> str:
    """A comparison as a row of that table."""
    size = ""
    if comparison.difference is not None:
        size = f"{comparison.difference:.1e} of `{comparison.signal}`"
    reason = f": {comparison.reason}" if comparison.reason else ""
    verdict = f"{comparison.verdict}{reason}".replace("|", "/").replace("\n", " ")
    return f"| {comparison.file} | {comparison.fmi} | {size} | {verdict} |"
