"""The file of tuned gains, `gains.toml`: written by the tuning, read by whoever runs observers."""

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from workbench.errors import InputError
from workbench.fmu import FMU
from workbench.observers import (
    DisturbanceGains,
    DisturbanceObserver,
    FilterNoise,
    ParameterEstimator,
    ParameterGains,
    Settings,
    reasoned_settings,
)
from workbench.tuning.space import TUNABLE, Gains, from_vector, gain_names, to_vector

DEFAULTS = Path(__file__).parent / "defaults"  # gains.toml of `make tune`, by estimator

_MEANING = {
    "disturbance_observer": "L: rows omegaW, omegaR [1/s, 1/s2], dmuWR, dmuDC [1/rad, 1/(rad.s)]; "
    "columns dy (2), integral of dy (2). T [1/s]",
    "parameter_estimator": "L: rows dmuWR, dmuDC; columns dy (2) [s/rad], integral (2) [1/rad]",
    "ekf": "standard deviations of samples, and random walks",
    "ukf": "standard deviations of samples, and random walks",
}


def format_gains(estimator: str, gains: Gains, provenance: Mapping[str, Any]) -> str:
    """The text of `gains.toml`; numbers have all their digits."""
    values = map(float, to_vector(gains))
    parts = [
        tomli_w.dumps({"estimator": estimator}),
        f"# {_MEANING[estimator]}\n"
        + tomli_w.dumps({"gains": dict(zip(gain_names(gains), values, strict=True))}),
    ]
    if not isinstance(gains, FilterNoise):
        parts.append(
            "# effect of muWR, muDC on der(omegaW) from which on a friction has full authority\n"
            + tomli_w.dumps({"design": {"effect": gains.effect.tolist()}})
        )
    return "\n".join([*parts, tomli_w.dumps({"provenance": provenance})])


def read_gains(path: Path) -> tuple[str, Gains]:
    """Name of the estimator and its gains.

    Raises
    ------
    InputError
        If the file cannot be read, or lacks a gain.
    """
    try:
        content = tomllib.loads(path.read_text())
    except OSError as error:
        raise _wrong(path, error.strerror or "no file") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise _wrong(path, f"no TOML ({error})") from None
    estimator = content.get("estimator")
    if estimator not in TUNABLE:
        raise _wrong(path, f"estimator = {estimator!r}", f"one of {', '.join(TUNABLE)}")
    blank = _blank(estimator, content.get("design", {}).get("effect"), path)
    names, given = gain_names(blank), content.get("gains", {})
    if missing := [name for name in names if name not in given]:
        raise _wrong(path, f"no {missing[0]} in [gains]", f"the gains {', '.join(names)}")
    if unknown := [name for name in given if name not in names]:
        raise _wrong(path, f"{unknown[0]} in [gains]", f"the gains {', '.join(names)}")
    for name in names:
        number = given[name]
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise _wrong(path, f"{name} = {number!r}", "a number")
        if not np.isfinite(number):
            raise _wrong(path, f"{name} = {number!r}", "a finite number")
    return estimator, from_vector(blank, np.array([float(given[name]) for name in names]))


def default_settings(minimal: FMU, full: FMU) -> tuple[Settings, dict[str, str]]:
    """Settings of all estimators, and by estimator the file of the gains that are tuned.

    Gains tuned on the project's cases serve the models they were tuned on; other models get gains
    that follow from their linearisation, and so do Kalman filters from their sensors' noise.

    Parameters
    ----------
    minimal, full : the two observer models; their states are left at an operating point.
    """
    settings, tuned = reasoned_settings(minimal, full), {}
    for name, fmu in ((DisturbanceObserver.name, minimal), (ParameterEstimator.name, full)):
        path = DEFAULTS / f"{name}.toml"
        if tomllib.loads(path.read_text())["provenance"]["fmu"]["model"] == fmu.name:
            settings, tuned[name] = with_tuned(settings, read_gains(path)[1]), path.name
    return settings, tuned


def with_tuned(settings: Settings, gains: Gains) -> Settings:
    """The settings of all estimators with tuned ones in their place."""
    match gains:
        case DisturbanceGains():
            return replace(settings, disturbance=gains)
        case ParameterGains():
            return replace(settings, parameter=gains)
        case FilterNoise():
            return replace(settings, noise=gains)


def _blank(estimator: str, effect: object, path: Path) -> Gains:
    """Gains without values."""
    if estimator in ("ekf", "ukf"):
        return FilterNoise()
    try:
        pair = np.array(effect, float)
    except (TypeError, ValueError):
        pair = np.zeros(0)
    if pair.shape != (2,) or not np.all(np.isfinite(pair) & (pair != 0.0)):
        raise _wrong(path, f"effect = {effect!r} in [design]", "two numbers other than zero")
    if estimator == "disturbance_observer":
        return DisturbanceGains(np.zeros((4, 4)), 0.0, 0.0, pair)
    return ParameterGains(np.zeros((2, 4)), pair)


def _wrong(path: Path, found: str, expected: str = "a file as the tuning writes it") -> InputError:
    return InputError(
        where=str(path),
        found=found,
        expected=expected,
        remedy="take the gains.toml that 'python -m workbench tune' wrote",
    )
