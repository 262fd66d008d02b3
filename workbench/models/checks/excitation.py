"""Moving an unknown FMU so that every state and input matters, and judging what it does."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError
from workbench.models.checks.result import CheckResult
from workbench.models.fmu import FMU, CoSimulation, Variables

COMMUNICATION_STEPS = 100


@dataclass(frozen=True)
class Excitation:
    """Where an FMU is moved.

    Attributes
    ----------
    states : (n,) start values, off the FMU's own by up to a tenth of a nominal value.
    nominal : (n,) typical size of the states.
    inputs : the real inputs that may change in continuous time.
    first, second : (m,) inputs, and those after a jump.
    """

    states: Vector
    nominal: Vector
    inputs: Variables
    first: Vector
    second: Vector


def excite(fmu: FMU) -> Excitation:
    """Start the FMU and bring it to an excited point; returns where."""
    by_name = {v.name: v for v in fmu.description.variables}
    nominal = np.array([abs(by_name[name].nominal or 1.0) for name in fmu.states])
    inputs = continuous_variables(fmu, fmu.inputs)
    fmu.start({})
    states = origin = fmu.get_states()
    rest = fmu.get(inputs).copy()
    for share in (0.1, 0.01, 0.001):
        rates = _rates_at(fmu, origin + share * nominal)
        if rates is None:
            continue
        states = origin + share * nominal
        if np.all(np.abs(rates) < 100.0 * nominal):  # farther out, it flies off within 10 ms
            break
    fmu.set_states(states)
    levels = np.array([_level(fmu, inputs, rest, j, nominal) for j in range(rest.size)])
    excitation = Excitation(states, nominal, inputs, rest + levels, rest + levels / 3)
    fmu.set(inputs, excitation.first)
    return excitation


def _rates_at(fmu: FMU, states: Vector) -> Vector | None:
    """Derivatives, (n,); None if the model does not bear these states."""
    try:
        fmu.set_states(states)
        rates = fmu.derivatives()
    except FMUError:
        return None
    return rates if np.isfinite(rates).all() else None


def _level(fmu: FMU, inputs: Variables, rest: Vector, j: int, nominal: Vector) -> float:
    """Power of ten by which an input must change to move a state by a tenth in a second."""
    still = fmu.derivatives()
    level = 1.0
    for candidate in 10.0 ** np.arange(-3, 10):
        moved = rest.copy()
        moved[j] += candidate
        try:
            fmu.set(inputs, moved)
            change = np.abs(fmu.derivatives() - still)
        except FMUError:
            break
        if np.any(change > 0.1 * nominal):
            level = float(candidate)
            break
    fmu.set(inputs, rest)
    return level


def real_variables(fmu: FMU, names: Sequence[str] | None = None) -> Variables:
    """Look up those of the names that are real scalars; without names, all of the FMU."""
    real = [v.name for v in fmu.description.variables if v.real]
    return fmu.variables([n for n in real if names is None or n in names])


def continuous_variables(fmu: FMU, names: Sequence[str]) -> Variables:
    """Look up those of the names that are real scalars and continuous."""
    continuous = {v.name for v in fmu.description.variables if v.variability == "continuous"}
    return real_variables(fmu, [name for name in names if name in continuous])


def step_size(fmu: FMU) -> float:
    """Communication step [s]: the FMU's own, or a thousandth of its experiment, or 10 ms."""
    return fmu.description.step or (fmu.description.stop or 10.0) / 1000


def walk(fmu: FMU, excitation: Excitation, begin: float) -> tuple[Matrix, float]:
    """Follow the derivatives for 40 steps, inputs jumping half way.

    Each step is at most a hundredth of a nominal value long, which no stiffness makes unstable,
    and rests on states, inputs and derivatives alone.

    Returns
    -------
    (40, k) all real variables, and the time at the end [s].
    """
    everything = real_variables(fmu)
    t, rows = begin, []
    for k in range(40):
        if k == 20:
            fmu.set(excitation.inputs, excitation.second)
        rates = fmu.derivatives()
        rows.append(fmu.get(everything).copy())
        pace = float(np.max(np.abs(rates) / excitation.nominal, initial=0.0))
        h = min(step_size(fmu), 0.01 / pace if pace > 0.0 else np.inf)
        t += h
        fmu.set_time(t)
        fmu.set_states(fmu.get_states() + h * rates)
        fmu.complete_step()
    return np.array(rows), t


def start_co_simulation(simulation: CoSimulation, excitation: Excitation) -> None:
    """Start at the excited point if the FMU lets itself be put there, else at its own."""
    try:
        simulation.start(dict(zip(simulation.states, excitation.states, strict=True)))
    except FMUError:
        simulation.start({})
    simulation.set(excitation.inputs, excitation.first)


def run(simulation: CoSimulation, excitation: Excitation, begin: float) -> tuple[Matrix, float]:
    """Let a Co-Simulation run for COMMUNICATION_STEPS, inputs jumping half way.

    Returns
    -------
    (COMMUNICATION_STEPS + 1, k) all real variables, and the time at the end [s].
    """
    everything = real_variables(simulation)
    h = step_size(simulation)
    simulation.set_time(begin)
    rows = [simulation.get(everything).copy()]
    for k in range(COMMUNICATION_STEPS):
        if k == COMMUNICATION_STEPS // 2:
            simulation.set(excitation.inputs, excitation.second)
        simulation.step(h)
        rows.append(simulation.get(everything).copy())
    return np.array(rows), begin + COMMUNICATION_STEPS * h


def same_bits(
    question: CheckResult, fmu: FMU, first: Matrix, second: Matrix, what: str
) -> CheckResult:
    """Judge two runs, (samples, k) of all real variables, that must be one and the same."""
    if first.tobytes() == second.tobytes():
        return replace(question, passed=True, value=0.0)
    row, column = np.argwhere(first.view(np.uint64) != second.view(np.uint64))[0]
    return replace(
        question,
        passed=False,
        value=float(np.nanmax(np.abs(first - second))),
        reason=f"{what}, '{real_variables(fmu).names[column]}' is {second[row, column]:.9g} "
        f"instead of {first[row, column]:.9g} at sample {row}",
    )
