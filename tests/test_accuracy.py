"""Accuracy of gains that nobody tuned, on recordings made by an independent simulator."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from workbench.case import read_cases
from workbench.cosim import observe
from workbench.fmu import FMU
from workbench.objective import Weights, score
from workbench.observers import Estimator, all_estimators, reasoned_settings

RECORDINGS = Path(__file__).parent.parent.parent / "shared" / "recordings"
OBSERVERS = ("disturbance_observer", "parameter_estimator", "ekf", "ukf")


@pytest.fixture(scope="module")
def estimators(root: Path) -> Iterator[dict[str, Estimator]]:
    fmus = root / "fmus" / "fmi2"
    with FMU(fmus / "MinimalObserver.fmu") as minimal, FMU(fmus / "FullObserver.fmu") as full:
        made = all_estimators(minimal, full, reasoned_settings(minimal, full))
        yield {estimator.name: estimator for estimator in made}


def worst(estimator: Estimator, folder: Path, pattern: str = "") -> float:
    """Largest error of Fx, rms over mean, over the cases whose name holds the pattern."""
    errors = []
    for case in read_cases([folder]):
        if pattern in case.name:
            error = score(case, observe(case, estimator), 0.70, Weights()).Fx_nrmse
            assert error is not None, case.name
            errors.append(error)
    return max(errors)


@pytest.mark.parametrize("name", OBSERVERS)
@pytest.mark.parametrize(
    "recordings",
    ["clean", "cylinder_lag", "fade", "pole_ring", "radius", "speed_friction"],
)
def test_force_within_two_percent_whatever_is_wrong_with_the_plant(
    estimators: dict[str, Estimator], name: str, recordings: str
) -> None:
    """Dry stops of a rig that lags, fades, or has a wrong radius or an eccentric pole ring."""
    folder = RECORDINGS / "labelled" / recordings
    if not folder.is_dir():
        pytest.skip("the recordings are not at hand")
    assert worst(estimators[name], folder) < 0.02


@pytest.mark.parametrize("name", OBSERVERS)
@pytest.mark.parametrize(("pattern", "limit"), [("_dry_", 0.02), ("wet", 0.04)])
def test_force_on_the_standard_recordings(
    estimators: dict[str, Estimator], name: str, pattern: str, limit: float
) -> None:
    folder = RECORDINGS / "standard"
    if not folder.is_dir():
        pytest.skip("the recordings are not at hand")
    assert worst(estimators[name], folder, pattern) < limit
