"""Whatever ends a command, it is said, and nothing is left: no file, no process."""

import fcntl
import itertools
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from subprocess import Popen

import pytest

from workbench.models.fmu import FMU
from workbench.runtime import files
from workbench.runtime.files import TemporaryFolder, own_umask

from .hostile_fmus import own_folder, workbench
from .processes import LONGEST, ROOT, comes_true, living, needs_compiler, python, running

CASE = ROOT / "cases" / "01_dry_80_1.5"
ONE_STOP = (
    "simulate",
    CASE,
    "--estimator",
    "open_loop",
    "--workers",
    "1",
    "--json",
    "--out",
    "out",
)
ONE_STOP += ("--fmu",)
linux_only = pytest.mark.skipif(sys.platform != "linux", reason="Landlock and seccomp are Linux's")


@pytest.fixture
def home() -> Iterator[Path]:
    """A folder with a short name, in which there is room for the names of sockets."""
    with tempfile.TemporaryDirectory(prefix="w-", dir="/tmp") as folder:
        yield Path(folder)


def shell(line: str, folder: Path, longest: float = LONGEST) -> subprocess.CompletedProcess[str]:
    """What a shell makes of a line, in a folder, within some seconds."""
    given = {"cwd": folder, "env": {**os.environ, "PYTHONPATH": str(ROOT)}, "timeout": longest}
    return subprocess.run(
        ["bash", "-c", line], capture_output=True, text=True, check=False, **given
    )


def left(folder: Path) -> list[Path]:
    return list((folder / "tmp").iterdir())


# --- models that end the command ---


@needs_compiler
@pytest.mark.parametrize(
    "command",
    [
        ("simulate", CASE, "--out", "out", "--fmu"),
        pytest.param(("observability", CASE, "--out", "out", "--fmu"), marks=pytest.mark.long),
        pytest.param(
            ("diagnose", CASE, ROOT / "cases" / "02_dry_100_2.7", "--out", "out", "--model"),
            marks=pytest.mark.long,
        ),
    ],
)
def test_a_model_that_ends_its_process_does_not_end_a_command_in_silence(
    command, hostile_path, home
):
    # A cache of its own: other tests find the same file sound, which is then not tried again.
    own = {"HOSTILE": "exit fmi2GetReal 2", "XDG_CACHE_HOME": str(home / "cache")}
    run = workbench(home, *command, hostile_path, **own)
    assert run.returncode == 1
    assert "evil.fmu: ended the process with exit status 0 in fmi2GetReal" in run.stderr
    assert len(run.stderr.splitlines()) <= 10
    assert left(home) == []


LATE = {
    "exit": "status 0",
    "crash": "SIGSEGV",
    "scribble_and_leave": "status 0",
    "split": "status 0",
    "eat": "SIGSEGV",
    "beg": "open_loop estimated nothing in any case",
    "hang_at_exit": "a call did not return for 3 s",
    "spin": "a call did not return for 3 s",
    "wait": "a call did not return for 3 s",
    "go": "a model's own code went to another folder, /",
    "close_streams": "error: .*Bad file descriptor",
    "close_files": "before it was done|Bad file descriptor",
    "stopped": "before it was done",
}


# Of each kind of end one is quick.
FURTHER = ("split", "eat", "scribble_and_leave", "hang_at_exit", "wait")


@needs_compiler
@pytest.mark.parametrize(
    ("attack", "how"),
    [pytest.param(*late, marks=[pytest.mark.long] * (late[0] in FURTHER)) for late in LATE.items()],
)
def test_a_model_that_ends_its_process_late_is_told_by_the_process_beside(
    attack, how, hostile_path, home
):
    own = {
        "HOSTILE": f"{attack} fmi2SetReal 1000",  # after the trial, whose calls of it are few
        # A busy machine may compile a loop for longer than that, which would be told alike.
        "WORKBENCH_TRIAL": "memory=768 answer=60" + " call=3" * ("a call did not" in how),
    }
    run = workbench(home, *ONE_STOP, hostile_path, **own)
    assert run.returncode == 1
    assert re.search(how, run.stderr)
    assert "Traceback" not in run.stderr
    assert left(home) == []
    if attack not in ("close_streams", "scribble_and_leave"):  # which reach standard output, too
        document = json.loads(run.stdout)
        assert (document["command"], document["status"]) == ("simulate", 1)
        assert attack != "exit" or "before it was done" in document["error"]["message"]


@needs_compiler
@pytest.mark.parametrize(
    "attack",
    [
        "scribble",
        pytest.param("scribble_and_leave", marks=pytest.mark.long),
        pytest.param("close_files", marks=pytest.mark.long),  # of a command alone it is quick
    ],
)
def test_what_a_model_does_to_all_open_files_is_no_answer_of_a_worker(attack, hostile_path, home):
    cases = (CASE, ROOT / "cases" / "02_dry_100_2.7")
    command = ("simulate", *cases, "--estimator", "open_loop", "--workers", "2", "--out", "out")
    run = workbench(home, *command, "--fmu", hostile_path, HOSTILE=f"{attack} fmi2SetReal 1000")
    assert run.returncode == 1
    lost = "a task ended its worker, twice"
    written = "a model's own code wrote into files that are not its own"
    assert (lost if attack == "close_files" else written) in run.stderr
    assert "Traceback" not in run.stderr
    assert left(home) == []


@needs_compiler
def test_what_a_model_prints_or_sets_is_not_in_the_results(hostile_path, home):
    run = workbench(home, *ONE_STOP, hostile_path, HOSTILE="say_and_hide fmi2SetReal 1000")
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout)["status"] == 0
    summary = home / "out" / "summary.json"
    assert summary.stat().st_mode & 0o777 == 0o666 & ~own_umask()
    assert '"a": "model"' in run.stderr


@needs_compiler
def test_of_a_process_that_a_model_has_doubled_one_tells_the_results(hostile_path, home):
    run = workbench(home, *ONE_STOP, hostile_path, HOSTILE="twice fmi2SetReal 1000")
    assert run.returncode == 0
    assert json.loads(run.stdout)["status"] == 0
    assert "error" not in run.stderr
    assert left(home) == []


@linux_only
@pytest.mark.parametrize("limit", ["d", "v"])
def test_memory_that_is_short_is_told_before_libraries_hang(limit, home):
    """OpenBLAS tries again for minutes to get what it needs, where 150 MB are allowed."""
    run = shell(f"ulimit -{limit} 150000; {sys.executable} -m workbench systems", home, 60.0)
    assert run.returncode == 1
    assert "memory is short: 146 MB are allowed, and a command takes 350 MB" in run.stderr


@linux_only
def test_a_recording_that_does_not_fit_is_refused_before_the_work(home):
    (home / "long").mkdir()
    shutil.copy(CASE / "case.toml", home / "long")
    header, *rows = (CASE / "measured.csv").read_text().splitlines()
    samples = [row.partition(",")[2] for row in rows]
    with (home / "long" / "measured.csv").open("w") as table:
        table.write(f"{header}\n")
        there_and_back = itertools.cycle([*samples, *reversed(samples)])
        for number, row in zip(range(400_000), there_and_back, strict=False):
            table.write(f"{number * 0.005:.3f},{row}\n")
    command = f"{sys.executable} -m workbench simulate long --estimator open_loop --out out"
    run = shell(f"ulimit -d 400000; {command}", home)
    assert run.returncode == 2, run.stderr
    assert "found 400000 samples, whose run takes about 402 MB; expected what fits" in run.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a full device")
@pytest.mark.parametrize("output", [">/dev/full", ">&-", "--json >/dev/full", "--json >&-"])
def test_results_that_cannot_be_printed_are_told(output, home):
    run = shell(f"{sys.executable} -m workbench systems {output}", home)
    assert run.returncode == 1
    assert re.fullmatch(r"error: standard output (takes no more|is closed).*\n", run.stderr)


# Sources at which the front end overflows; the model is in the second line.
OVERFLOWS = {
    "a recursive function": "function f input Real a; output Real b; algorithm b := f(a); end f;\n"
    "model M Real x(start=1.0); equation der(x) = -f(x); end M;",
    "functions of one another": "function f input Real a; output Real b; algorithm b := g(a); end "
    "f; function g input Real a; output Real b; algorithm b := f(a); end g;\n"
    "model M Real x(start=1.0); equation der(x) = -f(x); end M;",
    "a long sum": "\nmodel M Real x(start=1.0); equation der(x) = -x"
    + " + 0.001*x" * 20_000
    + "; end M;",
    "a large array": "\nmodel M Real x(start=1.0); Real a[1000000000]; equation der(x) = -x; "
    "for i in 1:1000000000 loop a[i] = x; end for; end M;",
    "a long loop": "function f input Real a; output Real b; algorithm b := a; "
    "for i in 1:1000000000 loop b := b + a; end for; end f;\n"
    "model M Real x(start=1.0); equation der(x) = -f(x); end M;",
    "a constant of itself": "constant Real a = b; constant Real b = a;\n"
    "model M Real x(start=1.0); equation der(x) = -a*x; end M;",
}


@pytest.mark.skipif(sys.platform != "linux", reason="how an overflow ends a process")
@pytest.mark.parametrize("source", OVERFLOWS)
def test_a_source_that_the_front_end_cannot_bear_is_named_with_its_line(source, home):
    pytest.importorskip("rumoca", reason="needs the extra [compiler]")
    (home / "P.mo").write_text(f"package P {OVERFLOWS[source]}\nend P;\n")
    run = workbench(home, "fmu", "build", "P.mo", "P.M", "--out", "m.fmu")
    assert run.returncode != 0
    # What the front end can tell before it overflows depends on the order in which it looks.
    own = (
        r"P\.M, at which the front end overflows|function 'P\.[fg]', which calls itself"
        "|a loop of 1000000000 turns"
    )
    assert re.match(rf"error: P\.mo:[12]: found ({own}|P\.M .*cyclic dependency)", run.stderr)
    assert "a model's own code" not in run.stderr
    assert not (home / "m.fmu").exists()
    assert left(home) == []


# --- signals ---

IN_A_CLASS = """\
import os, signal, sys, time
from workbench.runtime.supervision import supervised

signal.signal(signal.SIGINT, signal.default_int_handler)  # who runs in the background ignores it


class Named:
    def __set_name__(self, owner, name):
        os.kill(os.getpid(), signal.{request})
        time.sleep(60.0)


def work():
    class Holder:
        member = Named()


sys.exit(supervised(work))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the command is no process of its own")
@pytest.mark.parametrize(("request_", "status"), [("SIGTERM", 143), ("SIGINT", 130)])
def test_who_asks_for_an_end_while_a_module_is_imported_sees_no_traceback(request_, status, home):
    """Python makes another error of what comes while a class names its members."""
    (home / "work.py").write_text(IN_A_CLASS.format(request=request_))
    run = python("work.py", cwd=home)
    assert (run.returncode, run.stderr) == (status, "")


BESIDE_FILES = """\
import os, signal, sys
from workbench.runtime import files
from workbench.runtime.supervision import supervised

{which} = files.{which}


def asked_to_end(*given, **named):
    os.kill(os.getpid(), signal.SIGTERM)
    return {which}(*given, **named)


files.{which} = asked_to_end
sys.exit(supervised(lambda: 0))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the command is no process of its own")
@pytest.mark.parametrize("which", ["_held", "_remove"])
def test_who_asks_for_an_end_while_temporary_files_are_made_or_removed_leaves_none(which, home):
    (home / "work.py").write_text(BESIDE_FILES.format(which=which))
    python("work.py", **own_folder(home))
    assert left(home) == []


BESIDE_THREADS = """\
import os, signal, sys, time
from pathlib import Path
from workbench.runtime.supervision import supervised


def work():
    tasks, deadline = Path(f"/proc/{os.getppid()}/task"), time.monotonic() + 10.0
    while len(others := [t for t in tasks.iterdir() if int(t.name) != os.getppid()]) < 1:
        assert time.monotonic() < deadline
    masks = [(t / "status").read_text().partition("SigBlk:")[2].split()[0] for t in others]
    return sum(not int(mask, 16) >> (signal.SIGTERM - 1) & 1 for mask in masks)


sys.exit(supervised(work))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="no system of /proc")
def test_a_request_to_end_reaches_no_thread_beside_the_one_that_removes_files(home):
    """One that took it as it ends would end the process before its files are removed."""
    (home / "work.py").write_text(BESIDE_THREADS)
    run = python("work.py", cwd=home)
    assert (run.returncode, run.stderr) == (0, "")


@contextmanager
def waiting(folder: Path, hostile_path: Path) -> "Iterator[Popen[str]]":
    """A check that waits for a model, in the middle of its work."""
    plan = {"HOSTILE": "wait fmi2Instantiate 10", "WORKBENCH_TRIAL": "answer=300"}
    check = ("-m", "workbench", "fmu", "check", hostile_path)
    with running(*check, **own_folder(folder), **plan) as command:
        while "serialised" not in (line := command.stdout.readline()):
            assert line, command.communicate()
        assert comes_true(lambda: len(left(folder)) > 0)
        yield command


@needs_compiler
@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize(
    ("number", "status"), [(signal.SIGTERM, 143), (signal.SIGINT, 130), (signal.SIGHUP, 129)]
)
def test_a_command_that_is_asked_to_end_leaves_nothing(number, status, hostile_path, home):
    with waiting(home, hostile_path) as command:
        command.send_signal(number)
        command.communicate(timeout=LONGEST)
    assert command.returncode == status
    assert left(home) == []
    assert comes_true(lambda: not living(command.pid))


@needs_compiler
def test_what_a_killed_command_left_is_removed_by_the_next(hostile_path, home):
    with waiting(home, hostile_path) as command:
        command.kill()
    assert comes_true(lambda: not living(command.pid))
    assert left(home) != []
    assert workbench(home, "fmu", "info", hostile_path).returncode == 0
    assert left(home) == []


def served(session: int) -> list[int]:
    """The server of workers, if it runs, and the workers it has started."""

    def of_server() -> set[int]:
        processes = set()
        for process in living(session):
            with suppress(OSError):  # it ended meanwhile
                if b"multiprocessing.forkserver" in Path(f"/proc/{process}/cmdline").read_bytes():
                    processes.add(process)
        return processes

    # a program that the server's imports run bears the server's name until it is loaded
    seen = of_server()
    time.sleep(0.1)
    return sorted(seen & of_server())


@pytest.mark.parametrize("victim", [pytest.param("server", marks=pytest.mark.long), "worker"])
def test_a_command_goes_on_without_a_process_of_its_pool_and_leaves_nothing(victim, home):
    cases = (CASE, ROOT / "cases" / "02_dry_100_2.7")
    command = ("-m", "workbench", "simulate", *cases, "--estimator", "open_loop", "--workers", "2")
    with running(*command, "--out", "out", **own_folder(home)) as process:
        number = ["server", "worker"].index(victim)
        assert comes_true(lambda: len(served(process.pid)) > number)
        killed = served(process.pid)[number]
        os.kill(killed, signal.SIGSTOP)
        time.sleep(5.0)  # in which it is asked for something, and does not answer
        os.kill(killed, signal.SIGKILL)
        _, printed = process.communicate(timeout=LONGEST)
    assert process.returncode == 0, printed
    assert "Traceback" not in printed
    assert left(home) == []
    assert comes_true(lambda: not living(process.pid))


# --- folders ---


@pytest.fixture
def place(tmp_path, monkeypatch) -> Path:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    files.sweep.cache_clear()
    return tmp_path


def test_folders_that_are_held_or_not_ours_stay(place):
    held, linked, other = place / "workbench-held", place / "workbench-link", place / "else"
    named = place / "workbench-results"  # by someone who keeps them there
    for folder in (held, other, named):
        folder.mkdir()
        (folder / "file").touch()
    for folder in (held, other):
        (folder / ".scratch").touch()
    linked.symlink_to(other)
    lock = os.open(held, os.O_RDONLY)
    fcntl.flock(lock, fcntl.LOCK_EX)
    TemporaryFolder().close()
    assert held.exists()
    assert (other / "file").exists()
    os.close(lock)
    files.sweep.cache_clear()
    TemporaryFolder().close()
    assert not held.exists()
    assert (named / "file").exists()
    assert (other / "file").exists()
    assert linked.is_symlink()


def test_folders_of_living_processes_stay(place):
    with closing(TemporaryFolder()) as mine:
        files.sweep.cache_clear()
        with closing(TemporaryFolder()) as second:
            assert mine.path.exists()
            assert second.path != mine.path
    assert list(place.iterdir()) == []


def test_an_fmu_that_is_refused_or_forgotten_leaves_no_folder(place, minimal_path):
    fmu = FMU(minimal_path)
    assert len(list(place.iterdir())) == 1
    del fmu
    assert list(place.iterdir()) == []


# --- confinement ---


@needs_compiler
@linux_only
def test_an_isolated_model_can_neither_write_elsewhere_nor_reach_a_network(hostile_path, home):
    place = home / "elsewhere"
    command = (*ONE_STOP, hostile_path)
    plan = {"HOSTILE": "touch fmi2SetReal 1000", "PLACE": str(place)}
    free = workbench(home, *command, **plan)
    assert "file open, network open" in free.stderr
    place.unlink()
    confined = workbench(home, *command, "--isolated", **plan)
    assert "file refused, network refused" in confined.stderr
    assert re.search(rf"isolated: writing only below .*{home / 'tmp'}", confined.stderr)
    assert "; no network" in confined.stderr
    assert (free.returncode, confined.returncode) == (0, 0)
    assert not place.exists()
    assert json.loads(confined.stdout)["status"] == 0
    assert left(home) == []


@needs_compiler
@linux_only
def test_an_isolated_model_changes_no_mode_owner_time_attribute_limit_or_socket(hostile_path, home):
    """In workers, whose command does its work, with figures and all."""
    place = home / "file"
    place.touch(0o600)
    cases = (CASE, ROOT / "cases" / "02_dry_100_2.7")
    command = ("simulate", *cases, "--estimator", "open_loop", "--workers", "2", "--isolated")
    plan = {"HOSTILE": "meddle fmi2SetReal 1000", "PLACE": str(place)}
    run = workbench(home, *command, "--out", "out", "--fmu", hostile_path, **plan)
    assert run.returncode == 0, run.stderr
    deeds = ("chmod", "chown", "utimes", "setxattr", "setflags", "prlimit", "socket")
    printed = {line for line in run.stderr.splitlines() if line.endswith((" refused", " DEED"))}
    assert printed == {f"{deed} refused" for deed in deeds}
    assert place.stat().st_mode & 0o777 == 0o600
    assert ("run as root" in run.stderr) == (os.geteuid() == 0)
    assert "no change of modes, owners, times or attributes of files" in run.stderr
    assert (home / "out" / "index.html").exists()
    assert left(home) == []


@linux_only
def test_a_program_that_asks_for_isolation_stays_free_itself(home):
    given = ["simulate", str(CASE), "--estimator", "open_loop", "--workers", "1", "--isolated"]
    program = (
        "from workbench.__main__ import main\n"
        f"status = main({[*given, '--out', 'out']!r})\n"
        "open('mine', 'w').close()\n"
        "raise SystemExit(status)"
    )
    run = python("-c", program, cwd=home)
    assert run.returncode == 0, run.stderr
    assert (home / "mine").exists()
