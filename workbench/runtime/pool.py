"""Worker processes: one kind of pool for everything that takes long.

No worker is a fork of this process, whose threads may hold locks. Where the system can, workers are
forks of a server that has imported what they need; elsewhere (Windows) each starts anew. None runs
the program that made the pool again: a script needs no `if __name__ == "__main__"`. Loky has no
time limits, and one dead worker ends its pool; Pebble's workers import everything anew.
"""

import math
import multiprocessing
import os
import pickle
import signal
import socket
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, as_completed, wait
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from functools import cache
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext, SpawnContext
from multiprocessing.process import BaseProcess
from pathlib import Path
from queue import SimpleQueue
from types import ModuleType
from typing import Any, Generic, Self, TypeVar, TypeVarTuple

from threadpoolctl import threadpool_limits

from workbench.errors import WorkerError
from workbench.runtime.files import end_copy, temporary_folder
from workbench.runtime.supervision import Watch, beat, usual_limits

Given = TypeVar("Given")
State = TypeVar("State")
Item = TypeVar("Item")
Result = TypeVar("Result")
Arguments = TypeVarTuple("Arguments")

_PREPARATION = 600.0  # [s] to load models and compile loops, on a busy machine
_END = 5.0  # [s] from the end of a pipe to that of its process, on a busy machine
_GIVEN = "given.pickle"  # in the folder of a pool
_READY = "workbench.runtime.server_ready"
# A worker needs the same memory again for the next task: glibc is to keep what is freed.
_KEPT = {"MALLOC_MMAP_THRESHOLD_": str(2**25), "MALLOC_TRIM_THRESHOLD_": str(2**28)}
_SECRET_SIZE = 16  # [byte]


@cache
def _served() -> bool:
    """Whether a server can start workers: it listens to a socket, which isolation refuses."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return False
    try:
        socket.socket(socket.AF_UNIX).close()
    except PermissionError:
        return False
    return True


_starting = threading.Lock()


class Pool(Generic[State]):
    """Processes that are prepared once, and work on one task after the other.

    A task is a function of what a worker was prepared with. One whose worker dies is tried again by
    a new worker, which no other task disturbs; if that dies too, its future raises WorkerError, and
    so does one that takes longer than the limit, or does not return from a call. Other tasks never
    notice. Workers leave Ctrl-C to this process and do not outlive it. They, and it beside them,
    use one BLAS thread: threads of BLAS wait for one another, and matrices are small. Leaving the
    pool ends them.

    One worker with no limit, not isolated, is this process: `submit` returns when the task is done.

    Parameters
    ----------
    workers : how many.
    begin : prepares a worker: makes a context of `given` that yields the state. In a process of its
        own the context is not left: the process ends, and its temporary files are removed.
    given : what workers need, pickled once; as tasks, without functions and classes of `__main__`.
    limit : for one task [s]; a task that may hang needs a process.
    isolated : whether even a single worker is a process, for tasks that may crash.

    Examples
    --------
    >>> with Pool(1, open, os.devnull) as pool:
    ...     pool.map(lambda file, size: len(file.read(size)), [1, 2])
    [0, 0]
    """

    def __init__(
        self,
        workers: int,
        begin: Callable[[Given], AbstractContextManager[State]],
        given: Given,
        *,
        limit: float = math.inf,
        isolated: bool = False,
    ) -> None:
        self.workers = workers
        self._limit = limit
        self._closed = False
        self._stack = ExitStack()
        self._state: list[State] = []  # of this process, where it is the worker
        self._tasks: SimpleQueue[tuple[Future[Any], bytes] | None] = SimpleQueue()
        self._unfinished: set[Future[Any]] = set()
        self._running: dict[int, _Worker] = {}
        self._threads: list[threading.Thread] = []
        self._prepare: Callable[[], State] = lambda: self._stack.enter_context(begin(given))
        # Matrices are small: BLAS threads would wait for one another, and for other programs.
        self._stack.enter_context(threadpool_limits(1))
        if workers == 1 and limit == math.inf and not isolated:
            return
        self._folder = self._stack.enter_context(temporary_folder())
        self._secret = os.urandom(_SECRET_SIZE)
        self._call = usual_limits().call
        # In a file, because handing so much to a process that dies as it starts waits for ever.
        content = (dict(os.environ), self._call, begin, given)
        Path(self._folder, _GIVEN).write_bytes(pickle.dumps(content))
        preload(begin.__module__, type(given).__module__)
        for number in range(workers):
            thread = threading.Thread(target=self._attend, args=(number,), daemon=True)
            self._threads.append(thread)
            thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def submit(
        self, function: Callable[[State, *Arguments], Result], *arguments: *Arguments
    ) -> "Future[Result]":
        """Have a worker call function(state, *arguments)."""
        future: Future[Result] = Future()
        if not self._threads:
            future.set_running_or_notify_cancel()
            try:
                if not self._state:
                    self._state.append(self._prepare())
                future.set_result(function(self._state[0], *arguments))
            except Exception as error:
                future.set_exception(error)
            return future
        message = pickle.dumps((function, arguments))
        self._unfinished.add(future)
        future.add_done_callback(self._unfinished.discard)
        self._tasks.put((future, message))
        return future

    def submit_all(
        self, function: Callable[[State, *Arguments], Result], calls: Iterable[tuple[*Arguments]]
    ) -> "list[Future[Result]]":
        """Have workers call function(state, *arguments) for each of many."""
        return [self.submit(function, *arguments) for arguments in calls]

    def completed(
        self, function: Callable[[State, Item], Result], items: Iterable[Item]
    ) -> Iterator[tuple[int, Result]]:
        """Number of each item and function(state, item), as they end.

        Who leaves the loop drops what waits; see `finish` for what is under way.
        """
        if not self._threads:
            for number, item in enumerate(items):
                yield number, self.submit(function, item).result()
            return
        futures = {self.submit(function, item): number for number, item in enumerate(items)}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        finally:
            for future in futures:
                future.cancel()

    def map(self, function: Callable[[State, Item], Result], items: Iterable[Item]) -> list[Result]:
        """function(state, item) of all items, in their order."""
        results = dict(self.completed(function, items))
        return [results[number] for number in range(len(results))]

    def finish(self) -> None:
        """Drop tasks that wait, and wait for those under way."""
        for future in list(self._unfinished):
            future.cancel()
        wait(list(self._unfinished))

    def close(self) -> None:
        """End the workers; tasks that wait are cancelled, those under way fail."""
        self._closed = True
        for future in list(self._unfinished):
            future.cancel()
        for _ in self._threads:
            self._tasks.put(None)
        with _starting:
            for worker in self._running.values():
                worker.kill()
        for thread in self._threads:
            thread.join()
        for worker in self._running.values():
            worker.end()  # or it would write to the folder while that is removed
        self._stack.close()

    def _attend(self, number: int) -> None:
        """See to one worker, in a thread of its own."""
        with suppress(EOFError, OSError):  # the first task tries again, and can say why
            self._start(number)
        while (task := self._tasks.get()) is not None:
            future, message = task
            if not future.set_running_or_notify_cancel():
                continue
            try:
                result, error = self._answer(number, message)
            except Exception as failure:  # of unpickling, whatever that is, is the task's
                result, error = None, failure
            if error is None:
                future.set_result(result)
            else:
                future.set_exception(error)

    def _answer(self, number: int, message: bytes) -> tuple[Any, BaseException | None]:
        """Result or error of a task."""
        ended = ""
        for _ in range(2):
            try:
                worker = self._running.get(number) or self._start(number)
                answer: tuple[Any, BaseException | None] = pickle.loads(
                    worker.ask(message, self._limit)
                )
                return answer
            except TimeoutError as error:
                self._drop(number, kill=True)
                return None, WorkerError(str(error))
            except ForeignDataError as error:
                self._drop(number, kill=True)
                return None, WorkerError(f"a task failed: {error}")
            except (EOFError, OSError):
                if self._closed:
                    return None, WorkerError("the pool was closed")
                ended = self._drop(number)
        return None, WorkerError(f"a task ended its worker, twice: {ended}")

    def _start(self, number: int) -> "_Worker":
        """Start a worker; EOFError or OSError if the system does not, or the pool is closed."""
        with _starting:
            if self._closed:
                raise EOFError
            self._running[number] = _Worker(self._folder, self._secret, self._call)
            return self._running[number]

    def _drop(self, number: int, *, kill: bool = False) -> str:
        """End a worker, whose place the next task fills; says how it ended."""
        with _starting:
            worker = self._running.pop(number, None)
        if worker is None:
            return "before it had begun"
        if kill:
            worker.kill()
        return worker.end()


class ForeignDataError(RuntimeError):
    """Foreign code wrote into a pipe that another process listens to."""


def send_marked(connection: "Connection[bytes, bytes]", secret: bytes, content: bytes) -> None:
    """Send what `receive_marked` takes."""
    connection.send_bytes(secret)
    connection.send_bytes(content)


def receive_marked(connection: "Connection[bytes, bytes]", secret: bytes) -> bytes:
    """Receive what was sent with a secret, so that it may be unpickled.

    Raises
    ------
    ForeignDataError
        If something else was written into the pipe.
    EOFError, OSError
        If the other end was closed.
    """
    try:
        mark = connection.recv_bytes(len(secret))
    except ConnectionError:
        raise
    except OSError:  # another length than that of the secret
        mark = b""
    if mark != secret:
        raise ForeignDataError("a model's own code wrote into files that are not its own")
    return connection.recv_bytes()


class _Worker:
    """A process, and this end of its pipe."""

    def __init__(self, folder: str, secret: bytes, call: float) -> None:
        self._connection, theirs = multiprocessing.Pipe()
        self._ready = False
        self._secret, self._call = secret, call
        heart = Path(folder, f"heart-{os.urandom(8).hex()}")
        self._watch = Watch(heart, call)
        with theirs:
            self._process = _start(_serve, (theirs, folder, secret, heart))

    def ask(self, message: bytes, limit: float) -> bytes:
        """Answer to a task, or why the process could not be prepared for it.

        Raises
        ------
        TimeoutError
            If there is none in time; the message says which limit was passed.
        ForeignDataError
            If it sent something else.
        EOFError, OSError
            If the process died.
        """
        if not self._ready:
            if refusal := self._receive(_PREPARATION):
                self.kill()
                return refusal
            self._ready = True
        self._connection.send_bytes(message)
        return self._receive(limit)

    def kill(self) -> None:
        """End the process."""
        self._process.kill()

    def end(self) -> str:
        """Wait for the end of the process, which is near; says how it came."""
        self._process.join(_END)
        self._process.kill()
        self._process.join()
        code = self._process.exitcode or 0
        return f"by {signal.Signals(-code).name}" if code < 0 else f"with exit status {code}"

    def _receive(self, limit: float) -> bytes:
        end = time.monotonic() + limit
        while not self._connection.poll(min(self._watch.period, max(end - time.monotonic(), 0.0))):
            if self._watch.is_stuck():
                raise TimeoutError(f"a call did not return for {self._call:g} s, and was ended")
            if time.monotonic() >= end:
                raise TimeoutError(f"a task took longer than {limit:g} s")
        return receive_marked(self._connection, self._secret)


def _serve(connection: "Connection[bytes, bytes]", folder: str, secret: bytes, heart: Path) -> None:
    """Work on tasks, in a process of its own."""
    close_servers()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_master, daemon=True).start()
    tempfile.tempdir = folder
    with ExitStack() as stack:
        try:
            environment, call, begin, given = pickle.loads(Path(folder, _GIVEN).read_bytes())
            os.environ.clear()
            os.environ.update(environment)
            beat(heart, call)
            threadpool_limits(1)
            state = stack.enter_context(begin(given))
        except Exception as error:
            send_marked(connection, secret, _packed(None, error))
            return
        send_marked(connection, secret, b"")
        while True:
            try:
                message = connection.recv_bytes()
            except (EOFError, OSError):  # the pool has ended, or foreign code closed its pipe
                os._exit(1)
            try:
                function, arguments = pickle.loads(message)
                answer = _packed(function(state, *arguments), None)
            except Exception as error:
                answer = _packed(None, error)
            end_copy()
            try:
                send_marked(connection, secret, answer)
            except OSError:
                os._exit(1)


def close_servers() -> None:
    """Close pipes to servers of `multiprocessing`, to which foreign code might write."""
    for holder, name in (
        (forkserver._forkserver, "_forkserver_alive_fd"),
        (resource_tracker._resource_tracker, "_fd"),
    ):
        descriptor = getattr(holder, name, None)
        if descriptor is not None:
            os.close(descriptor)
            setattr(holder, name, None)


def _packed(result: Any, error: BaseException | None) -> bytes:
    if error is None:
        return pickle.dumps((result, None))
    error.add_note("in a worker:\n" + "".join(traceback.format_tb(error.__traceback__)))
    try:
        return pickle.dumps((None, error))
    except Exception:  # an error may hold what cannot be pickled
        return pickle.dumps((None, RuntimeError("".join(traceback.format_exception(error)))))


def _end_with_master() -> None:
    if (master := multiprocessing.parent_process()) is not None:
        master.join()
        os._exit(1)


def preload(*modules: str) -> None:
    """Have modules imported for workers to come, while this process does something else.

    The first call in a process decides; see `multiprocessing.set_forkserver_preload`.
    """
    if not _served():
        return
    # The server is to find modules where this process does.
    paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
    place = {"PYTHONPATH": paths, "PYTHONSAFEPATH": "1", **_KEPT}
    with _starting, _hidden_program():
        before = {name: os.environ.get(name) for name in place}
        os.environ |= place
        forkserver.set_forkserver_preload([*modules, _READY])
        forkserver.ensure_running()
        for name, value in before.items():
            del os.environ[name]
            if value is not None:
                os.environ[name] = value


def start(target: Callable[..., None], arguments: tuple[Any, ...]) -> BaseProcess:
    """Start a process that is no fork of this one, and does not run its program."""
    preload(target.__module__)
    with _starting:
        return _start(target, arguments)


def _start(target: Callable[..., None], arguments: tuple[Any, ...]) -> BaseProcess:
    context: ForkServerContext | SpawnContext = (
        multiprocessing.get_context("forkserver")
        if _served()
        else multiprocessing.get_context("spawn")
    )
    until = time.monotonic() + _END
    while True:
        process: BaseProcess = context.Process(target=target, args=arguments, daemon=True)
        try:
            with _hidden_program():
                process.start()
            return process
        except (EOFError, ConnectionError):
            # The server is dying: it refuses, and is replaced once its process has ended.
            if time.monotonic() > until:
                raise
        time.sleep(0.05)


class _Nameless(ModuleType):
    """All of a program but where it comes from, so that nobody can run it again."""

    def __init__(self, program: ModuleType) -> None:
        super().__init__(program.__name__)
        self._program = program

    def __getattr__(self, name: str) -> Any:
        if name == "__file__":
            raise AttributeError(name)
        return getattr(self._program, name)


@contextmanager
def _hidden_program() -> Iterator[None]:
    """Hide this program from processes that start now, and Ctrl-C too.

    They would run the program, to make pools of their own where it has no guard.
    """
    program = sys.modules["__main__"]
    sys.modules["__main__"] = _Nameless(program)
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT]) if _served() else set()
    try:
        yield
    finally:
        sys.modules["__main__"] = program
        if _served():
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


class NoWorkersError(RuntimeError):
    """No worker is left, and none will come; the message says why."""
