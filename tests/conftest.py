"""What several test files share: the repository's own FMUs, cases and sources."""

import fcntl
import gc
import json
import multiprocessing.util
import os
import pickle
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any, TypeVar

import fmpy
import lxml.html
import pytest
from threadpoolctl import threadpool_limits

from workbench import __main__ as program
from workbench.cli import simulate as command
from workbench.diagnosis import build_everything, read_effects
from workbench.models.fmu import FMU
from workbench.models.modelica import read_library
from workbench.recordings.case import Case, read_case
from workbench.recordings.datasets import write_cases
from workbench.runtime import pool as pools
from workbench.runtime.pool import Pool
from workbench.system.registry import load_system, open_model
from workbench.system.system import System
from workbench.system.template import write_system
from workbench.tuning import Evaluator, Job, Problem, pose, tunable

# Before they are imported, for asserts in them to tell values as those of the tests do.
pytest.register_assert_rewrite("tests.case_folders", "tests.page_rules", "tests.runtime_instances")

from .hostile_fmus import hostile  # noqa: E402
from .page_rules import script  # noqa: E402
from .processes import LONGEST  # noqa: E402
from .runtime_instances import Fmu, compile_model  # noqa: E402
from .systems import TRAIN, WHEELSET  # noqa: E402

ROOT = Path(__file__).parent.parent
Result = TypeVar("Result")

# Else each run, its workers and each program that tests start compile all modules of the
# repository anew, and rewrite the asserts of all tests: a third of what collecting takes.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# Its sockets stay where the first of them was, which may be no folder of one test: that has a long
# name, and goes.
multiprocessing.util.get_temp_dir()


def pytest_collection_finish() -> None:
    """Modules and tests are no garbage: to look through them now and then took a tenth of all."""
    gc.freeze()


# What workers of pools import most. Else the first pool of a session, which may need nothing,
# would decide that all later ones import everything anew: 1.7 s of a processor for each worker.
MOST = (
    *("workbench.observers.report", "workbench.observers.simulation", "workbench.diagnosis.laws"),
    *("workbench.models.loops_ready", "scipy.signal"),
)


@pytest.fixture(scope="session", autouse=True)
def workers_begin_with_most() -> Iterator[None]:
    preload = partial(pools.preload, *MOST)
    with pytest.MonkeyPatch.context() as patch:
        for module in (program, pools, command):
            patch.setattr(module, "preload", preload)
        yield


@pytest.fixture(scope="session", autouse=True)
def one_blas_thread() -> Iterator[None]:
    """Tests run side by side: threads that wait for one another take the time of others."""
    with threadpool_limits(1):
        yield


@pytest.fixture(scope="session")
def once(tmp_path_factory) -> Callable[[str, Callable[[Path], Result]], Result]:
    """Gives what is made in a new folder, which the first worker that needs it does for all."""
    place = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        place = place.parent
    shelf = place / "once"
    shelf.mkdir(exist_ok=True)

    def get(name: str, make: Callable[[Path], Result]) -> Result:
        folder, kept = shelf / name, shelf / f"{name}.pickle"
        with (shelf / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not kept.exists():
                shutil.rmtree(folder, ignore_errors=True)  # of a worker that failed in it
                folder.mkdir()
                part = kept.with_suffix(".part")
                part.write_bytes(pickle.dumps(make(folder)))
                part.rename(kept)
        return pickle.loads(kept.read_bytes())

    return get


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def minimal_path() -> Path:
    return ROOT / "fmus" / "fmi2" / "MinimalObserver.fmu"


@pytest.fixture(scope="session")
def reference_path() -> Path:
    return ROOT / "fmus" / "fmi2" / "Reference.fmu"


@pytest.fixture(scope="session")
def system() -> System:
    return WHEELSET


@pytest.fixture(scope="session")
def train() -> System:
    return TRAIN


@pytest.fixture(scope="session")
def tank(tmp_path_factory) -> System:
    """The tank that `workbench new` writes, with an inflow and a level, sampled each 0.5 s."""
    folder = tmp_path_factory.mktemp("systems") / "tank"
    write_system(folder)
    return load_system(folder)


@pytest.fixture
def minimal(minimal_path) -> Iterator[FMU]:
    with FMU(minimal_path) as fmu:
        yield fmu


@pytest.fixture(scope="module")
def fmu(minimal_path) -> Iterator[FMU]:
    """The observer model of the wheelset, as tests of a file leave it to each other."""
    with FMU(minimal_path) as fmu:
        yield fmu


@pytest.fixture(scope="session")
def dry_case(system) -> Case:
    return read_case(ROOT / "cases" / "03_dry_120_3.6", system)


@pytest.fixture(scope="session")
def published(root) -> Callable[[str], Path]:
    """Finds the folder of a published set; without it the test is skipped."""

    def folder_of(name: str) -> Path:
        folder = root.parent / "shared" / "recordings" / "real" / name
        if not folder.exists():
            pytest.skip("the recordings are not at hand")
        return folder

    return folder_of


@pytest.fixture(scope="session")
def published_cases(published, once) -> Callable[[str, str], Path]:
    """Makes the case folders of a system from a published set."""

    def made(system: str, name: str) -> Path:
        recordings = published(name)

        def write(folder: Path) -> Path:
            write_cases(system, recordings, folder / "cases")
            return folder / "cases"

        return once(f"{system} of {name}", write)

    return made


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Programs that a test starts hear Ctrl-C and a lost terminal, also where the suite does not.

    A shell without job control has what it starts in the background ignore the one, nohup the
    other, and that is handed on to every program started from there.
    """
    heard = {signal.SIGINT: signal.default_int_handler, signal.SIGHUP: signal.SIG_DFL}
    before = {number: signal.signal(number, handler) for number, handler in heard.items()}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


# --- tuning ---


@pytest.fixture(scope="session")
def stop_beginnings(system) -> list[Case]:
    """6 s each of three stops: first pressure and what follows."""
    names = ("03_dry_120_3.6", "08_wet_120_3.6", "10_wet_100_2.7_rev")
    return [read_case(ROOT / "cases" / n, system).part(slice(700, 1900)) for n in names]


@pytest.fixture(scope="session")
def prepare(system) -> Callable[[str, Sequence[Case]], Problem]:
    """Prepares the tuning of an estimator over cases as they were recorded."""

    def prepared(name: str, cases: Sequence[Case]) -> Problem:
        problem = pose(system, name, cases, {})
        cls = tunable(system, name)
        with open_model(system, cls.role) as model:
            space = cls.space(model, system, problem.job.gains, slowest=1 / 40, fastest=200.0)
        return replace(problem, space=space)

    return prepared


@pytest.fixture(scope="session")
def problem(prepare, stop_beginnings) -> Problem:
    """Tuning of the disturbance observer."""
    return prepare("disturbance_observer", stop_beginnings)


@pytest.fixture
def inline() -> Iterator[Callable[[Job], Pool[Evaluator]]]:
    """Opens pools of this process alone."""
    with ExitStack() as stack:
        yield lambda job: stack.enter_context(Pool(1, Evaluator, job))


@pytest.fixture
def pool(inline, problem) -> Pool[Evaluator]:
    return inline(problem.job)


# --- foreign FMUs ---


@pytest.fixture(scope="session")
def hostile_path(once) -> Path:
    """An FMU that does what HOSTILE in the environment says."""
    return once("hostile", lambda folder: hostile(folder / "evil.fmu"))


# --- the C runtime ---


@pytest.fixture(scope="session")
def open_fmu(once) -> Callable[..., Fmu]:
    """Opens an instance of a model; compiles each library once."""

    @cache
    def compiled(model: str, version: int) -> Path:
        platform = fmpy.platform if version == 2 else fmpy.platform_tuple
        library = Path("binaries", platform, f"{model}{fmpy.sharedLibraryExtension}")

        def build(folder: Path) -> Path:
            compile_model(model, version, folder / library)
            return folder

        return once(f"{model}{version}", build)

    def open_(model: str, version: int, slave: bool = True, **options: str | bool) -> Fmu:
        return Fmu(compiled(model, version), model, version, slave, **options)

    return open_


# --- diagnosis ---


@pytest.fixture(scope="session")
def everything(system, once) -> Path:
    """The observer model of the wheelset with every effect at zero."""

    def build(folder: Path) -> Path:
        library = read_library(system.library)
        effects = read_effects(library, "MinimalObserver")
        build_everything(system, library, effects, folder / "AllEffects.fmu")
        return folder / "AllEffects.fmu"

    return once("everything", build)


# --- results of a command ---


@pytest.fixture(scope="session")
def of_a_stop(once) -> Path:
    """One estimator on one recorded stop, through the command line."""

    def simulate(folder: Path) -> Path:
        case = str(ROOT / "cases" / "01_dry_80_1.5")
        out = folder / "out"
        assert program.main(["simulate", case, "--estimator", "ekf", "--out", str(out)]) == 0
        return out

    return once("results of a stop", simulate)


@pytest.fixture(scope="module")
def summary(results) -> dict[str, Any]:
    """Of the `results` that a file has."""
    return json.loads((results / "summary.json").read_text())


@pytest.fixture(scope="module")
def page(results) -> Any:
    return lxml.html.fromstring((results / "index.html").read_bytes())


# --- pages ---

# Set before the page's own scripts, for a probe to report.
COLLECT = """<script>
const errors = [];
for (const name of ["error", "securitypolicyviolation"]) {
  addEventListener(name, (event) => errors.push(`${event.message ?? event.violatedDirective}`));
}
</script>"""
ANSWER = script("answer")


@pytest.fixture(scope="session")
def probe(tmp_path_factory) -> Callable[..., dict[str, Any]]:
    """Opens a page as a file in headless Chromium, with a script that fills `told`.

    What needs the samples of figures goes into a function `then`. A window is 500 px wide at least.
    """
    chromium = shutil.which("chromium")
    if chromium is None:
        pytest.skip("no chromium")

    def opened(page: Path, script: str, width: int = 1200) -> dict[str, Any]:
        folder = tmp_path_factory.mktemp("browser")
        begin = "<script>\n(async () => {\nconst told = {};\nlet then;\n"
        probing = f"{begin}{script}\n{ANSWER}</body>"
        text = page.read_text().replace("<head>", "<head>" + COLLECT).replace("</body>", probing)
        (folder / "index.html").write_text(text)
        run = subprocess.run(
            [
                chromium,
                *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic"),
                *("--no-first-run", "--disable-background-networking"),
                *("--disable-component-update", "--disable-sync", f"--window-size={width},900"),
                *("--enable-logging=stderr", "--virtual-time-budget=10000", "--dump-dom"),
                f"--user-data-dir={folder / 'profile'}",
                (folder / "index.html").as_uri(),
            ],
            capture_output=True,
            text=True,
            timeout=LONGEST,
            check=True,
        )
        assert not [line for line in run.stderr.splitlines() if "CONSOLE" in line]
        answer = lxml.html.fromstring(run.stdout.encode()).get_element_by_id("probe")
        return json.loads(answer.text_content())

    return opened


_NARROW = script("narrow")


@pytest.fixture(scope="session")
def narrow(probe) -> Callable[[Path], None]:
    """Asks that a screen of 320 px shows all of a page, in letters of the usual size."""

    def asked(page: Path) -> None:
        shown = probe(page, _NARROW, width=400)
        assert shown["errors"] == []
        assert shown["sideways"] == []
        assert shown["cut"] == []
        assert shown["drawn"]
        for units, pixels in shown["drawn"]:
            assert pixels <= 296
            assert pixels >= 0.98 * units  # one unit is one pixel

    return asked
