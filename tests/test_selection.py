"""A law that stands for two at first gives way to them.

A block loses heat by a draught, in proportion to its temperature, and by radiation, to the square
of it. Either alone is no match for a law between the two; the recordings are solutions of the
equations by SciPy, not of the compiled model.
"""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

pytest.importorskip("casadi")
pytest.importorskip("rumoca")

import workbench as wb
from workbench.system import System

LIBRARY = """within ;
package Block "A heated block"
  partial model PartialLoss "Slot: from temperature to heat"
    input Real T(unit="K") "Above the surroundings";
    output Real Q(unit="W") "Lost";
  end PartialLoss;

  model NoLoss "Null version"
    extends PartialLoss;
  equation
    Q = 0.0;
  end NoLoss;

  model Convection "air that rises from the block"
    extends PartialLoss;
    parameter Real c(unit="W/K", min=0.0, max=5.0) = 0.0 "Conductance at 10 K";
  equation
    Q = c*T*sqrt(abs(T)/10.0 + 1e-6);
    annotation (__Workbench(effect(
      size="c", step=1e-3, matters=0.02, separation="the block on its side")));
  end Convection;

  model Draught "a draught that takes heat"
    extends PartialLoss;
    parameter Real G(unit="W/K", min=0.0, max=5.0) = 0.0 "Conductance";
  equation
    Q = G*T;
    annotation (__Workbench(effect(
      size="G", step=1e-3, matters=0.02, separation="the surface in a closed box")));
  end Draught;

  model Radiation "heat that is radiated"
    extends PartialLoss;
    parameter Real s(unit="W/K2", min=0.0, max=0.1) = 0.0 "Quadratic part";
  equation
    Q = s*T*abs(T);
    annotation (__Workbench(effect(
      size="s", step=1e-5, matters=5e-4, separation="a hotter block")));
  end Radiation;

  model Observer "Block"
    parameter Real C(unit="J/K") = 100.0 "Heat capacity";
    parameter Real G0(unit="W/K") = 0.5 "To the holder";
    input Real P(unit="W") "Heating power";
    input Real dG0(unit="W/K") "Correction of G0";
    output Real T(unit="K", start=0.0, fixed=true, nominal=20.0) "Temperature";
    replaceable NoLoss loss(T=T) constrainedby PartialLoss(T=T) "From the block";
  equation
    C*der(T) = P - (G0 + dG0)*T - loss.Q;
  end Observer;
end Block;
"""
SYSTEM = """
name = "block"
title = "A heated block"
sample_time = "1 s"

[models]
observer = { class = "Observer" }

[inputs.P]
unit = "W"
noise = "0 W"
scale = "40 W"
held = true

[outputs.T]
unit = "K"
noise = "0.05 K"
scale = "20 K"

[estimated.G0]
correction = "dG0"
unit = "W/K"
range = ["0.1 W/K", "2 W/K"]
walk = "0.01 W/K"
"""
G, S, NOISE, HELD, COUNT = 0.3, 0.006, 0.05, 60, 20  # planted [W/K], [W/K2]; [K]; [s], of powers


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> System:
    folder = tmp_path_factory.mktemp("block")
    (folder / "package.mo").write_text(LIBRARY)
    (folder / "system.toml").write_text(SYSTEM)
    return wb.load_system(folder)


def recorded(seed: int, draught: float, radiation: float) -> pd.DataFrame:
    """Temperatures while the power is held for a minute each time, with noise."""
    rng = np.random.default_rng(seed)
    powers = rng.uniform(0.0, 90.0, COUNT)
    T, found = 5.0, []
    for power in powers:
        run = solve_ivp(
            lambda _, T, P=power: (P - (0.5 + draught) * T - radiation * T * abs(T)) / 100.0,
            (0.0, HELD),
            [T],
            t_eval=np.arange(HELD + 1),
            rtol=1e-9,
        )
        found.append(run.y[0, :-1])
        T = run.y[0, -1]
    measured = np.concatenate(found) + NOISE * rng.standard_normal(HELD * COUNT)
    time = np.arange(measured.size, dtype=float)
    return pd.DataFrame({"time [s]": time, "P [W]": np.repeat(powers, HELD), "T [K]": measured})


def test_a_law_that_stands_for_two_gives_way_to_them(block: System, tmp_path: Path) -> None:
    cases = [wb.case_from_frame(block, recorded(k, G, S), name=f"{k:02}") for k in range(3)]
    found = wb.diagnose(block, cases, out=tmp_path).diagnosis
    first = found.steps[0].rivals[0].active[-1].name
    assert first == "Convection"  # alone, it explains most
    sizes = {cause.effect.name: cause.parameters for cause in found.causes}
    assert set(sizes) == {"Draught", "Radiation"}
    assert sizes["Draught"]["G"].low <= G <= sizes["Draught"]["G"].high
    assert sizes["Radiation"]["s"].low <= S <= sizes["Radiation"]["s"].high
    assert found.gain is not None
    # Block means of noise keep their size; of some sixty a recording, four sigma are a third.
    assert found.gain.after == pytest.approx(1.0, abs=0.33)
