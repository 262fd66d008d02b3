"""Estimators, stage 3: each turns measured inputs and outputs into an estimate, step by step."""

from workbench.observers.baselines import DirectInversion, OpenLoop
from workbench.observers.contract import ESTIMATE, Estimator
from workbench.observers.disturbance import (
    DisturbanceGains,
    DisturbanceObserver,
    NoiseLevels,
    OperatingPoint,
    stationary_gains,
)

__all__ = [
    "ESTIMATE",
    "DirectInversion",
    "DisturbanceGains",
    "DisturbanceObserver",
    "Estimator",
    "NoiseLevels",
    "OpenLoop",
    "OperatingPoint",
    "stationary_gains",
]
