"""The reader of Modelica source: what is written is read, or refused with its line."""

import re
from pathlib import Path

import pytest

from workbench.errors import InputError
from workbench.models.modelica import Library, read_library

ROOT = Path(__file__).parent.parent


def library(folder: Path, text: str) -> Library:
    file = folder / "P.mo"
    file.write_text(text)
    return read_library(file)


@pytest.fixture(scope="module")
def wheelset() -> Library:
    return read_library(ROOT / "modelica" / "WheelsetRig" / "package.mo")


# --- what is read ---


def test_classes_within_a_class_are_read_in_their_order(tmp_path):
    read = library(
        tmp_path,
        'package P "Two" model A model B end B; end A; partial model C "Third" end C; end P;',
    )
    assert list(read.classes) == ["P", "P.A", "P.A.B", "P.C"]
    assert [definition.partial for definition in read.classes.values()] == [
        False,
        False,
        False,
        True,
    ]
    assert read.find("C").description == read.find("P.C").description == "Third"


def test_every_file_of_the_library_is_read_in_the_order_of_its_packages(wheelset):
    files = {path.stem for path in (ROOT / "modelica" / "WheelsetRig").rglob("*.mo")} - {"package"}
    assert files <= {name.rpartition(".")[2] for name in wheelset.classes}
    order = (ROOT / "modelica" / "WheelsetRig" / "Effects" / "package.order").read_text().split()
    of_effects = [n.rpartition(".")[2] for n in wheelset.classes if n.startswith("WheelsetRig.Ef")]
    assert of_effects == ["Effects", *order]


def test_comments_are_none_of_the_code_and_strings_none_of_the_comments(tmp_path):
    read = library(
        tmp_path,
        """package P "No // comment, no /* comment */, a \\"quote\\" and a \\\\"
  // model Hidden end Hidden;
  /* model Hidden "
     end Hidden; */
  model A "end A;" // end A;
    parameter Real x(unit="a;b") = 1.0 /* = 2.0 */ "First, ""
      ; // ";
  equation
    assert(x > 0, "end A; \\" )");
  end A;
end P;
""".replace('First, ""', 'First, " + "joined"'),
    )
    assert list(read.classes) == ["P", "P.A"]
    assert read.find("P").description == 'No // comment, no /* comment */, a "quote" and a \\'
    x = read.components("P.A")["x"]
    assert (x.modifier.value, read.unit(x), x.description) == ("1.0", "a;b", "First, joined")


def test_a_component_has_its_prefixes_type_values_and_constraint(tmp_path):
    read = library(
        tmp_path,
        """package P
  partial model Slot end Slot;
  model Null extends Slot; end Null;
  model A
    final parameter Integer n = if 1 > 0 then 3 else 4 "Number";
    parameter Real M[2, 2] = [1, 2; 3, 4];
    parameter Real a[2](each min=-1.0, max={f(1, "x"), 2}), b = 2.0*a[1] "Second";
    input Real u(start=0.0, fixed=true);
    parameter String s = "text" "Label";
    Real y if n > 2 "Sometimes";
    replaceable Null slot(redeclare model X = Y, x(y=1)=u) constrainedby Slot(x=u) "Place";
  equation
    y = u;
    for i in 1:n loop a[i] = 1; end for;
  end A;
end P;
""",
    )
    n, M, a, b, u, s, y, slot = read.components("P.A").values()
    assert n.prefixes == {"final", "parameter"}
    assert M.modifier.value == "[1, 2; 3, 4]"
    assert n.modifier.value == "if 1 > 0 then 3 else 4"
    assert [modification.value for modification in a.modifier.inner.values()] == [
        "-1.0",
        '{f(1, "x"), 2}',
    ]
    assert (b.modifier.value, b.description, b.type) == ("2.0*a[1]", "Second", "Real")
    assert "input" in u.prefixes
    assert (s.modifier.value, s.description) == ('"text"', "Label")
    assert y.description == "Sometimes"
    assert (slot.type, slot.constraint, slot.description) == ("Null", "Slot", "Place")
    assert slot.modifier.inner["x"].value == "u"
    assert read.find("A").equations == {"y"}


def test_names_are_looked_up_from_the_inside_out_through_extends_and_imports(tmp_path):
    read = library(
        tmp_path,
        """package P
  import Far.Units;
  package Q
    import P.R.*;
    model A end A;
    model B extends A; end B;
    model C extends .P.A; end C;
    model D extends InR; end D;
    model E extends Units.Torque; end E;
    model F extends Other.A; end F;
  end Q;
  package R model InR end InR; end R;
  package S
    extends Q;
    model G extends B; end G;
  end S;
  model A end A;
end P;
""",
    )
    assert {name[-1]: read.bases(f"P.Q.{name}")[0] for name in "BCDEF"} == {
        "B": "P.Q.A",
        "C": "P.A",
        "D": "P.R.InR",
        "E": "Far.Units.Torque",
        "F": "Other.A",
    }
    assert read.ancestors("P.S.G") == ("P.Q.B", "P.Q.A")


def test_what_a_class_inherits_has_the_values_it_gives(wheelset):
    whole, single = (
        wheelset.components(f"WheelsetRig.Effects.{name}")
        for name in ("WaterFilm", "SingleDiscWaterFilm")
    )
    assert list(whole) == list(single)
    assert [parts["wet"].modifier.value for parts in (whole, single)] == ["1.0", "1.0/3.0"]
    assert wheelset.unit(single["wet"]) == "1"
    assert wheelset.unit(single["E0"]) == "J"  # by its type, whose unit is a modifier


def test_a_vendor_annotation_is_numbers_texts_arrays_and_parts(tmp_path):
    read = library(
        tmp_path,
        """package P
  model A
    annotation (Icon(graphics={Line(points={{-1, 2}, {3, 4}})}), __Other(x=1),
      __Workbench(a(size="b" + "c", step=-1.5e-3, on=true, values={0.1e6, 1}, in_={"x", "y"}),
        empty="a \\"b\\""), Documentation(info="<html>)</html>"));
  end A;
  model B extends A; end B;
end P;
""",
    )
    assert read.find("A").vendor == {
        "a": {"size": "bc", "step": -1.5e-3, "on": True, "values": (1e5, 1.0), "in_": ("x", "y")},
        "empty": 'a "b"',
    }
    assert read.find("B").vendor == {}  # annotations are not inherited


# --- what is refused ---


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("package P\n  model A\n  end B;\nend P;", 3, "expected 'end A'"),
        ("package P\n  model A", 2, "found the end of the file"),
        ('package P\n  model A "no end\nend A;\nend P;', 2, "may lack its end"),
        ("package P\n  /* no end\nend P;", 2, "may lack its end"),
        ("package P\n  model A\n  Real x = ;\n  end A;\nend P;", 3, "rest of an expression"),
        ("package P\n  model A\n  Real x(min=0;\n  end A;\nend P;", 3, "expected ','"),
        ("package P\n  model A\n  Real x = f(1;\n  end A;\nend P;", 3, r"found ';'; expected '\)'"),
        ("package P\n  model extends A end A;\nend P;", 2, "found 'model extends A'"),
        ("package P\nend P;\npackage Q\nend Q;", 3, "one class in a file"),
        ("within Q;\npackage P\nend P;", 1, "no 'within'"),
        ("package P\n  model A end A;\n  model A end A;\nend P;", 3, "a second class P.A"),
        *(
            (
                f"package P\n  model A\n    {part} annotation (__Workbench(a=1));\n  end A;\n"
                "end P;",
                3,
                "found 'annotation'; expected ';' before",
            )
            for part in ("extends B", "Real x", "equation x = 1.0", "import P.Q")
        ),
        ("package P\n annotation (__Workbench(a=b));\nend P;", 2, "found 'b'; expected a number"),
        ("package P\n annotation (__Workbench(a=1/3));\nend P;", 2, "found '/'"),
        ("package P\n annotation (__Workbench(a=1, a=2));\nend P;", 2, "expected one 'a'"),
        ("package P ?\nend P;", 1, "found '\\?'"),
        *(
            (f"package P\n  model {name}\n  end {name};\nend P;", 2, "names of at most 4096 char")
            for name in ("x" * 100_000, "'" + "x 1" * 2000 + "'")
        ),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_line(text, line, message, tmp_path):
    with pytest.raises(InputError, match=message) as refused:
        library(tmp_path, text)
    assert re.search(rf"P\.mo:{line}\b", refused.value.where)


def test_a_class_inherited_on_two_ways_has_what_either_says(tmp_path):
    parts = library(
        tmp_path,
        "package P partial model A input Real u; input Real w; end A; "
        'partial model B extends A(u(unit="m")); end B; '
        "model L extends A(u(min=1)); parameter Real p(max=3) = 0; end L; "
        "model K extends L; end K; model C extends B; extends K(p(min=2)); end C; end P;",
    ).components("P.C")
    assert list(parts) == ["u", "w", "p"]
    assert {key: modification.value for key, modification in parts["u"].modifier.inner.items()} == {
        "unit": '"m"',
        "min": "1",
    }
    assert set(parts["p"].modifier.inner) == {"min", "max"}


def test_a_file_must_stand_where_its_class_belongs(tmp_path):
    (tmp_path / "package.mo").write_text("package P end P;")
    part = tmp_path / "A.mo"
    part.write_text("model A end A;")
    with pytest.raises(InputError, match="expected 'within P;'"):
        read_library(tmp_path / "package.mo")
    part.write_text("within P; model B end B;")
    with pytest.raises(InputError, match=r"found class P\.B; expected a class named A"):
        read_library(tmp_path / "package.mo")
    part.write_bytes(b"\xef\xbb\xbfwithin P; model A end A;")
    with pytest.raises(InputError, match="found a byte order mark before its text"):
        read_library(tmp_path / "package.mo")
    part.write_bytes(b'within P; model A "\xff" end A;')
    with pytest.raises(InputError, match="expected Modelica in UTF-8"):
        read_library(tmp_path / "package.mo")
    with pytest.raises(InputError, match="no such file"):
        read_library(tmp_path / "Missing.mo")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("model A extends B; end A; model B extends A; end B;", "P.A extends itself, by P.B"),
        (
            "model A extends C; end A; model C extends D; end C; model D extends C; end D;",
            "P.C extends itself, by P.D",
        ),
        (
            "model A extends A0; end A;"
            + "".join(f"model A{k} extends A{k + 1}; end A{k};" for k in range(999)),
            "which 101 classes extend one after the other",
        ),
        ("type A = B; type B = A;", "P.A extends itself, by P.B"),
        ("package Q end Q; model A extends Q.X; end A;", "P.Q has no class 'X'"),
    ],
)
def test_what_a_class_extends_must_lead_somewhere(text, message, tmp_path):
    read = library(tmp_path, f"package P {text} end P;")
    with pytest.raises(InputError, match=message):
        read.components("P.A")


def test_an_unknown_class_is_refused_with_the_closest(wheelset):
    with pytest.raises(InputError, match=r"closest: 'WheelsetRig\.MinimalObserver'"):
        wheelset.find("MinimalObserve")
