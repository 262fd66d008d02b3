"""A machine as a value: what the engine must know of it, and its models do not say.

It is read from one file, `system.toml`, beside its Modelica library; see `system_file`.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Vector
from workbench.errors import InputError, closest
from workbench.system.comparison import Comparison
from workbench.system.declaration import Scope, declared, key
from workbench.system.experiments import Experiments
from workbench.system.expression import Expression
from workbench.system.parts import (
    AT_REST,
    ENDLESS,
    PARAMETER_OR_STATE,
    Candidates,
    Condition,
    DerivedSignal,
    EstimatedQuantity,
    Export,
    FeedbackFading,
    FittedParameter,
    FrictionPower,
    Model,
    Objective,
    OperatingPoint,
    RecordingSplit,
    Redundancy,
    RollingStates,
    Sampling,
    Signal,
    StateNoise,
    StepTracking,
    View,
    columns_of,
    names_of,
    refuse_no_sensor,
    unit_in_model,
    units_of,
)
from workbench.system.plugins import plugin_of
from workbench.system.stopping import Stopping
from workbench.system.tables import Table

OBSERVER = "observer"  # the role of the model that every system has
FULL = "full"  # of one with more states, where there is one
REFERENCE = "reference"  # of the most detailed one, which a package connects an observer to


def _refuse_no_observer(models: Mapping[str, Model], table: Table, name: str, _: Scope) -> None:
    if OBSERVER not in models:
        raise InputError(
            where=table.table(name).where,
            found=f"roles {', '.join(models) or 'none'}",
            expected=f"a model in the role '{OBSERVER}', which estimators run on",
            remedy=f'add {OBSERVER} = {{ class = "NAME" }}',
        )


def _refuse_no_outputs(signals: tuple[Signal, ...], table: Table, name: str, scope: Scope) -> None:
    if not signals:
        raise InputError(
            where=table.where,
            found=f"no [{name}]",
            expected="measured outputs, which correct the model",
            remedy=f"add a table [{name}.NAME] for each",
        )
    refuse_no_sensor(signals, table, name, scope)


def _samples(table: Table, name: str, _: Scope) -> int:
    return round(table.number(name, "1"))


def _reported(table: Table, name: str, scope: Scope) -> dict[str, str]:
    return {output: unit_in_model(scope, output) for output in table.texts(name)}


def _refuse_wrong_loggers(
    loggers: Mapping[str, tuple[str, ...]], table: Table, name: str, scope: Scope
) -> None:
    """Refuse a logger without a name of one word, or with a signal that has another one."""
    signals = list(names_of("inputs", "outputs", "reference_signals", "intermittent")(scope))
    owners: dict[str, str] = {}
    for logger, own in loggers.items():
        where = table.table(name).place(logger)
        if not logger.isidentifier() or not own:
            raise InputError(
                where=where,
                found="no signal"
                if logger.isidentifier()
                else f"'{logger}', a name of no one word",
                expected="a name of letters and digits, and the measured signals of this logger",
                remedy=f'write for instance second = ["{signals[0]}"]',
            )
        for signal in own:
            if signal in signals and signal not in owners:
                owners[signal] = logger
                continue
            raise InputError(
                where=where,
                found=f"'{signal}' a second time, after that of {owners[signal]}"
                if signal in owners
                else f"'{signal}'{closest(signal, signals)}",
                expected=f"measured signals, each of one logger: {', '.join(signals)}",
                remedy="name it once" if signal in owners else "correct the name",
            )


@declared
class System:
    """A machine: its models, its signals, what is estimated, and what counts.

    Attributes
    ----------
    source : the file it was read from.
    library : `package.mo` of its Modelica library.
    names : the models' own names of variables that we name otherwise: of `[variables]`, of each
        `variable` of a table, and those given elsewhere.
    values : all parameters of the observer model as they act, `given` included, SI.
    states : of the observer model that the system comes with, None before that is known; observers
        correct these.
    """

    source: Path
    library: Path
    values: Mapping[str, float]
    states: tuple[str, ...] | None

    names: Mapping[str, str] = key(
        "your names of variables of the FMU that have no table with `variable`: corrections, "
        "parameters, names in formulas",
        name="variables",
        absent={},
    )
    title: str = key("what the machine is, for people")
    name: str = key(
        "name for `--system`",
        absent=lambda scope: scope.file.resolve().parent.name,
        otherwise="the folder's",
    )
    sample_time: float = key("usual time between two samples", "s")
    shortest: float = key("least length of a recording", "s", 0.0)
    fewest: int = key(
        "least number of samples of a recording; fewer are enough if the machine moves by far more "
        "than noise",
        absent=20,
        read=_samples,
        schema={"type": "number"},
    )
    cases: Path | None = key("folder of the system's own recordings", absent=None)
    plugin: str = key(
        "Python code for this machine, such as a simulated rig: an entry point of "
        "the group `workbench.machines`, or the place of "
        'a [`Plugin`](own-machine.md#a-plugin), `"package.module:NAME"`',
        aliases=("companion",),
        absent="",
        read=lambda table, name, scope: plugin_of(table),
        schema={"type": "string", "minLength": 1},
    )
    models: Mapping[str, Model] = key(
        f"models by role: `{OBSERVER}` (required) for estimators, `{FULL}` for a larger model, "
        f"`{REFERENCE}` for the most detailed one, which makes simulated recordings",
        check=_refuse_no_observer,
    )
    given: Mapping[str, float] = key(
        'parameters of this machine that differ from the model\'s, `A = "0.52 m2"`; they are set '
        "in "
        "the FMU, without a compiler",
        unit_in_model,
        {},
        name="parameters",
        of_model=True,
    )
    inputs: tuple[Signal, ...] = key("measured signals that drive the model", absent=())
    outputs: tuple[Signal, ...] = key(
        "measured signals that correct estimates", check=_refuse_no_outputs
    )
    reference_signals: tuple[Signal, ...] = key(
        "validation sensors: they score estimates, and no estimator uses them",
        name="judged",
        aliases=("reference_signals",),
        absent=(),
        check=refuse_no_sensor,
    )
    intermittent: tuple[Signal, ...] = key(
        "outputs that are measured at times; they correct Kalman filters only",
        name="aids",
        aliases=("intermittent",),
        absent=(),
        check=refuse_no_sensor,
    )
    derived: tuple[DerivedSignal, ...] = key(
        "signals computed from measured ones and parameters", absent=()
    )
    estimated: tuple[EstimatedQuantity, ...] = key(
        "parameters of the model that observers estimate", absent=()
    )
    reported: Mapping[str, str] = key(
        "outputs of the model that estimates hold beside the measured ones",
        absent={},
        read=_reported,
        schema={"type": "array", "items": {"type": "string", "minLength": 1}},
    )
    work: tuple[FrictionPower, ...] = key(
        "friction powers by the part that they wear; [monitoring](monitor.md) sums them over "
        "recordings",
        absent=(),
    )
    conditions: tuple[Condition, ...] = key(
        "test conditions, set before a recording and stated in each `case.toml`", absent=()
    )
    sampling: Sampling = key("which times between samples are likely")
    loggers: Mapping[str, tuple[str, ...]] = key(
        "measured signals by the logger that records them; others share one more",
        absent={},
        check=_refuse_wrong_loggers,
    )
    state_noise: tuple[StateNoise, ...] = key(
        "noise and start of the model's states", name="states", absent=(), of_model=True
    )
    fitted: tuple[FittedParameter, ...] = key(
        "parameters of the model, and states by their starts, that `workbench fit` fits",
        name="fit",
        absent=(),
        keys=PARAMETER_OR_STATE,
        of_model=True,
    )
    settles: float = key("time in which the model comes to rest", "s", 10.0, name="points.settles")
    design: OperatingPoint = key(
        "where observers are designed",
        name="points.design",
        absent=AT_REST,
        otherwise="at rest, at the start values of the inputs",
    )
    tested: OperatingPoint = key(
        "where observability is tested", name="points.tested", absent="{design}"
    )
    objective: Objective = key("score of estimators, and objective of tuning")
    comparison: Comparison = key("how recordings are compared with the model", name="diagnosis")
    fading: FeedbackFading | None = key(
        "feedback fades out while a signal is small",
        name="feedback.fades",
        absent=None,
        otherwise="never",
    )
    rolling: RollingStates | None = key(
        "two states in a fixed ratio while an output is zero, which saturates",
        name="feedback.rolls",
        absent=None,
    )
    learns: float = key(
        "time in which filters learn noise levels from innovations, see "
        "[estimators](estimators.md#noise-levels)",
        "s",
        ENDLESS,
        name="feedback.learns",
        otherwise="never",
        above=0.0,
    )
    bands: Mapping[str, Mapping[str, float]] = key(
        "factor on an estimator's standard deviations, by estimator and quantity, from recordings "
        "with known truth",
        absent={},
        otherwise="1 each",
        keys=lambda scope: columns_of(scope.whole),
        above=0.0,
    )
    following: StepTracking | None = key(
        "tuned gains must find a step of a quantity in time", name="tuning.follows", absent=None
    )
    panels: tuple[View, ...] = key(
        "panels of the figures; without any they follow from the signals",
        name="figures",
        absent=(),
        otherwise="by signal",
    )
    candidates: Candidates = key("candidates of a diagnosis of an FMU alone")
    export: Export = key("estimators as FMUs")
    redundancies: tuple[Redundancy, ...] = key(
        "pairs of formulas that must agree in a recording", absent=()
    )
    experiments: Experiments | None = key(
        "what may be varied in the next recording", name="next", absent=None
    )
    cutting: RecordingSplit | None = key(
        "how `workbench import` splits a long recording; the default is at gaps that are not "
        "`possible`",
        absent=None,
    )
    stopping: Stopping | None = key("how the machine comes to rest", name="distance", absent=None)

    @property
    def walks(self) -> dict[str, float]:
        """Random walk of states [unit/sqrt(s)]; others move by a small share of their nominal."""
        return {s.name: s.walk for s in self.state_noise if s.walk is not None}

    @property
    def spreads(self) -> dict[str, float]:
        """Standard deviation of states at the start that no output shows [unit]."""
        return {s.name: s.spread for s in self.state_noise if s.spread is not None}

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
    def validated(self) -> bool:
        """Whether the objective weighs a signal that no estimator is fed."""
        return not self.objective.weights.keys() <= {output.name for output in self.outputs}

    @property
    def holds(self) -> Vector:
        """When samples of each input act, (m,); see `Signal.hold`."""
        return np.array([signal.hold for signal in self.inputs])

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
        references = {signal.name for signal in self.reference_signals}
        fed = [
            signal.formula.names for signal in self.derived if not signal.formula.names & references
        ]
        return frozenset(name for names in fed for name in names if name not in known)

    @property
    def columns(self) -> dict[str, str]:
        """Columns of an estimate, with units."""
        return columns_of(vars(self))

    @property
    def indirect(self) -> dict[str, tuple[DerivedSignal, str]]:
        """Derived signals of one column of an estimate, with it: who estimates one knows both."""
        indirect = {}
        for signal in self.derived:
            columns = signal.formula.names & self.columns.keys()
            known = signal.formula.names - columns <= self.values.keys()
            if len(columns) == 1 and known and signal.name not in self.columns:
                indirect[signal.name] = signal, min(columns)
        return indirect

    def unit(self, name: str) -> str:
        """SI unit of a measured, derived or estimated signal."""
        return units_of(vars(self))[name]

    def condition(self, name: str) -> Condition:
        """A condition by name."""
        return next(condition for condition in self.conditions if condition.name == name)

    def set_by(self, conditions: Mapping[str, object], *, told: bool = False) -> dict[str, float]:
        """Parameters that the conditions of a recording set, SI; if `told`, those told alone."""
        values: dict[str, float] = {}
        for condition in self.conditions:
            if condition.name in conditions and (condition.told or not told):
                values |= condition.means(conditions[condition.name])
        return values

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
        derived = next(channel for channel in self.derived if channel.name == signal)
        return derived.formula.slopes(names, self.values)

    def with_names(self, names: Mapping[str, str]) -> "System":
        """The same system, on models with other names of variables."""
        return replace(self, names={**self.names, **names})
