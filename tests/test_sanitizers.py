"""The C inside the FMUs under the address and undefined-behaviour sanitizers."""

import subprocess
import zipfile
from pathlib import Path

import pytest

from .processes import COMPILER

ROOT = Path(__file__).parent.parent
PROGRAMS = Path(__file__).parent / "runtime"
SANITIZE = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@pytest.fixture(scope="module", autouse=True)
def sanitizers(tmp_path_factory) -> None:
    """Skip where a program with sanitizers does not build or run."""
    if COMPILER is None:
        pytest.skip("needs a C compiler")
    folder = tmp_path_factory.mktemp("sanitizers")
    (folder / "empty.c").write_text("int main(void) { return 0; }\n")
    build = subprocess.run([COMPILER, *SANITIZE, "empty.c", "-o", "empty"], cwd=folder, check=False)
    if build.returncode != 0 or subprocess.run([folder / "empty"], check=False).returncode != 0:
        pytest.skip("needs the runtime of the sanitizers")


def unpack_sources(fmi: int, model: str, folder: Path) -> Path:
    with zipfile.ZipFile(ROOT / "fmus" / f"fmi{fmi}" / f"{model}.fmu") as archive:
        archive.extractall(folder, [n for n in archive.namelist() if n.startswith("sources/")])
    return folder / "sources"


def run_life(fmi: int, sources: Path) -> subprocess.CompletedProcess[str]:
    """Compile the sources with `life_fmi<n>.c` and run it; warnings are errors."""
    # -O1: unoptimised, the reference model's long functions fill the stack.
    command = [COMPILER, "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O1", *SANITIZE]
    command += ["-I.", *sorted(p.name for p in sources.glob("*.c"))]
    command += [PROGRAMS / f"life_fmi{fmi}.c", "-o", "life", "-lm"]
    subprocess.run(command, cwd=sources, check=True)
    return subprocess.run([sources / "life"], capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("fmi", "model"),
    [
        (2, "MinimalObserver"),
        (3, "MinimalObserver"),
        *(pytest.param(fmi, "Reference", marks=pytest.mark.long) for fmi in (2, 3)),
    ],
)
def test_a_life_with_right_and_wrong_calls_is_clean(fmi, model, tmp_path):
    run = run_life(fmi, unpack_sources(fmi, model, tmp_path))
    assert (run.returncode, run.stderr) == (0, "")


@pytest.mark.parametrize(
    ("right", "wrong", "found"),
    [
        ("sizeof *i + length + 1", "sizeof *i + length", "heap-buffer-overflow"),
        ("i->importer.release(*saved)", "(void)i", "detected memory leaks"),
        ("i->work[NX + column.row[n]]", "i->work[NX + NW + column.row[n]]", "out of bounds"),
    ],
)
def test_a_planted_fault_is_found(right, wrong, found, tmp_path):
    """The counterexamples: without them a clean run might mean that nothing was looked at."""
    sources = unpack_sources(2, "MinimalObserver", tmp_path)
    code = (sources / "instance.c").read_text()
    assert right in code
    (sources / "instance.c").write_text(code.replace(right, wrong))
    run = run_life(2, sources)
    assert run.returncode != 0
    assert found in run.stderr
