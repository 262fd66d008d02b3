"""All estimators with reasoned settings, and what they are made of."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from workbench.fmu import FMU
from workbench.observers.baselines import DirectInversion, OpenLoop
from workbench.observers.contract import Estimator
from workbench.observers.disturbance import (
    DiscModel,
    DisturbanceGains,
    DisturbanceObserver,
    stationary_gains,
)
from workbench.observers.kalman import ExtendedKalmanFilter, FilterNoise, UnscentedKalmanFilter
from workbench.observers.parameter import ParameterEstimator, ParameterGains, pole_placed_gains

# Baselines first, then observers.
STANDARD = (
    "open_loop",
    "direct_inversion",
    "disturbance_observer",
    "parameter_estimator",
    "ekf",
    "ukf",
)
ESTIMATORS = (*STANDARD, "disturbance_observer_disc")


@dataclass(frozen=True)
class Settings:
    """Gains and noise levels of the estimators."""

    disturbance: DisturbanceGains
    parameter: ParameterGains
    noise: FilterNoise

    def summary(self) -> dict[str, Any]:
        """The same as plain numbers and lists, keyed by estimator."""
        parameter = self.parameter
        disturbance = {
            "L": self.disturbance.L.tolist(),
            "T_WR": self.disturbance.T_WR,
            "T_DC": self.disturbance.T_DC,
            "effect": self.disturbance.effect.tolist(),
            "source": "stationary Kalman gain of the linearised model",
        }
        return {
            "disturbance_observer": disturbance,
            "disturbance_observer_disc": {**disturbance, "disc": DiscModel()._asdict()},
            "parameter_estimator": {
                "L": parameter.L.tolist(),
                "effect": parameter.effect.tolist(),
                "source": "pole placement in the two time scales of the linearised model",
            },
            "ekf, ukf": {**asdict(self.noise), "source": "noise of the sensors"},
        }


def reasoned_settings(minimal: FMU, full: FMU) -> Settings:
    """Settings that follow from the linearised models and the sensors' noise; nothing is tuned.

    Parameters
    ----------
    minimal, full : the two observer models; their states are left at an operating point.
    """
    return Settings(stationary_gains(minimal), pole_placed_gains(full), FilterNoise())


def make_estimators(
    names: Sequence[str], minimal: FMU, full: FMU, settings: Settings
) -> list[Estimator]:
    """Estimators by name; they share two FMU instances, so run one at a time.

    Parameters
    ----------
    names : of ESTIMATORS, in the order of the result.
    minimal, full : the two observer models.
    """
    make: dict[str, Callable[[], Estimator]] = {
        "open_loop": lambda: OpenLoop(minimal),
        "direct_inversion": lambda: DirectInversion(minimal),
        "disturbance_observer": lambda: DisturbanceObserver(minimal, settings.disturbance),
        "parameter_estimator": lambda: ParameterEstimator(full, settings.parameter),
        "ekf": lambda: ExtendedKalmanFilter(minimal, settings.noise),
        "ukf": lambda: UnscentedKalmanFilter(minimal, settings.noise),
        "disturbance_observer_disc": lambda: DisturbanceObserver(
            minimal, settings.disturbance, DiscModel()
        ),
    }
    return [make[name]() for name in names]


def all_estimators(minimal: FMU, full: FMU, settings: Settings) -> list[Estimator]:
    """The standard estimators, which run on any model that `check_model` accepts."""
    return make_estimators(STANDARD, minimal, full, settings)
