"""An explicit model to an FMU file, stage 5 of the compiler.

Token, C code, libraries of all platforms, and description. The same sources give the same bytes:
one pinned cross-compiler for every platform, no dates, no paths, no build identifiers, files in a
fixed order.
"""

import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import fmpy

from workbench.errors import InputError
from workbench.models.compiler.ccode import generate, identifier
from workbench.models.compiler.description import describe
from workbench.models.compiler.explicit import StateSpace
from workbench.models.description import OWN_TOOL
from workbench.runtime.files import replacing
from workbench.runtime.resources import own_version

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
_HEADERS = Path(fmpy.__file__).parent / "c-code"


@dataclass(frozen=True)
class BuiltFMU:
    """A built FMU and what made it; `notes` are what the user should know, a sentence each."""

    path: Path
    model: str
    fmi: int
    token: str
    sha256: str
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class SteppingLaw:
    """What steps a model in place of the integrator.

    Attributes
    ----------
    sources : C files by the name of the file of the runtime that they take the place of.
    tables : text by name of the headers that it includes.
    described : turns the description of the plain model into that of the stepped one.
    resources : text by name of files that the FMU holds for people.
    """

    sources: Mapping[str, Path]
    tables: Mapping[str, str]
    described: Callable[[str], str]
    resources: Mapping[str, str]


def assemble(
    space: StateSpace,
    fmu: Path,
    fmi: int,
    platforms: Sequence[str],
    law: SteppingLaw | None = None,
    report: Callable[[str], None] = lambda platform: None,
) -> BuiltFMU:
    """Write an FMU.

    Parameters
    ----------
    space : whose name is the dotted one of the model.
    fmu : file to write; written whole or not at all.
    fmi : 2 or 3.
    platforms : names from `PLATFORMS`.
    law : what steps it, if not the integrator of the runtime.
    report : called with the name of each platform when it is about to be compiled.

    Raises
    ------
    InputError
        If the C does not compile.
    """
    # The token must change with anything that changes the FMU's behaviour, and be in the code.
    draft = generate(space, "")
    parts: list[str | bytes] = [draft.header, draft.source]
    parts += law.tables.values() if law else []
    parts += [file.read_bytes() for file in sorted(RUNTIME.glob("*.[ch]"))]
    parts += [file.read_bytes() for file in law.sources.values()] if law else []
    digits = digest([*parts, str(fmi)])  # as a GUID, which FMI 2 asks for
    ends = ((0, 8), (8, 12), (12, 16), (16, 20), (20, 32))
    token = f"{{{'-'.join(digits[first:end] for first, end in ends)}}}"
    code = generate(space, token)
    name, files = identifier(space.name), library_sources(fmi)
    tool = f"{OWN_TOOL} {own_version()}"
    description = describe(space, code, token, fmi, tool, files)
    generated = {"model.c": code.source, "model_data.h": code.header}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / name
        sources = folder / "sources"
        write_sources(sources, fmi, {**generated, **(law.tables if law else {})}, _HEADERS)
        if law:
            # Under the names of files that they replace, so that the list of sources stays right.
            for replaced, file in law.sources.items():
                (sources / replaced).write_bytes(file.read_bytes())
            description = law.described(description)
            (folder / "resources").mkdir()
            for resource, text in law.resources.items():
                (folder / "resources" / resource).write_text(text)
        for platform in platforms:
            report(platform)
            fmi2_name, fmi3_name, target, suffix = PLATFORMS[platform]
            binaries = folder / "binaries" / (fmi2_name if fmi == 2 else fmi3_name)
            libraries = () if "windows" in target else ("-lm",)
            compile_files(sources, binaries / f"{name}{suffix}", files, target, libraries)
        (folder / "modelDescription.xml").write_text(description)
        if fmi == 3:
            (sources / "buildDescription.xml").write_text(_build_description(name, files))
        pack(folder, fmu)
    return BuiltFMU(fmu, space.name, fmi, token, digest_file(fmu), space.notes)


def _build_description(name: str, files: Sequence[str]) -> str:
    listed = "\n".join(f'      <SourceFile name="{file}"/>' for file in files)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<fmiBuildDescription fmiVersion="3.0">\n'
        f'  <BuildConfiguration modelIdentifier="{name}">\n'
        f'    <SourceFileSet language="C99">\n{listed}\n    </SourceFileSet>\n'
        "  </BuildConfiguration>\n</fmiBuildDescription>\n"
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
