"""A system for tests: a heated block in a casing, whose temperature is not measured."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from workbench import case_from_frame
from workbench.diagnosis import Outcome, diagnose, read_effects
from workbench.diagnosis.problem import Problem
from workbench.models.modelica import read_library
from workbench.recordings.case import Case
from workbench.runtime.engine import Engine
from workbench.system.system import System

from .built import declare

LIBRARY = """within ;
package Heater "A heated block in a casing"
  partial model PartialLoss "Slot: from temperature to heat"
    input Real T(unit="K") "Above the surroundings";
    output Real Q(unit="W") "Lost";
  end PartialLoss;

  model NoLoss "Null version"
    extends PartialLoss;
  equation
    Q = 0.0;
  end NoLoss;

  model Draught "a draught that takes heat"
    extends PartialLoss;
    parameter Real G(unit="W/K", min=0.0, max=5.0) = 0.0 "Conductance";
  equation
    Q = G*T;
    annotation (__Workbench(effect(
      size="G", matters=0.02, separation="the surface in a closed box")));
  end Draught;

  model Radiation "heat that is radiated"
    extends PartialLoss;
    parameter Real s(unit="W/K2", min=0.0, max=0.1) = 0.0 "Quadratic part";
  equation
    Q = s*T*abs(T);
    annotation (__Workbench(effect(
      size="s", matters=5e-4, separation="a hotter block")));
  end Radiation;

  model Observer "Block and casing"
    parameter Real C(unit="J/K") = 100.0 "Heat capacity of the block";
    parameter Real Cc(unit="J/K") = 200.0 "Heat capacity of the casing";
    parameter Real K(unit="W/K") = 2.0 "From block to casing";
    parameter Real Gc(unit="W/K") = 0.5 "From casing to the surroundings";
    input Real P(unit="W") "Heating power";
    input Real dGc(unit="W/K") "Correction of Gc";
    output Real T(unit="K", start=0.0, fixed=true, nominal=20.0) "Block";
    Real Tc(unit="K", start=0.0, fixed=true, nominal=20.0) "Casing";
    replaceable NoLoss loss(T=T) constrainedby PartialLoss(T=T) "From the block";
  equation
    C*der(T) = P - K*(T - Tc) - loss.Q;
    Cc*der(Tc) = K*(T - Tc) - (Gc + dGc)*Tc;
  end Observer;
end Heater;
"""
SYSTEM = """
name = "heater"
title = "A heated block in a casing"
sample_time = "1 s"

[models]
observer = {{ class = "Observer" }}

[inputs]
P = {{ unit = "W", noise = "0 W", scale = "40 W", held = true }}

[outputs.T]
unit = "K"
noise = "0.05 K"
scale = "20 K"
{sensor}

[states]
Tc = {{ spread = "30 K" }}

[estimated]
Gc = {{ correction = "dGc", unit = "W/K", range = ["0.1 W/K", "2 W/K"], walk = "0.01 W/K" }}
"""
NOISE = 0.05  # [K]


def system(folder: Path, sensor: str = "", effect: str = "") -> System:
    """The heater, with more keys of its sensor, or with one more effect in Modelica."""
    library = LIBRARY.replace("  model Draught", effect + "  model Draught")
    return declare(folder, library, SYSTEM.format(sensor=sensor))


def cases(of: System, frames: Sequence[pd.DataFrame]) -> list[Case]:
    return [case_from_frame(of, frame, name=f"{k:02}") for k, frame in enumerate(frames)]


def diagnosed(
    of: System, fitted: Sequence[Case], out: Path, held_out: Sequence[Case] = ()
) -> Outcome:
    library = read_library(of.library)
    effects = read_effects(library, "Observer")
    return diagnose(Problem(of, fitted, library, effects, held_out), Engine(out=out))
