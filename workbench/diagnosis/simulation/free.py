"""Prediction errors of whole simulations that nothing corrects, and derivatives by differences.

For an FMU that no compiled loop steps: one with events, or with Co-Simulation alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Matrix
from workbench.diagnosis.data.samples import Samples
from workbench.diagnosis.simulation.prediction import Variation
from workbench.errors import InputError
from workbench.models.description import MODEL_EXCHANGE
from workbench.models.fmu import FMU
from workbench.models.simulation import Drive, Simulation
from workbench.system.system import System


@dataclass(frozen=True, eq=False)
class FreeDerivatives:
    """Derivatives of errors (n, c, p), and shares by which they may be wrong, by variable."""

    errors: NDArray[np.float64]
    unsure: Mapping[str, float]


class FreePredictor:
    """One model, ready for many whole simulations; see `Predictor`.

    Raises
    ------
    InputError
        If the system compares what a simulation cannot give that nothing corrects.
    """

    def __init__(
        self, fmu: FMU, system: System, signals: Sequence[str], watched: Sequence[str] = ()
    ) -> None:
        for key, asked in (("rest", system.comparison.rests), ("rolling", system.rolling)):
            if asked:
                raise InputError(
                    where=f"{system.source}, '{key}'",
                    found="an FMU with events, or Co-Simulation alone, that runs freely",
                    expected="a Model Exchange FMU without events, for what this key asks",
                    remedy=f"remove '{key}'",
                )
        self._fmu, self._signals = fmu, tuple(signals)
        inputs = [signal.name for signal in system.inputs]
        readings = [*(system.signals[name].reading for name in signals), *watched]
        self._simulation = Simulation(fmu, inputs, readings, system.holds)
        variables = fmu.description.by_name
        self._whole = np.array([not variables[name].floats for name in inputs], bool)
        self._scales = {name: signal.scale for name, signal in system.signals.items()}
        self._scales |= {name: spread for name, spread in system.spreads.items() if spread > 0.0}

    def begin(self, samples: Samples) -> dict[str, float]:
        """Start values of states, as known at the start of a recording."""
        able = set(self._fmu.states)
        if self._fmu.interface != MODEL_EXCHANGE:
            variables = self._fmu.description.variables
            able = {v.name for v in variables if v.initial in ("exact", "approx")}
        return {name: value for name, value in samples.begin.items() if name in able}

    def started(self, samples: Samples, values: Mapping[str, float]) -> dict[str, float]:
        """Nothing: states start as they were read; see `Predictor.started`."""
        return {}

    def errors(self, samples: Samples, values: Mapping[str, float]) -> Matrix:
        """Measured minus simulated, (n, c); see `Predictor.errors`."""
        simulated = self._run(samples, values)[:, : len(self._signals)]
        errors = np.zeros_like(samples.y)
        errors[: len(simulated)] = samples.y[: len(simulated)] - simulated
        return errors

    def along(self, samples: Samples, values: Mapping[str, float]) -> Matrix:
        """What is watched, at each sample of a recording, (n, w); see `Predictor.along`."""
        simulated = self._run(samples, values)[:, len(self._signals) :]
        watched = np.zeros((samples.time.size, simulated.shape[1]))
        watched[: len(simulated)] = simulated
        return watched

    def _run(self, samples: Samples, values: Mapping[str, float]) -> Matrix:
        """Signals, then what is watched, up to one sample after the last that is told."""
        return self._simulation.run(self._drive(samples), {**self.begin(samples), **values})

    def derivatives(
        self,
        samples: Samples,
        values: Mapping[str, float],
        columns: Sequence[Variation],
        courses: Matrix | None = None,
        absent: Sequence[str] = (),
    ) -> tuple[Matrix, FreeDerivatives]:
        """Prediction errors (n, c) and their derivatives, see `Predictor.derivatives`.

        Raises
        ------
        InputError
            If columns act by courses: a parameter does not change in a whole simulation.
        """
        if courses is not None:
            raise InputError(
                where=self._fmu.place,
                found="an FMU with events, or Co-Simulation alone, that runs freely",
                expected="a model in which parameters may change in time, for a law to be inferred",
                remedy="diagnose without --propose",
            )
        drive, values = self._drive(samples), {**self.begin(samples), **values}
        for column in columns:
            values |= column.setting
        varied = [column.variables for column in columns]
        sizes = {
            column.variables[0]: column.size or self._scales.get(column.variables[0], 0.0)
            for column in columns
        }
        simulated = self._simulation.derivatives(drive, values, varied, sizes)
        derivatives = np.zeros((*samples.y.shape, len(columns)))
        derivatives[: drive.time.size] = -simulated.values[:, : len(self._signals)]
        unsure = {
            names[0]: float(share)
            for names, share in zip(varied, simulated.unsure, strict=True)
            if share
        }
        return self.errors(samples, values), FreeDerivatives(derivatives, unsure)

    def _drive(self, samples: Samples) -> Drive:
        """Inputs up to one sample after the last that is told; whole ones as at the next sample.

        What moves a recording in time reads between samples.
        """
        end = int(np.flatnonzero(samples.reported)[-1]) + 2
        u = np.where(self._whole, np.round(samples.u[:end]), samples.u[:end])
        return Drive(samples.time[:end], u, samples.model_time)
