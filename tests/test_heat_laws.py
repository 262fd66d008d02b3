"""Laws of heat that is kept, or lost again: they are offered, and their classes hold that heat."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from workbench.arrays import Vector
from workbench.diagnosis import given_values, read_effects
from workbench.diagnosis.data.motion import ModelSource
from workbench.diagnosis.effects.extension import ExtendedModel, build
from workbench.diagnosis.effects.slots import read_slots
from workbench.diagnosis.inference.fit import Fit
from workbench.diagnosis.laws.forms import ClosedForm, candidates
from workbench.diagnosis.laws.places import CLOCK, Place, laws, places
from workbench.diagnosis.laws.scan import watching
from workbench.diagnosis.laws.splines import Knots
from workbench.diagnosis.laws.writing import extended_library
from workbench.diagnosis.simulation.residual_model import ResidualModel
from workbench.models.fmu import FMU
from workbench.models.modelica import Library, read_library
from workbench.system.system import OBSERVER

LONGEST = 40.0  # [s]


@pytest.fixture(scope="module")
def library(system) -> Library:
    return read_library(system.library)


@pytest.fixture(scope="module")
def pads(library, system) -> Place:
    """Where the pads' friction coefficient acts."""
    base = system.models[OBSERVER].name
    every = places(library, base, read_slots(library, base))
    return next(one for one in every if one.slot.name == "padFriction")


def braking(pads: Place) -> tuple[Vector, dict[str, Vector]]:
    """Times and what is watched at the pads, in a stop."""
    time = np.linspace(0.0, LONGEST, 401)
    courses = {"Fperp": 3e4 * (1.0 - np.exp(-time)), "v": 20.0 - 0.5 * time}
    inputs = {variable.name: courses.get(variable.name, 0.0 * time) for variable in pads.inputs}
    watched = {**inputs, "mu": 0.35 + 0.0 * time}
    return time, {f"padFriction.{name}": course for name, course in watched.items()}


def of_heat(pads: Place) -> dict[float, ClosedForm]:
    """Laws in proportion to heat, that multiply the coefficient, by time constant [s]."""
    found = {}
    for law in laws(pads, [braking(pads)], 0.25):
        if law.influence is not None and law.influence.kind == "work":
            first = next(candidates(law, Knots(0.0, 1e7), 1.0))
            found.setdefault(law.influence.span, first)
    return found


def test_friction_may_depend_on_the_heat_it_makes_kept_or_lost(pads):
    """All of its power: force, speed and the coefficient itself."""
    found = of_heat(pads)
    # From heat that a stop keeps to heat of which most is gone at its end.
    assert set(found) == {0.0, 10.0 * LONGEST, 3.0 * LONGEST, LONGEST}
    for one in found.values():
        assert [part.name for part in one.law.influence.factors] == ["Fperp", "v", "mu"]


@pytest.mark.parametrize("span", [0.0, LONGEST])
def test_the_class_of_a_law_holds_the_heat_that_was_looked_at(
    span, library, pads, system, dry_case, tmp_path
):
    """What the model integrates, beside the integral over samples of what was watched."""
    base = system.models[OBSERVER].name
    law = of_heat(pads)[span]
    extended = extended_library(library, [law.written], tmp_path)
    (own,) = [effect for effect in read_effects(extended, base) if effect.name == law.written.name]
    names = [f"padFriction.{name}" for name in ("Fperp", "v", "mu")]
    text = watching(ExtendedModel(extended, base, "Heat", [own], "A law of heat").source(), names)
    path = tmp_path / "Heat.fmu"
    build(extended, "Heat", text, path, every_platform=False)
    with FMU(path) as fmu:
        (clock,) = (name for name in fmu.states if name.endswith(CLOCK))
    with ResidualModel(
        ModelSource(path, system, given_values(path, system)), [dry_case]
    ) as simulations:
        unknowns = Fit(simulations, [own]).unknowns
        points = unknowns.values(unknowns.start())
        (table,) = simulations.along(points, ["watched0", "watched1", "watched2", clock])
        (recording,) = simulations.recordings
    moving = slice(0, int(np.flatnonzero(recording.told)[-1]))
    *seen, held = table[moving].T
    course = dict(zip(names, seen, strict=True))
    heat = law.law.influence.course(pads, course, recording.time[moving])
    assert heat.max() > 1e6  # of a stop from 120 km/h; [J]
    # The trapezoidal rule over 5 ms, where the pressure rises in some tenths of a second.
    assert_allclose(held, heat, rtol=0.0, atol=1e-4 * heat.max())
