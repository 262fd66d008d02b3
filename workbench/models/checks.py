"""Is an FMU fit for observers? What its description promises is tried before it is trusted.

An observer sets states, rolls back, linearises and starts an FMU thousands of times, which ordinary
simulation never does, so faults there stay hidden. Each check runs in a process of its own: a
crash of the FMU is a finding, not the end. A check that rests on what another found missing is not
tried, so that a fault is named once, where it is.
"""

import functools
import gc
import multiprocessing
import os
import pickle
import secrets
import signal
import tempfile
import timeit
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError, InputError
from workbench.models.description import (
    CO_SIMULATION,
    MODEL_EXCHANGE,
    Description,
    read_description,
)
from workbench.models.fmu import FMU, CoSimulation, Variables, central_differences
from workbench.models.fmu_cache import cache_folder
from workbench.models.instance import NoFunctionError
from workbench.models.trial import ContainedError, NoAnswerError, describe_end, run_trial, unpacked
from workbench.models.trial_calls import limit_processor, limit_sizes
from workbench.runtime.files import parse_table, temporary_folder, write_json
from workbench.runtime.pool import (
    ForeignDataError,
    close_servers,
    receive_marked,
    send_marked,
    start,
)
from workbench.runtime.supervision import Limits, usual_limits


@dataclass(frozen=True)
class CheckResult:
    """What one check found."""

    name: str
    passed: bool | None = None  # None if the check was not made, for the reason given
    # value, limit: measured, and the largest (of instances: the smallest) that passes, in `unit`
    value: float | None = None
    limit: float | None = None
    unit: str = "1"
    reason: str = ""  # of a failure or of what was not checked, for whom has to act on it
    unknown: bool = False  # whether the check was begun and the FMU did not answer
    avoided: bool = False  # whether the workbench does not use what failed


def is_fit(findings: Iterable[CheckResult]) -> bool:
    """Say whether no check failed; see `CheckResult.unknown`, too."""
    return all(finding.passed is not False for finding in findings)


# One sample of a recording at 200 Hz: what takes longer cannot keep up with the rig.
SAMPLE = 5000.0

# The questions: findings without an answer. Bits are either the same or not, hence limits of 0.
START = CheckResult("start", limit=1, unit="instances")
# Filters correct states one by one.
SCALARS = CheckResult("scalar states", limit=0, unit="elements of arrays")
# Observers drive a model by inputs that are real and continuous.
INPUTS = CheckResult("real inputs", limit=0, unit="others")
# The step of most observers takes the model for smooth: it would pass over a jump.
EVENTS = CheckResult("smoothness", limit=0, unit="event indicators")
FUNCTION = CheckResult("function of states", limit=0)
RESET = CheckResult("reset and replay", limit=0.0)
INJECTION = CheckResult("state injection", limit=0.0)
ROLLBACK = CheckResult("rollback", limit=0.0)
SERIALISATION = CheckResult("serialised rollback", limit=0.0)
ROLLBACK_CS = CheckResult("rollback in Co-Simulation", limit=0.0)
# Of an entry. Differences at the best of several steps agree to 1e-7; a wrong term is far above.
DERIVATIVES = CheckResult("directional derivatives", limit=1e-4)
# Of the range of a state: above any sensible tolerance, below what a sensor of speed resolves.
INTERFACES = CheckResult("Co-Simulation against Model Exchange", limit=1e-3)
INSTANCES = CheckResult("instantiations", unit="instances")
LOADS = CheckResult("loads of the library", unit="instances")
# Tuning starts a model 1e5 times: 1 MB in 1000 would fill 100 MB of each worker.
MEMORY = CheckResult("memory growth", limit=1.0, unit="MB per 1000")
TIME_GET = CheckResult("time of states and outputs", limit=SAMPLE, unit="us")
TIME_SET = CheckResult("time of inputs", limit=SAMPLE, unit="us")
TIME_DERIVATIVES = CheckResult("time of states and derivatives", limit=SAMPLE, unit="us")
TIME_STEP = CheckResult("time of states and step", limit=SAMPLE, unit="us")

# Every estimator sets states and steps by the Jacobian. Kalman filters go through events where they
# can roll back, also where they are tuned and beside a rig. What makes many instances are tuning,
# fit and diagnosis, the last two of which simulate through events.
_OBSERVING = (START, SCALARS, INPUTS, EVENTS, FUNCTION, RESET, INJECTION, DERIVATIVES)
_OTHERS = "other observers on recordings"
_ROLLING_BACK, _SOLVING = "tools that roll back", "tools that use its own solver"
_USES = {
    "open loop": (START, FUNCTION, RESET, INJECTION),
    "ekf and ukf on recordings": _OBSERVING,
    _OTHERS: _OBSERVING,
    "tuning": (*_OBSERVING, INSTANCES, LOADS, MEMORY),
    "fit and diagnosis": (
        *(START, FUNCTION, RESET, INJECTION, DERIVATIVES),
        *(INSTANCES, LOADS, MEMORY),
    ),
    "observers beside a running rig": (
        *_OBSERVING,
        TIME_GET,
        TIME_SET,
        TIME_DERIVATIVES,
        TIME_STEP,
    ),
    _ROLLING_BACK: (START, ROLLBACK, SERIALISATION, ROLLBACK_CS),
    _SOLVING: (START, INTERFACES),
}


def uses(findings: Iterable[CheckResult]) -> dict[str, list[str]]:
    """Uses of an FMU, each with the names of what failed that it rests on; none: it would do.

    Exported observers are made of Modelica classes, not of FMUs.
    """
    by_name = {finding.name: finding for finding in findings}
    failed = {f.name for f in by_name.values() if f.passed is False and not f.avoided}
    rolls_back = any(by_name[question.name].passed for question in (ROLLBACK, ROLLBACK_CS))
    possible = {}
    for use, questions in _USES.items():
        wrong = [question.name for question in questions if question.name in failed]
        if by_name[ROLLBACK.name].passed and use != _OTHERS:
            wrong = [name for name in wrong if name != EVENTS.name]
        # What it does not offer has not failed, and nobody can use it.
        if use == _ROLLING_BACK and not rolls_back:
            wrong = wrong or [ROLLBACK.name]
        if use == _SOLVING and by_name[INTERFACES.name].reason.endswith(_ALONE):
            wrong = wrong or [CO_SIMULATION]
        possible[use] = wrong
    return possible


def _kept(sha256: str) -> Path:
    return cache_folder() / "findings" / f"{sha256}.json"


def remember_findings(sha256: str, failed: Iterable[CheckResult]) -> None:
    """Keep what failed in the check of an FMU, by the hash of its file."""
    reasons = {finding.name: finding.reason for finding in failed}
    with suppress(OSError, InputError):
        if reasons:
            _kept(sha256).parent.mkdir(parents=True, exist_ok=True)
            write_json(_kept(sha256), reasons)
        else:
            _kept(sha256).unlink(missing_ok=True)


def remembered_findings(sha256: str) -> Mapping[str, str]:
    """What failed in the last check of an FMU that observers rest on, with reasons."""
    try:
        reasons = parse_table(_kept(sha256).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    needed = {question.name for question in _OBSERVING}
    return {name: str(reason) for name, reason in reasons.items() if name in needed}


# A check yields findings, and numbers that say how far it is.
Task = Callable[[], Iterator[int | CheckResult]]
_Report = int | CheckResult | str | NoAnswerError  # text: of an exception; both are the last report
_SHARE = 10.0  # of the processor that a check gets at least, on a machine with other work to do


def isolated(task: Task, questions: Sequence[CheckResult], limits: Limits) -> list[CheckResult]:
    """Run a check in a process; returns one finding per question, whatever happens there.

    If the check ends before its time, the question it was at fails with the reason, and those
    after it stay open. One that does not answer, though it does not work either, is not measured.

    Parameters
    ----------
    task : the check; a function that can be pickled.
    questions : what it answers, in this order.
    limits : of processor time in one call of the FMU, of memory and of files.
    """
    reports, to_parent = multiprocessing.Pipe(duplex=False)
    secret = secrets.token_bytes(16)
    wait = max(limits.answer, _SHARE * limits.processor)
    with temporary_folder() as scratch:
        process = start(_work, (task, (to_parent, secret), scratch, limits, dict(os.environ)))
        to_parent.close()
        answers, reached, reason = _listen(reports, secret, wait)
        process.join(1.0 if reason else wait)
        unknown = isinstance(reason, NoAnswerError)
        if process.exitcode is None:
            process.kill()
            process.join()
            unknown = unknown or not reason
            reason = reason or f"the FMU did not let itself be freed within {wait:.0f} s"
    missing = any(question.name not in answers for question in questions)
    if not reason and (process.exitcode or missing):
        end = describe_end(process.exitcode or 0, "a call", f"{limits.processor:g}")
        reason = f"the FMU {end}"
    reports.close()
    if not reason:
        return [answers[question.name] for question in questions]
    blamed = next((q for q in questions if q.name not in answers), questions[-1])
    progress = f" after {reached} {blamed.unit}" if reached is not None else ""
    explanation = f"{'not measured: ' if unknown else ''}{reason}{progress}"
    passed = None if unknown else False
    answers[blamed.name] = replace(
        blamed, passed=passed, unknown=unknown, value=reached, reason=explanation
    )
    return [
        answers.get(q.name, replace(q, unknown=unknown, reason=f"not measured: {reason}"))
        for q in questions
    ]


def _listen(
    reports: "Connection[bytes, bytes]", secret: bytes, timeout: float
) -> tuple[dict[str, CheckResult], int | None, str | NoAnswerError]:
    """Collect reports to the end: findings, progress since the last, and what went wrong."""
    answers: dict[str, CheckResult] = {}
    reached: int | None = None
    while reports.poll(timeout):
        try:
            report: _Report = pickle.loads(receive_marked(reports, secret))
        except ForeignDataError as error:
            return answers, reached, str(error)
        except (EOFError, OSError):
            return answers, reached, ""
        if isinstance(report, str | NoAnswerError):
            return answers, reached, report
        if isinstance(report, CheckResult):
            answers[report.name] = report
            reached = None
        else:
            reached = report
    return answers, reached, NoAnswerError(f"the FMU did not answer within {timeout:.0f} s")


def _work(
    task: Task,
    reports: "tuple[Connection[bytes, bytes], bytes]",
    scratch: str,
    limits: Limits,
    environment: Mapping[str, str],
) -> None:
    """Run a check in this process and report."""
    close_servers()
    os.environ.clear()
    os.environ.update(environment)
    _limit(limits)
    tempfile.tempdir = scratch  # a crash leaves unpacked files, which go with the folder
    # What an FMU prints must not get between the lines of the caller's table.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)

    def send(report: _Report) -> None:
        send_marked(*reports, pickle.dumps(report))

    try:
        for report in task():
            send(report)
    except Exception as error:  # whatever a foreign library brings about is a finding
        known = isinstance(error, FMUError) and not isinstance(error, NoAnswerError)
        send(error if isinstance(error, NoAnswerError) else str(error) if known else repr(error))
    if hasattr(signal, "setitimer"):  # Python's handler goes before this process does
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def _limit(limits: Limits) -> None:
    """Limit what this process may use; processor time in each call that does not return."""
    limit_sizes(limits.file, limits.memory)
    if not hasattr(signal, "setitimer"):  # Windows
        return

    def alive(number: int = 0, frame: FrameType | None = None) -> None:
        # Python calls this between calls of the FMU only: one that does not return meets the limit.
        limit_processor(limits.processor)

    alive()
    signal.signal(signal.SIGPROF, alive)
    period = limits.processor / 10.0
    signal.setitimer(signal.ITIMER_PROF, period, period)


COMMUNICATION_STEPS = 100
_ALONE = "the FMU has no Co-Simulation"
_VISITS, _OFF = 10, 0.1  # points that are visited twice, and shares of what is borne they are off


@dataclass(frozen=True)
class Excitation:
    """Where an FMU is moved."""

    states: Vector  # (n,) start values, off the FMU's own by up to a tenth of a nominal value
    nominal: Vector  # (n,) typical size of the states
    reach: float  # share of it by which states may be moved further
    inputs: Variables  # the real inputs that may change in continuous time
    # first, second: (m,) inputs, and those after a jump
    first: Vector
    second: Vector


def excite(fmu: FMU) -> Excitation:
    """Start the FMU and bring it to an excited point; returns where."""
    by_name = fmu.description.by_name
    nominal = np.array([abs(by_name[name].nominal or 1.0) for name in fmu.states])
    inputs = continuous_variables(fmu, fmu.inputs)
    fmu.start({})
    states = origin = fmu.get_states()
    start, reach = fmu.get(inputs).copy(), 0.0
    for share in (0.1, 0.01, 0.001, -0.1, -0.01, -0.001):
        if share < 0.0 < reach:  # below is for a model that bears nothing above, as a full tank
            break
        try:  # whether the model bears these states
            fmu.set_states(origin + share * nominal)
            rates = fmu.derivatives()
        except FMUError:
            continue
        if not np.isfinite(rates).all():
            continue
        states, reach = origin + share * nominal, _OFF * abs(share)
        if np.all(np.abs(rates) < 100.0 * nominal):  # farther out, it flies off within 10 ms
            break
    fmu.set_states(states)
    levels = np.array([_level(fmu, inputs, start, j, nominal) for j in range(start.size)])
    excitation = Excitation(states, nominal, reach, inputs, start + levels, start + levels / 3)
    fmu.set(inputs, excitation.first)
    return excitation


def _level(fmu: FMU, inputs: Variables, start: Vector, j: int, nominal: Vector) -> float:
    """Power of ten by which an input must change to move a state by a tenth in a second."""
    still = fmu.derivatives()
    level = 1.0
    for candidate in 10.0 ** np.arange(-3, 10):
        moved = start.copy()
        moved[j] += candidate
        try:
            fmu.set(inputs, moved)
            change = np.abs(fmu.derivatives() - still)
        except FMUError:
            break
        if np.any(change > 0.1 * nominal):
            level = float(candidate)
            break
    fmu.set(inputs, start)
    return level


def real_variables(fmu: FMU, names: Sequence[str] | None = None) -> Variables:
    """Look up those of the names that are real scalars; without names, all of the FMU."""
    real = [v.name for v in fmu.description.variables if v.real]
    return fmu.variables([n for n in real if names is None or n in names])


def continuous_variables(fmu: FMU, names: Sequence[str]) -> Variables:
    """Look up those of the names that are real scalars and continuous."""
    continuous = {v.name for v in fmu.description.variables if v.variability == "continuous"}
    return real_variables(fmu, [name for name in names if name in continuous])


def step_size(fmu: FMU) -> float:
    """Communication step [s]: the FMU's own, or a thousandth of its experiment, or 10 ms."""
    return fmu.description.step or (fmu.description.stop or 10.0) / 1000


def walk(fmu: FMU, excitation: Excitation, begin: float) -> tuple[Matrix, float]:
    """Follow the derivatives for 40 steps, as far as the model bears, inputs jumping half way.

    Each step is at most a hundredth of a nominal value long, which no stiffness makes unstable,
    and rests on states, inputs and derivatives alone.

    Returns
    -------
    (40, k) all real variables, and the time at the end [s].
    """
    everything = real_variables(fmu)
    t, rows, x = begin, [], fmu.get_states()
    for k in range(40):
        if k == 20:
            fmu.set(excitation.inputs, excitation.second)
        try:
            rates = fmu.derivatives()
            x = fmu.get_states()
        except FMUError:
            fmu.set_states(x)
            rates = np.zeros(x.size)
        rows.append(fmu.get(everything).copy())
        pace = float(np.max(np.abs(rates) / excitation.nominal, initial=0.0))
        h = min(step_size(fmu), 0.01 / pace if pace > 0.0 else np.inf)
        t += h
        fmu.set_time(t)
        fmu.set_states(x + h * rates)
        fmu.complete_step()
    return np.array(rows), t


def start_co_simulation(simulation: CoSimulation, excitation: Excitation) -> None:
    """Start at the excited point if the FMU lets itself be put there, else at its own."""
    try:
        simulation.start(dict(zip(simulation.states, excitation.states, strict=True)))
    except FMUError:
        simulation.start({})
    simulation.set(excitation.inputs, excitation.first)


def run(simulation: CoSimulation, excitation: Excitation, begin: float) -> tuple[Matrix, float]:
    """Let a Co-Simulation run for COMMUNICATION_STEPS, inputs jumping half way.

    Returns
    -------
    (COMMUNICATION_STEPS + 1, k) all real variables, and the time at the end [s].
    """
    everything = real_variables(simulation)
    h = step_size(simulation)
    simulation.set_time(begin)
    rows = [simulation.get(everything).copy()]
    for k in range(COMMUNICATION_STEPS):
        if k == COMMUNICATION_STEPS // 2:
            simulation.set(excitation.inputs, excitation.second)
        simulation.step(h)
        rows.append(simulation.get(everything).copy())
    return np.array(rows), begin + COMMUNICATION_STEPS * h


def same_bits(
    question: CheckResult, fmu: FMU, first: Matrix, second: Matrix, rerun: str
) -> CheckResult:
    """Judge two runs, (samples, k) of all real variables, that must be one and the same."""
    if first.tobytes() == second.tobytes():
        return replace(question, passed=True, value=0.0)
    row, column = np.argwhere(first.view(np.uint64) != second.view(np.uint64))[0]
    return replace(
        question,
        passed=False,
        value=float(np.nanmax(np.abs(first - second))),
        reason=f"{rerun}, '{real_variables(fmu).names[column]}' is {second[row, column]:.9g} "
        f"instead of {first[row, column]:.9g} at sample {row}",
    )


# --- what many instances and calls cost ---


# A tenth of these leaks 0.05 MB at the limit, some pages of memory.
_MEMORY_SHOWS = 500


def endure(path: Path, instantiations: int) -> Iterator[int | CheckResult]:
    """Make instances one after the other, of one loaded library and each of its own.

    In a process of its own: what it was begun with is not searched for garbage from here on, which
    took three quarters of a check.
    """
    gc.freeze()
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
        shift = min(1e-6, excitation.reach) * excitation.nominal
        points = (excitation.states, excitation.states + shift)
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
    """
    description = read_description(path)
    description.require(MODEL_EXCHANGE)
    limits = limits or usual_limits()
    findings: dict[str, CheckResult] = {}
    for attempted, questions, needs in _CHECKS:
        failed = next((n.name for n in needs if not findings[n.name].passed), None)
        obstacle = _obstacle(questions[0], description) or (failed and f"needs '{failed}'")
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
        return _ALONE
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
        arrays = sum(not fmu.is_real(name) for name in fmu.states)
        rates = fmu.derivatives()
    if not np.isfinite(rates).all():
        name = fmu.states[int(np.argmin(np.isfinite(rates)))]
        reason = f"the derivative of '{name}' is not finite with the FMU's start values"
    else:
        reason = ""
    yield replace(START, passed=not reason, value=1, reason=reason)
    reason = "only open loop, fit and diagnosis go on; export the model with scalar variables"
    yield replace(SCALARS, passed=not arrays, value=arrays, reason=reason if arrays else "")
    inputs = [v for v in fmu.description.variables if v.causality == "input"]
    others = [f"'{v.name}'" for v in inputs if not (v.real and v.variability == "continuous")]
    reason = (
        f"with {', '.join(others)}, only open loop, fit and diagnosis go on; export continuous ones"
    )
    yield replace(INPUTS, passed=not others, value=len(others), reason=reason if others else "")
    count, timed = fmu.description.event_indicators, float(fmu.next_event[0])
    smooth = not fmu.has_events
    reason = "" if timed == np.inf else f"a time event at {timed:g} s; "
    reason += "rates or outputs follow from earlier steps, too; " * fmu.remembers_steps
    reason += "only open loop, fit, diagnose go through events, and filters ekf and ukf if the FMU "
    reason += "saves its state; replace jumps by smooth functions"
    yield replace(EVENTS, passed=smooth, value=count, reason="" if smooth else reason)


def _revisit(path: Path, instantiations: int) -> Iterator[CheckResult]:
    with FMU(path) as fmu:
        excitation, reason = excite(fmu), ""
        # About the excited point, the inputs jumping half way.
        shares = excitation.reach * np.array([1.0, -1.0] * (_VISITS // 2))
        x = excitation.states + shares[:, None] * excitation.nominal
        u = np.where(
            np.arange(_VISITS)[:, None] < _VISITS // 2, excitation.first, excitation.second
        )
        time = np.linspace(0.0, step_size(fmu) * _VISITS, _VISITS) + fmu.start_time
        outputs = [name for name in fmu.outputs if fmu.is_real(name)]
        fmu.start({})
        if not fmu.is_function:
            try:
                fmu.require_function(excitation.inputs.names, outputs, time, x, u)
            except NoFunctionError as error:
                reason = str(error)
        yield replace(FUNCTION, passed=not reason, value=int(bool(reason)), reason=reason)


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
        others = set(fmu.states)
        shown = fmu.variables([y for y in fmu.outputs if fmu.is_real(y) and y not in others])

        def read() -> Vector:
            if fmu.event_signs.size:  # what depends on states may follow the mode of their place
                fmu.handle_event()
            return np.concatenate([fmu.derivatives(), fmu.get(shown)])

        before = read()
        wanted = fmu.get_states() + excitation.reach * excitation.nominal
        fmu.set_states(wanted)
        by_vector = np.abs(fmu.get_states() - wanted)
        by_reference = np.abs(fmu.get_typed(fmu.typed(fmu.states)) - wanted)
        # Of a model that remembers steps they may follow later.
        ignored = np.array_equal(read(), before) and not fmu.remembers_steps
        unknown = not excitation.reach
        # A model may only integrate its inputs; then its own Jacobian or structure says so.
        if ignored and fmu.has_directional_derivatives and all(map(fmu.is_real, fmu.states)):
            ignored = bool(fmu.state_jacobian().any())
        elif ignored:
            known = [fmu.description.dependencies.get(rate) for rate in fmu.description.rates]
            unknown = unknown or None in known
            ignored = any(names and others.intersection(names) for names in known)
    name = fmu.states[int(np.argmax(np.maximum(by_vector, by_reference)))]
    if by_vector.any():
        reason = f"'{name}' was set, but the FMU returns another state"
    elif by_reference.any():
        reason = f"'{name}' was set, but the variable of this name has another value"
    else:
        reason = "states were set, but derivatives and outputs stay" if ignored else ""
    if reason:
        reason += "; the exporter protects its states: look for an option, or take another exporter"
    elif unknown:
        reason = (
            "not measured: where the model was started nothing follows from its states, and its "
            "description does not say whether something should"
        )
        yield replace(INJECTION, reason=reason)
        return
    value = float(max(by_vector.max(), by_reference.max()))
    yield replace(INJECTION, passed=not reason, value=value, reason=reason)


def _roll_back(path: Path, instantiations: int) -> Iterator[CheckResult]:
    with FMU(path) as fmu:
        yield _repeated(ROLLBACK, fmu, excite(fmu), walk)


def _roll_back_co_simulation(path: Path, instantiations: int) -> Iterator[CheckResult]:
    with FMU(path) as fmu:
        excitation = excite(fmu)
    with CoSimulation(path) as simulation:
        start_co_simulation(simulation, excitation)
        yield _repeated(ROLLBACK_CS, simulation, excitation, run)


def _repeated(
    question: CheckResult,
    fmu: Any,
    excitation: Excitation,
    move: Callable[[Any, Excitation, float], tuple[Matrix, float]],
) -> CheckResult:
    """Judge whether moves from a saved state are the same after it is restored."""
    _, t = move(fmu, excitation, fmu.start_time)
    fmu.set(excitation.inputs, excitation.first)
    saved = fmu.save()
    first, _ = move(fmu, excitation, t)
    fmu.restore(saved)
    second, _ = move(fmu, excitation, t)
    fmu.release(saved)
    return same_bits(question, fmu, first, second, "run again from a restored state")


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
        rerun = "run again in a new instance from serialised bytes"
        yield same_bits(SERIALISATION, fmu, first, second, rerun)


def _differentiate(path: Path, instantiations: int) -> Iterator[CheckResult]:
    with FMU(path) as fmu:
        excitation = excite(fmu)
        avoided = not fmu.has_directional_derivatives
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
            try:
                measured = central_differences(evaluate, centre, steps)
            except FMUError:  # farther than the model bears
                continue
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
        + ". The workbench does not use them"
        * avoided
    )
    finding = replace(DERIVATIVES, passed=passed, value=error[i, j], avoided=avoided)
    yield replace(finding, reason="" if passed else reason)


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
    from scipy.integrate import solve_ivp  # takes its time, and no other check needs it

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
    for inputs, part in ((excitation.first, times[: jump + 1]), (excitation.second, times[jump:])):
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
    (_start, (START, SCALARS, INPUTS, EVENTS), ()),
    (_revisit, (FUNCTION,), (START,)),
    (_reset, (RESET,), (START, FUNCTION)),
    (_inject, (INJECTION,), (START, FUNCTION)),
    (_roll_back, (ROLLBACK,), (START, FUNCTION)),
    (_serialise, (SERIALISATION,), (START, ROLLBACK)),
    (_roll_back_co_simulation, (ROLLBACK_CS,), (START,)),
    (_differentiate, (DERIVATIVES,), (START, SCALARS, INJECTION)),
    (_compare_interfaces, (INTERFACES,), (START, SCALARS, INJECTION)),
    (endure, (INSTANCES, LOADS, MEMORY), (START,)),
    (time_calls, (TIME_GET, TIME_SET, TIME_DERIVATIVES, TIME_STEP), (START, SCALARS)),
)
