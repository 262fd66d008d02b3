"""The checks: each tries one thing that an observer needs."""

import functools
import gc
import os
import timeit
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError
from workbench.models.checks.excitation import (
    COMMUNICATION_STEPS,
    Excitation,
    continuous_variables,
    excite,
    real_variables,
    run,
    same_bits,
    start_co_simulation,
    walk,
)
from workbench.models.checks.isolation import isolated
from workbench.models.checks.result import (
    DERIVATIVES,
    EVENTS,
    INJECTION,
    INSTANCES,
    INTERFACES,
    LOADS,
    MEMORY,
    RESET,
    ROLLBACK,
    ROLLBACK_CS,
    SAMPLE,
    SERIALISATION,
    START,
    TIME_DERIVATIVES,
    TIME_GET,
    TIME_SET,
    TIME_STEP,
    CheckResult,
)
from workbench.models.description import (
    CO_SIMULATION,
    MODEL_EXCHANGE,
    Description,
    read_description,
)
from workbench.models.fmu import FMU, CoSimulation, central_differences
from workbench.models.trial import (
    ContainedError,
    NoAnswerError,
    run_trial,
    unpacked,
)
from workbench.runtime.supervision import Limits, usual_limits

# --- what many instances and calls cost ---


# A tenth of these leaks 0.05 MB at the limit, some pages of memory.
_MEMORY_SHOWS = 500


def endure(path: Path, instantiations: int) -> Iterator[int | CheckResult]:
    """Make instances one after the other, of one loaded library and each of its own."""
    growth = []
    batch = max(instantiations // 10, 1)
    with FMU(path) as fmu:
        for question, reload in ((INSTANCES, False), (LOADS, True)):
            memory = []
            for n in range(1, instantiations + 1):
                fmu.renew(reload=reload)
                fmu.start({})
                fmu.derivatives()
                yield n
                if n % batch == 0:
                    memory.append(_resident_memory())
            # A leak grows in every batch, while allocators take a megabyte once in a while.
            growth += (
                [float(np.median(np.diff(memory[-7:]))) * 1000 / batch] if len(memory) > 1 else []
            )
            yield replace(question, passed=True, value=instantiations, limit=instantiations)
    if instantiations < _MEMORY_SHOWS:
        yield replace(MEMORY, reason=f"not tried: shows from {_MEMORY_SHOWS} instantiations on")
        return
    if np.isnan(growth).any():
        yield replace(MEMORY, reason="not tried: this system does not tell a process's memory")
        return
    passed = max(growth) <= (MEMORY.limit or 0.0)
    reason = "freed instances leave memory behind; reset one instance instead of making new ones"
    yield replace(MEMORY, passed=passed, value=max(growth), reason="" if passed else reason)


def _resident_memory() -> float:
    """Resident memory of this process [MB]; NaN where the system has no /proc."""
    gc.collect()
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except FileNotFoundError:
        return float("nan")
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def time_calls(path: Path, instantiations: int) -> Iterator[CheckResult]:
    """Time what an observer calls at every sample."""
    with FMU(path) as fmu:
        excitation = excite(fmu)
        outputs = real_variables(fmu, fmu.outputs)
        # New values at each call, because FMUs keep the results of the last ones.
        points = (excitation.states, excitation.states + 1e-6 * excitation.nominal)
        levels = (excitation.first, excitation.second)

        def at_points(read: Callable[[], object]) -> None:
            for point in points:
                fmu.set_states(point)
                read()

        def at_levels() -> None:
            for level in levels:
                fmu.set(excitation.inputs, level)

        tasks: tuple[tuple[CheckResult, Callable[[], None]], ...] = (
            (TIME_GET, lambda: at_points(lambda: fmu.get(outputs))),
            (TIME_SET, at_levels),
            (TIME_DERIVATIVES, lambda: at_points(fmu.derivatives)),
            (TIME_STEP, lambda: at_points(lambda: fmu.step(1e-9))),
        )
        for question, task in tasks:
            timer = timeit.Timer(task)
            number = 1 + int(0.02 / max(timer.timeit(3) / 3, 1e-6))  # 20 ms
            # The least of several: other load on the machine only adds.
            time = min(timer.repeat(5, number)) / number / len(points) * 1e6
            passed = time <= SAMPLE
            reason = "" if passed else "slower than samples come in at 200 Hz; simplify the model"
            yield replace(question, passed=passed, value=time, reason=reason)


# --- checks ---


def check(
    path: Path,
    instantiations: int = 2000,
    limits: Limits | None = None,
    begin: Callable[[str], None] = lambda name: None,
    report: Callable[[CheckResult], None] = lambda finding: None,
) -> list[CheckResult]:
    """Check whether an FMU is fit for observers.

    Parameters
    ----------
    path : FMU with Model Exchange.
    instantiations : number of instances to make, one after the other.
    limits : of what the FMU may use; the usual ones unless others are given.
    begin : takes the name of what is tried next.
    report : takes each finding as it comes.

    Raises
    ------
    InputError
        If the file is no FMU, or has no Model Exchange for this machine.
    """
    description = read_description(path)
    description.require(MODEL_EXCHANGE)
    limits = limits or usual_limits()
    findings: dict[str, CheckResult] = {}
    for attempted, questions, needs in _CHECKS:
        failed = next((n.name for n in needs if not findings[n.name].passed), None)
        obstacle = f"needs '{failed}'" if failed else _obstacle(questions[0], description)
        begin(questions[0].name)
        if obstacle:
            results = [replace(q, reason=f"not tried: {obstacle}") for q in questions]
        elif questions[0] is START and (refused := _unproved(description, limits)):
            results = [
                refused,
                *(replace(q, reason=f"not tried: needs '{START.name}'") for q in questions[1:]),
            ]
        else:
            task = functools.partial(attempted, path, instantiations)
            results = isolated(task, questions, limits)
        for finding in results:
            findings[finding.name] = finding
            report(finding)
    return list(findings.values())


def _unproved(description: Description, limits: Limits) -> CheckResult | None:
    """What keeps an FMU from being started at all: it ends its process, or does not return."""
    with unpacked(description, MODEL_EXCHANGE) as folder:
        try:
            run_trial(description, MODEL_EXCHANGE, folder, limits)
        except NoAnswerError as error:
            return replace(START, unknown=True, reason=f"not measured: {error}")
        except ContainedError as error:
            return replace(START, passed=False, value=0, reason=str(error))
    return None


def _obstacle(question: CheckResult, description: Description) -> str:
    """Say why a check cannot be made; empty if it can."""
    exchange = description.interfaces[MODEL_EXCHANGE]
    simulation = description.interfaces.get(CO_SIMULATION)
    several = (SERIALISATION, ROLLBACK_CS, INTERFACES, INSTANCES)
    if question in several and exchange.one_instance_per_process:
        return "the FMU allows one instance per process; give each worker process one"
    if question in (ROLLBACK_CS, INTERFACES) and simulation is None:
        return "the FMU has no Co-Simulation"
    if question is INTERFACES and not description.states:
        return "the FMU has no continuous states, so nothing is integrated"
    if question is INTERFACES and description.event_indicators:
        return "the FMU has events, which only its Co-Simulation treats"
    offered = simulation if question is ROLLBACK_CS and simulation else exchange
    if question in (ROLLBACK, SERIALISATION, ROLLBACK_CS) and not offered.saves_state:
        return "the FMU does not save its state (canGetAndSetFMUState)"
    if question is SERIALISATION and not offered.serialises_state:
        return "the FMU does not serialise its state (canSerializeFMUState)"
    if question is DERIVATIVES and not offered.directional_derivatives:
        return "the FMU offers none; Jacobians are differences, which take more calls"
    return ""


def _start(path: Path, instantiations: int) -> Iterator[CheckResult]:
    with FMU(path) as fmu:
        fmu.start({})
        scalar = set(fmu.states) <= set(real_variables(fmu).names)
        rates = fmu.derivatives() if scalar else np.zeros(0)
    if not scalar:
        reason = "states are arrays; export the model with scalar variables"
    elif not np.isfinite(rates).all():
        name = fmu.states[int(np.argmin(np.isfinite(rates)))]
        reason = f"the derivative of '{name}' is not finite with the FMU's start values"
    else:
        reason = ""
    yield replace(START, passed=not reason, value=1, reason=reason)
    count, timed = fmu.description.event_indicators, float(fmu.next_event[0])
    smooth = not count and timed == np.inf
    reason = "" if timed == np.inf else f"a time event at {timed:g} s; "
    reason += "only open loop, fit, diagnose go through events; replace jumps by smooth functions"
    yield replace(EVENTS, passed=smooth, value=count, reason="" if smooth else reason)


def _reset(path: Path, instantiations: int) -> Iterator[CheckResult]:
    with FMU(path) as fmu:
        everything = real_variables(fmu)

        def replay() -> Matrix:
            fmu.start({})
            fresh = fmu.get(everything).copy()
            return np.vstack([fresh, walk(fmu, excite(fmu), fmu.start_time)[0]])

        first = replay()
        parameters = real_variables(fmu, fmu.parameters)
        values = 1.001 * fmu.get(parameters)
        with suppress(FMUError):  # a model may refuse them; then reset has this to mend
            fmu.start({}, dict(zip(parameters.names, values, strict=True)))
        second = replay()
        yield same_bits(RESET, fmu, first, second, "after reset and the same calls")


def _inject(path: Path, instantiations: int) -> Iterator[CheckResult]:
    with FMU(path) as fmu:
        if not fmu.states:
            yield replace(INJECTION, passed=True, value=0.0)
            return
        excitation = excite(fmu)
        before = fmu.derivatives()
        wanted = fmu.get_states() + 0.01 * excitation.nominal
        fmu.set_states(wanted)
        by_vector = np.abs(fmu.get_states() - wanted)
        by_reference = np.abs(fmu.get(fmu.variables(fmu.states)) - wanted)
        ignored = np.array_equal(fmu.derivatives(), before)
        # A model may only integrate its inputs; then its own Jacobian says so.
        if ignored and fmu.has_directional_derivatives:
            ignored = bool(fmu.state_jacobian().any())
    name = fmu.states[int(np.argmax(np.maximum(by_vector, by_reference)))]
    if by_vector.any():
        reason = f"'{name}' was set, but the FMU returns another state"
    elif by_reference.any():
        reason = f"'{name}' was set, but the variable of this name has another value"
    else:
        reason = "states were set, but the derivatives stay" if ignored else ""
    if reason:
        reason += "; the exporter protects its states: look for an option, or take another exporter"
    value = float(max(by_vector.max(), by_reference.max()))
    yield replace(INJECTION, passed=not reason, value=value, reason=reason)


def _roll_back(path: Path, instantiations: int) -> Iterator[CheckResult]:
    with FMU(path) as fmu:
        excitation = excite(fmu)
        _, t = walk(fmu, excitation, fmu.start_time)
        fmu.set(excitation.inputs, excitation.first)
        saved = fmu.save()
        first, _ = walk(fmu, excitation, t)
        fmu.restore(saved)
        second, _ = walk(fmu, excitation, t)
        fmu.release(saved)
        yield same_bits(ROLLBACK, fmu, first, second, "run again from a restored state")


def _serialise(path: Path, instantiations: int) -> Iterator[CheckResult]:
    with FMU(path) as fmu:
        excitation = excite(fmu)
        _, t = walk(fmu, excitation, fmu.start_time)
        fmu.set(excitation.inputs, excitation.first)
        saved = fmu.save()
        data = fmu.serialise(saved)
        fmu.release(saved)
        first, _ = walk(fmu, excitation, t)
        # What bytes are for: an instance that never was where the state was saved.
        fmu.renew(reload=True)
        fmu.start({})
        saved = fmu.deserialise(data)
        fmu.restore(saved)
        fmu.release(saved)
        second, _ = walk(fmu, excitation, t)
        what = "run again in a new instance from serialised bytes"
        yield same_bits(SERIALISATION, fmu, first, second, what)


def _roll_back_co_simulation(path: Path, instantiations: int) -> Iterator[CheckResult]:
    with FMU(path) as fmu:
        excitation = excite(fmu)
    with CoSimulation(path) as simulation:
        start_co_simulation(simulation, excitation)
        _, t = run(simulation, excitation, simulation.start_time)
        simulation.set(excitation.inputs, excitation.first)
        saved = simulation.save()
        first, _ = run(simulation, excitation, t)
        simulation.restore(saved)
        second, _ = run(simulation, excitation, t)
        simulation.release(saved)
        what = "run again from a restored state"
        yield same_bits(ROLLBACK_CS, simulation, first, second, what)


def _differentiate(path: Path, instantiations: int) -> Iterator[CheckResult]:
    with FMU(path) as fmu:
        excitation = excite(fmu)
        fmu.has_directional_derivatives = True  # even if they were found wrong
        outputs = continuous_variables(fmu, fmu.outputs)
        stated = fmu.linearise(excitation.inputs, outputs)
        jacobian = np.block([[stated.A, stated.B], [stated.C, stated.D]])
        n = excitation.nominal.size
        centre = np.concatenate([fmu.get_states(), excitation.first])
        size = np.maximum(np.abs(centre), np.append(excitation.nominal, np.zeros(centre.size - n)))
        size[size == 0.0] = 1.0

        def evaluate(point: Vector) -> Vector:
            fmu.set_states(point[:n])
            fmu.set(excitation.inputs, point[n:])
            return np.concatenate([fmu.derivatives(), fmu.get(outputs)])

        scale = np.abs(evaluate(centre))[:, None]
        unknowns = [*fmu.description.rates, *outputs.names]
        nominal = {v.name: abs(v.nominal or 1.0) for v in fmu.description.variables}
        typical = np.array([nominal[name] for name in unknowns])
        error = np.full_like(jacobian, np.inf)
        differences = np.zeros_like(jacobian)
        # Large steps suffer from curvature, small ones from rounding: an entry is wrong if no
        # step confirms it.
        for share in (1e-3, 1e-5, 1e-7):
            steps = share * size
            measured = central_differences(evaluate, centre, steps)
            entry = np.maximum(np.abs(jacobian), np.abs(measured))
            # Below these, an entry is rounding of the differences, or nothing beside others.
            rounding = 1e6 * np.finfo(float).eps * scale / steps
            nothing = 1e-6 * np.maximum(typical, np.max(entry * size, axis=1))[:, None] / size
            entry = np.maximum(entry, np.maximum(rounding, nothing))
            gap = np.abs(jacobian - measured)
            relative = np.divide(gap, entry, out=np.zeros_like(gap), where=entry > 0.0)
            differences = np.where(relative < error, measured, differences)
            error = np.minimum(error, relative)
    i, j = np.unravel_index(np.argmax(error), error.shape)
    passed = bool(error[i, j] <= (DERIVATIVES.limit or 0.0))
    known = [*fmu.states, *excitation.inputs.names][j]
    reason = (
        f"d {unknowns[i]} / d {known} is {jacobian[i, j]:.6g} by the FMU, {differences[i, j]:.6g} "
        "by differences; switch directional derivatives off in the export"
    )
    yield replace(DERIVATIVES, passed=passed, value=error[i, j], reason="" if passed else reason)


def _compare_interfaces(path: Path, instantiations: int) -> Iterator[CheckResult]:
    with FMU(path) as fmu, CoSimulation(path) as simulation:
        excitation = excite(fmu)
        start_co_simulation(simulation, excitation)
        start = simulation.get(simulation.variables(simulation.states)).copy()
        rows, end = run(simulation, excitation, simulation.start_time)
        names = real_variables(simulation).names
        simulated = rows[:, [names.index(state) for state in simulation.states]]
        reference = _integrate(fmu, excitation, start, end)
    reach = np.maximum(np.ptp(reference, axis=0), 1e-3 * excitation.nominal)
    error = np.abs(simulated - reference) / reach
    row, column = np.unravel_index(np.argmax(error), error.shape)
    passed = bool(error.max() <= (INTERFACES.limit or 0.0))
    reason = (
        f"'{fmu.states[column]}' is {simulated[row, column]:.6g} in Co-Simulation and "
        f"{reference[row, column]:.6g} in Model Exchange after {row} steps; export "
        "Co-Simulation with a better integrator or a tighter tolerance"
    )
    yield replace(INTERFACES, passed=passed, value=error.max(), reason="" if passed else reason)


def _integrate(fmu: FMU, excitation: Excitation, start: Vector, end: float) -> Matrix:
    """Trajectory at the communication points, (k, n), by Radau on the FMU's derivatives."""

    def rates(t: float, x: Vector) -> Vector:
        fmu.set_time(t)
        fmu.set_states(x)
        return fmu.derivatives()

    def jacobian(t: float, x: Vector) -> Matrix:
        # Not SciPy's: its steps grow without bound for states that no derivative depends on.
        steps = 1e-6 * np.maximum(np.abs(x), excitation.nominal)
        return central_differences(lambda x: rates(t, x), x, steps)

    rows = start[None, :]
    times = np.linspace(fmu.start_time, end, COMMUNICATION_STEPS + 1)
    jump = COMMUNICATION_STEPS // 2
    for inputs, part in (
        (excitation.first, times[: jump + 1]),
        (excitation.second, times[jump:]),
    ):
        fmu.set(excitation.inputs, inputs)
        solution = solve_ivp(
            rates,
            (part[0], part[-1]),
            rows[-1],
            method="Radau",
            jac=jacobian,
            t_eval=part,
            rtol=1e-8,  # far below the limit of the comparison
            atol=1e-10 * excitation.nominal,
        )
        if not solution.success:
            raise FMUError(f"Model Exchange cannot be integrated: {solution.message}")
        rows = np.vstack([rows, solution.y.T[1:]])
    return rows


_Attempt = Callable[[Path, int], Iterator[int | CheckResult]]
# What is run, the questions it answers, and those whose answers it rests on.
_CHECKS: tuple[tuple[_Attempt, tuple[CheckResult, ...], tuple[CheckResult, ...]], ...] = (
    (_start, (START, EVENTS), ()),
    (_reset, (RESET,), (START,)),
    (_inject, (INJECTION,), (START,)),
    (_roll_back, (ROLLBACK,), (START,)),
    (_serialise, (SERIALISATION,), (START, ROLLBACK)),
    (_roll_back_co_simulation, (ROLLBACK_CS,), (START,)),
    (_differentiate, (DERIVATIVES,), (START, INJECTION)),
    (_compare_interfaces, (INTERFACES,), (START, INJECTION)),
    (endure, (INSTANCES, LOADS, MEMORY), (START,)),
    (time_calls, (TIME_GET, TIME_SET, TIME_DERIVATIVES, TIME_STEP), (START,)),
)
