"""FMUs that harm whoever calls them: the project's own, with a few lines of C in one function."""

import re
import shutil
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import fmpy

from .processes import COMPILER, ROOT, python

NAME = "MinimalObserver"
REFUSALS = {"void": "", "fmi2Component": "NULL", "fmi2Status": "fmi2Error"}


XML = "modelDescription.xml"


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


def compile_library(folder: Path, name: str) -> None:
    """Compile the sources of an unpacked FMU of FMI 2.0 into its library."""
    library = folder / "binaries" / fmpy.platform / f"{name}{fmpy.sharedLibraryExtension}"
    files = ("model", "integrator", "fmi2", "instance")
    command = [COMPILER, "-std=gnu99", "-shared", "-fPIC", "-fvisibility=hidden", "-w"]
    sources = [folder / "sources" / f"{file}.c" for file in files]
    subprocess.run([*command, *sources, "-o", library, "-lm"], check=True)


def hostile(path: Path) -> Path:
    """MinimalObserver that does what HOSTILE in the environment says; see hostile/attack.c."""

    def change(folder: Path) -> None:
        file = folder / "sources" / "fmi2.c"
        attack = (ROOT / "tests" / "hostile" / "attack.c").read_text()
        text, functions = re.subn(
            r"^(fmi2Status|fmi2Component|void) (fmi2\w+)(\([^{;]*\) \{)",
            lambda head: f'{head[0]} if (attack("{head[2]}")) return {REFUSALS[head[1]]};',
            file.read_text(),
            flags=re.MULTILINE,
        )
        assert functions > 30
        file.write_text(attack + text)
        compile_library(folder, NAME)

    return rewritten(ROOT / "fmus" / "fmi2" / f"{NAME}.fmu", path, change)


def own_folder(folder: Path) -> dict[str, str]:
    """Have Python work in a folder, and make its temporary files in `tmp` there."""
    (folder / "tmp").mkdir(exist_ok=True)
    return {"cwd": str(folder), "TMPDIR": str(folder / "tmp")}


def workbench(folder: Path, *arguments: str | Path, **environment: str) -> CompletedProcess[str]:
    """Run the command line with temporary files in a folder, `tmp`."""
    return python("-m", "workbench", *arguments, **own_folder(folder), **environment)
