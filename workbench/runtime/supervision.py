"""A command in a process of its own, with one beside it that outlives whatever happens to it.

Models are foreign code: one may end the process it runs in, without a word and with status 0. The
process beside it says so, ends what was started, and removes temporary files.
"""

import ctypes
import errno
import gc
import os
import platform
import signal
import struct
import subprocess
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

from workbench.runtime.files import own_temporary_files

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


_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446  # the same on every processor


_VERSION, _BENEATH = 1, 1


# Write a file; remove folders and files; make device, folder, file, socket, FIFO, block, link.
_WRITING = 1 << 1 | sum(1 << right for right in range(4, 13))


_LINK_ELSEWHERE, _TRUNCATE = 1 << 13, 1 << 14  # since versions 2 and 3


_TCP = 3  # bind and connect, since version 4


_OUTSIDE = 3  # abstract sockets and signals, since version 6


_NO_NEW_PRIVILEGES, _SECCOMP, _FILTER = 38, 22, 2  # of prctl

# Architecture as audit names it, and its system call `socket`.
_SOCKET = {"x86_64": (0xC000003E, 41), "aarch64": (0xC00000B7, 198)}


_IO_URING, _TAKE_DESCRIPTOR = 425, 438  # other ways to a socket: io_uring_setup, pidfd_getfd


_LOAD, _EQUAL, _AT_LEAST, _RETURN = 0x20, 0x15, 0x35, 0x06


_ALLOW, _REFUSE = 0x7FFF0000, 0x00050000


_X32 = 0x40000000  # bit of the numbers of a second interface on x86_64


def confine(folders: Sequence[Path]) -> str:
    """Confine this process, which must have one thread, and all that it starts.

    Parameters
    ----------
    folders : that may be written below.

    Returns
    -------
    What holds from now on, for people; it names what this system cannot do.
    """
    if sys.platform != "linux":
        return "in a process of its own; this system has no means to confine it further"
    libc = ctypes.CDLL(None, use_errno=True)
    writing = _confine_files(libc, folders)
    network = _confine_sockets(libc)
    places = ", ".join(map(str, folders))
    return (
        f"writing only below {places}" if writing else "writing NOT confined (no Landlock here)"
    ) + ("; no network" if network else "; network NOT confined (no seccomp filter here)")


def _confine_files(libc: ctypes.CDLL, folders: Sequence[Path]) -> bool:
    version = libc.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), _VERSION)
    if version < 1:
        return False
    rights = (
        _WRITING | (_LINK_ELSEWHERE if version >= 2 else 0) | (_TRUNCATE if version >= 3 else 0)
    )
    fields = [rights, *([_TCP] if version >= 4 else []), *([_OUTSIDE] if version >= 6 else [])]
    attributes = struct.pack(f"{len(fields)}Q", *fields)
    ruleset = libc.syscall(_CREATE_RULESET, attributes, ctypes.c_size_t(len(attributes)), 0)
    if ruleset < 0:
        return False
    of_files = rights & (1 << 1 | _TRUNCATE)
    for path, allowed in [*((folder, rights) for folder in folders), (Path(os.devnull), of_files)]:
        beneath = os.open(path, os.O_PATH)
        rule = struct.pack("=Qi", allowed, beneath)
        failed = libc.syscall(_ADD_RULE, ruleset, _BENEATH, rule, 0)
        os.close(beneath)
        if failed:
            raise OSError(ctypes.get_errno(), "no rule for Landlock", str(path))
    libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    failed = libc.syscall(_RESTRICT_SELF, ruleset, 0)
    os.close(ruleset)
    return not failed


def _confine_sockets(libc: ctypes.CDLL) -> bool:
    """Refuse sockets but those between processes of this machine."""
    if platform.machine() not in _SOCKET:
        return False
    architecture, make = _SOCKET[platform.machine()]
    refuse = _REFUSE | errno.EACCES
    # Code, jumps if true and if false, constant. The data: number, architecture, ..., arguments.
    program = [
        (_LOAD, 0, 0, 4),
        (_EQUAL, 0, 8, architecture),
        (_LOAD, 0, 0, 0),
        (_AT_LEAST, 6, 0, _X32),
        (_EQUAL, 5, 0, _IO_URING),
        (_EQUAL, 4, 0, _TAKE_DESCRIPTOR),
        (_EQUAL, 0, 2, make),
        (_LOAD, 0, 0, 16),
        (_EQUAL, 0, 1, 1),  # AF_UNIX
        (_RETURN, 0, 0, _ALLOW),
        (_RETURN, 0, 0, refuse),
    ]
    code = ctypes.create_string_buffer(
        b"".join(struct.pack("HBBI", *instruction) for instruction in program)
    )
    header = struct.pack("HxxxxxxP", len(program), ctypes.addressof(code))
    libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    failed = libc.prctl(_SECCOMP, _FILTER, header, 0, 0)
    return not failed
