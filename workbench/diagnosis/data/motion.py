"""What the noise of inputs does to a model's motion, and how outputs lead it back.

A simulation from measured inputs adds up their noise where the machine adds up forces. The outputs
lead the simulation by the Kalman gain for that noise and no other, so that prediction errors are
white where the model is right and last where it is not.
Source: L. Ljung, System Identification, 2nd ed. 1999, section 7.2.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, expm, solve_discrete_are

from workbench.arrays import Matrix, Vector
from workbench.errors import FMUError, InputError
from workbench.models.fmu import FMU
from workbench.models.simulation import needs_simulation
from workbench.observers.layout import rolling_ratio
from workbench.observers.operating import DesignPointError, corrected_states, linearised
from workbench.system.registry import open_file
from workbench.system.system import System

# Share of a state's size by which it is uncertain from sample to sample at least: what makes the
# Riccati equation solvable, and no more.
_LEAST = 1e-9


@dataclass(frozen=True, eq=False)
class Motion:
    """A model about its design point."""

    states: tuple[str, ...]  # that outputs lead; a model may have none
    # A, B, C, D: by states, measured inputs, and measured outputs with aids after them
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    nominal: Vector  # (p,) typical size of the states
    ratio: float  # of a state that rolls along over the one that leads it, 0 where none does


class ModelSource(NamedTuple):
    """A model that can be opened."""

    path: Path  # of its FMU
    system: System
    given: Mapping[str, float]  # values of its variables instead of the defaults
    free: bool = False  # whether nothing is to correct its simulations


@dataclass(frozen=True, eq=False)
class OpenModel:
    """An FMU that is open in this process, for one set of recordings after the other."""

    fmu: FMU
    # of the model at its design point; None of an FMU that is to be simulated as a whole, or can
    # only be: Co-Simulation alone, other types than Real, events where it should be linearised
    motion: Motion | None


@contextmanager
def opened(source: ModelSource) -> Iterator[OpenModel]:
    """Open an FMU."""
    system = source.system
    with open_file(source.path, system, source.given) as fmu:
        inputs = [signal.name for signal in system.inputs]
        readings = [signal.reading for signal in system.signals.values()]
        seen = [name for name in readings if name in fmu.outputs]
        along = None
        if not source.free and not needs_simulation(fmu, inputs, seen):
            try:
                along = motion(fmu, system)
            except (InputError, FMUError):
                if not fmu.has_events:
                    raise
        yield OpenModel(fmu, along)


@dataclass(frozen=True, eq=False)
class Lead:
    """How prediction errors of the outputs correct the states, sample by sample."""

    states: tuple[str, ...]  # that are corrected
    gain: Matrix  # (p, l) constant gain
    # covariance of predicted outputs and aids, by what led the states and by inputs that they show
    # at once
    ahead: Matrix
    noisy: bool  # whether an input has noise; else a gain only keeps the equation solvable


def motion(fmu: FMU, system: System) -> Motion:
    """Linearise a model at the design point; the FMU is started anew.

    Raises
    ------
    DesignPointError
        If the model cannot be evaluated or differentiated there.
    """
    try:
        return _motion(fmu, system)
    except FMUError as error:
        raise DesignPointError.at(fmu, system, str(error)) from None


def _motion(fmu: FMU, system: System) -> Motion:
    system = replace(system, outputs=(*system.outputs, *system.intermittent), intermittent=())
    states = corrected_states(fmu, system)
    model = linearised(fmu, system).of(states)
    at = [fmu.states.index(name) for name in states]
    inputs = fmu.variables([signal.name for signal in system.inputs])
    B = fmu.input_jacobian(inputs)[at]
    outputs = [output.name for output in system.outputs]
    # A state shows no input at once; not every FMU differentiates it.
    shown = [name not in fmu.states for name in outputs]
    D = np.zeros((len(outputs), len(system.inputs)))
    seen = fmu.variables([name for name, is_shown in zip(outputs, shown, strict=True) if is_shown])
    D[shown] = fmu.jacobian(seen.references, inputs)
    ratio = rolling_ratio(fmu, system) if system.rolling else 0.0
    return Motion(states, model.A, B, model.C, D, model.nominal, ratio)


def led_by(motion: Motion, inputs: Vector, outputs: Vector, h: float) -> Lead:
    """Stationary Kalman gain for the noise of the inputs alone, by outputs, which come first.

    Parameters
    ----------
    inputs, outputs : (m,) and (l,) standard deviation of a sample.
    h : from sample to sample [s].
    """
    p, m = motion.B.shape
    whole = expm(h * np.block([[motion.A, motion.B], [np.zeros((m, p + m))]]))
    transition, driven = whole[:p, :p], whole[:p, p:] * inputs
    least = _LEAST * motion.nominal
    process = driven @ driven.T + np.diag(least**2)
    # In units of noise and nominal sizes, so that the equation is well scaled.
    scale = motion.nominal
    Phi = transition * scale / scale[:, None]
    seen, shown = motion.C * scale, motion.D * inputs
    C = seen[: outputs.size] / outputs[:, None]
    Q = process / np.outer(scale, scale)
    D = shown[: outputs.size] / outputs[:, None]
    R = np.eye(len(C)) + D @ D.T
    try:
        P = solve_discrete_are(Phi.T, C.T, Q, R) if p else np.zeros((0, 0))
    except (LinAlgError, ValueError):
        # Nothing leads.
        P, C = np.zeros((p, p)), np.zeros_like(C)
    innovation = C @ P @ C.T + R
    gain = np.linalg.solve(innovation, C @ P).T * scale[:, None] / outputs
    ahead: Matrix = seen @ P @ seen.T + shown @ shown.T
    return Lead(motion.states, gain, ahead, bool(np.any(inputs > 0.0)))


def effects_on_led(motion: Motion, output: str) -> Vector:
    """Effect of each input on the rate of an output that is a state, (m,).

    Along the slow motion that it is part of, by the eigenvectors of the slowest mode.
    """
    values, right = np.linalg.eig(motion.A)
    rates, left = np.linalg.eig(motion.A.T)
    v = right[:, np.argmax(values.real)].real
    w = left[:, np.argmax(rates.real)].real
    v = v / v[motion.states.index(output)]
    return np.asarray(w @ motion.B / (w @ v))


def random_walk(
    process: Vector, measurement: float, missing: NDArray[np.bool_]
) -> tuple[Vector, Vector]:
    """Variance of a predicted output, and gain, where it walks at random, (n,).

    Parameters
    ----------
    process : (n,) standard deviation of what is added up to the next sample.
    measurement : standard deviation of a sample.
    missing : (n,) where there is none.
    """
    r = max(measurement, 1e-9) ** 2
    q = float(np.median(process)) ** 2
    predicted, gains = np.empty_like(process), np.zeros_like(process)
    p = 0.5 * (q + np.sqrt(q * q + 4.0 * q * r))
    for k in range(process.size):
        predicted[k] = p
        if not missing[k]:
            gains[k] = p / (p + r)
        p = (1.0 - gains[k]) * p + process[k] ** 2
    return predicted, gains


def noise_of(names: tuple[str, ...], deviation: Mapping[str, float]) -> Vector:
    """Standard deviations of samples of some signals, (k,)."""
    return np.array([deviation[name] for name in names])
