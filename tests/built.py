"""Machines that tests write; FMUs are built once for each state of sources and compiler.

A worker of the suite finds what another one has built, and so does the next run.
"""

from pathlib import Path

from workbench.models import compiler, fmu_cache
from workbench.system.registry import load_system
from workbench.system.system import System


def build_here(package: Path, model: str, path: Path, fmi: int = 2) -> None:
    """Write the FMU of a model for this machine."""
    here = compiler.native()
    fmu_cache.fetch(
        fmu_cache.key(package, model, f"FMI {fmi}", here),
        path,
        lambda path: compiler.build(package, model, path, fmi=fmi, platforms=[here]),
    )


def declare(folder: Path, library: str, system: str, **fmus: str) -> System:
    """Write the library and the system file of a machine, build its FMUs, and read it.

    Parameters
    ----------
    fmus : model of each FMU, by the name of its file.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "package.mo").write_text(library)
    for name, model in fmus.items():
        build_here(folder / "package.mo", model, folder / f"{name}.fmu")
    (folder / "system.toml").write_text(system)
    return load_system(folder)
