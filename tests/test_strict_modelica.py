"""What a library says of others must be so: each wrong one is refused in words, with its line."""

import re
import tomllib
from pathlib import Path

import pytest

from workbench.errors import InputError
from workbench.models.compiler import build, openmodelica
from workbench.models.compiler.flat import flatten
from workbench.models.modelica import check, read_library

from .built import library, machine_file

ROOT = Path(__file__).parent.parent
LIBRARIES = sorted(path.parent for path in (ROOT / "modelica").glob("*/package.mo"))

COMMON = machine_file("strict/package.mo").removeprefix("package Lib\n").removesuffix("end Lib;\n")


# Model M, and what is said of it.
WRONG = tomllib.loads(machine_file("strict/wrong.toml"))


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_what_is_not_so_is_refused_with_its_line(wrong, tmp_path):
    with pytest.raises(InputError, match=wrong["message"]) as refused:
        check(read_library(library(tmp_path, COMMON + wrong["text"])), "Lib.M")
    assert re.search(r"Lib/package\.mo:\d+$", refused.value.where)


RIGHT = tomllib.loads(machine_file("strict/right.toml"))


@pytest.mark.parametrize("text", RIGHT.values(), ids=RIGHT)
def test_what_is_so_is_accepted(text, tmp_path):
    check(read_library(library(tmp_path, COMMON + text)), "Lib.M")


@pytest.mark.parametrize("folder", LIBRARIES, ids=lambda folder: folder.name)
def test_every_class_that_comes_with_the_workbench_says_what_is_so(folder):
    check(read_library(folder / "package.mo"))


def test_either_compiler_refuses_it_before_its_front_end_is_asked(tmp_path, monkeypatch):
    package = library(tmp_path, COMMON + "model M Part part(slot(gain=2.0)); end M;")
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
        flatten(library(tmp_path, COMMON + text), "Lib.M")


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
        flatten(library(tmp_path, COMMON + law + text), "Lib.M")
    alone = text.replace("k(max=2.0)=1.0", "k=1.0")
    (tmp_path / "alone").mkdir()
    flatten(library(tmp_path / "alone", COMMON + law + alone), "Lib.M")
