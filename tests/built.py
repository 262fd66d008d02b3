"""FMUs of models that tests write, each built once for each state of sources and compiler.

A worker of the suite finds what another one has built, and so does the next run.
"""

from pathlib import Path

from workbench.models import compiler, fmu_cache


def build_here(package: Path, model: str, path: Path, fmi: int = 2) -> None:
    """Write the FMU of a model for this machine."""
    here = compiler.native()
    fmu_cache.fetch(
        fmu_cache.key(package, model, f"FMI {fmi}", here),
        path,
        lambda path: compiler.build(package, model, path, fmi=fmi, platforms=[here]),
    )
