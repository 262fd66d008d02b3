"""An observer of the Modelica library to a Co-Simulation FMU that runs the law sample by sample.

The Python observers take one linearly implicit Euler step per sample. So does the FMU: the compiler
makes C of the model, and `sampled.c` takes the place of the integrator.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

from workbench.compiler import PLATFORMS, BuiltFMU, Law, assemble
from workbench.compiler.explicit import StateSpace, make_explicit
from workbench.compiler.flat import flatten
from workbench.observers import (
    DisturbanceGains,
    DisturbanceObserver,
    ParameterEstimator,
    ParameterGains,
)
from workbench.tuning import gain_names, to_vector

Gains: TypeAlias = DisturbanceGains | ParameterGains

# Modelica class of each estimator that has one.
OBSERVERS = {
    DisturbanceObserver.name: "DisturbanceObserver",
    ParameterEstimator.name: "ParameterEstimator",
}

_LAW = Path(__file__).with_name("sampled.c")

# States by the last part of their name, that of the output of Observers.Sampled and .Applied.
_KINDS = {"held": "TAKEN", "acting": "APPLIED"}


@dataclass(frozen=True)
class ObserverModel:
    """What an FMU of an observer is made of.

    Attributes
    ----------
    package : `package.mo` of the Modelica library.
    model : dotted name of the class, such as WheelsetRig.Observers.DisturbanceObserver.
    gains : what becomes start values of parameters.
    gains_file : text of gains.toml, kept in the FMU.
    """

    package: Path
    model: str
    gains: Gains
    gains_file: str


def build_observer(
    observer: ObserverModel,
    fmu: Path,
    fmi: int,
    report: Callable[[str], None],
    platforms: Sequence[str] = tuple(PLATFORMS),
) -> BuiltFMU:
    """Compile an observer with its gains to a Co-Simulation FMU.

    Parameters
    ----------
    fmu : file to write; written whole or not at all.
    fmi : 2 or 3.
    report : called with the name of each platform when it is about to be compiled.
    platforms : names from `archive.PLATFORMS`.

    Raises
    ------
    InputError
        If the sources have errors.
    """
    space = _with_gains(make_explicit(flatten(observer.package, observer.model)), observer.gains)
    # As in Python: the parameter estimator is quiet at standstill without it.
    tables = _tables(space, sticks=isinstance(observer.gains, DisturbanceGains))
    law = Law(
        source=_LAW,
        tables={"sampled_data.h": tables},
        described=lambda description: _sampled(description, space),
        resources={"gains.toml": observer.gains_file},
    )
    return assemble(space, observer.model, fmu, fmi, platforms, law, report)


def parameter_values(gains: Gains) -> dict[str, float]:
    """Values of the Modelica class's parameters; its gains are named as in gains.toml."""
    values = dict(zip(gain_names(gains), map(float, to_vector(gains)), strict=True))
    return values | {"effectWR": float(gains.effect[0]), "effectDC": float(gains.effect[1])}


def _with_gains(space: StateSpace, gains: Gains) -> StateSpace:
    """The model with gains as start values of its parameters."""
    values = parameter_values(gains)
    names = {variable.name for variable in space.parameters}
    if missing := values.keys() - names:
        raise KeyError(f"{space.name} has no parameter {', '.join(sorted(missing))}")
    parameters = [replace(v, start=values.get(v.name, v.start)) for v in space.parameters]
    return replace(space, parameters=parameters)


def _tables(space: StateSpace, sticks: bool) -> str:
    """Text of sampled_data.h: what the law must know of each state."""
    inputs = {variable.name: i for i, variable in enumerate(space.inputs)}
    states = [variable.name for variable in space.states]
    parameters = [variable.name for variable in space.parameters]
    speeds = [str(states.index(f"plant.{name}")) for name in ("omegaW", "omegaR")]
    radii = [str(parameters.index(f"plant.{name}")) for name in ("rW", "rR")]
    kinds, first, low, high = [], [], [], []
    for state in space.states:
        component, _, name = state.name.rpartition(".")
        kinds.append(_KINDS.get(name, "DYNAMIC"))
        first.append(str(inputs.get(name, -1) if component == "plant" else -1))
        low.append(_limit(state.minimum, -math.inf))
        high.append(_limit(state.maximum, math.inf))
    return "\n".join(
        [
            f"/* What the law of {space.name} must know of each state. */",
            f"static const int sampled_kind[] = {{{', '.join(kinds)}}};",
            f"static const int sampled_first[] = {{{', '.join(first)}}};",
            f"static const double sampled_low[] = {{{', '.join(low)}}};",
            f"static const double sampled_high[] = {{{', '.join(high)}}};",
            f"static const int sampled_sticks = {int(sticks)};",
            f"static const int sampled_speeds[] = {{{', '.join(speeds)}}};",
            f"static const int sampled_radii[] = {{{', '.join(radii)}}};",
            f"static const int sampled_fading = {parameters.index('fadingSpeed')};",
            "",
        ]
    )


def _limit(limit: float | None, default: float) -> str:
    value = default if limit is None else limit
    return repr(value) if math.isfinite(value) else "-INFINITY" if value < 0.0 else "INFINITY"


def _sampled(description: str, space: StateSpace) -> str:
    """The model description without Model Exchange, and with the time from sample to sample."""
    root = ET.fromstring(description)
    for exchange in root.findall("ModelExchange"):
        root.remove(exchange)
    (experiment,) = root.findall("DefaultExperiment")
    experiment.set("stepSize", repr(space.experiment["Interval"]))
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
