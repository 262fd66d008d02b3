"""What each recording says about every parameter: whitened prediction errors, their derivatives.

The derivatives are made beside the simulation. Everything that follows, fits, tests on held-out
recordings and confusability, is linear algebra on them.
"""

import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor, wait
from contextlib import ExitStack, nullcontext
from dataclasses import replace
from typing import Any, Self, TypeVar

from workbench.arrays import Matrix
from workbench.diagnosis.data.clocks import DELAY, INPUT_DELAY, greatest_skew, late_signals
from workbench.diagnosis.data.motion import ModelSource, OpenModel, opened
from workbench.diagnosis.data.samples import Samples, compared, prepare
from workbench.diagnosis.data.sensors import sensor_errors
from workbench.diagnosis.inference.thresholds import SOUND, Soundness
from workbench.diagnosis.simulation.prediction import Variation
from workbench.diagnosis.simulation.simulator import (
    Simulator,
    SimulatorSetup,
    WhitenedResiduals,
    settled_parts,
    simulating,
)
from workbench.errors import InputError
from workbench.models.fmu import FMU, CoSimulation
from workbench.models.instance import EventError
from workbench.recordings.case import Case
from workbench.runtime.engine import ALONE, Engine, ProgressReporter
from workbench.runtime.pool import Pool

Item = TypeVar("Item")
Result = TypeVar("Result")


class ResidualModel:
    """A model along all recordings, in worker processes if there are more than one.

    Parameters
    ----------
    source : FMU with all effects that may be asked for, with the values of the diagnosed model.
    engine : is told now and then how many simulations were made.
    sound : which samples count.
    restarting : whether samples count where states can be restarted.
    model : the same, where it is open already; it must outlive the simulations.

    Attributes
    ----------
    source, system, given : the model, whose it is, and its values.
    nominal, units, bounds : value, unit, (least, greatest) value by variable of the FMU.
    begin : start values of states by recording, as measured.
    free : whether the model is simulated as a whole, and nothing corrects it: it passes events, has
        Co-Simulation alone, or other types than Real.
    unsure : shares by which derivatives may be wrong, by variable; only of free simulations.
    simulated : what its simulators are made from.
    cases, recordings : as recorded, and made ready.
    """

    def __init__(
        self,
        source: ModelSource,
        cases: Sequence[Case],
        engine: Engine = ALONE,
        sound: Soundness = SOUND,
        *,
        restarting: bool = True,
        model: OpenModel | None = None,
    ) -> None:
        self._pace = ProgressReporter(engine.report, "simulations")
        self.source, self.system = source, source.system
        self.given, self.cases = dict(source.given), list(cases)
        self._sound, self._workers = sound, min(engine.workers, len(cases))
        self._alone = self._workers == 1
        self._at = list(range(len(cases)))  # of each recording, which of the forms is in use
        # Of each, where what is restarted does not count, or why there is none.
        self._without: list[int | InputError] = []
        self._interrupted = threading.Event()
        self.unsure: dict[str, float] = {}
        with ExitStack() as stack:
            self._model = model or stack.enter_context(opened(source))
            self._tell(self._model.fmu)
            self.free = self._model.motion is None
            self.simulated = self._prepared(restarting=restarting and not self.free)
            if not self.free:
                try:
                    usual: list[dict[str, float]] = [{} for _ in self.recordings]
                    parts = settled_parts(self._simulator(self.simulated), usual)
                    self.simulated = self.simulated._replace(parts=parts)
                except EventError:
                    self._model, self.free = replace(self._model, motion=None), True
                    self.simulated = self._prepared(restarting=False)
            self._forms = self._weighed([*self.recordings, *self._lesser()])
            every = self.simulated._replace(recordings=tuple(form for form, _ in self._forms))
            self._pool = stack.enter_context(self._workers_with(every))
            self._open = stack.pop_all()
        self._choose()
        # Long ones first: the last one to finish leaves the other processors idle.
        self._order = sorted(range(len(cases)), key=lambda k: -self.recordings[k].time.size)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()

    def take_warning(self) -> str:
        """What the FMU of this process warned of, see `FMU.take_warning`."""
        return self._model.fmu.take_warning()

    @property
    def averaged(self) -> tuple[str, ...]:
        """Inputs on straight lines, of which a Co-Simulation takes the mean of each step."""
        fmu = self._model.fmu
        if not isinstance(fmu, CoSimulation) or fmu.takes_slopes:
            return ()
        return tuple(s.name for s in self.system.inputs if s.hold == 0.0 and fmu.is_real(s.name))

    def held(self, ways: Mapping[str, bool | str]) -> "ResidualModel":
        """The same model with inputs held in other ways between samples, by name; to be closed."""
        inputs = (
            replace(signal, held=ways.get(signal.name, signal.held))
            for signal in self.system.inputs
        )
        system = replace(self.system, inputs=tuple(inputs))
        return ResidualModel(self.source._replace(system=system), self.cases)

    def _tell(self, fmu: FMU) -> None:
        self.nominal = dict(fmu.defaults)
        if unsaid := [state for state in fmu.states if state not in fmu.defaults]:
            fmu.start({})  # as of what it calculates, and of elements of arrays
            self.nominal |= zip(unsaid, fmu.get_typed(fmu.typed(unsaid)), strict=True)
        self.states, self.units = tuple(fmu.states), dict(fmu.units)
        self.bounds = {v.name: v.limits for v in fmu.description.variables}
        for parameter in self.system.fitted:
            low, high = self.bounds[parameter.name]
            self.bounds[parameter.name] = (
                max(low, parameter.range[0]),
                min(high, parameter.range[1]),
            )
        most = greatest_skew(self.system)
        for name in late_signals(self.system):
            # Nothing acts before its cause, but an input that is held otherwise by a sample, which
            # is well inside of the bounds.
            early = 2.0 * self.system.sample_time if name.startswith(INPUT_DELAY) else 0.0
            self.units[name] = "s"
            self.bounds[name] = (-early if name.endswith(DELAY) else -most, most)
        for name, error in sensor_errors(self.system).items():
            self.units[name], self.bounds[name] = error.unit, error.bounds

    def _prepared(self, *, restarting: bool) -> SimulatorSetup:
        self.recordings = [self._ready(case, restarting=restarting) for case in self.cases]
        recordings = tuple(self.recordings)
        return SimulatorSetup(self.source.path, self.system, recordings, free=self.free)

    def _simulator(self, given: SimulatorSetup) -> Simulator:
        """One in this process, with the FMU that is open."""
        return Simulator(given, self._model.fmu)

    def _workers_with(self, given: SimulatorSetup) -> Pool[Simulator]:
        if self._alone:
            return Pool(1, lambda given: nullcontext(self._simulator(given)), given)
        return Pool(self._workers, simulating, given)

    def _ready(self, case: Case, *, restarting: bool) -> Samples:
        signals = compared(self.system, self.cases)
        return prepare(case, self.system, signals, self._model, self._sound, restarting=restarting)

    def _lesser(self) -> list[Samples]:
        """Recordings as they are where what is restarted does not count."""
        lesser: list[Samples] = []
        for k, (case, recording) in enumerate(zip(self.cases, self.recordings, strict=True)):
            form: int | InputError = k
            if recording.restarted.any():
                try:
                    lesser.append(self._ready(case, restarting=False))
                    form = len(self.cases) + len(lesser) - 1
                except InputError as error:
                    form = error
            self._without.append(form)
        return lesser

    def _weighed(self, forms: Sequence[Samples]) -> list[tuple[Samples, dict[str, float]]]:
        """Forms of recordings, with what is uncertain in them weighed, and states as they begin."""
        lesser = [k for k, at in enumerate(self._without) if isinstance(at, int) and at != k]
        own = self._simulator(self.simulated._replace(recordings=tuple(forms)))
        weighed = []
        for at, k in enumerate([*self._at, *lesser]):
            parameters = self.system.set_by(self.cases[k].conditions)
            weighed.append((own.weighed(at, {**self.given, **parameters}), own.begin(at)))
        return weighed

    def _choose(self) -> None:
        """Take the forms of recordings that are asked for."""
        self.recordings[:] = [self._forms[at][0] for at in self._at]
        self.begin = [self._forms[at][1] for at in self._at]
        self.simulated = self.simulated._replace(recordings=tuple(self.recordings))

    def started(self, points: Sequence[Mapping[str, float]]) -> list[dict[str, float]]:
        """All that a simulation of each recording starts with at a point, states as they were."""
        own = self._simulator(self.simulated)
        return [own.started(k, values) for k, values in enumerate(points)]

    def count_restarted(self, numbers: Collection[int], *, counting: bool) -> None:
        """Let samples of some recordings count, or not, where states can be restarted."""
        at = list(self._at)
        for k in numbers:
            form = k if counting else self._without[k]
            if isinstance(form, InputError):
                raise form
            at[k] = form
        self._at = at
        self._choose()

    def settle(self, points: Sequence[Mapping[str, float]]) -> bool:
        """Take finer steps if those so far are too long at a point; whether they were.

        Friction that was found is stiff near standstill, where the nominal model has none.
        """
        parts = settled_parts(self._simulator(self.simulated), points, self.simulated.parts)
        return self.take_steps(parts)

    def take_steps(self, parts: int) -> bool:
        """Take so many steps of a sample time; whether they are others than so far."""
        if parts == self.simulated.parts:
            return False
        self.simulated = self.simulated._replace(parts=parts)
        every = self.simulated._replace(recordings=tuple(form for form, _ in self._forms))
        self._pool = self._open.enter_context(self._workers_with(every))
        return True

    def in_steps(
        self, points: Sequence[Mapping[str, float]], parts: int
    ) -> list[WhitenedResiduals]:
        """As `at`, in so many steps of a sample time."""
        own = self._simulator(self.simulated._replace(parts=parts))
        return [own.at(k, values) for k, values in enumerate(points)]

    def at(self, points: Sequence[Mapping[str, float]]) -> list[WhitenedResiduals]:
        """Errors of every recording at its own point.

        Parameters
        ----------
        points : values of the FMU's variables and of delays, one mapping for each recording.
        """
        results = self._gathered({k: (Simulator.at, self._at[k], points[k]) for k in self._order})
        return [results[k] for k in range(len(self.recordings))]

    def derivatives(
        self,
        points: Sequence[Mapping[str, float]],
        columns: Sequence[Variation],
        sizes: Mapping[str, Sequence[str]] | None = None,
    ) -> list[Matrix]:
        """Derivatives of every recording's [errors, rest] by the columns, each (b*c + q, p).

        Parameters
        ----------
        sizes : see `Simulator.derivatives`.
        """
        results = self._gathered(
            {
                k: (Simulator.derivatives, self._at[k], points[k], columns, None, sizes)
                for k in self._order
            }
        )
        for _, unsure in results.values():
            self.unsure |= {n: max(share, self.unsure.get(n, 0.0)) for n, share in unsure.items()}
        return [results[k][0] for k in range(len(self.recordings))]

    def responses(
        self,
        points: Sequence[Mapping[str, float]],
        columns: Sequence[Variation],
        courses: Sequence[Matrix],
    ) -> list[Matrix]:
        """As `derivatives`, of columns that act by factors `courses` of each recording, (n, p)."""
        results = self._gathered(
            {
                k: (Simulator.derivatives, self._at[k], points[k], columns, courses[k])
                for k in self._order
            }
        )
        return [results[k][0] for k in range(len(self.recordings))]

    def along(self, points: Sequence[Mapping[str, float]], watched: Sequence[str]) -> list[Matrix]:
        """Variables of the FMU at the samples of every recording, each (n, w); see `at`."""
        results = self._gathered(
            {k: (Simulator.along, self._at[k], points[k], watched) for k in self._order}
        )
        return [results[k] for k in range(len(self.recordings))]

    def free_runs(self, points: Sequence[Mapping[str, float]]) -> list[Matrix]:
        """Errors of samples of every recording that nothing corrects, each (2, c); see `at`."""
        results = self._gathered(
            {k: (Simulator.free_run, self._at[k], points[k]) for k in self._order}
        )
        return [results[k] for k in range(len(self.recordings))]

    def predicted(self, points: Sequence[Mapping[str, float]]) -> list[Matrix]:
        """Signals of every recording as the model has them, each (n, c); see `at`."""
        results = self._gathered(
            {k: (Simulator.predicted, self._at[k], points[k]) for k in self._order}
        )
        return [results[k] for k in range(len(self.recordings))]

    def together(self, job: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
        """Results of a job that asks for evidence, by item; no processor waits for one of them."""
        if self._alone or len(items) < 2:
            return [job(item) for item in items]
        with ThreadPoolExecutor(len(items)) as threads:
            jobs = [threads.submit(job, item) for item in items]
            try:
                return [job.result() for job in jobs]
            except BaseException:
                # Others end with what they wait for.
                self._interrupted.set()
                wait(jobs)
                self._interrupted.clear()
                raise

    def _gathered(self, tasks: Mapping[Any, tuple[Any, ...]]) -> dict[Any, Any]:
        if self._interrupted.is_set():
            raise CancelledError
        counted = self._pace.part(len(tasks))
        under_way = {}
        try:
            for name, task in tasks.items():
                under_way[name] = self._pool.submit(*task)
                under_way[name].add_done_callback(counted)
            return {name: task.result() for name, task in under_way.items()}
        finally:
            # After Ctrl-C nobody waits for the others.
            for future in under_way.values():
                future.cancel()
