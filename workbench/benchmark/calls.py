"""Where a model is evaluated while its calls are timed."""

import numpy as np

from workbench.arrays import Matrix
from workbench.models.fmu import FMU
from workbench.observers.operating import settle
from workbench.system.system import System

_POINTS = 64


def points(fmu: FMU, system: System, rng: np.random.Generator) -> Matrix:
    """States and inputs as its sensors show them at the design point, (points, n + m).

    Columns in the model's own order; what is not measured is as it rests, or as it starts.
    """
    x, u = settle(fmu, system, system.design)
    values = {name: fmu.defaults.get(name, 0.0) for name in fmu.inputs}
    values |= dict(zip(fmu.states, x.tolist(), strict=True))
    driven = [*(one.name for one in system.inputs), *system.corrections]
    values |= dict(zip(driven, u.tolist(), strict=True))
    columns = []
    for name in (*fmu.states, *fmu.inputs):
        noise = system.signals[name].noise_at_scale if name in system.signals else 0.0
        columns.append(values[name] + noise * rng.standard_normal(_POINTS))
    return np.column_stack(columns)
