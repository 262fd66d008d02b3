"""FMUs that harm whoever calls them: the project's own, with a few lines of C in one function."""

import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import fmpy
import pytest

from .processes import ending

NAME = "MinimalObserver"
COMPILER = shutil.which("cc") or shutil.which("gcc")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="needs a C compiler")
ROOT = Path(__file__).parents[1]


def rewritten(original: Path, path: Path, change: Callable[[Path], None]) -> Path:
    """Copy of an FMU, changed in its unpacked folder."""
    folder = path.with_suffix("")
    with zipfile.ZipFile(original) as archive:
        archive.extractall(folder)
    change(folder)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.rglob("*")):
            archive.write(file, file.relative_to(folder))
    shutil.rmtree(folder)
    return path


def hostile(path: Path) -> Path:
    """MinimalObserver that does what HOSTILE in the environment says; see hostile/attack.c."""

    def change(folder: Path) -> None:
        file = folder / "sources" / "fmi2.c"
        attack = (ROOT / "tests" / "hostile" / "attack.c").read_text()
        text, functions = re.subn(
            r"^(fmi2Status|fmi2Component|void) (fmi2\w+)(\([^{;]*\) \{)",
            r'\1 \2\3 attack("\2");',
            file.read_text(),
            flags=re.MULTILINE,
        )
        assert functions > 30
        file.write_text(attack + text)
        library = folder / "binaries" / fmpy.platform / f"{NAME}{fmpy.sharedLibraryExtension}"
        sources = [
            file.with_name(f"{one}.c") for one in ("model", "integrator", "fmi2", "instance")
        ]
        command = [COMPILER, "-std=gnu99", "-shared", "-fPIC", "-fvisibility=hidden", "-w"]
        subprocess.run([*command, *sources, "-o", library, "-lm"], check=True)

    return rewritten(ROOT / "fmus" / "fmi2" / f"{NAME}.fmu", path, change)


def workbench(
    folder: Path, *arguments: str | Path, **environment: str
) -> "subprocess.CompletedProcess[str]":
    """Run the command line with temporary files in a folder, `tmp`."""
    with running(folder, *arguments, **environment) as process:
        out, errors = process.communicate(timeout=120)
    return subprocess.CompletedProcess(process.args, process.returncode, out, errors)


@contextmanager
def running(
    folder: Path, *arguments: str | Path, **environment: str
) -> "Iterator[subprocess.Popen[str]]":
    """Run the command line beside the block; see `workbench`."""
    (folder / "tmp").mkdir(exist_ok=True)
    usual = {"TMPDIR": str(folder / "tmp"), "PYTHONPATH": str(ROOT)}
    command = subprocess.Popen(
        [sys.executable, "-m", "workbench", *map(str, arguments)],
        cwd=folder,
        env={**os.environ, **usual, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    with ending(command):
        yield command
