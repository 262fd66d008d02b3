"""Where a recording leads a model, and whether the model is a function of where it is there.

Of a Co-Simulation, whether it makes a step for each sample.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError, InputError
from workbench.models.description import CO_SIMULATION
from workbench.models.fmu import ALIKE, FMU
from workbench.models.hybrid import HybridSimulation
from workbench.models.instance import NoFunctionError
from workbench.models.simulation import Drive, Simulation, needs_simulation
from workbench.pages.views import amount, numberless, rounded
from workbench.recordings.case import Case
from workbench.system.system import System

_POINTS = 200  # of a recording, along which a model is led
_STEPS = 500  # first samples of a recording, by which a Co-Simulation shows its own steps
_INTERVALS = 10  # between samples at which it moves: that none is a single one is no chance then
# Shares of their values by which parameters are moved where derivatives are compared once more:
# each by its own, as a quotient of two would else stay as it is.
_MOVED = (0.2, 0.5)
_GOLDEN = 0.618  # steps of it never come back to where they were


@dataclass(frozen=True)
class Trajectory:
    """Where a recording leads a model: measured states, and others as the model has them."""

    samples: NDArray[np.int_]  # (k,) places in the recording, some of many
    x: Matrix  # (k, n) states
    u: Matrix  # (k, m + q) measured inputs, and corrections, which are zero


def trajectory(fmu: FMU, system: System, case: Case) -> Trajectory | None:
    """Lead a model along a recording, at nominal quantities; None where samples are missing.

    Raises
    ------
    FMUError
        If it fails there.
    """
    kept = _kept(case)
    held = _held(fmu, system)
    u = np.column_stack([case.u[kept], np.zeros((kept.size, len(system.estimated)))])
    values = np.column_stack([case[name][kept] for name in held]) if held else u[:, :0]
    if not np.isfinite(values).all() or not np.isfinite(u).all():
        return None
    fmu.begin_at(case.model_time)
    return Trajectory(kept, states_that_follow(fmu, system, case.time[kept], held, values, u), u)


def check_along(
    fmu: FMU, system: System, case: Case, *, walks: bool = True, moved: Sequence[str] = ()
) -> str:
    """Check a model along a recording, before anything rests on it.

    It is refused if rates and outputs follow from other calls, as of a hysteresis in code, or a
    random draw, which no event tells. Directional derivatives that are wrong are not used any more.
    Samples that are missing are between their neighbours. A model that cannot be led is at its own
    start, but for what is measured.

    Parameters
    ----------
    walks : whether states walk at random by their size, so that it may not be too small, either.
    moved : parameters that will have other values, at which derivatives may be wrong, too.

    Returns
    -------
    Which states are of another size than is taken, see `size_doubt`, or which outputs of a
    Co-Simulation are late, see `own_step_doubt`; or nothing.

    Raises
    ------
    NoFunctionError
    """
    if fmu.interface == CO_SIMULATION:
        return own_step_doubt(fmu, system, case)
    if fmu.is_function and not _unsized(fmu, system):
        return ""
    kept, held = _kept(case), _held(fmu, system)
    time = case.time[kept]
    u = _filled(case.time, case.u)[kept]
    values = _filled(case.time, np.column_stack([case.time, *(case[name] for name in held)]))
    values = values[kept, 1:]
    inputs = [signal.name for signal in system.inputs]
    outputs = [output.reading for output in system.outputs]
    fmu.begin_at(case.model_time)
    begin, doubt = dict(zip(held, values[0], strict=True)), ""
    try:
        x = _led(fmu, system, begin, (time, u, values))
        doubt = size_doubt(fmu, system, x, walks=walks)
        if not fmu.is_function:
            at = fmu.start_time + time - time[0]
            fmu.start(begin)
            fmu.require_function(inputs, outputs, at, x, u)
            driven = [name for name in driving_names(system) if fmu.is_continuous(name)]
            corrected = np.column_stack([u, np.zeros((time.size, len(system.corrections)))])
            places = [driving_names(system).index(name) for name in driven]
            for parameters in ({}, _elsewhere(fmu, moved)) if moved else ({},):
                fmu.start(begin, parameters)
                fmu.check_derivatives(driven, outputs, at, x, corrected[:, places])
    except NoFunctionError:
        raise
    except (InputError, FMUError, np.linalg.LinAlgError):
        pass  # the run says why
    fmu.take_warning()  # of a run alone
    return doubt


def _elsewhere(fmu: FMU, parameters: Sequence[str]) -> dict[str, float]:
    """Other values of those parameters that are Real, by what the model allows."""
    variables = fmu.description.by_name
    least, most = _MOVED
    values = {}
    for k, name in enumerate(filter(fmu.is_real, parameters)):
        variable, value = variables[name], fmu.defaults.get(name, 0.0)
        low, high = variable.limits
        share = least + (most - least) * (k * _GOLDEN % 1.0)
        other = float(np.clip(value * (1.0 + share), low, high))
        values[name] = other if other != value else float(np.clip(value / (1.0 + share), low, high))
    return values


def doubts_along(
    fmu: FMU, system: System, cases: Sequence[Case], *, moved: Sequence[str] = ()
) -> str:
    """Check a model along recordings, see `check_along`; what is said of it, each once.

    Of doubts that differ in numbers alone, the first stands for all.
    """
    doubts: dict[str, str] = {}
    for case in cases:
        doubt = check_along(fmu, system, case, moved=moved)
        doubts.setdefault(numberless(doubt), doubt)
    return "; ".join(filter(None, doubts.values()))


def _unsized(fmu: FMU, system: System) -> list[str]:
    """States whose size nothing says: the model no nominal value, the system no scale, no walk."""
    variables = fmu.description.by_name
    known = {*system.walks, *fmu.scales}
    return [name for name in fmu.states if name not in known and not variables[name].nominal]


def size_doubt(fmu: FMU, system: System, x: Matrix, *, walks: bool = True) -> str:
    """Say which states are of another size along a recording than is taken; or nothing.

    Steps of differences and tolerances of an integration are shares of a size, too, which are fine
    if it is too small.

    Parameters
    ----------
    x : (k, n) states.
    walks : see `check_along`.
    """
    reach = dict(zip(fmu.states, np.abs(x).max(axis=0, initial=0.0), strict=True))
    unsized = _unsized(fmu, system)
    off = [
        f"{name} is up to {reach[name]:.3g} {fmu.units.get(name, '')}".rstrip()
        + f", taken for {rounded(size)}"
        for name, size in zip(unsized, fmu.sizes(unsized), strict=True)
        if reach[name] > 64.0 * np.finfo(float).eps  # which is rounding of what is 1
        and not size / ALIKE <= reach[name] <= size * (ALIKE if walks else np.inf)
    ]
    if not off:
        return ""
    return (
        f"nothing says of what size states are: {', '.join(off)}. Random walks, starts and steps "
        "of differences may be far off. Write a nominal value in the model, or [states.NAME] walk "
        "and spread"
    )


def own_step_doubt(fmu: FMU, system: System, case: Case) -> str:
    """Say which outputs a Co-Simulation keeps for several samples, as its own steps are longer.

    What is continuous moves from each sample to the next. Where all of it stays for some samples,
    at even intervals that are not those of the inputs, it is the FMU that steps so: FMI has no word
    for it. Outputs then are late, which counts from a tenth of their noise on.

    Parameters
    ----------
    fmu : Co-Simulation.
    """
    variables = fmu.description.by_name
    outputs = [
        output for output in system.outputs if variables[output.reading].variability == "continuous"
    ]
    inputs = [signal.name for signal in system.inputs]
    time, u = case.time[:_STEPS], _filled(case.time, case.u)[:_STEPS]
    known = {**system.set_by(case.conditions), **_begin(fmu, system, case)}
    simulation = Simulation(fmu, inputs, [output.reading for output in outputs], system.holds)
    try:
        y = simulation.run(Drive(time, u, case.model_time), known)
    except (InputError, FMUError):
        return ""  # the run says why
    fmu.take_warning()  # of a run alone
    moves, driven = (np.any(np.diff(rows, axis=0) != 0.0, axis=1) for rows in (y, u))
    at = np.flatnonzero(moves) + 1
    intervals = np.diff(at)
    if intervals.size < _INTERVALS or intervals.min() == 1:
        return ""
    even = np.abs(intervals - np.median(intervals)) <= 1  # a step may be no multiple of samples
    switches = len(np.unique(y[at], axis=0)) <= at.size // 2
    if even.sum() < _INTERVALS or switches or abs(driven.sum() - at.size) <= 1:
        return ""
    late = [
        (output, float(np.sqrt(np.mean(np.square(np.interp(time, time[at], column[at]) - column)))))
        for output, column in zip(outputs, y.T, strict=True)
    ]
    shown = [
        f"{output.name} by {amount(off, output.unit)}"
        for output, off in late
        if off > 0.1 * output.noise_at_scale
    ]
    if not shown:
        return ""
    own = float(np.mean(np.diff(time[at])[even]))
    return (
        f"{fmu.called} makes steps of {own:.4g} s of its own, where samples are "
        f"{np.median(np.diff(time)):.4g} s apart: until the next one its outputs stay, and are "
        f"late, {', '.join(shown)} (root mean square). Export the model with a shorter step, or "
        f"record every {own:.4g} s"
    )


def _begin(fmu: FMU, system: System, case: Case) -> dict[str, float]:
    """Start values that are measured, of what the FMU lets be set."""
    variables = fmu.description.by_name
    return {
        output.name: float(case[output.name][0])
        for output in system.outputs
        if output.name in variables
        and variables[output.name].initial in ("exact", "approx")
        and np.isfinite(case[output.name][0])
    }


def _led(
    fmu: FMU, system: System, begin: dict[str, float], samples: tuple[Vector, Matrix, Matrix]
) -> Matrix:
    """States at samples (k, n); those of the start where the model cannot be led."""
    time, u, values = samples
    inputs = [signal.name for signal in system.inputs]
    try:
        if not needs_simulation(fmu, inputs, [output.reading for output in system.outputs]):
            corrections = np.zeros((time.size, len(system.estimated)))
            driven_by = np.column_stack([u, corrections])
            return states_that_follow(fmu, system, time, list(begin), values, driven_by)
        fmu.start(begin)
        simulation = HybridSimulation(fmu, fmu.typed(inputs), np.array(system.holds))
        simulation.begin(u[0])
        at = fmu.start_time + time - time[0]
        x = np.array([simulation.advance(t, row) for t, row in zip(at, u, strict=True)])
    except (InputError, FMUError, np.linalg.LinAlgError):
        fmu.start(begin)
        x = np.tile(fmu.get_states(), (time.size, 1))
    x[:, [fmu.states.index(name) for name in begin]] = values
    return x


def _kept(case: Case) -> NDArray[np.int_]:
    return np.unique(np.linspace(0, case.time.size - 1, _POINTS).astype(int))


def _held(fmu: FMU, system: System) -> list[str]:
    """States that outputs show by name."""
    return [output.name for output in system.outputs if output.name in fmu.states]


def _filled(time: Vector, columns: Matrix) -> Matrix:
    """Columns, (n, k), with straight lines where samples are missing; 0 where all are."""
    filled = np.zeros_like(columns)
    for column, values in zip(filled.T, columns.T, strict=True):
        known = np.isfinite(values)
        if known.any():
            column[:] = np.interp(time, time[known], values[known])
    return filled


def driving_names(system: System) -> list[str]:
    """Names of what drives a model: measured inputs, and corrections."""
    return [*(signal.name for signal in system.inputs), *system.corrections]


def states_that_follow(
    fmu: FMU, system: System, time: Vector, held: Sequence[str], values: Matrix, u: Matrix
) -> Matrix:
    """States, (n, k), of a model of which some are held at values, (n, h), and others follow.

    Parameters
    ----------
    u : (n, m + q) of `driving_names`.
    """
    places = [fmu.states.index(name) for name in held]
    fmu.start(dict(zip(held, values[0], strict=True)))
    inputs = fmu.variables(driving_names(system))
    x = np.tile(fmu.get_states(), (time.size, 1))
    x[:, places] = values
    if len(fmu.states) > len(held):
        for k, h in enumerate(np.diff(time)):
            fmu.set_time(fmu.start_time + time[k] - time[0])
            fmu.set_states(x[k])
            fmu.set(inputs, u[k])
            x[k + 1] = fmu.step(h)
            x[k + 1, places] = values[k + 1]
    return x
