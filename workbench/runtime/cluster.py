"""Workers of a Dask cluster; needs the extra [cluster]."""

import asyncio
import ctypes
import faulthandler
import hashlib
import logging
import math
import pickle
import threading
import time
from collections.abc import Callable, Mapping, Sequence, Set
from concurrent.futures import CancelledError, Future
from contextlib import AbstractContextManager, ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic, NamedTuple, TypeVar, TypeVarTuple

import cloudpickle
import distributed
from distributed import Client, KilledWorker, Worker, get_worker
from threadpoolctl import threadpool_limits

from workbench.errors import InputError, WorkerError
from workbench.runtime import installation
from workbench.runtime.installation import difference, fingerprint
from workbench.runtime.pool import NoWorkersError

cloudpickle.register_pickle_by_value(installation)  # for workers that may lack it

Given = TypeVar("Given")
State = TypeVar("State")
Result = TypeVar("Result")
Arguments = TypeVarTuple("Arguments")

_ANSWER = 5.0  # [s] for the scheduler to answer
_SILENCE = 30.0  # [s] after which one that does not is dead: a machine may be busy
_PATIENCE = 30.0  # [s] in which a cluster starts a worker
_PERIOD = 0.5  # [s] between two looks at who is there
_TRIALS = 3  # workers that a task may end, as of Dask's own
_PACKAGES = ("numpy", "scipy", "numba", "llvmlite", "fmpy")  # that compute
_PREPARATION = 600.0  # [s] to load the model and compile its loop, on a busy machine
# Calls in one task at most: scheduler and client take 4 ms for a task, beside 40 ms of a candidate.
_BATCH = 16

_LOG = logging.getLogger("distributed.client")

# Settings of glibc's malloc by number, and how high it would raise them by itself [bytes].
_TRIM_THRESHOLD, _MAP_THRESHOLD = (-1, 2**26), (-3, 2**25)


class _Ready(NamedTuple):
    """What a worker was prepared with; its threads work one at a time."""

    stack: ExitStack
    state: Any
    limit: float
    turn: threading.Lock


@dataclass(eq=False)
class _Task:
    """What was asked for, and where it may be done."""

    function: Callable[..., Any]
    calls: Sequence[tuple[Any, ...]]  # arguments of the function, once for each answer
    answers: "Sequence[Future[Any]]"
    workers: Set[str]  # that may do it, by address
    done: Any = None  # what the cluster makes of it
    tried: int = 0  # how often all of its workers went away


class DaskPool(Generic[State]):
    """Workers of a cluster, those that join later included; see `workbench.runtime.pool.Pool`.

    A worker gets work once it has proven that it runs the same code with the same packages, and
    that it has what was sent to it. Others are told to `warn` and left alone.

    Parameters
    ----------
    address : of the scheduler, such as tcp://10.0.0.1:8786.
    modules : whose sources must be the same, beside those of the workbench.
    patience : to wait for a first worker, or for another when all are gone [s].

    Raises
    ------
    OSError
        If there is no scheduler.
    InputError
        If there are no workers, or none of them may work.
    """

    def __init__(
        self,
        address: str,
        begin: Callable[[Given], AbstractContextManager[State]],
        given: Given,
        limit: float,
        *,
        modules: Sequence[str] = (),
        patience: float = _PATIENCE,
        warn: Callable[[str], None] = lambda message: None,
    ) -> None:
        self._address, self._given = address, pickle.dumps((begin, given, limit))
        self._warn, self._patience = warn, patience
        self._asked = (["workbench", *modules], _PACKAGES)
        self._ready: dict[str, str] = {}  # process of each worker that may work, by address
        self._refused: dict[str, str] = {}  # why others may not, by process
        self._tasks: dict[Future[Any], _Task] = {}
        self._lock = threading.RLock()  # answers call back
        self._lost = ""
        self._closed = threading.Event()
        self._client = Client(address, timeout=_ANSWER)
        # A scheduler that dies is told once and in words.
        self._loudness = _LOG.level
        _LOG.setLevel(logging.CRITICAL)
        try:
            self._await_worker()
        except BaseException:
            self._client.close()
            _LOG.setLevel(self._loudness)
            raise
        self._watch = threading.Thread(target=self._attend, daemon=True)
        self._watch.start()

    def submit(
        self, function: Callable[[State, *Arguments], Result], *arguments: *Arguments
    ) -> "Future[Result]":
        """See Pool; the cluster itself tries again what a worker died with.

        A task that no worker is left for raises NoWorkersError.
        """
        return self.submit_all(function, [arguments])[0]

    def submit_all(
        self, function: Callable[[State, *Arguments], Result], calls: Sequence[tuple[*Arguments]]
    ) -> "list[Future[Result]]":
        """The same of many calls, several in a task.

        Each task takes half of a worker's share of what is left, so that all end together. Source:
        C. D. Polychronopoulos, D. J. Kuck (1987), Guided self-scheduling, IEEE Trans. Comput. 36,
        1425-1439.
        """
        answers: list[Future[Result]] = [Future() for _ in calls]
        with self._lock:
            if self._lost:
                for answer in answers:
                    answer.set_exception(NoWorkersError(self._lost))
                return answers
            shares, first = 2 * max(len(self._ready), 1), 0
            while first < len(calls):
                end = first + min(_BATCH, math.ceil((len(calls) - first) / shares))
                self._add(function, calls[first:end], answers[first:end])
                first = end
        for answer in answers:
            answer.add_done_callback(self._forget)
        return answers

    def close(self) -> None:
        """See Pool."""
        self._closed.set()
        self._watch.join()
        self._client.close()
        _LOG.setLevel(self._loudness)

    def _add(
        self,
        function: Callable[..., Any],
        calls: Sequence[tuple[Any, ...]],
        answers: "Sequence[Future[Any]]",
    ) -> None:
        task = _Task(function, calls, answers, set(self._ready))
        self._tasks |= dict.fromkeys(answers, task)
        self._send(task)

    def _send(self, task: _Task) -> None:
        """Hand a task to the cluster; impure: what is done again is not to be looked up."""
        try:
            task.done = self._client.submit(
                _work, task.function, task.calls, pure=False, workers=list(task.workers)
            )
            task.done.add_done_callback(partial(self._hand_over, task))
        except Exception:  # whatever a client without a scheduler raises; the watch sees it, too
            task.done = None

    def _hand_over(self, task: _Task, done: "distributed.Future[Any]") -> None:
        if done is not task.done:
            return  # another worker does it by now
        try:
            error = self._await_answer(done.exception)
            results = self._await_answer(done.result) if error is None else []
        except CancelledError:
            return  # the scheduler was gone: the watch sends the task again, or tells that
        match error:
            case None:
                for answer, result in zip(task.answers, results, strict=True):
                    self._settle(answer, result)
            case KilledWorker():
                self._give_up(task, WorkerError(f"a task ended its workers ({error})"))
            case _:
                for answer in task.answers:
                    self._settle(answer, error)

    def _await_answer(self, ask: Callable[..., Any]) -> Any:
        """What the cluster answers, as long as there may be an answer.

        Of a scheduler that went away a client may wait for ever, in the one thread that hands over
        the answers of all clients of a process, and that the interpreter's end waits for.
        """
        while not (self._lost or self._closed.is_set()):
            with suppress(TimeoutError):
                return ask(timeout=_ANSWER)
        raise CancelledError

    def _give_up(self, task: _Task, error: WorkerError) -> None:
        """Answer a call that ended its workers; of several, each is tried by itself."""
        with self._lock:
            if len(task.answers) == 1:
                self._settle(task.answers[0], error)
                return
            for call, answer in zip(task.calls, task.answers, strict=True):
                if not answer.done():
                    self._add(task.function, [call], [answer])

    def _settle(self, answer: "Future[Any]", result: Any) -> None:
        """Answer a call, once, unless nobody waits for it any more."""
        with self._lock:
            if answer.done() or not answer.set_running_or_notify_cancel():
                return
            if isinstance(result, BaseException):
                answer.set_exception(result)
            else:
                answer.set_result(result)

    def _forget(self, answer: "Future[Any]") -> None:
        with self._lock:
            task = self._tasks.pop(answer, None)
        if task is None or not all(other.done() for other in task.answers):
            return
        if task.done is not None and answer.cancelled():
            with suppress(Exception):  # a scheduler that is gone has forgotten it
                task.done.cancel()

    def _await_worker(self) -> None:
        """Wait for a first worker that may work."""
        deadline = time.monotonic() + self._patience
        while True:
            self._admit(self._processes())
            if self._ready:
                return
            if self._refused or time.monotonic() > deadline:
                raise InputError(
                    where=f"cluster {self._address}",
                    found="; ".join(self._refused.values()) or "no workers",
                    expected="workers with the same code and packages as here, and with memory "
                    "for the recordings",
                    remedy="install the same state of the project there, and start workers with "
                    f"'dask worker {self._address}'",
                )
            time.sleep(_PERIOD)

    def _attend(self) -> None:
        """Admit who joins, send tasks of those who left to others, and tell when all are lost."""
        alone = answered = time.monotonic()
        while not self._closed.wait(_PERIOD):
            try:
                if self._client.status != "running":
                    raise OSError("no connection")
                self._admit(self._processes())
            except Exception as error:  # of many kinds, and some pass
                silent = time.monotonic() - answered > _SILENCE
                if self._client.status == "closed" or silent:
                    self._lose(f"the scheduler at {self._address} does not answer ({error})")
                    return
                continue
            answered = time.monotonic()
            self._move_tasks()
            if self._ready:
                alone = time.monotonic()
            elif time.monotonic() - alone > self._patience:
                self._lose(f"all workers of the cluster at {self._address} are gone")
                return

    def _processes(self) -> dict[str, str]:
        """Process of each worker by address; a worker that is started again has another one."""
        # Not of `scheduler_info`: what it asks for, the client's own look without workers replaces.
        asked = partial(self._client.scheduler.identity, n_workers=-1)
        workers = self._client.sync(asked, callback_timeout=_ANSWER)["workers"]
        return {address: str(worker["id"]) for address, worker in workers.items()}

    def _admit(self, present: Mapping[str, str]) -> None:
        """Have workers that are new prove themselves, and forget those that are gone."""
        self._ready = {a: p for a, p in self._ready.items() if present.get(a) == p}
        known = {*self._ready.values(), *self._refused}
        new = [address for address, process in present.items() if process not in known]
        if not new:
            return
        ours = fingerprint(*self._asked)
        shown = self._client.run(fingerprint, *self._asked, workers=new, on_error="return")
        equal = []
        for address, theirs in shown.items():
            if isinstance(theirs, dict) and not (other := difference(ours, theirs)):
                equal.append(address)
            else:
                reason = other if isinstance(theirs, dict) else repr(theirs)
                self._refuse(address, present[address], reason)
        digest = hashlib.sha256(self._given).hexdigest()
        if equal:
            ready = self._client.run(_prepare, self._given, workers=equal, on_error="return")
            for address, answer in ready.items():
                if answer == digest:
                    self._ready[address] = present[address]
                else:
                    self._refuse(address, present[address], f"what it was sent ended in {answer!r}")

    def _refuse(self, address: str, process: str, reason: str) -> None:
        self._refused[process] = f"a worker at {address} that may not work: {reason}"
        self._warn(f"found {self._refused[process]}; it gets no work")

    def _move_tasks(self) -> None:
        """Send tasks whose workers are all gone, or that were lost, to those that are there."""
        if not self._ready:
            return
        with self._lock:
            tasks = list(dict.fromkeys(self._tasks.values()))
        for task in tasks:
            if not task.workers & set(self._ready):
                task.tried += 1
            elif task.done is not None and task.done.status != "cancelled":
                continue
            before, task.workers = task.done, set(self._ready)
            if task.tried > _TRIALS:
                self._give_up(task, WorkerError("a task ended all its workers"))
                continue
            self._send(task)
            if before is not None:
                before.cancel()

    def _lose(self, reason: str) -> None:
        """Tell all who wait, and all who will, that nothing comes any more."""
        with self._lock:
            self._lost = reason
            for answer in list(self._tasks):
                self._settle(answer, NoWorkersError(reason))


async def _prepare(content: bytes, dask_worker: Worker) -> str:
    """Prepare a worker, in a thread: one that does not answer for half a minute is dropped."""
    return await asyncio.to_thread(_make_ready, content, dask_worker)


def _make_ready(content: bytes, dask_worker: Worker) -> str:
    """Prepare a worker, let it keep its memory, do not look over its shoulder; hash of `content`.

    Dask has its workers hand back at once what they free. To get it anew for every piece of a
    recording took a tenth of the time. Its profiler stops a loop every 10 ms to see where it is.
    """
    if (profiler := dask_worker.periodic_callbacks.get("profile")) is not None:
        profiler.stop()
    libc = ctypes.CDLL(None)
    if hasattr(libc, "mallopt"):  # not everywhere is glibc
        for setting, value in (_TRIM_THRESHOLD, _MAP_THRESHOLD):
            libc.mallopt(setting, value)
    # Matrices are small: with a pool of BLAS threads each, workers wait for one another.
    threadpool_limits(1)
    before: _Ready | None = getattr(dask_worker, "workbench", None)
    if before is not None:
        with before.turn:  # what it works on for another client needs the model
            before.stack.close()
    begin, given, limit = pickle.loads(content)
    stack = ExitStack()
    faulthandler.dump_traceback_later(_PREPARATION, exit=True)
    try:
        state = stack.enter_context(begin(given))
    finally:  # or one that could not be prepared would end its process later, whatever it does then
        faulthandler.cancel_dump_traceback_later()
    dask_worker.workbench = _Ready(stack, state, limit, threading.Lock())
    return hashlib.sha256(content).hexdigest()


def _work(function: Callable[..., Any], calls: Sequence[tuple[Any, ...]]) -> list[Any]:
    """Results or errors of calls in a worker, which ends if one takes longer than the limit."""
    ready: _Ready = get_worker().workbench
    results: list[Any] = []
    with ready.turn:
        for arguments in calls:
            faulthandler.dump_traceback_later(ready.limit, exit=True)
            try:
                results.append(function(ready.state, *arguments))
            except Exception as error:
                results.append(error)
            finally:
                faulthandler.cancel_dump_traceback_later()
    return results
