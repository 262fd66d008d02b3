"""Fit parameters of an FMU, and starts of its states, to recordings.

The residuals of all recordings, measured less simulated outputs over the noise of a sample, are
made small in the sum of squares, or by soft_l1, which bears outliers. Simulations run free, from
inputs alone. Unknowns are scaled by their sizes, so that a step of one is all of a parameter.
"""

import fnmatch
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import Bounds, OptimizeResult, differential_evolution, least_squares

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.data.cleaning import first_value, saturated
from workbench.errors import FMUError, InputError, require_known, unknown_name
from workbench.models.description import MODEL_EXCHANGE, Description, read_description
from workbench.models.fmu import FMU
from workbench.models.simulation import Drive, Simulation
from workbench.observers.operating import ShownStart, shown_states, start_spreads
from workbench.observers.trajectory import check_along
from workbench.observers.trust import MOSTLY
from workbench.recordings.case import Case
from workbench.runtime.engine import Engine, ProgressReporter, StepReporter
from workbench.runtime.pool import Pool
from workbench.studies.fit.outcome import (
    LOSSES,
    Direction,
    FitOutcome,
    FittedValue,
    Loss,
    RecordingFit,
    residual_doubts,
)
from workbench.system.parts import FittedParameter
from workbench.system.registry import model_path, open_model
from workbench.system.system import OBSERVER, System
from workbench.system.units import BAND

_CHANCE = BAND**2  # of a sum of squares, by which 95 of 100 fits of the truth are above the least
_STEPS = 40  # of a local fit; Gauss-Newton needs ten where it comes near
_REACH = 5.0  # times a parameter, and a fifth of it: where starts are drawn if it has no range
# Derivatives by differences are right to some 1e-5 of a column: columns that differ by ten times
# that, or less, may be the same.
_ROUNDING = 1e-4
_MOVES = 10.0  # deviations of a sample, by which a fit may move a start that it shows
_SHARE = 0.1  # of the leading part of a direction, from which on another one belongs to it
_CHEAP = 60.0  # [s] that profiles may take before a covariance has to do
_LED = (
    "say in [points.design] of the system file at which inputs the machine works, and in its "
    "'held' where states are held there. Then run 'workbench diagnose': outputs lead its "
    "simulations, and it sizes wrong parameters"
)
_FREE = FittedParameter(name="", range=(-np.inf, np.inf), prior=(), by_recording=None)
_UNBOUNDED = 1e100  # deviations, whose squares can still be added up
_MUCH = 4.0  # deviations of chi-squared; chance leaves more once in 30 000 fits
# Times e, by which a state that grows by itself makes its rounding as large as it was.
_LOST = -float(np.log(np.finfo(float).eps))
_FAILED = 1e4  # deviations, of all samples of a recording that cannot be simulated


@dataclass(frozen=True)
class FitSettings:
    """How a fit is made.

    Attributes
    ----------
    starts : local fits, the first from the model's own values.
    loss : of LOSSES.
    generations : of differential evolution, where starts disagree; 0: none.
    seed : of what is drawn.
    profiles : whether intervals are by profile likelihood; None: where that takes a minute at most.
    """

    starts: int = 3
    loss: Loss = "linear"
    generations: int = 20
    seed: int = 1
    profiles: bool | None = None


@dataclass(frozen=True)
class _Unknown:
    """What is fitted: a parameter or a start, in all recordings or in one."""

    name: str
    unit: str
    nominal: float
    low: float
    high: float
    size: float  # a change that matters, by which it is scaled
    prior: tuple[float, float] | tuple[()]
    recording: int | None  # that it belongs to, None for all
    is_state: bool


class _Run(NamedTuple):
    """A recording to simulate."""

    case: Case
    drive: Drive
    y: Matrix
    sigma: Matrix  # (n, l) standard deviations of their noise
    counted: np.ndarray  # (n, l) samples that are compared
    given: Mapping[str, float]  # parameters that its conditions set
    starts: Mapping[str, ShownStart]  # of states that outputs show, at the first sample
    doubt: str  # of the model along it, see `check_along`
    outputs: tuple[str, ...]  # (l,) names
    growth: float = 0.0  # 1/s, largest at the first sample, of a state by itself
    hidden: tuple[str, ...] = ()  # states that no output shows at the first sample

    @property
    def lost(self) -> str:
        """Why a simulation from inputs alone tells nothing of its end; empty: it may."""
        lasts = float(self.case.time[-1] - self.case.time[0])
        if not self.growth * lasts > _LOST:
            return ""
        return (
            f"the model is unstable where {self.case.name} begins: a state grows e-fold in "
            f"{1.0 / self.growth:.2g} s by itself, and is simulated from inputs alone for "
            f"{lasts:.3g} s"
        )

    @property
    def begin(self) -> dict[str, float]:
        """Values of `starts`."""
        return {name: start.value for name, start in self.starts.items()}


def fit(
    system: System,
    cases: Sequence[Case],
    parameters: Sequence[str | FittedParameter],
    engine: Engine,
    *,
    held_out: Sequence[Case] = (),
    settings: FitSettings = FitSettings(),
) -> FitOutcome:
    """Fit parameters and starts to recordings; Ctrl-C keeps the best values so far.

    Starts of states that outputs show are fitted to each recording.

    Parameters
    ----------
    parameters : names and patterns of parameters and states; all of `[fit]` of the system file if
        there are none.
    held_out : recordings on which only errors are measured.
    """
    require_known([settings.loss], LOSSES, where="loss")
    description = read_description(model_path(system, OBSERVER)).renamed(system.names)
    entries = resolve_parameters(system, description, parameters)
    with open_model(system) as fmu:
        spreads = dict(zip(fmu.states, start_spreads(fmu, system), strict=True))
        moved = [entry.name for entry in entries if entry.name in fmu.parameters]
        runs = [_run(case, system, fmu, moved) for case in (*cases, *held_out)]
        jumps = fmu.has_events or fmu.interface != MODEL_EXCHANGE
    unknowns = _unknowns(entries, description, system, runs[: len(cases)], spreads)
    workers = min(engine.workers, max(len(cases), len(unknowns)))
    with Pool(workers, _simulation, system) as pool:
        # Where a local fit comes near, it makes ten steps.
        progress = ProgressReporter(engine.report, "steps").part(10 * settings.starts)
        problem = _Problem(pool, runs[: len(cases)], unknowns, settings.loss, progress)
        problem.residuals(problem.start)
        if problem.failure:
            found = f"no simulation with the model's own values: {problem.failure}"
            first = "run 'workbench simulate --estimator open_loop' on them first"
            raise _failed(description, problem, found, first)
        # The first of each worker compiles.
        problem.seconds = min(problem.time_residuals() for _ in range(workers + 1))
        search, interrupted = _Search(problem, settings, engine.report, jumps=jumps), False
        try:
            search.run()
            if not np.isfinite(search.costs).any():
                found = f"no fit from any start: {search.failure}"
                first = "give narrower ranges, --range, or fit fewer parameters"
                raise _failed(description, problem, found, first)
        except KeyboardInterrupt:
            interrupted = True
            pool.finish()
        outcome = _Judgement(problem, search, settings, engine.report).outcome(interrupted)
        return outcome if interrupted else _with_held_out(outcome, problem, runs[len(cases) :])


def _failed(description: Description, problem: "_Problem", found: str, remedy: str) -> InputError:
    """What to raise where a model cannot be simulated along the recordings."""
    unstable = next((run.lost for run in problem.runs if run.lost), "")
    return InputError(
        where=str(description.path),
        found=f"{found}; {unstable}" if unstable else found,
        expected="a model that runs along the recordings from inputs alone",
        remedy=_LED if unstable else remedy,
    )


@contextmanager
def _simulation(system: System) -> Iterator[Simulation]:
    """A worker: the system's model, opened once."""
    outputs = [output.reading for output in system.outputs]
    with open_model(system) as fmu:
        yield Simulation(fmu, [signal.name for signal in system.inputs], outputs, system.holds)


def resolve_parameters(
    system: System, description: Description, parameters: Sequence[str | FittedParameter]
) -> list[FittedParameter]:
    """What is fitted, with ranges and priors of the system file."""
    known = [
        v.name
        for v in description.variables
        if v.causality == "parameter" and v.scalar and v.initial != "calculated"
    ]
    known += [name for name in description.states if name not in known]
    declared = {entry.name: entry for entry in system.fitted}
    entries: dict[str, FittedParameter] = {}
    for entry in parameters or system.fitted:
        pattern = entry if isinstance(entry, str) else entry.name
        names = [pattern] if pattern in known else fnmatch.filter(known, pattern)
        variable = description.by_name.get(pattern)
        if not names and variable is not None and variable.causality == "parameter":
            raise InputError(
                where="parameters to fit",
                found=f"'{pattern}', which is "
                + (
                    "calculated by the model"
                    if variable.scalar
                    else "an array, or an element of one"
                    if variable.floats
                    else f"a whole number or no number ({variable.type})"
                ),
                expected="a parameter that is a single real number and can be set, or a state",
                remedy=f"set other values of '{pattern}' in [parameters] of the system file, "
                "fit with each, and compare what remains",
            )
        if not names:
            raise unknown_name(
                pattern,
                known,
                where="parameters to fit",
                expected="names or patterns of parameters that can be set, and of states",
                remedy="correct the name; 'workbench fmu info' lists the FMU's variables",
            )
        for name in names:
            own = (
                declared.get(name, replace(_FREE, name=name))
                if isinstance(entry, str)
                else replace(entry, name=name)
            )
            entries[name] = own
    if not entries:
        raise InputError(
            where=str(system.source),
            found="no parameter to fit",
            expected="names or patterns, or tables [fit.NAME]",
            remedy=f"name them, --parameter NAME, of {', '.join(known[:20])}",
        )
    return list(entries.values())


def _run(case: Case, system: System, fmu: FMU, moved: Sequence[str]) -> _Run:
    doubt = check_along(fmu, system, case, walks=False, moved=moved)
    y = np.column_stack([case[output.name] for output in system.outputs])
    sigma = np.column_stack(
        [
            np.hypot(output.deviation(case[output.name]), output.resolution / np.sqrt(12.0))
            for output in system.outputs
        ]
    )
    counted = np.isfinite(y) & (case.time >= case.counts_from)[:, None]
    counted &= ~np.column_stack([saturated(case[o.name], o) for o in system.outputs])
    able = set(fmu.description.states)
    if MODEL_EXCHANGE not in fmu.description.interfaces:
        able = {v.name for v in fmu.description.variables if v.initial in ("exact", "approx")}
    first = {
        output.name: first_value(case.time, case[output.name], output.noise)
        for output in system.outputs
        if output.reading == output.name
    }
    noise = {output.name: output.noise for output in system.outputs}
    starts = {name: ShownStart(first[name], noise[name]) for name in first if name in able}
    inputs = [case[signal.name] for signal in system.inputs]
    u = np.column_stack(inputs) if inputs else np.empty((case.time.size, 0))
    drive, given = Drive(case.time, u, case.model_time), system.set_by(case.conditions)
    fmu.begin_at(case.model_time)
    held = dict(zip((signal.name for signal in system.inputs), u[0], strict=True))
    names = tuple(output.name for output in system.outputs)
    run = _Run(case, drive, y, sigma, counted, given, starts, doubt, names)
    fmu.start(run.begin, {**given, **held})
    run = run._replace(starts={**shown_states(fmu, system, u[0], first, starts), **starts})
    hidden = tuple(name for name in fmu.states if name not in run.starts)
    growth = _growth(fmu, run.begin, {**given, **held})
    return run._replace(growth=growth, hidden=hidden if fmu.interface == MODEL_EXCHANGE else ())


def _growth(fmu: FMU, begin: Mapping[str, float], held: Mapping[str, float]) -> float:
    """How fast a state grows by itself at the start [1/s]; 0 where none does, or nobody knows."""
    if fmu.interface != MODEL_EXCHANGE or not all(map(fmu.is_real, fmu.states)):
        return 0.0
    try:
        fmu.start(begin, held)
        rates = np.linalg.eigvals(fmu.state_jacobian())
    except (FMUError, np.linalg.LinAlgError):
        return 0.0
    return float(rates.real.max(initial=0.0))


def _unknowns(
    entries: Sequence[FittedParameter],
    description: Description,
    system: System,
    runs: Sequence[_Run],
    spreads: Mapping[str, float],
) -> list[_Unknown]:
    """All that is fitted, in the order in which it is told: parameters before starts."""
    variables = description.by_name
    unknowns = []
    names = [entry.name for entry in entries]
    started = dict.fromkeys(name for run in runs for name in run.starts)
    shown = [replace(_FREE, name=name) for name in started if name not in names]
    for entry in (*entries, *shown):
        variable = variables[entry.name]
        is_state = entry.name in description.states or entry.name in started
        low = max(entry.range[0], variable.limits[0])
        high = min(entry.range[1], variable.limits[1])
        nominal = system.given.get(entry.name, float(variable.start or 0.0))
        own = is_state if entry.by_recording is None else entry.by_recording
        numbers: Sequence[int | None] = range(len(runs)) if own else [None]
        for number in numbers:
            start, prior = nominal, entry.prior
            size = abs(nominal) or (high - low if np.isfinite(high - low) else 1.0)
            if is_state:
                size = spreads.get(entry.name, size)
                if number is not None and entry.name in runs[number].starts:
                    start, deviation = runs[number].starts[entry.name]
                    size = _MOVES * deviation
                    if not runs[number].counted[0].any():  # else its sample is a residual
                        prior = prior or (start, deviation)
            if np.isnan(size) or not size > 0.0:
                size = abs(variable.nominal or start) or 1.0
            start = min(max(start, low), high)
            unknowns.append(
                _Unknown(
                    name=entry.name,
                    unit=variable.unit or "1",
                    nominal=start,
                    low=low,
                    high=high,
                    size=float(size),
                    prior=prior,
                    recording=number,
                    is_state=is_state,
                )
            )
    return sorted(unknowns, key=lambda unknown: unknown.is_state)


def _simulate(simulation: Simulation, drive: Drive, values: Mapping[str, float]) -> Matrix | str:
    """Outputs, (n, l), or why there are none."""
    try:
        outputs: Matrix = simulation.run(drive, values)
    except FMUError as error:
        return str(error)
    return outputs


def _lost(run: _Run, simulated: Matrix) -> str:
    """Which output is no finite number at a sample that counts; empty: none."""
    lost = run.counted & ~np.isfinite(simulated)
    if not lost.any():
        return ""
    k, j = np.argwhere(lost)[0]
    at = f"{run.case.time[k]:g} s of {run.case.name}"
    return f"'{run.outputs[j]}' is no finite number ({simulated[k, j]:g}) at {at}"


def _warning(simulation: Simulation, drive: Drive, values: Mapping[str, float]) -> str:
    """What the FMU warns of along a recording; empty: nothing."""
    simulation.fmu.take_warning()
    _simulate(simulation, drive, values)
    return simulation.fmu.take_warning()


def _slopes(
    simulation: Simulation,
    drive: Drive,
    values: Mapping[str, float],
    names: Sequence[str],
    sizes: Mapping[str, float],
) -> tuple[Matrix, Vector]:
    """Derivatives of outputs, (n, l, p), and by which share each is unsure, (p,)."""
    by = simulation.derivatives(drive, values, [(name,) for name in names], sizes)
    return by.values, by.unsure


class _Problem:
    """Residuals and their derivatives by scaled unknowns, (p,); it keeps the best values.

    Attributes
    ----------
    best, least : the best unknowns so far and half their sum of squares, by the loss.
    failure : why the last simulation failed; empty: it did not.
    unsure : (p,) share by which derivatives are unsure.
    seconds : that a simulation of all recordings takes.
    """

    def __init__(
        self,
        pool: Pool[Simulation],
        runs: Sequence[_Run],
        unknowns: Sequence[_Unknown],
        loss: Loss,
        progress: Callable[[object], None],
    ) -> None:
        self.pool, self.runs, self.unknowns, self.loss = pool, runs, unknowns, loss
        self._progress = progress
        self.size = np.array([unknown.size for unknown in unknowns])
        self.start = np.array([unknown.nominal for unknown in unknowns]) / self.size
        self.low = np.array([unknown.low for unknown in unknowns]) / self.size
        self.high = np.array([unknown.high for unknown in unknowns]) / self.size
        self._known = [(q, u.prior) for q, u in enumerate(unknowns) if u.prior]
        self.best, self.least, self.residuals_at_best = self.start, np.inf, np.zeros(0)
        self.failure, self.unsure, self.seconds = "", np.zeros(len(unknowns)), 0.0

    def values(self, x: Vector, number: int) -> dict[str, float]:
        """Values that a recording runs with."""
        return {
            **self.runs[number].given,
            **self.runs[number].begin,
            **{
                unknown.name: float(value)
                for unknown, value in zip(self.unknowns, x * self.size, strict=True)
                if unknown.recording in (None, number)
            },
        }

    def outputs(self, x: Vector) -> list[Matrix | str]:
        """Outputs of each recording, (n, l)."""
        tasks = [
            self.pool.submit(_simulate, run.drive, self.values(x, number))
            for number, run in enumerate(self.runs)
        ]
        return [task.result() for task in tasks]

    def warnings(self, x: Vector) -> list[str]:
        """What is said of the FMU, and what it warns of, by recording."""
        tasks = [
            self.pool.submit(_warning, run.drive, self.values(x, number))
            for number, run in enumerate(self.runs)
        ]
        return [
            f"{run.case.name}: {text}"
            for run, task in zip(self.runs, tasks, strict=True)
            for text in (run.doubt, task.result())
            if text
        ]

    def residuals(self, x: Vector) -> Vector:
        """(N,) residuals over noise, those of priors last."""
        parts, self.failure = [], ""
        for run, simulated in zip(self.runs, self.outputs(x), strict=True):
            if isinstance(simulated, str):
                self.failure = simulated
                parts.append(np.full(int(run.counted.sum()), _FAILED))
                continue
            self.failure = self.failure or _lost(run, simulated)
            with np.errstate(over="ignore", invalid="ignore"):
                away = ((simulated - run.y) / run.sigma)[run.counted]
            parts.append(np.where(np.abs(away) < _UNBOUNDED, away, _FAILED))
        values = x * self.size
        priors = [(values[q] - middle) / spread for q, (middle, spread) in self._known]
        residuals = np.concatenate([*parts, priors])
        if (cost := self.cost(residuals)) < self.least:
            self.best, self.least, self.residuals_at_best = x.copy(), cost, residuals
        return residuals

    def time_residuals(self) -> float:
        """Seconds that the residuals at the start take."""
        begin = time.perf_counter()
        self.residuals(self.start)
        return time.perf_counter() - begin

    def cost(self, residuals: Vector) -> float:
        """Half the sum of squares; of soft_l1 the sum of sqrt(1 + r^2) - 1."""
        if self.loss == "linear":
            return float(0.5 * residuals @ residuals)
        return float(np.sum(np.sqrt(1.0 + residuals**2) - 1.0))

    def jacobian(self, x: Vector, held: int | None = None) -> Matrix:
        """(N, p) derivatives of the residuals by the scaled unknowns; 0 of one that is held."""
        sizes = {u.name: u.size for u in self.unknowns if not u.is_state}
        tasks = []
        for number, run in enumerate(self.runs):
            own = [
                q
                for q, unknown in enumerate(self.unknowns)
                if unknown.recording in (None, number) and q != held
            ]
            pieces = max(1, min(len(own), self.pool.workers // len(self.runs)))
            for columns in np.array_split(own, pieces):
                names = [self.unknowns[q].name for q in columns]
                values = self.values(x, number)
                task = self.pool.submit(_slopes, run.drive, values, names, sizes)
                tasks.append((number, columns, task))
        rows = np.concatenate([[0], np.cumsum([int(run.counted.sum()) for run in self.runs])])
        jacobian = np.zeros((rows[-1] + len(self._known), x.size))
        self.unsure = np.zeros(x.size)
        for number, columns, task in tasks:
            run, (by, unsure) = self.runs[number], task.result()
            slopes = (by / run.sigma[:, :, None])[run.counted] * self.size[columns]
            if not np.isfinite(slopes).all():
                raise FMUError(f"{run.case.name}: outputs or their slopes are no finite numbers")
            jacobian[rows[number] : rows[number + 1], columns] = slopes
            self.unsure[columns] = np.maximum(self.unsure[columns], unsure)
        for row, (q, (_, spread)) in enumerate(self._known, rows[-1]):
            jacobian[row, q] = self.size[q] / spread
        self._progress(None)
        return jacobian

    def local(self, x: Vector, held: int | None = None, loss: Loss | None = None) -> OptimizeResult:
        """A local fit (trust region reflective); of a profile, one unknown is held."""
        free = np.array([q for q in range(x.size) if q != held])
        low, high = self.low[free], self.high[free]
        inside = np.clip(x[free], low + 1e-9, high - 1e-9)

        def whole(part: Vector) -> Vector:
            at = x.copy()
            at[free] = part
            return at

        def residuals(part: Vector) -> Vector:
            return self.residuals(whole(part))

        def jacobian(part: Vector) -> Matrix:
            return self.jacobian(whole(part), held)[:, free]

        return least_squares(
            residuals,
            inside,
            jacobian,
            bounds=(low, high),
            loss=loss or self.loss,
            ftol=1e-6,  # of half of as many squares as there are samples: far below a half
            xtol=1e-8,
            gtol=1e-8,
            max_nfev=_STEPS,
        )


class _Search:
    """Local fits from several starts, and differential evolution where they disagree.

    Parameters
    ----------
    jumps : whether outputs may jump along a recording.
    """

    def __init__(
        self,
        problem: _Problem,
        settings: FitSettings,
        report: Callable[[str], None],
        *,
        jumps: bool,
    ) -> None:
        self._problem, self._settings, self._report = problem, settings, report
        self._jumps = jumps
        self.costs: list[float] = []
        self.converged = False
        self.evolved, self.failure = "", ""

    def run(self) -> None:
        """Search; the problem keeps the best."""
        problem, settings = self._problem, self._settings
        rng = np.random.default_rng(settings.seed)
        low, high = self._box()
        steps = StepReporter(self._report, settings.starts)
        for number in range(settings.starts):
            x = problem.start
            if number:
                drawn = rng.uniform(0.0, 1.0, x.size)
                positive = (low > 0.0) & (high > 0.0)
                ratio = np.where(positive, high / np.where(positive, low, 1.0), 1.0)
                x = np.where(positive, low * ratio**drawn, low + drawn * (high - low))
            self._fit(x)
            error = np.sqrt(2.0 * self.costs[-1] / max(problem.residuals_at_best.size, 1))
            steps.step(f"start {number + 1}: residuals {error:.4g} times the noise")
        # What is unstable stays so elsewhere, and each of many simulations fails slowly.
        hopeless = not np.isfinite(self.costs).any() and any(run.lost for run in problem.runs)
        if settings.generations and not (hopeless or self.agree() or self.leaves_noise()):
            self._evolve(low, high)

    def _fit(self, x: Vector) -> None:
        least = self._problem.least
        try:
            result = self._local(x)
        except FMUError as error:  # a model that bears no step from here
            self._report(str(error))
            self.failure = self.failure or str(error)
            self.costs.append(np.inf)
            return
        self.costs.append(float(result.cost))
        if result.cost <= least:
            self.converged = result.status > 0

    def _local(self, x: Vector) -> OptimizeResult:
        """A local fit; where much is left of what jumps, again by way of one that bears outliers.

        An output that jumps one sample off is wrong by hundreds of deviations, and no derivative
        says so: squares keep each jump between its samples, though all else asks for another time.
        By the robust loss a sample counts once for each deviation, and jumps go where the rest is.
        """
        problem = self._problem
        result = problem.local(x)
        size = problem.residuals_at_best.size
        left = 2.0 * result.cost - size > _MUCH * np.sqrt(2.0 * size)  # chi-squared's deviation
        if not (self._jumps and left and problem.loss == "linear"):
            return result
        again = problem.local(problem.local(x, loss="soft_l1").x)
        return again if again.cost < result.cost else result

    def agree(self) -> bool:
        """Whether all starts reached sums of squares that chance does not part."""
        return max(self.costs) < min(self.costs) + 0.5 * _CHANCE

    def leaves_noise(self) -> bool:
        """Whether the best values leave nothing but noise, so that no others leave much less."""
        problem = self._problem
        size = problem.residuals_at_best.size
        if not 2.0 * problem.least - size <= _MUCH * np.sqrt(2.0 * size):
            return False
        simulated = problem.outputs(problem.best)
        fits = map(recording_fit, problem.runs, simulated, simulated)
        return not any(text for fit in fits for text in residual_doubts(fit))

    def _box(self) -> tuple[Vector, Vector]:
        """Where starts are drawn: the range, or around the model's own value."""
        problem = self._problem
        middle = np.array([u.prior[0] if u.prior else u.nominal for u in problem.unknowns])
        middle = middle / problem.size
        away = np.array([3.0 * (u.prior[1] / u.size if u.prior else 1.0) for u in problem.unknowns])
        ranged = np.array([not u.is_state and not u.prior for u in problem.unknowns])
        below = np.where(ranged & (middle > 0.0), middle / _REACH, middle - away)
        above = np.where(ranged & (middle > 0.0), middle * _REACH, middle + away)
        low = np.where(ranged & np.isfinite(problem.low), problem.low, below)
        high = np.where(ranged & np.isfinite(problem.high), problem.high, above)
        return np.maximum(low, problem.low), np.minimum(high, problem.high)

    def _evolve(self, low: Vector, high: Vector) -> None:
        """Differential evolution over the box, then a local fit from its best."""
        problem, before = self._problem, self._problem.least
        self._report("starts disagree: differential evolution over the ranges")
        steps = StepReporter(self._report, self._settings.generations)

        def generation(*_: object, **__: object) -> None:
            error = np.sqrt(2.0 * problem.least / max(problem.residuals_at_best.size, 1))
            steps.step(f"generation: residuals {error:.4g} times the noise")

        def cost(x: Vector) -> float:
            return problem.cost(problem.residuals(x))

        differential_evolution(
            cost,
            Bounds(low, high),
            maxiter=self._settings.generations - 1,
            popsize=6,
            rng=np.random.default_rng(self._settings.seed),
            x0=np.clip(problem.best, low, high),
            polish=False,
            callback=generation,
        )
        self._fit(problem.best)
        better = 2.0 * (before - problem.least) > _CHANCE
        self.evolved = "found a better fit" if better else "found no better fit"


class _Judgement:
    """What a fit says: intervals, correlations, what cannot be identified, residuals."""

    def __init__(
        self,
        problem: _Problem,
        search: _Search,
        settings: FitSettings,
        report: Callable[[str], None],
    ) -> None:
        self._problem, self._search, self._settings = problem, search, settings
        self._report = report

    def outcome(self, interrupted: bool) -> FitOutcome:
        """The outcome; without intervals where the search was interrupted."""
        problem, search = self._problem, self._search
        outputs = problem.outputs(problem.start), problem.outputs(problem.best)
        recordings = list(map(recording_fit, problem.runs, *outputs))
        doubts = problem.warnings(problem.best)
        if not (search.converged or interrupted):
            doubts.append("the fit has not converged")
        if interrupted:
            doubts.append("interrupted: these are the best values so far, without intervals")
        elif not (search.agree() or search.leaves_noise()):
            reached = sum(2.0 * (cost - problem.least) < _CHANCE for cost in search.costs)
            if reached < 2:
                doubts.append(
                    f"only one of {len(search.costs)} fits reached these values: there may be "
                    "better ones"
                )
        contradictions = [text for fit in recordings for text in residual_doubts(fit)]
        lost = [run.lost for run in problem.runs if run.lost]
        doubts += [f"{lost[0]}. To do: {_LED}"] if lost and contradictions else []
        doubts += filter(None, [self._other_starts()] if contradictions and not interrupted else [])
        values, correlation = self._values(), np.eye(problem.best.size)
        directions: list[Direction] = []
        if not interrupted:
            r = problem.residuals_at_best  # their variance over that of the noise
            excess = float(r @ r / max(r.size - problem.best.size, 1))
            widened = np.sqrt(max(1.0, excess if contradictions else 1.0))
            values, directions, correlation = self._intervals(widened)
            doubts += [f"not identified: {direction}" for direction in directions]
            doubts += [
                f"derivatives by {u.name} are unsure by {share:.0%}: its interval is, too"
                for u, share in zip(problem.unknowns, problem.unsure, strict=True)
                if share
            ]
        doubts += [
            f"{value.label} is at its bound of {value.value:.4g} {value.unit}"
            for value in values
            if value.at_bound
        ]
        return FitOutcome(
            values=tuple(values),
            correlation=correlation,
            directions=tuple(directions),
            recordings=tuple(recordings),
            doubts=(*doubts, *contradictions),
            costs=tuple(search.costs),
            evolved=search.evolved,
            loss=self._settings.loss,
            interrupted=interrupted,
        )

    def _other_starts(self) -> str:
        """Say which state that no output shows may begin elsewhere, by recording; or nothing.

        Where a Gauss-Newton step of its starts and of all unknowns removes most of what remains.
        """
        problem, best = self._problem, self._problem.best
        names = [n for n in problem.runs[0].hidden if n not in {u.name for u in problem.unknowns}]
        try:
            own = problem.jacobian(best)
            tasks = [
                problem.pool.submit(_slopes, run.drive, problem.values(best, number), names, {})
                for number, run in enumerate(problem.runs)
            ]
            slopes = [
                (task.result()[0] / run.sigma[:, :, None])[run.counted]
                for run, task in zip(problem.runs, tasks, strict=True)
            ]
        except (FMUError, InputError):
            return ""
        r, shares = problem.residuals_at_best, dict[str, float]()
        above = float(r @ r) - r.size
        for k, name in enumerate(names):
            starts = np.zeros((r.size, len(slopes)))
            first = 0
            for number, columns in enumerate(slopes):
                starts[first : first + len(columns), number] = columns[:, k]
                first += len(columns)
            jacobian = np.hstack([own, starts])
            norms = np.linalg.norm(jacobian, axis=0)
            if not np.isfinite(norms).all() or not above > 0.0:
                continue
            scaled = jacobian / np.where(norms > 0.0, norms, 1.0)
            left = r - scaled @ np.linalg.lstsq(scaled, r, rcond=_ROUNDING)[0]
            shares[name] = min((float(r @ r) - float(left @ left)) / above, 1.0)
        name = max(shares, key=lambda name: shares[name], default="")
        if not name or not shares[name] > MOSTLY:
            return ""
        return (
            f"another start of {name} in each recording would explain {shares[name]:.0%} of what "
            f"remains. If that start may differ from the model, write a table "
            f"[fit.{name}] in the system file, and fit again"
        )

    def _values(self) -> list[FittedValue]:
        problem = self._problem
        x = problem.best
        near = 1e-6 * np.maximum(np.abs(x), 1.0)
        bound = (x - problem.low < near) | (problem.high - x < near)
        return [
            FittedValue(
                name=unknown.name,
                recording=""
                if unknown.recording is None
                else problem.runs[unknown.recording].case.name,
                unit=unknown.unit,
                is_state=unknown.is_state,
                nominal=unknown.nominal,
                value=float(x[q] * unknown.size),
                at_bound=bool(bound[q]),
            )
            for q, unknown in enumerate(problem.unknowns)
        ]

    def _intervals(self, widened: float) -> tuple[list[FittedValue], list[Direction], Matrix]:
        """Values with intervals, directions that cannot be identified, and correlations, (p, p).

        With residuals r, their derivatives J and the loss' psi(r), H = J' diag(psi') J, the
        covariance is H^-1 for squares, and H^-1 J' diag(psi^2) J H^-1 for another loss (sandwich;
        P. J. Huber, 1967). A direction v of H with eigenvalue s^2 is known to 1/s of the sizes.
        """
        problem = self._problem
        jacobian, r = problem.jacobian(problem.best), problem.residuals_at_best
        bend = np.ones(r.size) if problem.loss == "linear" else (1.0 + r**2) ** -1.5
        weighted = np.sqrt(bend)[:, None] * jacobian
        # What no residual shows is a direction by itself, and not one with others of its kind.
        moves = weighted.any(axis=0)
        problem.best = np.where(moves, problem.best, problem.start)
        count, own = np.count_nonzero(moves), weighted[:, moves]
        # Columns that are alike but for rounding are made the same.
        norms = np.maximum(np.linalg.norm(own, axis=0), np.finfo(float).tiny)
        left, alike, right = np.linalg.svd(own / norms, full_matrices=False)
        parted = np.where(alike < _ROUNDING * alike.max(initial=0.0), 0.0, alike)
        singular, axes = np.zeros(moves.size), np.zeros((moves.size, moves.size))
        _, singular[:count], axes[:count, moves] = np.linalg.svd(
            left * parted @ right * norms, full_matrices=False
        )
        axes[np.arange(count, moves.size), np.flatnonzero(~moves)] = 1.0
        # A direction that is not shown at all is no uncertainty of what is hardly a part of it, by
        # the noise of derivatives.
        shown, size = np.count_nonzero(parted), np.abs(axes)
        axes[shown:] *= (size >= _SHARE * size.max(axis=1, keepdims=True))[shown:]
        floor = max(singular[0] * np.finfo(float).eps, np.finfo(float).tiny)
        inverse = axes.T / np.maximum(singular, floor) ** 2 @ axes
        covariance = inverse
        if problem.loss != "linear":
            psi = (r / np.sqrt(1.0 + r**2))[:, None] * jacobian
            covariance = inverse @ (psi.T @ psi) @ inverse
        deviation = widened * np.sqrt(np.diag(covariance))
        blind = singular < BAND * widened  # 95 % reach from zero to twice the size
        labels = [value.label for value in self._values()]
        # Relative to values, exponents of a product are what they are in the equations.
        at = np.abs(problem.best)
        at = np.where((at > 0.0) & [not u.is_state for u in problem.unknowns], at, 1.0)
        directions, lost = [], set[int]()
        for axis, s in zip(axes[blind], singular[blind], strict=True):
            parts = np.flatnonzero(np.abs(axis) >= _SHARE * np.abs(axis).max())
            lost |= set(parts.tolist())
            relative = axis / at
            lead = relative[parts[np.argmax(np.abs(relative[parts]))]]
            named = {labels[q]: float(relative[q] / lead) for q in parts}
            directions.append(Direction(named, float(1.0 / max(s, floor)), bool(s >= BAND)))
        profiles, cost = self._settings.profiles, self._cost_of_profiles(len(lost))
        profiles = cost <= _CHEAP if profiles is None else profiles
        values = []
        begun = StepReporter(self._report, len(labels))
        for q, value in enumerate(self._values()):
            sd = float(deviation[q] * problem.size[q])
            if q in lost:
                values.append(replace(value, identified=False))
                continue
            low, high, method = value.value - BAND * sd, value.value + BAND * sd, "covariance"
            if profiles and not value.at_bound and problem.unknowns[q].recording is None:
                along = covariance[:, q] / np.sqrt(covariance[q, q])
                ends = [self._profile(q, side * along, widened) for side in (-1.0, 1.0)]
                if None not in ends:
                    low, high = (float(end * problem.size[q]) for end in ends if end is not None)
                    method = "profile"
                begun.step(f"interval of {value.label}")
            values.append(replace(value, low=low, high=high, deviation=sd, method=method))
        norm = np.sqrt(np.diag(covariance))
        return values, directions, covariance / np.outer(norm, norm)

    def _cost_of_profiles(self, lost: int) -> float:
        """Seconds: four points on both sides, three steps each with all derivatives."""
        problem = self._problem
        shared = sum(u.recording is None for u in problem.unknowns) - lost
        own = len({u.name for u in problem.unknowns})
        return problem.seconds * max(shared, 0) * 2 * 4 * 3 * (2 + 2 * own)

    def _profile(self, q: int, along: Vector, widened: float) -> float | None:
        """Where the least sum of squares with one unknown held is `_CHANCE` above the least.

        Others begin where the covariance says. The root of what the sum rises by is nearly linear
        in the unknown: secants find it.

        Parameters
        ----------
        along : (p,) change of all unknowns with a standard deviation of this one.
        """
        problem = self._problem
        best, least, aim = problem.best.copy(), problem.least, BAND * widened
        near, rise_near, reach = 0.0, 0.0, aim  # in standard deviations
        for _ in range(6):
            x = best + reach * along
            if not problem.low[q] <= x[q] <= problem.high[q]:
                return None
            cost = problem.local(x, q).cost if x.size > 1 else problem.cost(problem.residuals(x))
            rise = float(np.sqrt(max(2.0 * (cost - least), 0.0)))
            if abs(rise - aim) < 0.01 * aim:  # of an interval's half, as the derivatives are right
                return float(x[q])
            if rise <= rise_near:
                return None
            slope = (rise - rise_near) / (reach - near)
            near, rise_near, reach = reach, rise, reach + (aim - rise) / slope
        return None


def recording_fit(
    run: _Run, nominal: Matrix | str, fitted: Matrix | str, *, held_out: bool = False
) -> RecordingFit:
    """A recording beside both simulations; NaN where one failed."""
    nothing = np.full(run.y.shape, np.nan)
    return RecordingFit(
        case=run.case,
        counted=run.counted,
        sigma=run.sigma,
        nominal=nothing if isinstance(nominal, str) else nominal,
        fitted=nothing if isinstance(fitted, str) else fitted,
        held_out=held_out,
    )


def _with_held_out(outcome: FitOutcome, problem: _Problem, runs: Sequence[_Run]) -> FitOutcome:
    """Errors on recordings that were not fitted: starts by their first samples, else the mean."""
    means: dict[str, list[float]] = {}
    for value in outcome.values:
        means.setdefault(value.name, []).append(value.value)
    fitted = {name: float(np.mean(values)) for name, values in means.items()}
    nominal = {u.name: u.nominal for u in problem.unknowns}
    tasks = [
        [
            problem.pool.submit(_simulate, run.drive, {**run.given, **values, **run.begin})
            for values in (nominal, fitted)
        ]
        for run in runs
    ]
    held = [
        recording_fit(run, *(task.result() for task in both), held_out=True)
        for run, both in zip(runs, tasks, strict=True)
    ]
    worse = [
        f"{fit.case.name}, which was not fitted: the fitted model errs more than the nominal one, "
        f"{fit.error(fit.fitted):.3g} for {fit.error(fit.nominal):.3g} times the noise"
        for fit in held
        if not fit.error(fit.fitted) <= max(fit.error(fit.nominal), 1.0)
    ]
    return replace(
        outcome, recordings=(*outcome.recordings, *held), doubts=(*outcome.doubts, *worse)
    )
