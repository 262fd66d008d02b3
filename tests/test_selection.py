"""A law that stands for two at first gives way to them.

A block loses heat by a draught, in proportion to its temperature, and by radiation, to the square
of it. Either alone is no match for a law between the two; the recordings are solutions of the
equations by SciPy, not of the compiled model.
"""

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from .built import machine_file
from .heater import NOISE, cases, diagnosed, system

CONVECTION = machine_file("heater/Convection.mo")
G, S = 0.3, 0.006  # planted [W/K], [W/K2]
HELD, COUNT = 60, 20  # [s] and number of powers


def recorded(seed: int) -> pd.DataFrame:
    """Temperatures while the power is held for a minute each time, with noise."""
    rng = np.random.default_rng(seed)
    powers = rng.uniform(0.0, 90.0, COUNT)
    x, found = np.array([5.0, 5.0]), []
    for power in powers:

        def rates(_: float, x: np.ndarray, power: float = power) -> list[float]:
            T, casing = x
            lost = G * T + S * T * abs(T)
            into = 2.0 * (T - casing)
            return [(power - into - lost) / 100.0, (into - 0.5 * casing) / 200.0]

        run = solve_ivp(rates, (0.0, HELD), x, t_eval=np.arange(HELD + 1), rtol=1e-9)
        found.append(run.y[0, :-1])
        x = run.y[:, -1]
    measured = np.concatenate(found) + NOISE * rng.standard_normal(HELD * COUNT)
    time = np.arange(measured.size, dtype=float)
    return pd.DataFrame({"time [s]": time, "P [W]": np.repeat(powers, HELD), "T [K]": measured})


def test_a_law_that_stands_for_two_gives_way_to_them(tmp_path):
    block = system(tmp_path / "block", effect=CONVECTION)
    found = diagnosed(block, cases(block, [recorded(k) for k in range(3)]), tmp_path).diagnosis
    assert "Convection" in [step.rivals[0].active[-1].name for step in found.steps]
    sizes = {cause.effect.name: cause.parameters for cause in found.causes}
    assert set(sizes) == {"Draught", "Radiation"}
    assert sizes["Draught"]["G"].low <= G <= sizes["Draught"]["G"].high
    assert sizes["Radiation"]["s"].low <= S <= sizes["Radiation"]["s"].high
    # Block means of noise keep their size; of some sixty a recording, four sigma are a third.
    assert found.gain.after == pytest.approx(1.0, abs=0.33)
