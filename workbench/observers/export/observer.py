"""An observer of the Modelica library to a Co-Simulation FMU that runs the law sample by sample.

The Python observers take one linearly implicit Euler step per sample. So does the FMU: the compiler
makes C of the model, and `sampled.c` takes the place of the integrator.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from workbench.errors import InputError, unknown_name
from workbench.models.compiler import PLATFORMS, BuiltFMU, SteppingLaw, assemble
from workbench.models.compiler.explicit import StateSpace, make_explicit
from workbench.models.compiler.flat import flatten
from workbench.observers import Estimator, Gains
from workbench.observers.export.description import co_simulated
from workbench.system.system import System

_LAW = Path(__file__).with_name("sampled.c")
_HALF = "fadingHalf"  # parameter of the class: level of the signal that feedback fades with
_PLANT = "plant"  # component of the class that is the model of the machine

# States by the last part of their name, that of the output of Observers.Sampled and .Applied.
_KINDS = {"held": "TAKEN", "acting": "APPLIED"}


@dataclass(frozen=True)
class ObserverModel:
    """What an FMU of an observer is made of.

    Attributes
    ----------
    system : whose library has the class.
    kind : the estimator that it is.
    gains : what becomes start values of parameters.
    gains_file : text of gains.toml, kept in the FMU.
    """

    system: System
    kind: type[Estimator]
    gains: Gains
    gains_file: str

    @property
    def model(self) -> str:
        """Dotted name of the class."""
        return f"{self.system.library.parent.name}.{self.system.export.classes[self.kind.name]}"


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
        If the sources have errors, or the system has an input that is held.
    """
    if held := [signal.name for signal in observer.system.inputs if signal.held]:
        raise InputError(
            where=f"{observer.system.source}, [export.classes]",
            found=f"a class of {observer.kind.name}, and the input {held[0]} that is held",
            expected="inputs that are not, as the FMU of a class takes those of the step's end",
            remedy=f"leave {observer.kind.name} out of [export.classes]: its step is then "
            "translated from Python, which holds them",
        )
    space = _with_gains(make_explicit(flatten(observer.system.library, observer.model)), observer)
    law = SteppingLaw(
        sources={"integrator.c": _LAW},
        tables={"sampled_data.h": _tables(space, observer)},
        described=lambda text: co_simulated(text, space.experiment["Interval"]),
        resources={"gains.toml": observer.gains_file},
    )
    return assemble(space, observer.model, fmu, fmi, platforms, law, report)


def parameter_values(gains: Gains, system: System) -> dict[str, float]:
    """Values of the Modelica class's parameters.

    Its gains are named as in gains.toml, constants of the design by quantity, such as `effect_mu`.
    """
    values = dict(zip(gains.names, map(float, gains.values), strict=True))
    for name, constants in gains.design.items():
        for quantity, value in zip(system.estimated, constants, strict=True):
            values[f"{name}_{quantity.name}"] = float(value)
    return values | ({_HALF: system.fading.half} if system.fading else {})


def _with_gains(space: StateSpace, observer: ObserverModel) -> StateSpace:
    """The model with gains as start values of its parameters."""
    values = parameter_values(observer.gains, observer.system)
    names = {variable.name for variable in space.parameters}
    if missing := sorted(values.keys() - names):
        raise unknown_name(
            missing[0],
            names,
            where=observer.model,
            found=f"no parameter '{missing[0]}'",
            expected=f"parameters {', '.join(values)}, as gains are named",
            remedy="rename the parameter of the class, or correct [export.classes]",
        )
    parameters = [replace(v, start=values.get(v.name, v.start)) for v in space.parameters]
    return replace(space, parameters=parameters)


def _tables(space: StateSpace, observer: ObserverModel) -> str:
    """Text of sampled_data.h: what the law must know of each state."""
    inputs = {variable.name: i for i, variable in enumerate(space.inputs)}
    kinds, first, low, high = [], [], [], []
    for state in space.states:
        component, _, name = state.name.rpartition(".")
        kinds.append(_KINDS.get(name, "DYNAMIC"))
        first.append(str(inputs.get(name, -1) if component == _PLANT else -1))
        low.append(_limit(state.minimum, -math.inf))
        high.append(_limit(state.maximum, math.inf))
    rolls = _rolls(space, observer.system) if observer.kind.sticks else None
    follower, leader, zero, lead, half = rolls or (0, 0, 0, 0.0, 0)
    return "\n".join(
        [
            f"/* What the law of {space.name} must know of each state. */",
            f"static const int sampled_kind[] = {{{', '.join(kinds)}}};",
            f"static const int sampled_first[] = {{{', '.join(first)}}};",
            f"static const double sampled_low[] = {{{', '.join(low)}}};",
            f"static const double sampled_high[] = {{{', '.join(high)}}};",
            f"static const int sampled_sticks = {int(rolls is not None)};",
            f"static const int sampled_follower = {follower}, sampled_leader = {leader};",
            f"static const int sampled_zero = {zero};",
            f"static const double sampled_lead = {lead!r};",
            f"static const int sampled_half = {half};",
            "",
        ]
    )


def _rolls(space: StateSpace, system: System) -> tuple[int, int, int, float, int] | None:
    """Places of follower, leader, what is zero, and half; None where nothing rolls along.

    The fourth is the share of the leader in the signal that feedback fades with.
    """
    if system.rolling is None or system.fading is None:
        return None
    states = [variable.name for variable in space.states]
    leader = [output.name for output in system.outputs].index(system.rolling.leader)
    return (
        states.index(f"{_PLANT}.{system.rolling.follower}"),
        states.index(f"{_PLANT}.{system.rolling.leader}"),
        [variable.name for variable in space.outputs].index(system.rolling.zero),
        system.slopes(system.fading.signal)[leader],
        [variable.name for variable in space.parameters].index(_HALF),
    )


def _limit(limit: float | None, default: float) -> str:
    value = default if limit is None else limit
    return repr(value) if math.isfinite(value) else "-INFINITY" if value < 0.0 else "INFINITY"
