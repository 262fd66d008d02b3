"""The moving horizon estimator solves its problem: beside the Kalman filter and scipy's solvers.

Two tanks and a leak whose flow is estimated. The linear ones have a voltage as output; in the others
the leak's flow grows with its square and the voltage with the root of the level, but the Jacobian of
the states is constant, so that derivatives of a step are exact.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from workbench.fmu import FMU, Matrix, Vector
from workbench.observers import Estimate
from workbench.observers.kalman import ExtendedKalmanFilter
from workbench.observers.mhe import MovingHorizonEstimator
from workbench.system import System
from workbench.systems import load_system, open_model

pytest.importorskip("casadi")
pytest.importorskip("rumoca")

from workbench import compiler

LIBRARY = """
package Water
  partial model Tanks
    parameter Real area(unit="m2") = 0.5;
    parameter Real pipe(unit="m2/s") = 2e-3;
    parameter Real drain(unit="m2/s") = 1e-3;
    parameter Real leak(unit="m3/s") = 1e-4;
    input Real pump(unit="m3/s");
    input Real dleak(unit="m3/s");
    output Real h1(unit="m", start=1.0, fixed=true, nominal=1.0);
    output Real h2(unit="m", start=0.8, fixed=true, nominal=1.0);
    output Real reading(unit="V");
    output Real lost(unit="m3/s");
  equation
    area*der(h1) = pump - pipe*(h1 - h2);
    area*der(h2) = pipe*(h1 - h2) - drain*h2 - lost;
  end Tanks;
  model Linear
    extends Tanks;
  equation
    reading = 2.0*h2 + 0.4;
    lost = leak + dleak;
  end Linear;
  model Bent
    extends Tanks;
  equation
    reading = 3.0*sqrt(h2);
    lost = 5e3*(leak + dleak)^2;
  end Bent;
end Water;
"""
SYSTEM = """
title = "Two tanks"
reported = ["lost"]
sample_time = "2 s"
models.observer = {{ class = "{model}", fmu = "{model}.fmu" }}
inputs.pump = {{ unit = "m3/s", noise = "1e-5 m3/s", scale = "1e-3 m3/s" }}
outputs.reading = {{ unit = "V", noise = "0.005 V", scale = "2 V" }}
outputs.h1 = {{ unit = "m", noise = "0.01 m", scale = "1 m" }}
states.h1 = {{ walk = "1e-4 m", spread = "0.1 m" }}
states.h2 = {{ walk = "2e-4 m", spread = "0.1 m" }}

[estimated.leak]
correction = "dleak"
unit = "m3/s"
range = ["{low} m3/s", "{high} m3/s"]
walk = "3e-6 m3/s"
spread = "5e-5 m3/s"
useful = "1e-5 m3/s"

[points]
settles = "1 h"
design.inputs = {{ pump = "1e-3 m3/s" }}
"""
STEP = 2.0  # [s]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tanks")
    (folder / "package.mo").write_text(LIBRARY)
    for model in ("Linear", "Bent"):
        path = folder / f"{model}.fmu"
        compiler.build(
            folder / "package.mo", f"Water.{model}", path, platforms=[compiler.native()]
        )
    return folder


def system(folder: Path, model: str, low: float = -1e-2, high: float = 1e-2) -> System:
    path = folder / "system.toml"
    path.write_text(SYSTEM.format(model=model, low=low, high=high))
    return load_system(path)


@pytest.fixture(scope="module")
def linear(folder: Path) -> Iterator[tuple[FMU, System]]:
    known = system(folder, "Linear")
    with open_model(known) as fmu:
        yield fmu, known


def recording(count: int = 120, seed: int = 1) -> tuple[Vector, Matrix, Matrix]:
    """Noisy samples of tanks whose leak opens from 1e-4 to 2.5e-4 m3/s; time, u, y."""
    rng = np.random.default_rng(seed)
    time = STEP * np.arange(count)
    pump = np.where(time % 80.0 < 40.0, 1.4e-3, 0.8e-3)
    h1, h2, y = 0.95, 0.75, np.empty((count, 2))
    for k in range(count):
        y[k] = 2.0 * h2 + 0.4, h1
        leak = 1e-4 if k < count // 2 else 2.5e-4
        between = 2e-3 * (h1 - h2)
        h1 += STEP * (pump[k] - between) / 0.5
        h2 += STEP * (between - 1e-3 * h2 - leak) / 0.5
    return time, pump[:, None], y + rng.normal(size=y.shape) * [0.005, 0.01]


def horizon(
    fmu: FMU, known: System, samples: int, iterations: int = 1
) -> MovingHorizonEstimator:
    gains = MovingHorizonEstimator.reasoned(fmu, known)
    design = {"horizon": np.array([samples]), "iterations": np.array([iterations])}
    gains = type(gains)(gains.estimator, gains.names, gains.values, design, "")
    return MovingHorizonEstimator(fmu, known, gains)


def kalman(fmu: FMU, known: System, samples: tuple[Vector, Matrix, Matrix]) -> Estimate:
    gains = ExtendedKalmanFilter.reasoned(fmu, known)
    return ExtendedKalmanFilter(fmu, known, gains).run(*samples)


@pytest.mark.parametrize("samples", [1, 2, 7, 20, 200])
def test_on_a_linear_model_it_is_the_kalman_filter(
    linear: tuple[FMU, System], samples: int
) -> None:
    expected = kalman(*linear, recording())
    found = horizon(*linear, samples).run(*recording())
    # Rounding of double precision, over the 1e6 that lie between variances of levels and flows.
    scale = np.abs(expected.values).max(axis=0)
    assert_allclose(found.values / scale, expected.values / scale, rtol=0, atol=1e-10)
    assert_allclose(found.sigma, expected.sigma, rtol=1e-10)
    assert_allclose(found.nis[1:], expected.nis[1:], rtol=1e-8, atol=1e-10)
