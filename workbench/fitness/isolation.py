"""A check in a process of its own, because a foreign library may crash or hang."""

import multiprocessing
import os
import signal
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from multiprocessing.connection import Connection

from workbench.errors import FMUError
from workbench.fitness.finding import Finding
from workbench.pool import start

# A check yields findings, and numbers that say how far it is.
Task = Callable[[], Iterator[int | Finding]]
_Report = int | Finding | str  # text: of an exception, the last report


def isolated(task: Task, questions: Sequence[Finding], timeout: float) -> list[Finding]:
    """Run a check in a process; returns one finding per question, whatever happens there.

    If the check ends before its time, the question it was at fails with the reason, and those
    after it stay open.

    Parameters
    ----------
    task : the check; a function that can be pickled.
    questions : what it answers, in this order.
    timeout : time without a report after which it is stopped [s].
    """
    reports, to_parent = multiprocessing.Pipe(duplex=False)
    with tempfile.TemporaryDirectory(prefix="fmu-check-") as scratch:
        process = start(_work, (task, to_parent, scratch))
        to_parent.close()
        found, reached, reason = _listen(reports, timeout)
        process.join(1.0 if reason else timeout)
        if process.exitcode is None:
            process.kill()
            process.join()
            reason = reason or f"the FMU did not let itself be freed within {timeout:.0f} s"
    if process.exitcode and not reason:
        reason = f"the FMU {_death(process.exitcode)}"
    reports.close()
    if not reason:
        return [found[question.name] for question in questions]
    blamed = next((q for q in questions if q.name not in found), questions[-1])
    progress = f" after {reached} {blamed.unit}" if reached is not None else ""
    failure = replace(blamed, passed=False, value=reached, reason=reason + progress)
    found[blamed.name] = failure
    return [found.get(q.name, replace(q, reason=f"not measured: {reason}")) for q in questions]


def _listen(
    reports: "Connection[None, _Report]", timeout: float
) -> tuple[dict[str, Finding], int | None, str]:
    """Collect reports to the end: findings, progress since the last, and what went wrong."""
    found: dict[str, Finding] = {}
    reached: int | None = None
    while reports.poll(timeout):
        try:
            report = reports.recv()
        except EOFError:
            return found, reached, ""
        if isinstance(report, str):
            return found, reached, report
        if isinstance(report, Finding):
            found[report.name] = report
            reached = None
        else:
            reached = report
    return found, reached, f"the FMU did not return within {timeout:.0f} s"


def _work(task: Task, reports: "Connection[_Report, None]", scratch: str) -> None:
    """Run a check in this process and report."""
    tempfile.tempdir = scratch  # a crash leaves unpacked files, which go with the folder
    # What an FMU prints must not get between the lines of the caller's table.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    try:
        for report in task():
            reports.send(report)
    except Exception as error:  # whatever a foreign library brings about is a finding
        reports.send(str(error) if isinstance(error, FMUError) else repr(error))


def _death(exit_code: int) -> str:
    if exit_code < 0:
        return f"crashed with {signal.Signals(-exit_code).name}"
    return f"ended the process with exit code {exit_code}"
