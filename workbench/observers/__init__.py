"""Estimators, stage 3: each turns measured inputs and outputs into an estimate, step by step."""

from workbench.observers.baselines import DirectInversion, OpenLoop
from workbench.observers.contract import ESTIMATE, Estimate, Estimator
from workbench.observers.disturbance import (
    DiscModel,
    DisturbanceGains,
    DisturbanceObserver,
    NoiseLevels,
    OperatingPoint,
    stationary_gains,
)
from workbench.observers.kalman import ExtendedKalmanFilter, FilterNoise, UnscentedKalmanFilter
from workbench.observers.parameter import ParameterEstimator, ParameterGains, pole_placed_gains
from workbench.observers.suite import (
    ESTIMATORS,
    STANDARD,
    Settings,
    all_estimators,
    make_estimators,
    reasoned_settings,
)
from workbench.observers.utilisation import MODELLED_CONTACT, PeakForce

__all__ = [
    "ESTIMATE",
    "ESTIMATORS",
    "MODELLED_CONTACT",
    "STANDARD",
    "DirectInversion",
    "DiscModel",
    "DisturbanceGains",
    "DisturbanceObserver",
    "Estimate",
    "Estimator",
    "ExtendedKalmanFilter",
    "FilterNoise",
    "NoiseLevels",
    "OpenLoop",
    "OperatingPoint",
    "ParameterEstimator",
    "ParameterGains",
    "PeakForce",
    "Settings",
    "UnscentedKalmanFilter",
    "all_estimators",
    "make_estimators",
    "pole_placed_gains",
    "reasoned_settings",
    "stationary_gains",
]
