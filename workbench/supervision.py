"""A command in a process of its own, with one beside it that outlives whatever happens to it.

Models are foreign code: one may end the process it runs in, without a word and with status 0. The
process beside it says so, ends what was started, and removes temporary files.
"""

import ctypes
import gc
import os
import signal
import subprocess
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

from workbench.scratch import own_temporary_files

_DIE_WITH_PARENT, _ADOPT = 1, 36  # PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER of <sys/prctl.h>
_REQUESTS = tuple(
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGTSTP")
    if hasattr(signal, name)  # Windows has not all
)
_PATIENCE = 10  # [s] from a request to end until the end; results are written in less


def supervised(work: Callable[[], int]) -> int:
    """Do work in a child process; returns its status, or 1 if it did not come to its end.

    Signals that ask this process to end or to pause are passed on; when the work is over they are
    left blocked, for a process that ends. Where processes cannot be forked (Windows) the work is
    done in this one.
    """
    if not hasattr(os, "fork"):
        with own_temporary_files():
            return work()
    status = b""
    # They wait but for while they are passed on: who ended before or after would leave files.
    signal.pthread_sigmask(signal.SIG_BLOCK, _REQUESTS)
    with own_temporary_files():
        done, tell = os.pipe()
        sys.stdout.flush()
        sys.stderr.flush()
        parent = os.getpid()
        child = os.fork()
        if child == 0:
            os.close(done)
            _begin(parent)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, _REQUESTS)
            return _worked(work, tell)
        os.close(tell)
        _control(_ADOPT, 1)
        with _passing_on(child):
            _, ending = os.waitpid(child, 0)
        _end_the_rest(child)
        os.set_blocking(done, False)  # a model may have left someone who holds the other end
        with suppress(BlockingIOError):
            status = os.read(done, 1)
        os.close(done)
    if status:
        return status[0]
    print(f"error: {_told(os.waitstatus_to_exitcode(ending))}", file=sys.stderr)
    return 1


def run_program(command: Sequence[str]) -> int:
    """Run a program until it ends, which is asked to when this one is; returns its status."""
    with subprocess.Popen(command, process_group=0 if os.name == "posix" else None) as program:
        while True:
            try:
                return program.wait()
            except KeyboardInterrupt:
                program.send_signal(signal.SIGINT)
            except BaseException:
                program.terminate()
                raise


def _begin(parent: int) -> None:
    """Prepare the child: a group of its own, so that a terminal's Ctrl-C reaches it once."""
    os.setpgid(0, 0)
    _control(_DIE_WITH_PARENT, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)

    def leave(number: int, frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    for request in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(request) != signal.SIG_IGN:  # as under nohup
            signal.signal(request, leave)


def _worked(work: Callable[[], int], tell: int) -> int:
    """Status of the work, told to the parent, too."""
    try:
        status = work()
    except BaseException as error:
        status = _status(error)
    with suppress(OSError, ValueError):  # whoever read it has gone
        sys.stdout.flush()
    os.write(tell, bytes([status & 0xFF]))
    gc.freeze()  # all that is left goes with the process: a last search for garbage takes 0.2 s
    return status


def _status(error: BaseException) -> int:
    """Status that work ends with; says what was wrong."""
    match error:
        case SystemExit(code=int(status)):
            return status
        case SystemExit(code=text):
            if text is not None:
                print(text, file=sys.stderr)
            return int(text is not None)
        case KeyboardInterrupt():
            return 130
        # Python wraps whatever comes while a class names its members, as when modules are imported.
        case RuntimeError(__cause__=SystemExit() | KeyboardInterrupt() as request):
            return _status(request)
    traceback.print_exception(error)
    return 1


@contextmanager
def _passing_on(child: int) -> Iterator[None]:
    """Pass signals on to the child; one that does not end when asked to is ended."""

    def end(number: int, frame: FrameType | None) -> None:
        with suppress(ProcessLookupError):
            os.kill(child, number)
        if number != signal.SIGINT:
            signal.alarm(_PATIENCE)

    def pause(number: int, frame: FrameType | None) -> None:
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGSTOP)
            os.kill(os.getpid(), signal.SIGSTOP)
            os.killpg(child, signal.SIGCONT)

    def kill(number: int, frame: FrameType | None) -> None:
        with suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)

    handlers = {
        **dict.fromkeys((signal.SIGINT, signal.SIGTERM, signal.SIGHUP), end),
        signal.SIGTSTP: pause,
        signal.SIGALRM: kill,
    }
    before = {number: signal.getsignal(number) for number in handlers}
    for number, handler in handlers.items():
        if before[number] != signal.SIG_IGN:
            signal.signal(number, handler)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _REQUESTS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_BLOCK, _REQUESTS)
        signal.alarm(0)
        for number, usual in before.items():
            signal.signal(number, usual)


def _end_the_rest(group: int) -> None:
    """End what the child left running, and wait for it."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)
    # Orphans are ours (`_ADOPT`); each that ends may leave us others.
    listing = Path(f"/proc/self/task/{os.getpid()}/children")
    with suppress(OSError):
        while orphans := listing.read_text().split():
            for orphan in map(int, orphans):
                os.kill(orphan, signal.SIGKILL)
                os.waitpid(orphan, 0)


def _told(status: int) -> str:
    """Say how a process ended that did not come to its end."""
    how = f"killed by {signal.Signals(-status).name}" if status < 0 else f"ended, status {status},"
    return (
        f"the command was {how} before it was done: by a model's own code, or from outside. "
        "'workbench fmu check FILE' tries a model call by call"
    )


def _control(what: int, value: int) -> None:
    """Set a property of this process; without effect where the system is not Linux."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(what, value, 0, 0, 0)
