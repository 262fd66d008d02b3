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
import tempfile
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

from workbench.errors import InputError
from workbench.runtime.files import end_copy, own_temporary_files

try:
    import resource
except ImportError:  # Windows: there memory is not limited
    resource = None  # type: ignore[assignment]

_DIE_WITH_PARENT, _ADOPT = 1, 36  # PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER of <sys/prctl.h>
_REQUESTS = tuple(
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGTSTP")
    if hasattr(signal, name)  # Windows has not all
)
_PATIENCE = 10  # [s] from a request to end until the end; results are written in less
# [byte] of numpy, SciPy, numba and their threads before any work, at two processors
STARTUP = 350 << 20


@dataclass(frozen=True)
class Limits:
    """What foreign code may use: while it is tried, and for memory and `call` in a command, too."""

    # time of the processor in one call [s]. Calls take microseconds, a start seconds.
    processor: float = 3.0
    # time until the end of all [s], long enough for a machine that has other work to do
    answer: float = 10.0
    # that can be written [bytes]; models hold kilobytes, runtimes that they bring megabytes
    memory: int = 2 << 30
    file: int = 100 << 20  # the largest file that is written [bytes]
    # time in which a call must return while a command runs [s]. The longest of them is a compiled
    # loop over a recording, of minutes for a million samples.
    call: float = 900.0

    def __str__(self) -> str:
        return (
            f"{self.processor:g} s of processor time in one call, {self.answer:g} s in all, "
            f"{self.memory >> 20} MB of memory, files of {self.file >> 20} MB"
        )


_NAMES = {
    "processor": 1,
    "answer": 1,
    "memory": 1 << 20,
    "file": 1 << 20,
    "call": 1,
}  # and their units


def usual_limits() -> Limits:
    """Limits that hold unless others are given: WORKBENCH_TRIAL="processor=20 answer=60".

    The variable of the environment names times in seconds and sizes in MB.
    """
    # WORKBENCH_PROOF is its name before version 0.2.
    text = os.environ.get("WORKBENCH_TRIAL", os.environ.get("WORKBENCH_PROOF", ""))
    given: dict[str, Any] = {}
    for word in text.split():
        name, _, number = word.partition("=")
        try:
            unit = _NAMES[name]
            value = float(number) * unit
            given[name] = value if unit == 1 else int(value)
        except (KeyError, ValueError, OverflowError):
            value = 0.0
        if not 0.0 < value < 2.0**62:
            raise InputError(
                where="environment, WORKBENCH_TRIAL",
                found=f"'{word[:80]}'",
                expected=f"some of {', '.join(_NAMES)}, each =NUMBER above 0 (s or MB)",
                remedy="correct it, for instance to 'processor=20 answer=60'",
            )
    return Limits(**given)


_HEART, _NOTE = "heart", "blamed"  # files of a command, in its temporary folder
_TICKS = 20  # in the time that a call may take


def beat(heart: Path, limit: float) -> None:
    """Have this process show that its calls return: a file's time changes as long as they do.

    Python runs the handler of a signal between calls of foreign code, and while it waits itself.
    """
    if not hasattr(signal, "setitimer"):  # Windows
        return

    def touch(*_: object) -> None:
        with suppress(OSError):
            heart.write_bytes(b"1")  # not os.utime, which isolation refuses

    touch()
    signal.signal(signal.SIGALRM, touch)
    signal.siginterrupt(signal.SIGALRM, False)
    signal.setitimer(signal.ITIMER_REAL, limit / _TICKS, limit / _TICKS)


class Watch:
    """Sees whether the calls of another process return; see `beat`.

    It counts its own looks, so that who is stopped together with it has not missed any.
    """

    def __init__(self, heart: Path, limit: float) -> None:
        self.period = limit / _TICKS  # at which it looks [s]
        self._heart, self._last, self._silent = heart, 0, 0

    def is_stuck(self) -> bool:
        """Look; returns whether a call did not return for as long as it may take."""
        try:
            now = self._heart.stat().st_mtime_ns
        except OSError:  # it has not begun
            return False
        self._silent = self._silent + 1 if now == self._last else 0
        self._last = now
        return self._silent > _TICKS


def memory_limit() -> int | None:
    """Memory that a process may have at most [bytes]; None where the system does not say."""
    if resource is None or sys.platform != "linux":
        return None
    (_, data), (space, _) = map(resource.getrlimit, (resource.RLIMIT_DATA, resource.RLIMIT_AS))
    return min(size for size in (_memory(), data, space) if size != resource.RLIM_INFINITY)


def _memory() -> int:
    """Memory of the machine [bytes]."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def short_memory() -> str:
    """Say that a command has too little memory to start; empty where it has enough.

    Libraries of linear algebra that get none try again for minutes, or end the process.
    """
    limit = memory_limit()
    if limit is None or limit >= STARTUP:
        return ""
    return (
        f"memory is short: {limit >> 20} MB are allowed, and a command takes {STARTUP >> 20} MB to "
        "start. Allow more (ulimit -d, ulimit -v, or limits of the service)"
    )


def limit_memory(size: int) -> tuple[int, int] | None:
    """Limit what this process takes from now on [bytes], if it belongs to a command.

    Returns
    -------
    limits : of before, soft and hard; None where nothing is limited.

    Raises
    ------
    OSError
        If the system does not say what the process has.
    """
    if resource is None or sys.platform != "linux":
        return None
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if hard == resource.RLIM_INFINITY or soft != hard:  # of a notebook, or done before
        return None
    status = Path("/proc/self/status").read_text()
    held = int(status.partition("VmData:")[2].split()[0]) << 10
    resource.setrlimit(resource.RLIMIT_DATA, (min(held + size, hard), hard))
    return soft, hard


@contextmanager
def limited_memory(size: int) -> Iterator[None]:
    """Limit what this process takes meanwhile, see `limit_memory`."""
    before = limit_memory(size)
    try:
        yield
    finally:
        if before is not None:
            resource.setrlimit(resource.RLIMIT_DATA, before)


def supervised(
    work: Callable[[], int],
    tell: Callable[[str], object] = lambda message: print(message, file=sys.stderr),
) -> int:
    """Do work in a child process; returns its status, or 1 if it did not come to its end.

    The status comes with a secret, which no foreign code writes by accident. The child, and what it
    starts, has no more memory than the machine. Signals that ask this process to end or to pause
    are passed on; when the work is over they are left blocked, for a process that ends. Where
    processes cannot be forked (Windows) the work is done in this one.

    Parameters
    ----------
    work : returns a status.
    tell : takes why the work did not come to its end.
    """
    if not hasattr(os, "fork"):
        with own_temporary_files():
            return work()
    try:
        limit = usual_limits().call
    except InputError as error:
        tell(f"error: {error}")
        return 2
    content, stuck, blamed = b"", False, ""
    secret = os.urandom(32)
    # They wait but for while they are passed on: who ended before or after would leave files.
    signal.pthread_sigmask(signal.SIG_BLOCK, _REQUESTS)
    with own_temporary_files() as folder:
        heart = folder / _HEART
        done, status_pipe = os.pipe()
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:  # closed by who started this
                stream.flush()
        parent = os.getpid()
        child = os.fork()
        if child == 0:
            os.close(done)
            _begin(parent)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, _REQUESTS)
            os.set_blocking(status_pipe, False)  # who fills it does not stop us
            beat(heart, limit)
            return _worked(work, status_pipe, secret)
        os.close(status_pipe)
        _control(_ADOPT, 1)
        # The thread that watches starts while requests wait, and so takes none: one that it took as
        # it ends would end this process, which has files to remove.
        with _watching(child, Watch(heart, limit)) as ended, _passing_on(child):
            _, ending = os.waitpid(child, 0)
            if os.WIFSTOPPED(ending):  # a model has the process traced, by us: it stops at signals
                os.kill(child, signal.SIGKILL)
                _, ending = os.waitpid(child, 0)
        stuck = ended.is_set()
        _end_the_rest(child)
        os.set_blocking(done, False)  # a model may have left someone who holds the other end
        with suppress(BlockingIOError):
            while piece := os.read(done, 1 << 16):
                content += piece
        os.close(done)
        with suppress(OSError):
            blamed = (folder / _NOTE).read_text(encoding="utf-8")
    _, ours, status = content.rpartition(secret)
    if ours and len(status) == 1:
        return status[0]
    how = (
        f'stuck: a call did not return for {limit:g} s (WORKBENCH_TRIAL="call={10 * limit:g}" '
        "allows more), and the command was ended"
        if stuck
        else blamed or _describe_end(os.waitstatus_to_exitcode(ending))
    )
    tell(f"error: {how}")
    return 1


@contextmanager
def quiet_panics() -> Iterator[None]:
    """Keep what a panic of foreign code writes to the process's standard error from the user's."""
    if sys.stderr is not None:
        sys.stderr.flush()
    shown = os.dup(2)
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(shown, 2)
        os.close(shown)


@contextmanager
def blaming(error: InputError) -> Iterator[None]:
    """Say what is told if foreign code ends this process meanwhile, where a command is supervised.

    Parameters
    ----------
    error : of what that code reads; it is written as text.
    """
    folder = Path(tempfile.gettempdir())
    note = folder / _NOTE
    if not (folder / _HEART).exists():  # not in a command
        yield
        return
    note.write_text(str(error), encoding="utf-8")
    try:
        yield
    finally:
        note.unlink(missing_ok=True)


@contextmanager
def _watching(child: int, watch: Watch) -> Iterator[threading.Event]:
    """Kill a child whose calls do not return; the event says whether that was so."""
    over, ended = threading.Event(), threading.Event()

    def look() -> None:
        while not over.wait(watch.period):
            if watch.is_stuck():
                ended.set()
                with suppress(ProcessLookupError):
                    os.kill(child, signal.SIGKILL)
                return

    thread = threading.Thread(target=look, daemon=True)
    thread.start()
    try:
        yield ended
    finally:
        over.set()
        thread.join()


def run_program(command: Sequence[str]) -> int:
    """Run a program until it ends, which is asked to when this one is; returns its status."""
    try:
        shown = sys.stdout.fileno()
    except (AttributeError, OSError):  # closed, or not of the system
        shown = None
    group = 0 if os.name == "posix" else None
    with subprocess.Popen(command, stdout=shown, process_group=group) as program:
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
    _set_results_apart()
    _control(_DIE_WITH_PARENT, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)
    if (most := memory_limit()) is not None:
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))

    def leave(number: int, frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    for request in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(request) != signal.SIG_IGN:  # as under nohup
            signal.signal(request, leave)


def _set_results_apart() -> None:
    """Lead what foreign code prints to standard error, and what Python prints where it went.

    Python's own descriptors serve where a model closes those of its standard streams.
    """
    if sys.stdout is None or sys.stderr is None:
        return
    shown, messages = os.dup(1), os.dup(2)
    os.dup2(2, 1)
    buffering = 1 if os.isatty(shown) else -1
    sys.stdout = open(  # noqa: SIM115  # for as long as the process runs
        shown, "w", buffering, encoding=sys.stdout.encoding, errors=sys.stdout.errors
    )
    sys.stderr = open(  # noqa: SIM115
        messages, "w", 1, encoding=sys.stderr.encoding, errors=sys.stderr.errors
    )


def _worked(work: Callable[[], int], status_pipe: int, secret: bytes) -> int:
    """Status of the work, told to the parent, too."""
    try:
        status = work()
    except BaseException as error:
        status = _status(error)
    end_copy()
    with suppress(AttributeError, OSError, ValueError):  # it is closed, or its reader has gone
        sys.stdout.flush()
    with suppress(OSError):  # a model has filled it; the parent says that no status came
        os.write(status_pipe, secret + bytes([status & 0xFF]))
    if hasattr(signal, "alarm"):  # what a model does at the end of a process ends, too
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(_PATIENCE)
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


def _describe_end(status: int) -> str:
    """Say how a process ended that did not come to its end."""
    how = f"killed by {signal.Signals(-status).name}" if status < 0 else f"ended, status {status},"
    limit, by = memory_limit(), ""
    if limit is not None and limit < _memory():
        by = f", or as memory was short, of which {limit >> 20} MB are allowed"
    return (
        f"the command was {how} before it was done: by a model's own code, or from outside{by}. "
        "'workbench fmu check FILE' tries a model call by call"
    )


def _control(option: int, value: int) -> None:
    """Set a property of this process; without effect where the system is not Linux."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446  # the same on every processor
_VERSION, _BENEATH = 1, 1
# Write a file; remove folders and files; make device, folder, file, socket, FIFO, block, link.
_WRITING = 1 << 1 | sum(1 << right for right in range(4, 13))
_LINK_ELSEWHERE, _TRUNCATE = 1 << 13, 1 << 14  # since versions 2 and 3
_TCP = 3  # bind and connect, since version 4
_DEVICES = 1 << 15  # ioctl of devices, since version 5
_OUTSIDE = 3  # abstract sockets and signals, since version 6
_NO_NEW_PRIVILEGES, _SECCOMP, _FILTER = 38, 22, 2  # of prctl

# Numbers of system calls: sockets, modes, owners, times and attributes of files, memory of others.
# Sources: Linux 6.17, arch/x86/entry/syscalls/syscall_64.tbl and scripts/syscall.tbl.
_SINCE_2019 = {425, 438, 452, 463, 466, 469}  # io_uring_setup, pidfd_getfd, fchmodat2, xattrs, attr
_X86_64 = {41, 90, 91, 92, 93, 94, 101, 132, 188, 189, 190, 197, 198, 199, 235, 260, 261, 268, 280}
_ARM64 = {5, 6, 7, 14, 15, 16, 52, 53, 54, 55, 88, 117, 198, 271}
# Architecture as audit names it, calls that are refused, prlimit64, ioctl.
_CALLS = {
    "x86_64": (0xC000003E, _X86_64 | {311} | _SINCE_2019, 302, 16),
    "aarch64": (0xC00000B7, _ARM64 | _SINCE_2019, 261, 29),
}
_SET_ATTRIBUTES = (0x40086602, 0x401C5820)  # FS_IOC_SETFLAGS, FS_IOC_FSSETXATTR
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
        return "in a process of its own; this system has no sandbox"
    libc = ctypes.CDLL(None, use_errno=True)
    writing = _confine_files(libc, folders)
    calls = _confine_calls(libc)
    places = ", ".join(map(str, folders))
    holds = [
        f"writing only below {places}" if writing else "writing NOT restricted (no Landlock here)",
        "no network; no sockets; no change of modes, owners, times or attributes of files, nor of "
        "limits or memory of other processes"
        if calls
        else "network, sockets and modes of files NOT restricted (no seccomp filter here)",
        "reading is not restricted",
    ]
    if os.geteuid() == 0:
        holds.append("run as root: prefer a user of its own")
    return "; ".join(holds)


def _confine_files(libc: ctypes.CDLL, folders: Sequence[Path]) -> bool:
    version = libc.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), _VERSION)
    if version < 1:
        return False
    rights = _WRITING
    for since, right in ((2, _LINK_ELSEWHERE), (3, _TRUNCATE), (5, _DEVICES)):
        rights |= right if version >= since else 0
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


def _confine_calls(libc: ctypes.CDLL) -> bool:
    """Refuse system calls that Landlock does not know."""
    if platform.machine() not in _CALLS:
        return False
    architecture, refused, limits, control = _CALLS[platform.machine()]
    # Code, constant, and where to jump if true and if false; None: on. The data of a call: number,
    # architecture, ..., arguments.
    steps: list[tuple[int, int, str | None, str | None]] = [
        (_LOAD, 4, None, None),
        (_EQUAL, architecture, None, "refuse"),
        (_LOAD, 0, None, None),
        (_AT_LEAST, _X32, "refuse", None),
        *((_EQUAL, number, "refuse", None) for number in sorted(refused)),
        (_EQUAL, limits, "of whom", None),
        (_EQUAL, control, None, "allow"),
        (_LOAD, 24, None, None),
        *((_EQUAL, request, "refuse", None) for request in _SET_ATTRIBUTES),
        (_RETURN, _ALLOW, None, None),
        (_LOAD, 16, None, None),
        (_EQUAL, 0, None, "refuse"),  # of this process itself
        (_RETURN, _ALLOW, None, None),
        (_RETURN, _REFUSE | errno.EACCES, None, None),
    ]
    end = len(steps) - 1
    places = {"refuse": end, "allow": end - 1, "of whom": end - 3}
    code = ctypes.create_string_buffer(
        b"".join(
            struct.pack(
                "HBBI",
                operation,
                *(places[to] - at - 1 if to else 0 for to in (if_true, if_false)),
                constant,
            )
            for at, (operation, constant, if_true, if_false) in enumerate(steps)
        )
    )
    header = struct.pack("HxxxxxxP", len(steps), ctypes.addressof(code))
    libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    failed = libc.prctl(_SECCOMP, _FILTER, header, 0, 0)
    return not failed
