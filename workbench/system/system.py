"""A machine as a value: what the engine must know of it, and its models do not say.

It is read from one file, `system.toml`, beside its Modelica library; see `system_file`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Vector
from workbench.errors import InputError, closest
from workbench.system.comparison import (
    Channel,
    Comparison,
    Exclusion,
    Influence,
    LeadingOutput,
    Level,
    Rest,
)
from workbench.system.experiments import Experiments
from workbench.system.expression import Expression
from workbench.system.parts import (
    Condition,
    DerivedSignal,
    EstimatedQuantity,
    Export,
    FeedbackFading,
    Mode,
    Model,
    Objective,
    OperatingPoint,
    RecordingSplit,
    Redundancy,
    RollingStates,
    Sampling,
    Signal,
    StepTracking,
    Threshold,
    View,
)
from workbench.system.stopping import Stopping

__all__ = [
    "FULL",
    "OBSERVER",
    "REFERENCE",
    "Channel",
    "Comparison",
    "Condition",
    "DerivedSignal",
    "EstimatedQuantity",
    "Exclusion",
    "Export",
    "FeedbackFading",
    "Influence",
    "LeadingOutput",
    "Level",
    "Mode",
    "Model",
    "Objective",
    "OperatingPoint",
    "RecordingSplit",
    "Redundancy",
    "Rest",
    "RollingStates",
    "Sampling",
    "Signal",
    "StepTracking",
    "System",
    "Threshold",
    "View",
]

OBSERVER = "observer"  # the role of the model that every system has
FULL = "full"  # of one with more states, where there is one
REFERENCE = "reference"  # of the most detailed one, which a package connects an observer to


@dataclass(frozen=True)
class System:
    """A machine: its models, its signals, what is estimated, and what counts.

    Attributes
    ----------
    name : by which it is asked for.
    source : the file it was read from.
    library : `package.mo` of its Modelica library.
    models : by role; OBSERVER is always there.
    names : the models' own names of variables that we name otherwise.
    given : parameters of this machine that differ from the models', SI.
    values : all parameters of the observer model as they act, `given` included, SI.
    walks : random walk of states by name [unit/sqrt(s)]; others move by a small share of their
        nominal value.
    spreads : standard deviation of states at the start that no output shows, by name [unit].
    inputs, outputs : measured; inputs drive the models, outputs correct estimates.
    reference_signals : measured, but only there to score estimates by.
    intermittent : measured at times, and missing in others: they correct Kalman filters alone.
    reported : outputs of the model that estimates hold, with their units.
    export : estimators as FMUs.
    plugin : what is of this machine alone, by the name or the place of a `Plugin`; empty: none.
    shortest : [s] that a recording must last.
    fewest : samples that a recording must have.
    settles : [s] in which a model comes to rest at an operating point.
    sample_time : [s] of usual recordings.
    sampling : which times between samples are likely.
    redundancies : what tells the same in a recording.
    cutting : how a long recording is cut into several, or None.
    stopping : how the machine comes to rest, or None where nobody said so.
    cases : folder of recordings that come with the system, or None.
    experiments : what may be run next, or None where nobody said so.
    work : powers of friction by what they wear, in measured signals and parameters [W].
    loggers : measured signals by the logger that records them; others share one more.
    learns : [s] in which filters learn noise levels from innovations; infinite: they hold them.
    bands : by estimator and quantity, reach of its 95 % bands over that by its own standard
        deviations, where recordings whose truth is known say so [1].
    states : of the observer model that the system comes with, None before that is known; observers
        correct these.
    """

    name: str
    title: str
    source: Path
    library: Path
    models: Mapping[str, Model]
    names: Mapping[str, str]
    given: Mapping[str, float]
    values: Mapping[str, float]
    walks: Mapping[str, float]
    spreads: Mapping[str, float]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    reference_signals: tuple[Signal, ...]
    intermittent: tuple[Signal, ...]
    derived: tuple[DerivedSignal, ...]
    estimated: tuple[EstimatedQuantity, ...]
    reported: Mapping[str, str]
    conditions: tuple[Condition, ...]
    design: OperatingPoint
    tested: OperatingPoint
    objective: Objective
    comparison: Comparison
    fading: FeedbackFading | None = None
    rolling: RollingStates | None = None
    following: StepTracking | None = None
    panels: tuple[View, ...] = ()
    export: Export = field(default_factory=lambda: Export({}, OperatingPoint({}, {}, {})))
    plugin: str = ""
    shortest: float = 0.0
    fewest: int = 20
    settles: float = 10.0
    sample_time: float = 0.005
    learns: float = math.inf
    bands: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    states: tuple[str, ...] | None = None
    cases: Path | None = None
    sampling: Sampling = field(default_factory=lambda: Sampling(math.inf, math.inf, math.inf))
    redundancies: tuple[Redundancy, ...] = ()
    experiments: Experiments | None = None
    cutting: RecordingSplit | None = None
    stopping: Stopping | None = None
    work: tuple[DerivedSignal, ...] = ()
    loggers: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def clocks(self) -> dict[str, tuple[str, ...]]:
        """Loggers but one, against whose clock theirs may be late: that of all other signals.

        Where there are no others, it is the first logger's.
        """
        named = [name for own in self.loggers.values() for name in own]
        first = 0 if set(self.signals) - set(named) else 1
        return dict(list(self.loggers.items())[first:])

    @property
    def signals(self) -> dict[str, Signal]:
        """All measured signals by name."""
        return {
            signal.name: signal
            for signal in (*self.inputs, *self.outputs, *self.reference_signals, *self.intermittent)
        }

    @property
    def corrections(self) -> tuple[str, ...]:
        """Inputs of the model that correct estimated quantities."""
        return tuple(quantity.correction for quantity in self.estimated)

    @property
    def variables(self) -> dict[str, str]:
        """What is asked of a model, with units; one with other names is mapped onto these."""
        measured = {
            signal.name: signal.unit for signal in (*self.inputs, *self.outputs, *self.intermittent)
        }
        corrected = {quantity.correction: quantity.unit for quantity in self.estimated}
        return {
            **measured,
            **corrected,
            **self.reported,
            **{quantity.name: quantity.unit for quantity in self.estimated},
            **{name: "" for name in sorted(self.constants)},
        }

    @property
    def constants(self) -> frozenset[str]:
        """Parameters of the model that formulas of derived signals use, of those that are fed."""
        known = {*self.signals, *(signal.name for signal in self.derived)}
        judged = {signal.name for signal in self.reference_signals}
        fed = [signal.formula.names for signal in self.derived if not signal.formula.names & judged]
        return frozenset(name for names in fed for name in names if name not in known)

    @property
    def columns(self) -> dict[str, str]:
        """Columns of an estimate, with units."""
        return {
            **{output.name: output.unit for output in self.outputs},
            **{quantity.correction: quantity.unit for quantity in self.estimated},
            **{quantity.name: quantity.unit for quantity in self.estimated},
            **self.reported,
        }

    @property
    def indirect(self) -> dict[str, tuple[DerivedSignal, str]]:
        """Derived signals of one column of an estimate, with it: who estimates one knows both."""
        found = {}
        for signal in self.derived:
            columns = signal.formula.names & self.columns.keys()
            known = signal.formula.names - columns <= self.values.keys()
            if len(columns) == 1 and known and signal.name not in self.columns:
                found[signal.name] = signal, min(columns)
        return found

    def unit(self, name: str) -> str:
        """SI unit of a measured, derived or estimated signal."""
        derived = {signal.name: signal.unit for signal in self.derived}
        measured = {name: signal.unit for name, signal in self.signals.items()}
        return {**derived, **self.columns, **measured}[name]

    def condition(self, name: str) -> Condition:
        """A condition by name."""
        return next(condition for condition in self.conditions if condition.name == name)

    def set_by(self, conditions: Mapping[str, object], *, told: bool = False) -> dict[str, float]:
        """Parameters that the conditions of a recording set, SI; if `told`, those told alone."""
        found: dict[str, float] = {}
        for condition in self.conditions:
            if condition.name in conditions and (condition.told or not told):
                found |= condition.means(conditions[condition.name])
        return found

    def under(self, conditions: Mapping[str, object]) -> "System":
        """The same machine, with the parameters that the conditions of a recording set."""
        return replace(self, values={**self.values, **self.set_by(conditions)})

    def model(self, role: str) -> Model:
        """The model in a role, or the observer's where the system has none.

        Raises
        ------
        KeyError
            If the system has no observer, which the reader refuses.
        """
        return self.models.get(role, self.models[OBSERVER])

    def signal(self, name: str, measured: Mapping[str, Vector]) -> Vector:
        """A measured or derived signal of a recording, (n,) SI.

        Parameters
        ----------
        measured : signals by name, (n,) each.
        """
        if name in measured:
            return measured[name]
        derived = next(signal for signal in self.derived if signal.name == name)
        return self.evaluate(derived.formula, measured)

    def evaluate(
        self,
        formula: Expression,
        measured: Mapping[str, Vector],
        parameters: Mapping[str, float] | None = None,
    ) -> Vector:
        """A formula along a recording, (n,); parameters are the model's unless others are given."""
        # What a law in a slot has within itself is as the model has it.
        known = {**self.values, **(parameters or {})}
        values: dict[str, Any] = {}
        for name in formula.names:
            if name in measured or any(signal.name == name for signal in self.derived):
                values[name] = self.signal(name, measured)
            else:
                values[name] = known[name]
        size = next(iter(measured.values())).size
        result: Vector = np.broadcast_to(np.asarray(formula(values), np.float64), (size,))
        return result

    def slopes(self, signal: str) -> tuple[float, ...]:
        """Coefficients of the outputs in a signal that is a sum of them, (l,)."""
        names = tuple(output.name for output in self.outputs)
        if signal in names:
            return tuple(float(name == signal) for name in names)
        derived = next(one for one in self.derived if one.name == signal)
        return derived.formula.slopes(names, self.values)

    def with_names(self, names: Mapping[str, str]) -> "System":
        """The same system, on models with other names of variables."""
        return replace(self, names={**self.names, **names})

    def refuse_missing(self, name: str, where: str) -> None:
        """Refuse a name that is no signal of this system.

        Raises
        ------
        InputError
            If it is none.
        """
        known = [*self.signals, *(signal.name for signal in self.derived), *self.columns]
        if name not in known:
            raise InputError(
                where=where,
                found=f"'{name}'{closest(name, known)}",
                expected=f"a signal of this system: {', '.join(dict.fromkeys(known))}",
                remedy="correct the name",
            )
