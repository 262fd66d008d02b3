"""Times of calls into the models, through FMI beside plain C."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from workbench.arrays import Matrix
from workbench.models.fmu import FMU
from workbench.observers.operating import settle
from workbench.pages.answer import Answer, Measure
from workbench.system.registry import open_model
from workbench.system.system import System

if TYPE_CHECKING:
    from workbench.models.compiler.benchmark import CallTimes  # of the extra [compiler]

SEED = 1
_POINTS = 64


def time_models(system: System) -> "dict[str, CallTimes]":
    """Time calls into the models of all roles, by the name of the model."""
    from workbench.models.compiler.benchmark import time_sources

    calls = {}
    for role, model in system.models.items():
        with open_model(system, role) as fmu:
            at = points(fmu, system, np.random.default_rng(SEED))
            calls[model.name] = time_sources(fmu.description, at, system.sample_time)
    return calls


def points(fmu: FMU, system: System, rng: np.random.Generator) -> Matrix:
    """States and inputs as its sensors show them at the design point, (points, n + m).

    Columns in the model's own order; what is not measured is as it rests, or as it starts.
    """
    x, u = settle(fmu, system, system.design)
    values = {name: fmu.defaults.get(name, 0.0) for name in fmu.inputs}
    values |= dict(zip(fmu.states, x.tolist(), strict=True))
    driven = [*(signal.name for signal in system.inputs), *system.corrections]
    values |= dict(zip(driven, u.tolist(), strict=True))
    columns = []
    for name in (*fmu.states, *fmu.inputs):
        noise = system.signals[name].noise_at_scale if name in system.signals else 0.0
        columns.append(values[name] + noise * rng.standard_normal(_POINTS))
    return np.column_stack(columns)


def calls_answer(calls: "Mapping[str, CallTimes]") -> Answer:
    """Times of calls, which are those of this machine."""
    headline, ratios = {}, []
    for name, times in calls.items():
        headline[f"{name}: derivatives through FMI"] = Measure(times.derivatives_fmi, "s", "lower")
        headline[f"{name}: Jacobian through FMI"] = Measure(times.jacobian_fmi, "s", "lower")
        headline[f"{name}: Co-Simulation steps"] = Measure(1.0 / times.step, "1/s", "higher")
        ratios.append(f"{times.derivatives_fmi / times.derivatives:.1f} times for {name}")
    return Answer(
        f"Derivatives through FMI take, over a plain call: {', '.join(ratios)}.", headline
    )


def format_calls(calls: "Mapping[str, CallTimes]", step: float) -> str:
    """The measurements as a table."""
    lines = [
        "derivatives: one C call (plain); setting states and inputs, getting derivatives (FMI)",
        "jacobian: full matrix d[der(x), w]/d[x, u] from one C call for its nonzeros (plain);",
        "    setting states and inputs, one directional derivative for each column (FMI)",
        f"{'model':<16} {'evaluation':<12} {'plain':>9} {'FMI':>9}  {'ratio':>5}",
    ]
    for name, times in calls.items():
        ratios = times.ratios()
        for evaluation, plain, through in (
            ("derivatives", times.derivatives, times.derivatives_fmi),
            ("jacobian", times.jacobian, times.jacobian_fmi),
        ):
            spent = f"{1e9 * plain:>6.0f} ns {1e9 * through:>6.0f} ns"
            lines.append(f"{name:<16} {evaluation:<12} {spent}  {ratios[evaluation]:5.2f}")
    for name, times in calls.items():
        rate = f"Co-Simulation steps of {1e3 * step:g} ms per second"
        lines.append(f"{name:<16} {1.0 / times.step:>9.0f} {rate}")
    return "\n".join(lines)
