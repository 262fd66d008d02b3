"""What a library says of others must be so: each wrong one is refused in words, with its line."""

import re
import tomllib
from pathlib import Path

import pytest

from workbench.errors import InputError
from workbench.models.compiler import build, openmodelica
from workbench.models.compiler.flat import flatten
from workbench.models.modelica import check, read_library

from .built import machine_file

ROOT = Path(__file__).parent.parent
LIBRARIES = sorted(path.parent for path in (ROOT / "modelica").glob("*/package.mo"))

COMMON = machine_file("strict/package.mo").removesuffix("end Lib;\n")


def write(folder: Path, text: str) -> Path:
    file = folder / "Lib" / "package.mo"
    file.parent.mkdir()
    file.write_text(f"{COMMON}{text}\nend Lib;\n")
    return file


# Model M, and what is said of it.
WRONG = tomllib.loads((ROOT / "tests" / "wrong" / "modelica.toml").read_text())


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_what_is_not_so_is_refused_with_its_line(wrong, tmp_path):
    with pytest.raises(InputError, match=wrong["message"]) as refused:
        check(read_library(write(tmp_path, wrong["text"])), "Lib.M")
    assert re.search(r"Lib/package\.mo:\d+$", refused.value.where)


RIGHT = {
    "attributes of every kind": (
        "model M parameter Integer n(min=1, max=3) = 2; parameter State s(start=State.open);"
        ' Real x(quantity="Length", unit="m", displayUnit="mm", min=0, max=1, start=0, fixed=true,'
        " nominal=1, unbounded=false, stateSelect=StateSelect.prefer); parameter Boolean b(start="
        'true) = true; parameter String t(start="") = "a"; equation der(x) = n; end M;'
    ),
    "inherited elements, two classes up": (
        "model N extends Part(k=2.0); end N; model M extends N(slot(y(min=0.0)), k=3.0); end M;"
    ),
    "protected elements of a base": "model M extends Part(hidden(min=0.0)); end M;",
    "arrays": "model M Part part[2](each k=2.0, x(each start=0.0), slot(u={1.0, 2.0})); end M;",
    "elements of what is redeclared": (
        "model N = Part(redeclare replaceable Gain slot); model M N n(slot(gain=2.0)); "
        "N o(redeclare Named slot(label(min=0.0))); end M;"
    ),
    "elements of a redeclared class": (
        "model M Holder a(redeclare model Law = Gain(gain=3.0), law(gain=4.0)); end M;"
    ),
    "a stand-in that extends nothing": (
        "model Alike input Real u; output Real y; equation y = u; end Alike;"
        " model M Part part(redeclare Alike slot); end M;"
    ),
    "connectors of the same variables": (
        "connector Alike Real s; flow Real f; end Alike; model N Alike c; equation c.s = 1.0;"
        " end N; model M Part part[2]; N n; equation for i in 1:2 loop connect(part[i].a, n.c); "
        "end for; if true then connect(part[1].p, part[2].p); end if; end M;"
    ),
    "connectors of a predefined type": (
        "model N Signal u; end N; model M Signal u; N n; equation connect(u, n.u); end M;"
    ),
    "what an expandable connector gets": (
        "model M Bus bus; Signal u; equation connect(bus.speed, u); end M;"
    ),
    "an inner further out": (
        "model N Falls falls; end N; model M N n; inner World world(g=1.6); end M;"
    ),
    "what is wrong in another model": "model M Part part; end M; model N Part part(kk=1.0); end N;",
}


@pytest.mark.parametrize("text", RIGHT.values(), ids=RIGHT)
def test_what_is_so_is_accepted(text, tmp_path):
    check(read_library(write(tmp_path, text)), "Lib.M")


@pytest.mark.parametrize("library", LIBRARIES, ids=lambda library: library.name)
def test_every_class_that_comes_with_the_workbench_says_what_is_so(library):
    check(read_library(library / "package.mo"))


def test_either_compiler_refuses_it_before_its_front_end_is_asked(tmp_path, monkeypatch):
    package = write(tmp_path, "model M Part part(slot(gain=2.0)); end M;")
    omc = tmp_path / "bin" / "omc"
    omc.parent.mkdir()
    omc.write_text("#!/bin/sh\ntouch called\n")
    omc.chmod(0o755)
    monkeypatch.setenv("PATH", str(omc.parent))
    out = tmp_path / "out"
    message = r"package\.mo:\d+: found a modifier of 'gain'"
    with pytest.raises(InputError, match=message):
        build(package, "Lib.M", out / "M.fmu")
    with pytest.raises(InputError, match=message):
        openmodelica.build_with_omc(package, ["Lib.M"], out)
    assert not out.exists()


def test_what_the_front_end_would_drop_is_refused(tmp_path):
    """A component that the base inherits stays as it was, however right its redeclaration is."""
    text = "model N extends Part; end N; model M extends N(redeclare Named slot); end M;"
    message = r"redeclaration of 'slot', which Lib\.N inherits.*declare 'slot' in Lib\.N"
    with pytest.raises(InputError, match=message):
        flatten(write(tmp_path, text), "Lib.M")


@pytest.mark.parametrize(
    "text",
    [
        "model M extends A(k(max=2.0)=1.0); end M;",
        "model M = A(k(max=2.0)=1.0);",
        "model H A a; end H; model M H h(a(k(max=2.0)=1.0)); end M;",
        "model H replaceable A a; end H; model M H h(redeclare A a(k(max=2.0)=1.0)); end M;",
    ],
)
def test_a_value_that_the_front_end_would_lose_is_refused(text, tmp_path):
    """It would go on with the default: a model with another number, and no word of it."""
    law = "model A parameter Real k(max=1.0) = 0.5; output Real y = k; end A; "
    with pytest.raises(
        InputError, match=r"package\.mo:\d+: found a value of 'k' together with max"
    ):
        flatten(write(tmp_path, law + text), "Lib.M")
    alone = text.replace("k(max=2.0)=1.0", "k=1.0")
    (tmp_path / "alone").mkdir()
    flatten(write(tmp_path / "alone", law + alone), "Lib.M")
