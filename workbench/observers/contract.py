"""What every estimator does, and what they share."""

import warnings
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, ClassVar, Self

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.errors import InputError
from workbench.models.fmu import FMU
from workbench.models.native import Instance, compiled, instance, raise_on_failure, read_only
from workbench.observers.estimators.step import Step
from workbench.observers.gains import Gains, SearchSpace
from workbench.observers.layout import layout, rolling_ratio
from workbench.observers.operating import shown_states
from workbench.recordings.case import Value
from workbench.system.check import check_model
from workbench.system.system import OBSERVER, System

_RENAMED = {"reasoned": "default_gains", "tell": "set_conditions", "_law": "_step"}


@dataclass(frozen=True)
class Estimate:
    """Estimates at one time, (w,), or at all times, (n, w)."""

    values: Vector | Matrix  # columns as in `System.columns`
    sigma: Vector | Matrix  # standard deviations, NaN where the method has none
    nis: Vector | float  # normalised innovation squared, () or (n,), NaN where the method has none
    probability: Vector | Matrix  # of each of the estimator's modes, (k,) or (n, k)


@dataclass(frozen=True)
class Parts:
    """A compiled step and what it takes, for who writes it in another language."""

    step: Any  # compiled; advances by one sample
    # that it steps; `several`: it takes the tuple of them, else the only one
    models: tuple[Instance, ...]
    several: bool
    # settings, state: named tuples, whose arrays are those of the estimator
    settings: Any
    state: Any
    width: int  # entries of an estimate


@cache
def _loop_of(step: Any) -> Any:
    """Compile the loop of a step over samples, which ends at the first status that is not 0."""

    def loop(model, settings, state, steps, u, y, estimates):  # type: ignore[no-untyped-def]
        for k in range(steps.size):
            status = step(model, settings, state, steps[k], u[k], y[k], estimates[k])
            if status:
                return status
        return 0

    # By this name its code is kept, apart from that of others.
    loop.__qualname__ = f"{step.py_func.__module__}.{step.py_func.__qualname__}.loop"
    return compiled(loop)


class Estimator(ABC):
    """Feeds on measured inputs u and outputs y of a system, sample by sample.

    A method provides `_begin`, which fills its state, and `_step`, a compiled function, which
    advances by one sample. What is tuned are its gains: `default_gains` says what they are before
    tuning, `space` where they are sought.

    Parameters
    ----------
    fmu : model with the variables of the system.
    system : whose signals are fed.

    Raises
    ------
    InputError
        If the model lacks a variable, or has it in another unit.
    """

    name: str  # in results and commands
    label: ClassVar[str]  # for people
    role: ClassVar[str] = OBSERVER  # of the model that it runs on
    rank: ClassVar[int] = 50  # place in tables
    standard: ClassVar[bool] = True  # whether it runs unless others are asked for
    tunable: ClassVar[bool] = True  # whether it has gains
    # whether it makes its feedback as it goes; its gains are noise levels
    adapts: ClassVar[bool] = False
    meaning: ClassVar[str] = ""  # of the gains, with units, for whoever reads their file
    # whether it needs a whole recording, and has no `init`, `step` and `advance`
    offline: ClassVar[bool] = False
    tuned_as: ClassVar[str] = ""  # estimator whose gains it takes; empty: its own
    # whether it runs on a model that has Co-Simulation alone
    co_simulates: ClassVar[bool] = False
    # whether it takes one step of first order from sample to sample, whatever swings
    coarse_steps: ClassVar[bool] = False
    # whether it goes through events of a model that saves its state
    passes_events: ClassVar[bool] = False
    # whether its feedback acts by estimated quantities alone, so that it does nothing without them
    by_quantities: ClassVar[bool] = False
    # whether samples may be missing, so that it takes aids as outputs, too
    aided: ClassVar[bool] = False
    # what it weighs models by, in columns and figures; none if it runs on one model
    modes: tuple[str, ...] = ()
    finds: frozenset[str] = frozenset()  # conditions that it finds out by itself
    _step: Any
    _settings: Any
    _state: Any

    def __init__(self, fmu: FMU, system: System, gains: Gains) -> None:
        self.fmu = fmu
        self.system = system = self.fed(system)
        check_model(system, fmu.description)
        if self.by_quantities and not system.estimated:
            raise InputError(
                where=str(system.source),
                found="no table [estimated.NAME]",
                expected=f"quantities of the model, by which the {self.label} corrects it",
                remedy="add one (docs/system-file.md), or choose ekf or disturbance_observer",
            )
        self.gains = gains
        inputs = [signal.name for signal in system.inputs]
        unseen = [output.name for output in system.outputs if output.name not in fmu.states]
        self._outputs = [*system.reported, *unseen]
        self._model: Any = instance(
            fmu, inputs, system.corrections, self._outputs, only_read=self.co_simulates
        )
        self._layout = layout(fmu, system)
        self._t = 0.0
        self._model_time = fmu.start_time
        self._known: dict[str, float] = {}
        self._width = 2 * len(system.columns) + len(self.modes) + 1
        # (w,) what the law's standard deviations are multiplied by, see `System.bands`
        bands = system.bands.get(self.name, {})
        self.bands = np.array([bands.get(name, 1.0) for name in system.columns])

    def __init_subclass__(cls, **options: Any) -> None:
        """Take methods of an estimator that still have their former names, for one version."""
        super().__init_subclass__(**options)
        for old, new in _RENAMED.items():
            if old in vars(cls):
                warnings.warn(f"{cls.__name__}.{old} is now called {new}", DeprecationWarning, 2)
                setattr(cls, new, vars(cls)[old])

    @property
    def models(self) -> tuple[FMU, ...]:
        """What it runs on: the model, or one of each mode."""
        return (self.fmu,)

    @classmethod
    def fed(cls, system: System) -> System:
        """A system as the estimator sees it: outputs are all that corrects its estimates."""
        aids = system.intermittent if cls.aided else ()
        return replace(system, outputs=(*system.outputs, *aids), intermittent=())

    @classmethod
    def default_gains(cls, fmu: FMU, system: System) -> Gains:
        """Gains before tuning; the FMU is left at an operating point."""
        return Gains(cls.name, (), np.zeros(0), {}, "")

    @classmethod
    def untuned(cls, fmu: FMU, system: System) -> Self:
        """The estimator with its gains before tuning."""
        return cls(fmu, system, cls.default_gains(fmu, system))

    @classmethod
    def reasoned(cls, fmu: FMU, system: System) -> Gains:
        """Call `default_gains`; the former name, for one version."""
        warnings.warn("reasoned is now called default_gains", DeprecationWarning, stacklevel=2)
        # Of an override that asks the method it overrides.
        owner: Any = super(cls, cls) if "reasoned" in vars(cls) else cls
        gains: Gains = owner.default_gains(fmu, system)
        return gains

    @classmethod
    def space(
        cls, fmu: FMU, system: System, gains: Gains, slowest: float, fastest: float
    ) -> SearchSpace:
        """Where gains are sought; the FMU is left at an operating point.

        Parameters
        ----------
        slowest, fastest : angular frequencies that recordings show [rad/s].

        Raises
        ------
        InputError
            If the estimator is called tunable, and does not say where.
        """
        raise InputError(
            where=f"estimator {cls.name}",
            found="no method `space`",
            expected="where gains are sought, because the estimator is called tunable",
            remedy="write it, or say `tunable = False` in the class",
        )

    @classmethod
    def acts_on(cls, fmu: FMU, system: System) -> tuple[str, ...]:
        """States of the model that the gains act on, or act through."""
        return fmu.states

    @classmethod
    def meanings(cls, fmu: FMU, system: System, gains: Gains) -> dict[str, tuple[str, str]]:
        """What each gain does, and its unit."""
        return {}

    @classmethod
    def error_dynamics(
        cls, A: Matrix, B: Matrix, C: Matrix, gains: Gains
    ) -> tuple[Matrix, Matrix] | None:
        """Linear dynamics of the estimate's error, after a step of the true quantities.

        Parameters
        ----------
        A, B, C : of the model by states (n), corrections (q) and outputs (l).

        Returns
        -------
        dynamics : (m, m) d/dt of errors and memory; the last q unknowns are the true quantities.
        error : (q, m) error of the estimated quantities. None for a method that makes its gain as
            it goes.
        """
        return None

    def settings(self) -> dict[str, object]:
        """What it runs with, as plain numbers, lists and texts; empty if it has no gains."""
        return self.gains.summary() if self.gains.names else {}

    @abstractmethod
    def _begin(self, u: Vector, y: Vector) -> None:
        """Set the state to the first sample."""

    def _arguments(self) -> tuple[Any, Any]:
        """Settings and state of the step."""
        return self._settings, self._state

    @property
    def steps(self) -> tuple[Step, ...]:
        """Steps that are Euler's until that shows, see `estimators.step`; none if they stay so."""
        return ()

    @property
    def doubt(self) -> str:
        """What is said of its last run; empty for nothing."""
        count = int(max((step.coarse[0] for step in self.steps), default=0.0))
        if not count:
            return ""
        return (
            f"{self.name} takes {count} of its steps less accurately than noise allows: the model "
            "moves too fast there. Record more often"
        )

    @property
    def parts(self) -> Parts:
        """The compiled step and what it takes."""
        settings, state = self._arguments()
        several = not isinstance(self._model, Instance)
        models = self._model if several else (self._model,)
        return Parts(self._step, models, several, settings, state, self._width)

    def set_conditions(self, conditions: Mapping[str, Value]) -> None:
        """Take the parameters of a recording's conditions from its next start on.

        Those that estimators are told, and their model has; estimates of quantities start there.
        One that finds a condition by itself has a model for each choice, to which this is nothing.
        """
        known = self.system.set_by(conditions, told=True)
        self._known = {name: known[name] for name in known if name in self.fmu.parameters}

    def tell(self, conditions: Mapping[str, Value]) -> None:
        """Call `set_conditions`; the former name, for one version."""
        warnings.warn("tell is now called set_conditions", DeprecationWarning, stacklevel=2)
        Estimator.set_conditions(self, conditions)

    def start(self, u: Vector, y: Vector) -> None:
        """Start FMU and state from the first sample; `advance` takes it again, after no time."""
        measured = zip(self.system.outputs, self._measured(y), strict=True)
        begin = {
            output.name: float(value)
            for output, value in measured
            if output.name in self.fmu.states and not np.isnan(value)
        }
        rolling = self.system.rolling
        if rolling is not None and rolling.follower not in begin and rolling.leader in begin:
            begin[rolling.follower] = rolling_ratio(self.fmu, self.system) * begin[rolling.leader]
        estimated = {quantity.name for quantity in self.system.estimated}
        held = {name: value for name, value in self._known.items() if name not in estimated}
        # What a model calculates at its start, and events there, may depend on inputs.
        # Samples of a wrong size are refused when they are fed.
        held |= dict(zip((signal.name for signal in self.system.inputs), u, strict=False))
        self.fmu.start(begin, held)
        samples = {o.name: v for o, v in zip(self.system.outputs, self._measured(y), strict=True)}
        if shown := shown_states(self.fmu, self.system, u, samples, begin.keys()):
            self.fmu.start({**begin, **{name: s.value for name, s in shown.items()}}, held)
        self._model_time = self.fmu.start_time
        self._model.u[:] = 0.0
        for step in self.steps:
            step.accurate[0] = 0.0
        self._begin(u, y)

    def init(self, t: float, u: Vector, y: Vector) -> Estimate:
        """Start at time t [s] with the first sample: measured states, nominal quantities."""
        self._t = t
        self._check_shapes(1, np.atleast_2d(u), np.atleast_2d(self._measured(y)))
        self.start(u, y)
        return self._take(0.0, u, y)

    def step(self, t: float, u: Vector, y: Vector) -> Estimate:
        """Advance to time t [s] with the sample taken there."""
        h, self._t = t - self._t, t
        return self._take(h, u, y)

    def run(self, time: Vector, u: Matrix, y: Matrix) -> Estimate:
        """The same as `init` and `step` over a whole recording, in one compiled loop.

        Parameters
        ----------
        time : (n,) [s].
        u, y : (n, m) and (n, l) measured inputs and outputs; y of a case holds aids, too.
        """
        self._check_shapes(time.size, u, self._measured(y))
        self.start(u[0], y[0])
        return self.advance(np.diff(time, prepend=time[0]), u, y)

    def advance(self, steps: Vector, u: Matrix, y: Matrix) -> Estimate:
        """Run over a piece of a recording, from where the piece before it ended, or from `start`.

        Parameters
        ----------
        steps : (n,) from the sample before [s].
        u, y : (n, m) and (n, l) measured inputs and outputs; y of a case holds aids, too.
        """
        return self._split(self._run(steps, u, y))

    def advance_values(self, steps: Vector, u: Matrix, y: Matrix) -> Matrix:
        """The values of `advance` alone, (n, w), as they are scored."""
        return self._run(steps, u, y)[:, : len(self.system.columns)]

    def _take(self, h: float, u: Vector, y: Vector) -> Estimate:
        """One sample, by the loop over many: a law is compiled once."""
        return self._split(self._run(np.array([h]), np.atleast_2d(u), np.atleast_2d(y))[0])

    def _run(self, steps: Vector, u: Matrix, y: Matrix) -> Matrix:
        """Rows of estimates, as laws write them."""
        rows = np.full((steps.size, self._width), np.nan)
        settings, state = self._arguments()
        u, y = self._samples(steps, u, y)
        status = _loop_of(self._step)(self._model, settings, state, steps, u, y, rows)
        raise_on_failure(status, self.fmu)
        for model in self.models:
            model.check_event()
        return rows

    def _samples(self, steps: Vector, u: Matrix, y: Matrix) -> tuple[Matrix, Matrix]:
        """Inputs with the model's time, (n, m + 1), as `measure` sets them, and outputs, (n, l)."""
        y = self._measured(y)
        self._check_shapes(steps.size, u, y)
        samples = np.empty((steps.size, u.shape[1] + 1))
        samples[:, :-1] = u
        samples[:, -1] = self._model_time + np.cumsum(steps)
        self._model_time = float(samples[-1, -1]) if steps.size else self._model_time
        return read_only(samples), read_only(y)

    def _check_shapes(self, count: int, u: Matrix, y: Matrix) -> None:
        """Refuse samples of other sizes than compiled code reads, which would go beyond them."""
        for array, columns in ((u, len(self.system.inputs)), (y, len(self.system.outputs))):
            if array.shape != (count, columns):
                raise ValueError(f"samples of shape {array.shape}, not {(count, columns)}")

    def _measured(self, y: Any) -> Any:
        """Outputs that the estimator takes of those given, (l,) or (n, l), NaN for more."""
        more = len(self.system.outputs) - y.shape[-1]
        if more <= 0:
            return y[..., : len(self.system.outputs)]
        return np.concatenate([y, np.full((*y.shape[:-1], more), np.nan)], axis=-1)

    def _split(self, rows: Any) -> Estimate:
        width = len(self.system.columns)
        values, sigma, probability = np.split(rows[..., :-1], [width, 2 * width], axis=-1)
        if (self.bands != 1.0).any():
            sigma = self.bands * sigma
        return Estimate(values, sigma, rows[..., -1], probability)
