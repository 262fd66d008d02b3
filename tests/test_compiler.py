"""Modelica to FMU: what is computed, what is refused and how, and that nothing is left behind."""

import itertools
import tempfile
import zipfile
from pathlib import Path

import casadi
import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from numpy.testing import assert_allclose

from workbench.errors import InputError
from workbench.models import compiler
from workbench.models.compiler.description import base_units
from workbench.models.compiler.explicit import StateSpace, make_explicit
from workbench.models.compiler.flat import flatten
from workbench.models.fmu import FMU

from .built import library, machine_file


def state_space(folder: Path, text: str, model: str = "Lib.M") -> StateSpace:
    return make_explicit(flatten(library(folder, text), model))


def evaluate(
    model: StateSpace, x: list[float], u: list[float], t: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives and outputs at default parameters."""
    p = [v.start for v in model.parameters]
    function = casadi.Function("f", [model.t, model.x, model.u, model.p], [model.f, model.w])
    f, w = function(t, x, u, p)
    return np.array(f).ravel(), np.array(w).ravel()


def test_expressions_mean_what_modelica_says(tmp_path):
    """Reference: numpy, for arrays, matrices, functions with branches and loops, and builtins."""
    model = state_space(tmp_path, machine_file("expressions/Expressions.mo"))
    assert [v.start for v in model.states] == [2.0, 4.0, 6.0]
    r, u, t = np.array([1.5, -2.0, 0.5]), -0.7, 3.0
    f, w = evaluate(model, list(r), [u], t)
    A = np.eye(3) + np.arange(1.0, 10.0).reshape(3, 3)
    length = np.linalg.norm(r)
    assert_allclose(f, -np.array([1, 2, 3]) * r + u)
    expected = [
        A[0] @ r + r[1] + r[2] + t + r @ r,
        r.min() + max(r[0], u) + 4.0 + np.arctan2(r[0], 2.0) + abs(u),
        *(np.cross(r, [1.0, 0.0, u]) + A.T @ r - r),
        2.0 * r[1] / length + length,
    ]
    assert_allclose(w, expected, rtol=1e-14)


CHAIN = machine_file("chain/Chain.mo")


def test_spring_dampers_between_connectors_become_an_explicit_ode(tmp_path):
    """Reference: equations of motion of two masses in a chain, written by hand."""
    model = state_space(tmp_path, CHAIN)
    assert [v.name for v in model.states] == ["m[1].s", "m[1].v", "m[2].s", "m[2].v"]
    s1, v1, s2, v2 = x = [0.3, -1.0, 0.7, 2.0]
    f, w = evaluate(model, x, [])
    first, second = 50 * s1 + 3 * v1, 70 * (s2 - s1) + 3 * (v2 - v1)
    assert_allclose(f, [v1, (second - first) / 2.0, v2, -second / 5.0], rtol=1e-14)
    assert_allclose(w, [first], rtol=1e-14)


def test_a_failed_build_leaves_no_folder_and_the_old_fmu_alone(tmp_path):
    """What is refused, and with which words, is a table of `test_modelica_constructs`."""
    old, new = tmp_path / "M.fmu", tmp_path / "out" / "M.fmu"
    old.write_text("old")
    package = library(tmp_path, "model M Real x; equation der(x) = y; end M;")
    for target in (old, new):
        with pytest.raises(InputError, match="unresolved component reference: 'y'"):
            compiler.build(package, "Lib.M", target)
    assert old.read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["Lib", "M.fmu"]


@pytest.mark.parametrize(
    ("unit", "exponents", "factor"),
    [
        ("N.m", {"kg": 1, "m": 2, "s": -2}, 1.0),
        ("kg.m2", {"kg": 1, "m": 2}, 1.0),
        ("N.m.s2/rad2", {"kg": 1, "m": 2, "rad": -2}, 1.0),
        ("bar", {"kg": 1, "m": -1, "s": -2}, 1e5),
        ("1", {}, 1.0),
    ],
)
def test_units_are_reduced_to_base_units(unit, exponents, factor):
    assert base_units(unit) == (exponents, factor)


def test_an_unknown_unit_is_refused():
    with pytest.raises(InputError, match="unit 'wombats'"):
        base_units("wombats")


@pytest.fixture(scope="module", params=[2, 3])
def chain(request, tmp_path_factory) -> tuple[Path, int]:
    folder = tmp_path_factory.mktemp("chain")
    path = folder / "M.fmu"
    package = library(folder, CHAIN)
    compiler.build(package, "Lib.M", path, fmi=request.param, platforms=["linux-x86_64"])
    return path, request.param


def test_a_built_fmu_validates(chain):
    path, fmi = chain
    assert validate_fmu(str(path)) == []
    assert fmpy.read_model_description(str(path)).fmiVersion == f"{fmi}.0"


def test_a_built_fmu_computes_what_the_equations_say(chain):
    path, _ = chain
    with FMU(path) as fmu:
        fmu.start({"m[1].s": 0.3, "m[1].v": -1.0}, {"m[1].m": 4.0})
        fmu.set_states(np.array([0.3, -1.0, 0.7, 2.0]))
        first, second = 50 * 0.3 - 3.0, 70 * 0.4 + 9.0
        assert_allclose(fmu.derivatives(), [-1.0, (second - first) / 4.0, 2.0, -second / 5.0])
        A = fmu.state_jacobian()
        assert_allclose(A[1], [-(50 + 70) / 4, -6 / 4, 70 / 4, 3 / 4], rtol=1e-14)


def test_dependencies_are_those_of_the_equations(chain):
    path, _ = chain
    description = fmpy.read_model_description(str(path))
    assert {
        u.variable.name: sorted(d.name for d in u.dependencies)
        for u in [*description.derivatives, *description.outputs]
    } == {
        "der(m[1].s)": ["m[1].v"],
        "der(m[1].v)": ["m[1].s", "m[1].v", "m[2].s", "m[2].v"],
        "der(m[2].s)": ["m[2].v"],
        "der(m[2].v)": ["m[1].s", "m[1].v", "m[2].s", "m[2].v"],
        "force": ["m[1].s", "m[1].v"],
    }


def test_the_same_sources_give_the_same_bytes(tmp_path):
    package = library(tmp_path, CHAIN)
    paths = [tmp_path / name / "M.fmu" for name in ("a", "b")]
    for path in paths:
        compiler.build(package, "Lib.M", path, platforms=["linux-x86_64", "macos-aarch64"])
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_every_variable_of_the_minimal_observer_has_unit_and_description(minimal_path):
    description = fmpy.read_model_description(str(minimal_path))
    assert validate_fmu(str(minimal_path)) == []
    bare = [v.name for v in description.modelVariables if not v.unit or not v.description]
    assert bare == ([] if description.fmiVersion == "2.0" else ["time"])


def test_the_archive_holds_sources_and_no_paths_of_the_building_machine(minimal_path):
    with zipfile.ZipFile(minimal_path) as archive:
        names = archive.namelist()
        assert "sources/model.c" in names
        folders = (tempfile.gettempdir(), str(Path.home()), "site-packages", "/home/", "/Users/")
        for name, folder in itertools.product(names, folders):
            assert folder.encode() not in archive.read(name), f"{folder} in {name}"


def test_a_model_has_its_own_experiment_not_that_of_a_namesake(tmp_path):
    package = library(tmp_path, machine_file("two_of_one_name/Pumps.mo"))
    new, old, plain = (
        flatten(package, f"Lib.{name}") for name in ("New.Pump", "Old.Pump", "New.Plain")
    )
    assert new.description == "the new pump"
    assert new.experiment == {"StartTime": 50.0, "StopTime": 500.0, "Tolerance": 1e-9}
    assert old.description == "the old pump"
    assert old.experiment == {"StopTime": 1.0, "Tolerance": 1e-2}
    assert plain.experiment == {}


def test_a_panic_of_the_front_end_is_an_error_with_file_and_line(tmp_path, capfd):
    """The front end panics where the derivative of an input is asked for."""
    package = library(
        tmp_path,
        "  model M\n    input Real u; output Real y;\n  equation\n    y = der(u);\n  end M;\n",
    )
    with pytest.raises(InputError, match=r"package\.mo:5: found der\(u\): .*continuous state"):
        flatten(package, "Lib.M")
    assert "panicked" not in capfd.readouterr().err
