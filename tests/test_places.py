"""An effect whose size is an array is one candidate in each of its places."""

from pathlib import Path

import pytest

from workbench.diagnosis import choose, read_effects
from workbench.diagnosis.effects.extension import ExtendedModel, parameter_of, variables
from workbench.errors import InputError
from workbench.models.compiler.flat import flatten
from workbench.models.modelica import Library, read_library

ORCHARD = """package Orchard "Three trees that drink from one pipe"
  partial model PartialValves "Slot: from openings to flows"
    parameter Integer n = 3 "Valves";
    input Real u[n](each unit="1") "Opening";
    output Real y[n](each unit="1") "Opening that acts";
  end PartialValves;

  model Valves "Null version"
    extends PartialValves;
  equation
    y = u;
  end Valves;

  model Clogging "a valve that is clogged"
    extends PartialValves;
    parameter Real share(unit="1") = 1.0 "Of the water, that it is clogged for";
    parameter Real lost[n](each unit="1", each min=0.0, each max=1.0) = zeros(n) "Of the opening";
  equation
    for i in 1:n loop
      y[i] = u[i]*(1.0 - share*lost[i]);
    end for;
    annotation (__Workbench(effect(size="lost", matters=0.02, separation="a look")));
  end Clogging;

  model Drought "less water in all valves"
    extends PartialValves;
    parameter Real dry(unit="1", min=0.0, max=1.0) = 0.0 "Of the water";
  equation
    y = u*(1.0 - dry);
    annotation (__Workbench(effect(
      size="dry", matters=0.02, after="Clogging", separation="a look at the well")));
  end Drought;

  model Base "Water in the ground"
    parameter Real opening[3](each unit="1") = fill(0.3, 3) "Of the valves";
    output Real water[3](each unit="m3", each start=0.0, each fixed=true) "Of the trees";
    replaceable Valves valves(u=opening) constrainedby PartialValves(u=opening) "Valves";
  equation
    for i in 1:3 loop
      der(water[i]) = valves.y[i];
    end for;
  end Base;
end Orchard;
"""


def orchard(folder: Path, change: tuple[str, str] = ("", "")) -> Library:
    (folder / "Orchard.mo").write_text(ORCHARD.replace(*change))
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
    assert [one.name for one in choose(["Clogging"], effects)] == [
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
    found = [effects[0], effects[2], effects[3]]
    text = ExtendedModel(
        library, "Base", "Extended", found, "Two valves, and the well", values
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
