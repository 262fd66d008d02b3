"""Modelica to FMU: flatten, make explicit, generate C, describe, compile and pack.

This package needs the extra `[compiler]`; running FMUs does not.
"""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

from workbench.errors import InputError
from workbench.models import fmu_cache
from workbench.models.compiler.assembly import (
    PLATFORMS,
    RUNTIME,
    BuiltFMU,
    SteppingLaw,
    assemble,
    digest,
    digest_file,
    native,
)
from workbench.models.compiler.explicit import make_explicit
from workbench.models.compiler.flat import flatten
from workbench.models.description import read_description
from workbench.models.modelica import files, packages
from workbench.runtime.files import write_json, write_whole

__all__ = [
    "PLATFORMS",
    "BuiltFMU",
    "SteppingLaw",
    "assemble",
    "build",
    "build_all",
    "differences",
    "native",
    "source_hash",
]

FMI_VERSIONS = (2, 3)


def source_hash(*libraries: Path) -> str:
    """SHA-256 over all files of libraries, of those that they use, and of the compiler."""
    here = Path(__file__).parent
    used = dict.fromkeys(package for library in libraries for package in packages(library))
    folders = [(package.parent, files(package)) for package in used]
    folders.append((here, tuple(sorted([*here.glob("*.py"), *RUNTIME.glob("*.[ch]")]))))
    parts: list[str | bytes] = []
    for root, inside in folders:
        for file in inside:
            parts += [file.relative_to(root).as_posix(), file.read_bytes()]
    return digest(parts)


def build(
    package: Path,
    model: str,
    fmu: Path,
    *,
    fmi: int = 2,
    platforms: Sequence[str] = tuple(PLATFORMS),
) -> BuiltFMU:
    """Compile a Modelica model to an FMU (Model Exchange and Co-Simulation).

    Parameters
    ----------
    package : `package.mo` of the library.
    model : dotted name of the model.
    fmu : file to write; written whole or not at all.
    fmi : 2 or 3.
    platforms : names from `assembly.PLATFORMS`.

    Raises
    ------
    InputError
        If the sources have errors or the model is not one this compiler treats.
    """
    if fmi not in (2, 3):
        raise InputError(
            where="fmi", found=str(fmi), expected="2 or 3", remedy="choose one of the two"
        )
    if unknown := [p for p in platforms if p not in PLATFORMS]:
        raise InputError(
            where="platforms",
            found=", ".join(unknown),
            expected=", ".join(PLATFORMS),
            remedy="choose from the list",
        )
    return assemble(make_explicit(flatten(package, model)), fmu, fmi, platforms)


def build_all(models: Mapping[Path, Sequence[str]], folder: Path) -> list[BuiltFMU]:
    """Build models for FMI 2.0 and 3.0 into `folder`, and their manifest.

    Files in `folder` change only when all of them have been built. What this machine has built of
    these very sources is taken from where built FMUs are kept.

    Parameters
    ----------
    models : dotted names by library, its `package.mo`.
    """
    with tempfile.TemporaryDirectory() as scratch:
        built = [
            _kept_build(
                package, model, Path(scratch) / f"fmi{fmi}" / f"{model.rpartition('.')[2]}.fmu", fmi
            )
            for fmi in FMI_VERSIONS
            for package, names in models.items()
            for model in names
        ]
        manifest = {
            "source_sha256": source_hash(*models),
            "compiler": {name: version(name) for name in ("rumoca", "casadi", "ziglang", "fmpy")},
            "fmus": {
                b.path.relative_to(scratch).as_posix(): {
                    "model": b.model,
                    "fmi": f"{b.fmi}.0",
                    "token": b.token,
                    "sha256": b.sha256,
                }
                for b in built
            },
        }
        write_json(Path(scratch) / "manifest.json", manifest)
        for file in sorted(p for p in Path(scratch).rglob("*") if p.is_file()):
            write_whole(folder / file.relative_to(scratch), file.read_bytes())
    return [replace(b, path=folder / b.path.relative_to(scratch)) for b in built]


def _kept_build(package: Path, model: str, fmu: Path, fmi: int) -> BuiltFMU:
    """Build for every platform, once for each state of the sources."""
    fmu.parent.mkdir(exist_ok=True)
    key = fmu_cache.key(package, model, f"FMI {fmi}", *PLATFORMS)
    fmu_cache.fetch(key, fmu, lambda path: build(package, model, path, fmi=fmi))
    return BuiltFMU(fmu, model, fmi, read_description(fmu).token, digest_file(fmu))


def differences(models: Mapping[Path, Sequence[str]], folder: Path) -> list[str]:
    """Compare what the sources give with what `folder` holds; returns the differences.

    Parameters
    ----------
    models : see `build_all`.
    """
    with tempfile.TemporaryDirectory() as scratch:
        build_all(models, Path(scratch))
        fresh = {p.relative_to(scratch): digest_file(p) for p in _files(Path(scratch))}
        held = {p.relative_to(folder): digest_file(p) for p in _files(folder)}
    return [
        *(f"{folder / name} is missing" for name in sorted(fresh.keys() - held.keys())),
        *(
            f"{folder / name} is not built from anything"
            for name in sorted(held.keys() - fresh.keys())
        ),
        *(
            f"{folder / name} does not match its sources"
            for name in sorted(fresh.keys() & held.keys())
            if fresh[name] != held[name]
        ),
    ]


def _files(folder: Path) -> list[Path]:
    return sorted(p for p in folder.rglob("*") if p.is_file())
