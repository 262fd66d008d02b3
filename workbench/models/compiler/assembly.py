"""An explicit model to an FMU: token, C code, libraries of all platforms and description."""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import fmpy

from workbench.models.compiler.archive import (
    PLATFORMS,
    RUNTIME,
    compile_library,
    digest,
    digest_file,
    library_sources,
    pack,
    write_sources,
)
from workbench.models.compiler.ccode import generate, identifier
from workbench.models.compiler.description import describe
from workbench.models.compiler.explicit import StateSpace

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
    platforms : names from `archive.PLATFORMS`.
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
    token = _token(digest([*parts, str(fmi)]))
    code = generate(space, token)
    name, files = identifier(space.name), library_sources(fmi)
    tool = f"Wheelset observer workbench {version('wheelset-workbench')}"
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
            compile_library(sources, binaries / f"{name}{suffix}", fmi, target)
        (folder / "modelDescription.xml").write_text(description)
        if fmi == 3:
            (sources / "buildDescription.xml").write_text(_build_description(name, files))
        pack(folder, fmu)
    return BuiltFMU(fmu, space.name, fmi, token, digest_file(fmu), space.notes)


def _token(digits: str) -> str:
    """As a GUID, which FMI 2 asks for."""
    groups = (digits[:8], digits[8:12], digits[12:16], digits[16:20], digits[20:32])
    return "{" + "-".join(groups) + "}"


def _build_description(name: str, files: Sequence[str]) -> str:
    listed = "\n".join(f'      <SourceFile name="{file}"/>' for file in files)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<fmiBuildDescription fmiVersion="3.0">\n'
        f'  <BuildConfiguration modelIdentifier="{name}">\n'
        f'    <SourceFileSet language="C99">\n{listed}\n    </SourceFileSet>\n'
        "  </BuildConfiguration>\n</fmiBuildDescription>\n"
    )
