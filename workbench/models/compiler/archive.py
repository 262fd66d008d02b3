"""C sources and description to an FMU file, stage 5 of the compiler.

The same sources give the same bytes: one pinned cross-compiler for every platform, no dates, no
paths, no build identifiers, files in a fixed order.
"""

import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

from workbench.errors import InputError
from workbench.runtime.files import replacing

RUNTIME = Path(__file__).parent / "runtime"

# FMI 2.0 name, FMI 3.0 name, compiler target, library suffix. glibc 2.17 is that of 2012.
PLATFORMS = {
    "linux-x86_64": ("linux64", "x86_64-linux", "x86_64-linux-gnu.2.17", ".so"),
    "linux-aarch64": ("aarch64-linux", "aarch64-linux", "aarch64-linux-gnu.2.17", ".so"),
    "windows-x86_64": ("win64", "x86_64-windows", "x86_64-windows-gnu", ".dll"),
    "macos-x86_64": ("darwin64", "x86_64-darwin", "x86_64-macos", ".dylib"),
    "macos-aarch64": ("aarch64-darwin", "aarch64-darwin", "aarch64-macos", ".dylib"),
}

# Without frame pointers: in calls of a small model, saving them is a tenth of the time.
FLAGS = (
    *("-std=c99", "-O2", "-g0", "-fPIC", "-fvisibility=hidden"),
    *("-ffp-contract=off", "-fomit-frame-pointer"),
)


def native() -> str:
    """Name in PLATFORMS of the machine that this runs on."""
    system = {"Linux": "linux", "Windows": "windows", "Darwin": "macos"}[platform.system()]
    processor = {"amd64": "x86_64", "arm64": "aarch64"}.get(
        platform.machine().lower(), platform.machine().lower()
    )
    return f"{system}-{processor}"


def library_sources(fmi: int) -> list[str]:
    """C files that make up the library, besides headers."""
    return ["model.c", "instance.c", "integrator.c", f"fmi{fmi}.c"]


def digest(parts: Sequence[str | bytes]) -> str:
    """SHA-256 over texts, each with its length, as hexadecimal digits."""
    state = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        state.update(len(data).to_bytes(8, "little") + data)
    return state.hexdigest()


def digest_file(path: Path) -> str:
    """SHA-256 of a file, as `sha256sum` prints it."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def write_sources(folder: Path, fmi: int, generated: dict[str, str], headers: Path) -> None:
    """Lay out everything that compiles to the library: generated code, runtime, FMI headers."""
    folder.mkdir(parents=True)
    for name, text in generated.items():
        (folder / name).write_text(text)
    for file in sorted(RUNTIME.iterdir()):
        if file.suffix == ".h" or file.name in library_sources(fmi):
            shutil.copyfile(file, folder / file.name)
    for file in sorted(headers.glob(f"fmi{fmi}*.h")):
        shutil.copyfile(file, folder / file.name)


def compile_library(sources: Path, library: Path, fmi: int, target: str) -> None:
    """Compile the sources of an FMU to a shared library for `target`; see `compile_files`."""
    libraries = () if "windows" in target else ("-lm",)
    compile_files(sources, library, library_sources(fmi), target, libraries)


def compile_files(
    sources: Path, library: Path, files: Sequence[str], target: str, libraries: Sequence[str]
) -> None:
    """Compile C files of a folder to a shared library for `target`.

    Parameters
    ----------
    libraries : options of the linker, such as "-lm".

    Raises
    ------
    InputError
        With the compiler's output.
    """
    library.parent.mkdir(parents=True, exist_ok=True)
    command = [
        *(sys.executable, "-m", "ziglang", "cc", "-target", target, *FLAGS, "-shared", "-s", "-I."),
        *files,
        *libraries,
        *((f"-Wl,-install_name,@rpath/{library.name}",) if "macos" in target else ()),
        *("-o", os.path.relpath(library, sources)),
    ]
    # Compilers that share objects may wait for each other for ever (ziglang/zig#22453).
    with tempfile.TemporaryDirectory() as objects:
        own = {**os.environ, "ZIG_LOCAL_CACHE_DIR": objects}
        run = subprocess.run(
            command, cwd=sources, env=own, capture_output=True, text=True, check=False
        )
    if run.returncode != 0:
        raise InputError(
            where=f"compiling {sources.name} for {target}",
            found=run.stderr.strip()[-2000:] or f"exit status {run.returncode}",
            expected="C sources that compile without error",
            remedy="report this: generated code should always compile",
        )
    for leftover in library.parent.iterdir():
        if leftover != library:
            leftover.unlink()


def pack(folder: Path, fmu: Path) -> None:
    """Zip `folder` to `fmu`, reproducibly, in one atomic step."""
    with replacing(fmu) as stream, zipfile.ZipFile(stream, "w") as archive:
        for file in sorted(p for p in folder.rglob("*") if p.is_file()):
            entry = zipfile.ZipInfo(file.relative_to(folder).as_posix())
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, file.read_bytes())
