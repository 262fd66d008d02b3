"""Estimators as FMUs for this machine, built once for each state of estimators and compiler."""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

from workbench.models import fmu_cache
from workbench.models.compiler import native
from workbench.observers import Estimator, Gains
from workbench.observers.export import build_observer, model_name

PACKAGE = Path(__file__).parents[1] / "workbench"


@dataclass(frozen=True)
class Exported:
    """An FMU and the Python estimator with the same gains."""

    path: Path
    python: Estimator


def with_all_gains(gains: Gains) -> Gains:
    """Reasoned gains with those that are zero filled in, on dy and on its integral."""
    values = gains.values.copy()
    if gains.estimator == "parameter_estimator":
        L = values.reshape(2, 4)
        L[:, :2] = [[0.2, -0.3], [0.1, -2.0]]
        L[1, 2] = -1.0
    elif gains.estimator == "disturbance_observer":
        L = values[:16].reshape(4, 4)
        L[:, 2:] = 0.3 * L[:, :2]
    return gains.with_values(values)


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


class Instance:
    """A Co-Simulation instance of either version, ready to step, with all outputs or some."""

    def __init__(self, path: Path, outputs: Sequence[str] = ()) -> None:
        description = fmpy.read_model_description(str(path))
        listed = {v.name: v for v in description.modelVariables}
        chosen = outputs or [name for name, v in listed.items() if v.causality == "output"]
        self.inputs = [v.valueReference for v in listed.values() if v.causality == "input"]
        self.outputs = [listed[name].valueReference for name in chosen]
        self._fmi3 = description.fmiVersion.startswith("3")
        self._folder = fmpy.extract(str(path))
        self.fmi = (FMU3Slave if self._fmi3 else FMU2Slave)(
            guid=description.guid,
            modelIdentifier=description.coSimulation.modelIdentifier,
            unzipDirectory=self._folder,
            instanceName="estimator",
        )
        self.fmi.instantiate()
        if not self._fmi3:
            self.fmi.setupExperiment(startTime=0.0)
        self.fmi.enterInitializationMode()
        self.fmi.exitInitializationMode()

    def step(self, sample: Sequence[float], start: float, size: float) -> list[float]:
        """The estimate of a sample."""
        set_, get = (
            (self.fmi.setFloat64, self.fmi.getFloat64)
            if self._fmi3
            else (self.fmi.setReal, self.fmi.getReal)
        )
        set_(self.inputs, list(sample))
        self.fmi.doStep(currentCommunicationPoint=start, communicationStepSize=size)
        return list(get(self.outputs))

    def close(self) -> None:
        self.fmi.terminate()
        self.fmi.freeInstance()
        shutil.rmtree(self._folder)


@contextmanager
def instance(path: Path, outputs: Sequence[str] = ()) -> Iterator[Instance]:
    fmu = Instance(path, outputs)
    try:
        yield fmu
    finally:
        fmu.close()


def run_fmu(
    path: Path, time: np.ndarray, u: np.ndarray, y: np.ndarray, outputs: Sequence[str] = ()
) -> np.ndarray:
    """Outputs after each sample: one communication step for each."""
    # The last step has no sample after it; any size will do.
    ends = np.append(time[1:], time[-1] + 0.005) - time[0]
    with instance(path, outputs) as fmu:
        return np.array(
            [
                fmu.step(sample, start, end - start)
                for sample, start, end in zip(np.hstack([u, y]), time - time[0], ends, strict=True)
            ]
        )


def run_python(estimator: Estimator, time: np.ndarray, u: np.ndarray, y: np.ndarray) -> np.ndarray:
    """All that an estimate has, in the order of the FMU's outputs."""
    estimate = estimator.run(time, u, y)
    return np.column_stack([estimate.values, estimate.sigma, estimate.probability, estimate.nis])
