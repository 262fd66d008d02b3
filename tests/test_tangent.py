"""Derivatives of a simulation by parameters, against closed forms."""

from collections.abc import Iterator

import numpy as np
import pytest

from workbench.arrays import Matrix
from workbench.diagnosis.simulation.steps import step, steps
from workbench.diagnosis.simulation.tangent import advance, renew, tangent, tell
from workbench.models.fmu import FMU
from workbench.models.native import instance

from .built import build_text, machine_file

MODEL = machine_file("draining_tank/Tank.mo")
END = 2.0  # [s]


@pytest.fixture(scope="module", params=[2, 3])
def tank(request, tmp_path_factory) -> Iterator[FMU]:
    with FMU(build_text(tmp_path_factory.mktemp("tank"), MODEL, request.param)) as fmu:
        yield fmu


def derivatives(tank: FMU, columns: list[tuple[str, ...]], inflow: float, count: int) -> Matrix:
    """Derivatives of what is read, by columns, at samples, (n, p)."""
    stiff, h = np.array([1]), END / count
    tank.start({})
    model, work = instance(tank, ["q"], [], ["y"]), steps(tank, stiff, 1)
    along = tangent(tank, model, columns, count + 1, stiff)
    model.x[:], model.u[0], work.to[0] = tank.get_states(), inflow, inflow
    tank.set(tank.variables(["q"]), model.u)
    assert renew(model, along) == 0
    tell(along, 0)
    for k in range(count):
        assert step(model, work, h) == 0
        assert advance(model, along, h) == 0
        tell(along, k + 1)
    return -along.errors[:, 0, :]  # an error is what was measured without what is predicted


def test_derivatives_are_those_of_the_closed_form(tank):
    inflow, k, c, count = 0.3, 0.8, 1.5, 200
    slopes = derivatives(tank, [("k",), ("c",), ("T",), ("h", "s")], inflow, count)
    t = np.linspace(0.0, END, count + 1)
    level = inflow / k + (2.0 - inflow / k) * np.exp(-k * t)
    by_k = -inflow / k**2 * (1.0 - np.exp(-k * t)) - (2.0 - inflow / k) * t * np.exp(-k * t)
    # The sensor lags by T = 1e-4 s, in which a level changes by less than 2e-4 m. Steps of order
    # two: (k h)^2 = 6e-5 of each, times the duration.
    np.testing.assert_allclose(slopes[:, 0], c * by_k, atol=5e-4)
    np.testing.assert_allclose(slopes[1:, 1], level[1:], atol=5e-4)
    # A sensor that is later shows what was before.
    np.testing.assert_allclose(slopes[5:, 2], -c * (inflow - k * level)[5:], atol=2e-2)
    np.testing.assert_allclose(slopes[:, 3], c * np.exp(-k * t), atol=5e-4)


def test_halving_the_step_quarters_the_error(tank):
    errors = []
    k, c, T = 0.8, 1.5, 1e-4
    for count in (20, 40):
        slopes = derivatives(tank, [("k",), ("c",)], 0.0, count)
        t = np.linspace(0.0, END, count + 1)
        # The tank drains as h0 exp(-k t), of which the sensor shows 1/(1 - k T).
        exact = 2.0 * c * np.exp(-k * t) * (T / (1.0 - k * T) ** 2 - t / (1.0 - k * T))
        errors.append(np.abs(slopes[2:, 0] - exact[2:]).max())
    # A fourth, and a little of the next order.
    assert 0.2 < errors[1] / errors[0] < 0.3


def test_variables_that_one_value_sets_add_up(tank):
    alone = derivatives(tank, [("k",), ("c",)], 0.3, 50)
    together = derivatives(tank, [("k", "c")], 0.3, 50)
    # Sums in another order.
    np.testing.assert_allclose(together[:, 0], alone[:, 0] + alone[:, 1], rtol=1e-9, atol=1e-12)
