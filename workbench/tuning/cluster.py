"""Workers of a Dask cluster; needs the extra [cluster]."""

import ctypes
from collections.abc import Sequence
from concurrent.futures import Future
from functools import partial

from distributed import Client, KilledWorker, Worker

from workbench.tuning.cost import Candidate, Job, Verdict
from workbench.tuning.workers import equip, judge

_PATIENCE = 5.0  # [s] for the scheduler to answer

# Settings of glibc's malloc by number, and how high it would raise them by itself [bytes].
_TRIM_THRESHOLD, _MAP_THRESHOLD = (-1, 2**26), (-3, 2**25)


class DaskPool:
    """All workers of a cluster, those that join later included; see Pool.

    Parameters
    ----------
    address : of the scheduler, such as tcp://10.0.0.1:8786.
    timeout : for one candidate [s].
    """

    deaths: tuple[type[BaseException], ...] = (KilledWorker,)

    def __init__(self, job: Job, address: str, timeout: float) -> None:
        self._client = Client(address, timeout=_PATIENCE)
        self._client.register_worker_callbacks(partial(_equip, job, timeout))
        # Impure: what is judged again, after a death, is not to be looked up.
        self._executor = self._client.get_executor(pure=False)
        self.size = len(self._client.scheduler_info()["workers"])

    def submit(self, candidates: Sequence[Candidate]) -> "Future[list[Verdict]]":
        """See Pool."""
        task: Future[list[Verdict]] = self._executor.submit(judge, candidates)
        return task

    def close(self) -> None:
        """See Pool."""
        self._client.close()


def _equip(job: Job, timeout: float, dask_worker: Worker) -> None:
    """Give a worker what it needs, let it keep its memory, and do not look over its shoulder.

    Dask has its workers hand back at once what they free. To get it anew for every piece of a
    recording took a tenth of the time. Its profiler stops a loop every 10 ms to see where it is.
    """
    if (profiler := dask_worker.periodic_callbacks.get("profile")) is not None:
        profiler.stop()
    libc = ctypes.CDLL(None)
    if hasattr(libc, "mallopt"):  # not everywhere is glibc
        for setting, value in (_TRIM_THRESHOLD, _MAP_THRESHOLD):
            libc.mallopt(setting, value)
    equip(job, timeout)
