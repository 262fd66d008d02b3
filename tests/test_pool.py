"""A pool of processes survives what its tasks do, and asks nothing of the program that uses it."""

import gc
import math
import os
import platform
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Future, wait
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from workbench.errors import InputError, WorkerError
from workbench.runtime import pool as pools
from workbench.runtime.pool import Pool

from .processes import LONGEST, comes_true, living, python, running


def pid(state: object) -> int:
    return os.getpid()


def parent(state: object) -> int:
    return os.getppid()


def kill(state: object) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def kill_once(mark: Path) -> int:
    """End the worker, but not the one that tries again."""
    if not mark.exists():
        mark.touch()
        kill(mark)
    return os.getpid()


def blas_threads(state: object) -> list[int]:
    return [library["num_threads"] for library in threadpool_info()]


def refuse(state: object) -> None:
    raise InputError(where="here", found="this", expected="that", remedy="do it")


@contextmanager
def counted(folder: Path) -> Iterator[Path]:
    """Leaves a file for each preparation."""
    (folder / str(os.getpid())).touch()
    yield folder


@pytest.mark.parametrize("isolated", [False, True])
@pytest.mark.parametrize("workers", [1, 2])
def test_results_are_those_of_the_function(workers, isolated):
    with Pool(workers, nullcontext, 2.0, isolated=isolated) as pool:
        assert pool.map(math.pow, range(5)) == [1.0, 2.0, 4.0, 8.0, 16.0]
        assert sorted(pool.completed(math.pow, [3, 1])) == [(0, 8.0), (1, 2.0)]
        assert pool.submit(math.pow, 0.5).result() == math.sqrt(2.0)
        assert (pool.submit(pid).result() == os.getpid()) == (workers == 1 and not isolated)


@pytest.mark.parametrize("isolated", [False, True])
def test_an_error_of_a_task_is_raised_as_it_is_and_costs_no_worker(isolated):
    with Pool(1, nullcontext, None, isolated=isolated) as pool:
        before = pool.submit(pid).result()
        with pytest.raises(InputError, match="found this; expected that"):
            pool.submit(refuse).result()
        assert pool.submit(pid).result() == before


def test_each_worker_is_prepared_once(tmp_path):
    with Pool(2, counted, tmp_path) as pool:
        used = set(pool.map(_name_of_worker, range(50)))
    assert used <= {file.name for file in tmp_path.iterdir()}
    assert len(list(tmp_path.iterdir())) <= 2


def _name_of_worker(folder: Path, number: int) -> str:
    return str(os.getpid())


def test_a_failed_preparation_is_raised_by_every_task():
    with Pool(2, open, "/nowhere/at/all") as pool:
        for _ in range(3):
            with pytest.raises(FileNotFoundError, match="nowhere"):
                pool.submit(pid).result(timeout=LONGEST)


def test_a_task_whose_worker_dies_is_tried_again(tmp_path):
    with Pool(1, nullcontext, tmp_path / "mark", isolated=True) as pool:
        first = pool.submit(pid).result()
        assert pool.submit(kill_once).result() != first


def test_a_task_that_kills_two_workers_is_lost_and_no_other():
    with Pool(2, nullcontext, 2.0) as pool:
        tasks: list[Future[float]] = [pool.submit(math.pow, k) for k in range(30)]
        deadly = pool.submit(kill)
        tasks += [pool.submit(math.pow, k) for k in range(30)]
        with pytest.raises(WorkerError, match="ended its worker, twice"):
            deadly.result()
        assert [task.result() for task in tasks] == [2.0**k for k in range(30)] * 2


def test_a_worker_that_is_killed_while_it_waits_is_replaced():
    with Pool(1, nullcontext, None, isolated=True) as pool:
        first = pool.submit(pid).result()
        os.kill(first, signal.SIGKILL)
        assert pool.submit(pid).result() != first


@pytest.mark.skipif(sys.platform == "win32", reason="there, no server starts workers")
def test_a_server_of_workers_that_has_just_been_killed_is_replaced(monkeypatch):
    monkeypatch.setattr(
        pools, "preload", pools.preload.func
    )  # one that imports little is there soon
    # What starts at once meets a server that refuses, and is not yet known to have ended: every
    # other time, so ten times in a row never.
    for _ in range(10):
        with Pool(1, nullcontext, None, isolated=True) as pool:
            os.kill(pool.submit(parent).result(), signal.SIGKILL)
            with Pool(1, nullcontext, None, isolated=True) as another:
                assert another.submit(pid).result() != os.getpid()
    with Pool(1, nullcontext, None, isolated=True) as last:
        os.kill(last.submit(parent).result(), signal.SIGKILL)  # others have one that imports more


def test_a_task_beyond_the_limit_is_ended_and_the_next_is_done():
    with Pool(1, nullcontext, 600.0, limit=0.2) as pool:
        begin = time.monotonic()
        with pytest.raises(WorkerError, match=r"longer than 0\.2 s"):
            pool.submit(time.sleep).result()
        assert pool.submit(math.sqrt).result() == math.sqrt(600.0)
        assert time.monotonic() - begin < LONGEST  # of 600 s


def test_leaving_a_pool_ends_what_is_under_way_and_drops_what_waits():
    begin = time.monotonic()
    with Pool(1, nullcontext, 600.0, isolated=True) as pool:
        worker = pool.submit(pid).result()
        tasks = [pool.submit(time.sleep) for _ in range(3)]
        while not tasks[0].running():
            wait(tasks[:1], timeout=0.01)
    assert time.monotonic() - begin < LONGEST
    with pytest.raises(WorkerError, match="closed"):
        tasks[0].result()
    assert all(task.cancelled() for task in tasks[1:])
    assert comes_true(lambda: not Path(f"/proc/{worker}").exists())


def test_finishing_keeps_what_is_under_way_and_drops_what_waits():
    with Pool(1, nullcontext, 0.3, isolated=True) as pool:
        tasks = [pool.submit(time.sleep) for _ in range(3)]
        while not tasks[0].running():
            wait(tasks[:1], timeout=0.01)
        pool.finish()
        assert [task.cancelled() for task in tasks] == [False, True, True]
        assert tasks[0].result() is None


@pytest.mark.parametrize("isolated", [False, True])
def test_workers_use_one_blas_thread(isolated):
    with threadpool_limits(2), Pool(1, nullcontext, np.zeros(1), isolated=isolated) as pool:
        assert set(pool.submit(blas_threads).result()) == {1}


def frozen(state: object) -> int:
    return gc.get_freeze_count()


def test_no_worker_searches_for_garbage_in_what_its_server_imported():
    with Pool(1, nullcontext, 0, isolated=True) as pool:
        assert pool.submit(frozen).result() > 1000


def faults(state: object) -> int:
    """Pages that a task was given anew, of 32 MB in pieces that it also needed before."""
    import resource

    for _ in range(3):
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        pieces = [np.ones(2**19) for _ in range(8)]
        del pieces
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another memory allocator")
def test_workers_keep_memory_for_the_next_task():
    # Of 8192 pages of 4 KB.
    with Pool(1, nullcontext, 0, isolated=True) as pool:
        assert pool.submit(faults).result() < 100


# --- programs that use a pool ---

PLAIN = """
import math, os, pickle, sys
from contextlib import nullcontext
from pathlib import Path
from workbench.runtime import pool as pools
from workbench.runtime.pool import Pool

print("program", flush=True)

class Mine:
    pass

with Pool(2, nullcontext, 3.0) as pool:
    # While workers start, the program is still itself for itself.
    pickle.loads(pickle.dumps(Mine()))
    assert Path(__file__).exists() and __name__ == "__main__"
    print(pool.map(math.pow, [1.0, 2.0]), flush=True)
assert sys.modules["__main__"].Mine is Mine
"""

WAITING = """
import time
from contextlib import nullcontext
from workbench.runtime import pool as pools
from workbench.runtime.pool import Pool

def worked(pool):
    for _ in pool.completed(time.sleep, []):
        pass
    tasks = [pool.submit(time.sleep) for _ in range(4)]
    while not tasks[0].running():
        time.sleep(0.01)
    print("under way", flush=True)
    while not tasks[0].done():  # Python does not hear what comes just before a wait without end
        time.sleep(0.01)

with Pool(2, nullcontext, 600.0) as pool:
    try:
        worked(pool)
    except KeyboardInterrupt:
        print("interrupted", flush=True)
"""


def started(program: str, folder: Path) -> "AbstractContextManager[subprocess.Popen[str]]":
    (folder / "program.py").write_text(program)
    return running("program.py", cwd=folder)


def test_a_script_needs_no_guard(tmp_path):
    with started(PLAIN, tmp_path) as program:
        out, errors = program.communicate(timeout=LONGEST)
    assert out == "program\n[3.0, 9.0]\n"
    assert errors == ""
    assert program.returncode == 0


def test_a_program_from_the_prompt_needs_no_guard(tmp_path):
    """As in a notebook, where the program is no file."""
    program = PLAIN.replace('Path(__file__).exists() and __name__ == "__main__"', "True")
    run = python("-c", program, cwd=tmp_path)
    assert (run.stdout, run.stderr) == ("program\n[3.0, 9.0]\n", "")


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_is_the_programs_alone_and_ends_the_pool(tmp_path):
    with started(WAITING, tmp_path) as program:
        assert program.stdout.readline() == "under way\n"
        os.killpg(program.pid, signal.SIGINT)  # as a terminal does: to all processes of the group
        out, errors = program.communicate(timeout=LONGEST)
    assert (out, errors, program.returncode) == ("interrupted\n", "", 0)
    assert comes_true(lambda: not living(program.pid))


def test_workers_end_with_a_program_that_is_killed(tmp_path):
    with started(WAITING, tmp_path) as program:
        assert program.stdout.readline() == "under way\n"
        assert len(living(program.pid)) > 2
        program.kill()
    assert comes_true(lambda: not living(program.pid))
