"""Workers of a Dask cluster; needs the extra [cluster]."""

import ctypes
import faulthandler
import threading
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import AbstractContextManager, ExitStack
from functools import partial
from typing import Any, Generic, NamedTuple, TypeVar, TypeVarTuple

from distributed import Client, KilledWorker, Worker, get_worker
from threadpoolctl import threadpool_limits

from workbench.errors import WorkerError

Given = TypeVar("Given")
State = TypeVar("State")
Result = TypeVar("Result")
Arguments = TypeVarTuple("Arguments")

_PATIENCE = 5.0  # [s] for the scheduler to answer
_PREPARATION = 600.0  # [s] to load the model and compile its loop, on a busy machine

# Settings of glibc's malloc by number, and how high it would raise them by itself [bytes].
_TRIM_THRESHOLD, _MAP_THRESHOLD = (-1, 2**26), (-3, 2**25)


class _Ready(NamedTuple):
    """What a worker was prepared with; its threads work one at a time."""

    stack: ExitStack
    state: Any
    limit: float
    turn: threading.Lock


class DaskPool(Generic[State]):
    """All workers of a cluster, those that join later included; see `workbench.pool.Pool`.

    Parameters
    ----------
    address : of the scheduler, such as tcp://10.0.0.1:8786.
    """

    def __init__(
        self,
        address: str,
        begin: Callable[[Given], AbstractContextManager[State]],
        given: Given,
        limit: float,
    ) -> None:
        self._client = Client(address, timeout=_PATIENCE)
        self._client.register_worker_callbacks(partial(_prepare, begin, given, limit))
        # Impure: what is done again, after a death, is not to be looked up.
        self._executor = self._client.get_executor(pure=False)

    def submit(
        self, function: Callable[[State, *Arguments], Result], *arguments: *Arguments
    ) -> "Future[Result]":
        """See Pool; the cluster itself tries again what a worker died with."""
        answer: Future[Result] = Future()
        task = self._executor.submit(_work, function, arguments)
        task.add_done_callback(partial(_hand_over, answer))
        answer.add_done_callback(lambda one: task.cancel() if one.cancelled() else None)
        return answer

    def close(self) -> None:
        """See Pool."""
        self._client.close()


def _hand_over(answer: "Future[Any]", task: "Future[Any]") -> None:
    if task.cancelled():
        answer.cancel()
    if not answer.set_running_or_notify_cancel():
        return
    match task.exception():
        case None:
            answer.set_result(task.result())
        case KilledWorker() as error:
            answer.set_exception(WorkerError(f"a task ended its workers ({error})"))
        case error:
            answer.set_exception(error)


def _prepare(
    begin: Callable[[Any], AbstractContextManager[Any]],
    given: Any,
    limit: float,
    dask_worker: Worker,
) -> None:
    """Prepare a worker, let it keep its memory, and do not look over its shoulder.

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
        before.stack.close()
    faulthandler.dump_traceback_later(_PREPARATION, exit=True)
    stack = ExitStack()
    dask_worker.workbench = _Ready(
        stack, stack.enter_context(begin(given)), limit, threading.Lock()
    )
    faulthandler.cancel_dump_traceback_later()


def _work(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    """Do a task in a worker, which ends if that takes longer than the limit."""
    ready: _Ready = get_worker().workbench
    with ready.turn:
        faulthandler.dump_traceback_later(ready.limit, exit=True)
        try:
            return function(ready.state, *arguments)
        finally:
            faulthandler.cancel_dump_traceback_later()
