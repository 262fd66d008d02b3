"""What compiles of Modelica: each construct computes what it means, or is refused by line.

One small model for each construct, with its solution in closed form or the refusal that names file,
line and construct; blocks of the standard library likewise, where it is at hand. The lists in
`docs/modelica.md` follow from the tables: `python tests/test_modelica_constructs.py` writes them, a
test holds them against it.
"""

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import casadi
import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from workbench.errors import InputError
from workbench.models import compiler
from workbench.models.compiler.explicit import StateSpace, make_explicit
from workbench.models.compiler.flat import flatten

from .built import library

Series = NDArray[np.float64]
TIMES = np.linspace(0.0, 1.0, 11)  # s
# Far above the error of the integration (1e-9 a step), far below any other reading of the source;
# where an expression switches without an event, the step of 0.01 s across it errs by up to 1e-3.
TOLERANCE = 2e-3
FOLDER = Path(__file__).parent
PAGE = FOLDER.parent / "docs" / "modelica.md"


class Construct(NamedTuple):
    """A package body with a model M, and its first output over time, or its refusal."""

    name: str
    source: str
    output: str
    place: str
    refusal: str


def read_table(file: str) -> list[Construct]:
    """Constructs of a file, which says at its top how it is written."""
    constructs = []
    for text in re.split(r"^# ", (FOLDER / file).read_text(), flags=re.MULTILINE)[2:]:
        name, *source, answer = text.strip().splitlines()
        refusal = re.fullmatch(r"! (\S+): (.*)", answer)
        place, words = (refusal[1], refusal[2]) if refusal else ("", "")
        output = "" if refusal else answer.removeprefix("= ")
        constructs.append(Construct(name, "\n".join(source), output, place, words))
    return constructs


CONSTRUCTS = read_table("modelica_constructs.txt")
LIBRARY = read_table("modelica_library.txt")


def first_output(model: StateSpace) -> Series:
    """The first output, or the first state that is one, at TIMES, by an integrator of scipy."""
    p, u = ([v.start for v in group] for group in (model.parameters, model.inputs))
    equations = casadi.Function("m", [model.t, model.x, model.u, model.p], [model.f, model.w])

    def rates(t: float, x: Series) -> Series:
        return np.array(equations(t, x, u, p)[0]).ravel()

    x0 = model.initial_states()
    x = np.empty((0, TIMES.size))
    if x0:
        options = {"rtol": 1e-9, "atol": 1e-10, "max_step": 0.01}
        x = solve_ivp(rates, (0.0, TIMES[-1]), x0, t_eval=TIMES, **options).y
    if not model.outputs:
        return np.array(x[[s.name for s in model.states].index(model.state_outputs[0])])
    return np.array([float(equations(t, x[:, k], u, p)[1][0]) for k, t in enumerate(TIMES)])


def check(construct: Construct, folder: Path, place: str) -> str:
    """Compile a construct, and compare it with what it means, or its refusal with place and words.

    Returns the refusal.

    Parameters
    ----------
    place : regular expression of where a refusal is to stand.
    """
    package = library(folder, construct.source)
    if construct.refusal:
        with pytest.raises(InputError) as refusal:
            make_explicit(flatten(package, "Lib.M"))
        assert re.search(place, refusal.value.where)
        assert construct.refusal in refusal.value.found
        assert refusal.value.remedy
        return str(refusal.value)
    computed = first_output(make_explicit(flatten(package, "Lib.M")))
    expected = eval(construct.output, {**vars(np), "t": TIMES})
    np.testing.assert_allclose(computed, expected + 0 * TIMES, atol=TOLERANCE, rtol=0)
    return ""


@pytest.mark.parametrize("construct", CONSTRUCTS, ids=lambda construct: construct.name)
def test_a_construct_computes_what_it_means_or_is_refused_by_line(construct, tmp_path):
    package = tmp_path / "Lib" / "package.mo"
    refusal = check(construct, tmp_path, rf"^{re.escape(str(package))}:{construct.place}$")
    # The front end, the C compiler and the cache work in temporary folders of their own.
    assert set(re.findall(r"/[\w./-]+\.mo\b", refusal)) <= {str(package)}


@pytest.mark.skipif(
    not any((Path(f) / "Modelica").is_dir() for f in os.environ.get("MODELICAPATH", "").split(":")),
    reason="needs the Modelica Standard Library in a folder of MODELICAPATH",
)
@pytest.mark.parametrize("construct", LIBRARY, ids=lambda construct: construct.name)
def test_a_block_of_the_standard_library_computes_what_it_means_or_is_refused(construct, tmp_path):
    check(construct, tmp_path, rf"/{construct.place}:\d+$")


FOLLOWING = (
    "model M parameter Real x0=5; parameter Real k=2; input Real u(start=4); "
    "output Real x(start=x0,fixed=true); output Real v; Real free(start=7,fixed=true); "
    "initial equation der(v)=0; "
    "equation der(x)=-x; der(v)=u-k*v; der(free)=0; end M;"
)


@pytest.mark.parametrize("fmi", [2, 3])
def test_starts_in_an_fmu_follow_what_is_set_and_yield_to_a_start_that_is_set(fmi, tmp_path):
    fmu = tmp_path / "M.fmu"
    compiler.build(
        library(tmp_path, FOLLOWING), "Lib.M", fmu, fmi=fmi, platforms=[compiler.native()]
    )
    assert validate_fmu(str(fmu)) == []  # without any unit, too

    def begin(start: Mapping[str, float], interface: str) -> list[float]:
        result = fmpy.simulate_fmu(
            str(fmu),
            start_values=dict(start),
            fmi_type=interface,
            stop_time=1.0,
            output=["x", "v", "free"],
        )
        return [float(result[name][0]) for name in ("x", "v", "free")]

    for interface in ("ModelExchange", "CoSimulation"):
        assert begin({}, interface) == [5.0, 2.0, 7.0]
        assert begin({"x0": 2.0, "k": 8.0}, interface) == [2.0, 0.5, 7.0]
        assert begin({"x0": 2.0, "x": 9.0}, interface) == [9.0, 2.0, 7.0]
        assert begin({"x": 9.0, "x0": 2.0, "u": 6.0}, interface) == [9.0, 3.0, 7.0]


def test_a_parameter_without_value_and_start_is_zero_and_said(tmp_path):
    body = "model M parameter Real a; output Real x(start=1,fixed=true); equation der(x)=a; end M;"
    package = library(tmp_path, body)
    model = make_explicit(flatten(package, "Lib.M"))
    assert [v.start for v in model.parameters] == [0.0]
    (note,) = model.notes
    assert note.startswith(f"{package}:2: parameter 'a' has neither a value nor a start")


def test_an_experiment_gives_start_stop_step_and_tolerance(tmp_path):
    body = (
        'model M output Real x(start=0,fixed=true,unit="degC"); equation der(x)=1; '
        "annotation(experiment(StartTime=50, Interval=0.25, Tolerance=1e-9)); end M;"
    )
    fmu = tmp_path / "M.fmu"
    compiler.build(library(tmp_path, body), "Lib.M", fmu, platforms=[compiler.native()])
    assert validate_fmu(str(fmu)) == []
    description = fmpy.read_model_description(str(fmu))
    experiment = description.defaultExperiment
    assert [float(experiment.startTime), float(experiment.stopTime)] == [50.0, 51.0]
    assert [float(experiment.stepSize), float(experiment.tolerance)] == [0.25, 1e-9]
    celsius = next(unit for unit in description.unitDefinitions if unit.name == "degC").baseUnit
    assert [float(celsius.factor), float(celsius.offset)] == [1.0, 273.15]


@pytest.mark.parametrize(
    ("body", "remedy"),
    [
        ("Modelica.Units.SI.Mass m=2; output Real y=m;", "set MODELICAPATH to the folder"),
        ("import SI=Modelica.Units.SI; SI.Mass m=2;", "set MODELICAPATH to the folder"),
        ("import Modelica.Constants.pi; output Real y=pi;", "set MODELICAPATH to the folder"),
        ("output Real y=Modelica.Math.sin(time);", "set MODELICAPATH to the folder"),
        ("Mass m=2;", "correct the name, or import it"),
        (
            "partial model P extends Effects.Interfaces.Signal; end P; P p(u=1.0);",
            r"the package uses it: annotation \(uses\(Effects",
        ),
        ("output Real y; protected Real a; algorithm a:=time; y:=a+1;", "a function with this"),
        ('output Real y; algorithm y:=1; y:=y+time; assert(y>0, "");', "a function with this"),
    ],
)
def test_a_refusal_says_what_helps_there(body, remedy, tmp_path):
    """Of names of the standard library, and of algorithms, remedies were to correct the source."""
    with pytest.raises(InputError, match=rf"package.mo:2.*To do: .*{remedy}"):
        make_explicit(flatten(library(tmp_path, f"model M {body} end M;"), "Lib.M"))


def test_each_element_of_an_array_has_its_own_unit(tmp_path):
    """The front end keeps no unit of an array that has one for each element."""
    body = (
        'type V = Real[2](unit={"A", "V"});\n'
        'model B Real x[2](unit={"m", "s"}, each start=1, each fixed=true); V v;\n'
        "equation der(x)=-x; v=x; end B;\n"
        'model M B b; B c[2](x(unit={{"kg", "N"}, {"J", "W"}}), v(each unit={"K", "Pa"}));\n'
        'parameter Real k[2,2](unit={{"m", "s"}, {"kg", "A"}})={{1, 2}, {3, 4}};\n'
        "output Real y=b.x[1]+b.v[1]+c[1].v[1]+c[2].v[2]+k[1,1]; end M;"
    )
    flat = flatten(library(tmp_path, body), "Lib.M")
    variables = [*flat.differentiated, *flat.algebraic, *flat.parameters]
    units = {v.name: v.unit for v in variables if v.unit}
    assert units == {
        **{"b.x[1]": "m", "b.x[2]": "s", "b.v[1]": "A", "b.v[2]": "V"},
        **{"c[1].x[1]": "kg", "c[1].x[2]": "N", "c[2].x[1]": "J", "c[2].x[2]": "W"},
        **{f"c[{i}].v[{k + 1}]": unit for i in (1, 2) for k, unit in enumerate(("K", "Pa"))},
        **{"k[1,1]": "m", "k[1,2]": "s", "k[2,1]": "kg", "k[2,2]": "A"},
    }


def test_units_of_an_array_are_as_many_as_its_elements(tmp_path):
    body = 'model M output Real y[2](unit={"m", "s", "kg"})={1, 2}; end M;'
    with pytest.raises(InputError, match=r"'y' with units .*an array of 2"):
        flatten(library(tmp_path, body), "Lib.M")


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_refuses_a_parameter_that_makes_a_start_infinite(fmi, tmp_path):
    body = (
        "model M parameter Real a=4; output Real x(start=sqrt(a),fixed=true); equation der(x)=1; "
        "end M;"
    )
    fmu = tmp_path / "M.fmu"
    compiler.build(library(tmp_path, body), "Lib.M", fmu, fmi=fmi, platforms=[compiler.native()])
    for interface in ("ModelExchange", "CoSimulation"):
        run = {"fmi_type": interface, "stop_time": 1.0, "output": ["x"]}
        result = fmpy.simulate_fmu(str(fmu), start_values={"a": 9.0}, **run)
        assert result["x"][[0, -1]] == pytest.approx([3.0, 4.0])
        with pytest.raises(fmpy.fmi1.FMICallException, match="ExitInitializationMode"):
            fmpy.simulate_fmu(str(fmu), start_values={"a": -1.0}, **run)


def listing(constructs: list[Construct]) -> str:
    """Lists of the page: what compiles, and what is refused."""
    compiled = [c.name for c in constructs if not c.refusal]
    refused = [c.name for c in constructs if c.refusal]
    return "\n".join(
        [
            f"{len(compiled)} compile, and compute their solution in closed form:",
            "; ".join(compiled) + ".",
            "",
            f"{len(refused)} are refused, with file, line and remedy:",
            "; ".join(refused) + ".",
            "",
        ]
    )


def page(text: str) -> str:
    """Text of the page with its lists written anew."""
    for name, constructs in (("constructs", CONSTRUCTS), ("library", LIBRARY)):
        begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
        before, _, below = text.partition(begin)
        text = before + begin + listing(constructs) + end + below.partition(end)[2]
    return text


def test_the_page_lists_what_the_compiler_takes():
    text = PAGE.read_text()
    assert text == page(text), f"write it again: python {Path(__file__).name}"


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text()))
