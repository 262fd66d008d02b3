"""Effects describe themselves: read from the wheelset's library, and from those of other fields.

A library uses others: found beside it or among the workbench's, read, compiled, kept, copied.
"""

import shutil
from pathlib import Path

import numpy as np
import pytest

from workbench.__main__ import main
from workbench.diagnosis import choose, read_effects
from workbench.diagnosis.effects.extension import ExtendedModel, build, parameter_of, variables
from workbench.diagnosis.effects.slots import read_slots
from workbench.errors import InputError
from workbench.models import compiler, fmu_cache
from workbench.models.compiler.flat import flatten
from workbench.models.fmu import FMU
from workbench.models.modelica import Library, packages, read_library
from workbench.runtime import resources

from .built import machine_file
from .edits import edit, replaced

ROOT = Path(__file__).parent.parent
WHEELSET = read_library(ROOT / "modelica" / "WheelsetRig" / "package.mo")
EFFECTS = read_effects(WHEELSET, "MinimalObserver")


def tank(folder: Path, *changes: tuple[str, str]) -> Library:
    """A library of one file, with changes."""
    file = folder / "Tank.mo"
    file.write_text(replaced(machine_file("tank_that_runs_out/package.mo"), *changes))
    return read_library(file)


# --- the wheelset ---


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_every_effect_has_a_claim_that_gives_it_a_size(effect):
    """A class with an annotation is an effect, and is found here without being listed."""
    assert [
        definition.name
        for definition in WHEELSET.classes.values()
        if definition.name.startswith("WheelsetRig.Tests.")
        for declared in definition.components
        for component in [declared, *(m.redeclared for m in declared.modifier.inner.values())]
        if component is not None
        and WHEELSET.resolve(component.type, definition.name) == effect.model
        and not component.modifier.inner.keys().isdisjoint(effect.sizes)
    ]


def test_slots_follow_from_the_class_that_an_effect_extends():
    slots = {effect.name: effect.slots for effect in EFFECTS}
    assert slots["BrakeFade"] == ("padFriction",)
    assert slots["SingleDiscWaterFilm"] == ("padFriction",)  # which extends WaterFilm
    assert slots["OutOfRoundWheel"] == slots["WheelRadius"] == ("wheelRadius",)
    assert slots["DriveTorqueGain"] == ("driveTorque",)
    assert slots["ApexOffset"] == ("forceSensor",)


def test_of_several_slots_of_one_class_an_effect_names_its_own():
    slots = {effect.name: effect.slots for effect in EFFECTS}
    assert slots["SpeedSignalDelay"] == ("speedSensorW",)
    assert (slots["WheelsetLosses"], slots["RollerLosses"]) == (("wheelsetLoss",), ("rollerLoss",))


def test_outputs_continue_inputs_where_they_are_of_the_same_kind():
    slots = {slot.name: slot for slot in read_slots(WHEELSET, "MinimalObserver")}
    cylinder, loss = slots["cylinder"], slots["wheelsetLoss"]
    assert (cylinder.inputs, cylinder.outputs) == (("pB", "restBefore"), ("p", "rest"))
    assert slots["padFriction"].inputs == ("level", "Fperp", "v", "TBefore", "lackBefore")
    # A loss takes a speed and gives a torque; its power follows by an equation of the slot.
    assert (loss.inputs, loss.outputs) == (("omega",), ("tau",))
    assert {slot.name for slot in slots.values() if not slot.chained} == {
        "actuation",  # from a pressure to a force
        "wheelsetLoss",
        "rollerLoss",
    }


def test_an_output_that_is_an_input_is_handed_on_by_effects_that_say_nothing_of_it(everything):
    """Water on one of three discs, before and behind laws that hold for all of them."""
    slots = {slot.name: slot for slot in read_slots(WHEELSET, "MinimalObserver")}
    assert slots["padFriction"].outputs == ("mu",)
    assert slots["padFriction"].handed == {"lack": "lackBefore"}
    assert not any(slot.handed for name, slot in slots.items() if name != "padFriction")

    def force(size: str, film: float) -> float:
        """Of the disc that brakes least [N], at 50 rad/s and 2.7 bar."""
        with FMU(everything) as model:
            model.start({"omegaW": 50.0, "omegaR": 50.0 * 0.46 / 0.70}, {size: film})
            model.set(model.variables(["pB"]), np.array([2.7e5]))
            (reading,) = model.get(model.variables(["FDisc"]))
        return float(reading)

    dry = force("padFriction.waterFilm.film", 0.0)
    # Half wet it rubs half way from 0.30 to 0.12, as it does where all are.
    for size in ("padFriction.waterFilm.film", "padFriction.singleDiscWaterFilm.film"):
        assert force(size, 0.5) == pytest.approx(dry * 0.21 / 0.30, rel=1e-12)


def test_of_effects_that_look_the_same_the_usual_one_stands_first():
    names = [effect.name for effect in EFFECTS]
    for usual, rare in (
        ("WaterFilm", "SingleDiscWaterFilm"),
        ("WheelRadius", "RollerRadius"),
        ("FxOffset", "ApexOffset"),
    ):
        assert names.index(usual) < names.index(rare), (usual, rare)


def test_the_command_lists_the_effects_of_a_library(tmp_path, capsys):
    package = ROOT / "modelica" / "WheelsetRig" / "package.mo"
    assert main(["diagnose", "--list", "--library", str(package)]) == 0
    lines = capsys.readouterr().out.splitlines()
    names = [line.split()[0] for line in lines]
    assert names == [*(effect.name for effect in EFFECTS), "LoggerTimeSkew[speeds]"]
    assert "pads that lag behind the measured pressure" in lines[7]


# --- another field ---


def test_effects_of_a_library_of_one_file_are_read_in_its_order(tmp_path):
    effects = read_effects(tank(tmp_path), "Base")
    assert [(effect.name, effect.slots) for effect in effects] == [
        ("Clogging", ("orifice",)),
        ("Leak", ("orifice",)),
        ("GaugeOffset", ("gauge",)),
        ("GaugeGain", ("gauge",)),
    ]
    assert effects[0].text == "an orifice that is narrower than drawn"


def test_after_puts_an_effect_behind_a_more_usual_one(tmp_path):
    library = tank(tmp_path, ('separation="a dry floor"', 'separation="", after="GaugeOffset"'))
    names = [effect.name for effect in read_effects(library, "Base")]
    assert names.index("Leak") > names.index("GaugeOffset")


def test_a_foreign_library_is_extended_and_flattened(tmp_path):
    library = tank(tmp_path)
    effects = read_effects(library, "Base")
    text = ExtendedModel(
        library, "Tank.Base", "Extended", effects, "All effects", parameters={"A": 3.0}
    ).source()
    package = library.file.rename(tmp_path / "package.mo")
    (tmp_path / "Extended.mo").write_text(f"within Tank;\n{text}")
    flat = flatten(package, "Tank.Extended")
    names = {parameter.name for parameter in flat.parameters}
    assert {variables(effect, effect.size)[0] for effect in effects} <= names
    assert [state.name for state in flat.differentiated] == ["h"]


def test_effects_in_a_chain_follow_one_another_and_others_add_up(tmp_path):
    """Closed forms: a level of 1 m, Torricelli's law."""
    library = tank(tmp_path)
    text = ExtendedModel(
        library, "Base", "Extended", read_effects(library, "Base"), "", {"Leak": {"area": 2e-4}}
    ).source()
    path = tmp_path / "Extended.fmu"
    build(library, "Extended", text, path, every_platform=False)
    velocity = np.sqrt(2.0 * 9.81)
    with FMU(path) as fmu:
        sizes = {
            "orifice.clogging.share": 0.1,
            "gauge.gaugeOffset.offset": 0.2,
            "gauge.gaugeGain.gain": 0.5,
        }
        fmu.start({}, sizes)
        # Of 1e-3 m2 a tenth is closed; the leak of 2e-4 m2 is as wide as ever.
        expected = -(0.9e-3 + 2e-4) * velocity / 2.0
        np.testing.assert_allclose(fmu.derivatives(), [expected], rtol=1e-12)
        np.testing.assert_allclose(fmu.get(fmu.variables(["reading"])), [1.5 * 1.2], rtol=1e-12)


def test_what_is_handed_on_is_so_where_changes_add_up(tmp_path):
    library = tank(
        tmp_path,
        (
            'output Real q(unit="m3/s") "Flow";',
            'output Real q(unit="m3/s") "Flow";\n'
            '    input Real siltBefore(unit="1") = 0.0 "From earlier in the slot";\n'
            '    output Real silt(unit="1") = siltBefore "Share of the orifice";',
        ),
        (
            "extends PartialOutflow;\n    parameter Real share",
            "extends PartialOutflow(silt=siltBefore + share);\n    parameter Real share",
        ),
        (
            '    output Real reading(unit="m") = gauge',
            '    output Real silt(unit="1") = orifice.silt "Share of the orifice";\n'
            '    output Real reading(unit="m") = gauge',
        ),
    )
    text = ExtendedModel(library, "Base", "Extended", read_effects(library, "Base"), "").source()
    path = tmp_path / "Extended.fmu"
    build(library, "Extended", text, path, every_platform=False)
    with FMU(path) as fmu:
        fmu.start({}, {"orifice.clogging.share": 0.3, "orifice.leak.area": 2e-4})
        (silt,) = fmu.get(fmu.variables(["silt"]))
        assert silt == pytest.approx(0.3, rel=1e-12)  # the leak, which comes behind, says nothing
        (rate,) = fmu.derivatives()
        assert rate == pytest.approx(-(0.7e-3 + 2e-4) * np.sqrt(2.0 * 9.81) / 2.0, rel=1e-12)


def test_effects_beside_a_class_with_values_of_the_base_model_are_refused(tmp_path):
    library = tank(tmp_path, ("Orifice orifice(h=h)", "Orifice orifice(h=h, a=A/1e3)"))
    effects = read_effects(library, "Base")
    with pytest.raises(InputError, match=r"Clogging and Leak beside a Tank\.Orifice"):
        ExtendedModel(library, "Base", "Extended", effects, "").source()
    ExtendedModel(library, "Base", "Extended", effects[1:], "").source()  # one of them alone


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "    extends PartialGauge;\n    parameter",
            "    parameter",
            "extends no slot of the base",
        ),
        (
            "    extends PartialGauge;\n    parameter",
            "    extends PartialGauge;\n    input Real temperature;\n    parameter",
            "extends no slot of the base",
        ),
        ('size="share"', 'size="shar"', r"without a parameter 'shar' \(closest: 'share'\)"),
        ("max=0.9) = 0.0", "max=0.9) = 0.1", "share = 0.1; expected '= 0.0'"),
        ("max=0.9) = 0.0", "max=0.9)", "share without a value; expected '= 0.0'"),
        ("matters=0.02, ", "", "found no 'matters'; expected a number above 0"),
        ("matters=0.02", "matters=-0.02", "found matters = -0.02"),
        ("matters=0.02", 'matters="x"', "found matters = 'x'"),
        (', separation="a look into the orifice"', "", "found no 'separation'"),
        ("matters=0.02", "mattters=0.02", r"found 'mattters' \(closest: 'matters'\)"),
        ("(effect(", "(efect(", r"found 'efect' \(closest: 'effect'\)"),
        ('size="share",', 'size="share", slots={"gauge"},', "found slot 'gauge'"),
        ('size="share",', 'size="share", shapes(b={1.0}),', "without a parameter 'b'"),
        (
            'size="share",',
            'size="share", shapes(share=1.0),',
            r"found share = 1\.0; expected an arr",
        ),
        ('size="share",', 'size="share", shapes(share={0.0, 1.0}),', "numbers that are not 0"),
        ('size="share",', 'size="share", after="Rust",', 'found after="Rust"'),
        ('size="share",', 'size="share", after="Clogging",', "which does not stand after this one"),
        ('size="share",', 'size={"a", "b"},', r"found size = \('a', 'b'\)"),
        ('size="share",', 'size="share", falling(signal="inflow"),', "found no 'because'"),
    ],
)
def test_an_effect_that_says_something_wrong_is_refused_with_its_line(old, new, message, tmp_path):
    library = tank(tmp_path, (old, new))
    with pytest.raises(InputError, match=message) as refused:
        read_effects(library, "Base")
    assert str(tmp_path / "Tank.mo") in refused.value.where


def test_a_base_model_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"no class 'Bas' \(closest: 'Tank\.Base'\)"):
        read_effects(tank(tmp_path), "Bas")


def orchard(folder: Path, change: tuple[str, str] = ("", "")) -> Library:
    (folder / "Orchard.mo").write_text(machine_file("orchard/Orchard.mo").replace(*change))
    return read_library(folder / "Orchard.mo")


def test_a_size_that_is_an_array_makes_an_effect_in_each_place(tmp_path):
    effects = read_effects(orchard(tmp_path), "Base")
    names = ["Clogging[1]", "Clogging[2]", "Clogging[3]", "Drought"]
    assert [effect.name for effect in effects] == names
    assert variables(effects[1], "lost") == ("valves.clogging.lost[2]",)
    assert parameter_of(effects[1], "valves.clogging.lost[2]") == "lost"
    assert parameter_of(effects[1], "valves.clogging.lost[3]") == ""
    assert parameter_of(effects[3], "valves.drought.dry") == "dry"


def test_all_places_or_one_are_chosen_by_name(tmp_path):
    effects = read_effects(orchard(tmp_path), "Base")
    assert [effect.name for effect in choose(["Clogging"], effects)] == [
        effect.name for effect in effects[:3]
    ]
    assert choose(["Clogging[2]", "Drought"], effects) == (effects[1], effects[3])
    with pytest.raises(InputError, match=r"no effect of this name \(closest: 'Clogging"):
        choose(["Clogging[4]"], effects)


def test_the_extended_model_has_a_size_in_its_place_alone(tmp_path):
    """Two places of one class are one component; the other effect of the slot follows it."""
    library = orchard(tmp_path)
    effects = read_effects(library, "Base")
    values = {"Clogging[1]": {"lost": 0.1}, "Clogging[3]": {"lost": 0.5}, "Drought": {"dry": 0.2}}
    chosen = [effects[0], effects[2], effects[3]]
    text = ExtendedModel(
        library, "Base", "Extended", chosen, "Two valves, and the well", values
    ).source()
    package = library.file.rename(tmp_path / "package.mo")
    (tmp_path / "Extended.mo").write_text(f"within Orchard;\n{text}")
    flat = flatten(package, "Orchard.Extended")
    defaults = {parameter.name: parameter.start for parameter in flat.parameters}
    assert [defaults[f"valves.clogging.lost[{k}]"] for k in (1, 2, 3)] == [0.1, 0.0, 0.5]
    assert defaults["valves.drought.dry"] == 0.2
    assert [defaults[f"opening[{k}]"] for k in (1, 2, 3)] == [0.3, 0.3, 0.3]  # fill(0.3, 3)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('size="lost",', 'size="lost", shapes(share={0.5}),', "shapes of Clogging"),
        ("Integer n = 3", "Integer n = 1 + 2", r"found lost = zeros\(n\); expected 'parameter Int"),
    ],
)
def test_places_that_cannot_be_counted_or_told_apart_are_refused(old, new, message, tmp_path):
    with pytest.raises(InputError, match=message):
        read_effects(orchard(tmp_path, (old, new)), "Base")


def stage(folder: Path, *changes: tuple[str, str]) -> Path:
    file = folder / "Stage" / "package.mo"
    file.parent.mkdir()
    file.write_text(replaced(machine_file("stage/package.mo"), *changes))
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
    edit(law, ("tanh(v/v0)", "sin(v/v0)"))
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
        edit(law, ("f = damping*v", "f = 2.0*damping*v"))
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
        np.testing.assert_allclose(fmu.get(fmu.variables(["reading"])), [0.5 * 0.6], rtol=1e-12)


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
    read = {
        component.name: library.unit(component)
        for component in inherited
        if "parameter" in component.prefixes
    }
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
