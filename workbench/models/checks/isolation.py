"""A check in a process of its own, because a foreign library may crash or hang."""

import multiprocessing
import os
import pickle
import secrets
import signal
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from multiprocessing.connection import Connection
from types import FrameType

from workbench.errors import FMUError
from workbench.models.checks.result import CheckResult
from workbench.models.trial import NoAnswerError, describe_end
from workbench.models.trial_calls import limit_processor, limit_sizes
from workbench.runtime.files import temporary_folder
from workbench.runtime.pool import (
    ForeignDataError,
    close_servers,
    receive_marked,
    send_marked,
    start,
)
from workbench.runtime.supervision import Limits

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
    if os.name == "posix":  # Python's handler goes before this process does
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def _limit(limits: Limits) -> None:
    """Limit what this process may use; processor time in each call that does not return."""
    limit_sizes(limits.file, limits.memory)
    if os.name != "posix":
        return

    def alive(number: int = 0, frame: FrameType | None = None) -> None:
        # Python calls this between calls of the FMU only: one that does not return meets the limit.
        limit_processor(limits.processor)

    alive()
    signal.signal(signal.SIGPROF, alive)
    period = limits.processor / 10.0
    signal.setitimer(signal.ITIMER_PROF, period, period)
