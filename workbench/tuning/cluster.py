"""Workers of a Dask cluster; needs the extra [cluster]."""

from collections.abc import Sequence
from concurrent.futures import Future
from functools import partial

from distributed import Client, KilledWorker

from workbench.tuning.cost import Candidate, Job, Verdict
from workbench.tuning.workers import equip, judge

_PATIENCE = 5.0  # [s] for the scheduler to answer


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
        self._client.register_worker_callbacks(partial(equip, job, timeout))
        self._executor = self._client.get_executor()
        self.size = len(self._client.scheduler_info()["workers"])

    def submit(self, candidates: Sequence[Candidate]) -> "Future[list[Verdict]]":
        """See Pool."""
        task: Future[list[Verdict]] = self._executor.submit(judge, candidates)
        return task

    def close(self) -> None:
        """See Pool."""
        self._client.close()
