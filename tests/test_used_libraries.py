"""A library uses others: found beside it or among the workbench's, read, compiled, kept, copied."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from workbench.diagnosis import read_effects
from workbench.diagnosis.effects.extension import ExtendedModel, build
from workbench.diagnosis.effects.slots import read_slots
from workbench.errors import InputError
from workbench.models import compiler, fmu_cache
from workbench.models.compiler.flat import flatten
from workbench.models.fmu import FMU
from workbench.models.modelica import packages, read_library
from workbench.runtime import resources

STAGE = """package Stage "A stage on rails"
  import Common = Effects;

  package Effects "What the model leaves out; hides the library of this name"
    model BearingFriction "dry friction in the bearing"
      extends Common.Friction.Dry(coulomb(max=5.0));
      annotation (__Workbench(effect(
        size="coulomb", matters=0.2, separation="a slow run-down")));
    end BearingFriction;

    model Grease "stiff grease"
      extends Common.Friction.Viscous;
      annotation (__Workbench(effect(
        size="damping", matters=0.2, separation="a run-down from two velocities")));
    end Grease;

    model TachoOffset "a tacho whose zero is wrong"
      extends Common.Signals.Offset(offset(unit="m/s", min=-0.1, max=0.1));
      annotation (__Workbench(effect(
        size="offset", matters=1e-3, separation="its reading at standstill")));
    end TachoOffset;

    model TachoGain "a tacho whose gain is wrong"
      extends Common.Signals.Gain(gain(max=0.2));
      annotation (__Workbench(effect(
        size="gain", matters=1e-3, separation="a ruler and a clock")));
    end TachoGain;
  end Effects;

  model Base "What moves"
    parameter Real m(unit="kg") = 2.0 "Mass";
    input Real F(unit="N") "Force";
    output Real v(unit="m/s", start=0.0, fixed=true) "Velocity";
    output Real reading(unit="m/s") = tacho.y "Of the tacho";
    replaceable Common.Friction.Frictionless friction(v=v, load=9.81*m)
      constrainedby Common.Interfaces.Friction(v=v, load=9.81*m) "Rails";
    replaceable Common.Signals.Unchanged tacho(u=v)
      constrainedby Common.Interfaces.Signal(u=v) "Tacho";
  equation
    m*der(v) = F - friction.f;
  end Base;

  annotation (uses(Effects(version="1.0")));
end Stage;
"""


def stage(folder: Path, *changes: tuple[str, str]) -> Path:
    text = STAGE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    file = folder / "Stage" / "package.mo"
    file.parent.mkdir()
    file.write_text(text)
    return file


def own_effects(folder: Path) -> Path:
    """A copy of the common library beside a user's."""
    shutil.copytree(resources.modelica() / "Effects", folder / "Effects")
    return folder / "Effects" / "package.mo"


def test_a_library_is_taken_from_beside_before_from_the_workbench(tmp_path):
    file = stage(tmp_path)
    assert packages(file) == (file, resources.modelica() / "Effects" / "package.mo")
    own = own_effects(tmp_path)
    assert packages(file) == (file, own)


def test_libraries_are_used_through_others_and_once(tmp_path):
    for name, uses in (("A", 'B(version="1"), C(version="1")'), ("B", "C()"), ("C", "A()")):
        (tmp_path / name).mkdir()
        text = f'package {name} "uses(X())" annotation (uses({uses})); end {name};'
        (tmp_path / name / "package.mo").write_text(text)
    assert [file.parent.name for file in packages(tmp_path / "A" / "package.mo")] == ["A", "B", "C"]


def test_a_library_that_is_nowhere_is_refused_with_its_line(tmp_path):
    file = stage(tmp_path, ("uses(Effects", "uses(Efects"))
    message = rf"{file}:43: found uses\(Efects\), but no such library; expected {tmp_path}"
    with pytest.raises(InputError, match=message):
        read_library(file)
    with pytest.raises(InputError, match=message):
        fmu_cache.key(file)
    with pytest.raises(InputError, match=message):
        compiler.build(file, "Stage.Base", tmp_path / "a.fmu", platforms=[compiler.native()])


def test_a_change_of_a_used_library_is_another_fmu(tmp_path):
    file, own = stage(tmp_path), own_effects(tmp_path)
    before = fmu_cache.key(file), compiler.source_hash(file)
    law = own.parent / "Friction" / "Dry.mo"
    law.write_text(law.read_text().replace("tanh(v/v0)", "sin(v/v0)"))
    after = fmu_cache.key(file), compiler.source_hash(file)
    assert before[0] != after[0]
    assert before[1] != after[1]


def test_friction_adds_up_and_signals_form_a_chain(tmp_path):
    slots = {slot.name: slot for slot in read_slots(read_library(stage(tmp_path)), "Base")}
    assert (slots["friction"].inputs, slots["friction"].outputs) == (("v", "load"), ("f",))
    assert not slots["friction"].chained
    assert slots["tacho"].chained


def test_common_laws_are_no_effects_of_the_library_and_what_extends_them_is(tmp_path):
    effects = read_effects(read_library(stage(tmp_path)), "Base")
    assert [(effect.name, effect.slots) for effect in effects] == [
        ("BearingFriction", ("friction",)),
        ("Grease", ("friction",)),
        ("TachoOffset", ("tacho",)),
        ("TachoGain", ("tacho",)),
    ]


@pytest.mark.parametrize("beside", [False, True], ids=["of the workbench", "beside"])
def test_an_extended_model_has_the_common_laws(beside, tmp_path):
    """Closed forms, at 0.5 m/s."""
    file = stage(tmp_path)
    if beside:
        law = own_effects(tmp_path).parent / "Friction" / "Viscous.mo"
        law.write_text(law.read_text().replace("f = damping*v", "f = 2.0*damping*v"))
    library = read_library(file)
    text = ExtendedModel(library, "Base", "Extended", read_effects(library, "Base"), "").source()
    build(library, "Extended", text, tmp_path / "Extended.fmu", every_platform=False)
    sizes = {
        "friction.bearingFriction.coulomb": 3.0,
        "friction.grease.damping": 4.0,
        "tacho.tachoOffset.offset": 0.1,
        "tacho.tachoGain.gain": -0.5,
    }
    with FMU(tmp_path / "Extended.fmu") as fmu:
        bounds = {v.name: (v.unit, v.maximum) for v in fmu.description.variables}
        assert bounds["friction.bearingFriction.coulomb"] == ("N", 5.0)
        assert bounds["tacho.tachoOffset.offset"] == ("m/s", 0.1)
        fmu.start({"v": 0.5}, sizes)
        resists = 3.0 + 4.0 * 0.5 * (2.0 if beside else 1.0)
        np.testing.assert_allclose(fmu.derivatives(), [-resists / 2.0], rtol=1e-12)
        reading = fmu.get(fmu.variables(["reading"]))
        np.testing.assert_allclose(reading, [0.5 * 0.6], rtol=1e-12)


@pytest.mark.parametrize(
    ("law", "units"),
    [
        ("Dry", {"coulomb": "N.m", "v0": "rad/s"}),
        ("Viscous", {"damping": "N.m.s/rad"}),
        ("Stribeck", {"excess": "N.m", "vS": "rad/s", "v0": "rad/s"}),
        ("LoadDependent", {"mu": "1", "v0": "rad/s"}),
        ("Quadratic", {"drag": "N.m.s2/rad2"}),
    ],
)
def test_laws_of_turning_motion_have_its_units(law, units):
    file, name = (
        resources.modelica() / "Effects" / "package.mo",
        f"Effects.RotationalFriction.{law}",
    )
    library = read_library(file)
    inherited = library.components(name).values()
    read = {one.name: library.unit(one) for one in inherited if "parameter" in one.prefixes}
    compiled = {parameter.name: parameter.unit for parameter in flatten(file, name).parameters}
    assert read == compiled == units


def test_a_name_that_a_package_hides_is_refused_with_a_way_out(tmp_path):
    file = stage(tmp_path, ("extends Common.Friction.Viscous", "extends Effects.Friction.Viscous"))
    with pytest.raises(InputError, match=r"Stage\.Effects has no class 'Friction'.*import it"):
        read_effects(read_library(file), "Base")


def test_a_bound_that_the_compiler_would_lose_is_refused(tmp_path):
    file = stage(tmp_path, ("coulomb(max=5.0)", "v0(max=5.0)=0.02"))
    with pytest.raises(InputError, match=r"v0\(\.\.\.\) = 0\.02 where it extends"):
        read_effects(read_library(file), "Base")
