"""Estimators as FMUs for this machine, built once for each state of estimators and compiler."""

from dataclasses import dataclass
from pathlib import Path

from workbench.models import fmu_cache
from workbench.models.compiler import native
from workbench.observers import Estimator
from workbench.observers.export import build_observer, model_name

PACKAGE = Path(__file__).parents[1] / "workbench"


@dataclass(frozen=True)
class Exported:
    """An FMU and the Python estimator with the same gains."""

    path: Path
    python: Estimator


def write_fmu(path: Path, estimator: Estimator, fmi: int = 2) -> Path:
    """Build an estimator as an FMU."""
    files = [PACKAGE / "models" / "native.py", *(PACKAGE / "observers").rglob("*.[pch]*")]
    texts = [file.read_text() for file in sorted(files) if file.suffix in (".py", ".c", ".h")]
    parts = model_name(estimator), estimator.fmu.sha256, str(estimator.gains.summary()), str(fmi)
    texts.append(estimator.system.source.read_text())
    fmu_cache.fetch(
        fmu_cache.key(estimator.system.library, *texts, *parts),
        path,
        lambda path: build_observer(estimator, path, fmi, platforms=[native()]),
    )
    return path
