"""An FMU around another one: terms beside the rates of its states, and parameters of other values.

The inner FMU is kept whole below the resources; all calls are handed on to it by `added.c`. Model
Exchange of FMI 2.0, on this machine.
"""

import shutil
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree

import fmpy

from workbench.errors import InputError
from workbench.models import fmu_cache
from workbench.models.archive import DESCRIPTION
from workbench.models.description import MODEL_EXCHANGE, Description, read_description
from workbench.models.trial import derivatives_hold, remembers_steps

COULOMB, STRIBECK, VISCOUS = "coulomb", "stribeck", "viscous"
QUADRATIC, CONSTANT = "quadratic", "constant"
SPEED = "speed"  # of a Stribeck term, at which 1/e is left
_IDENTIFIER, _INNER = "Extended", "inner"
_HEADERS = Path(fmpy.__file__).parent / "c-code"
TERM = "added."  # how names of what scales a term begin
_MOST_KNOWNS = 4096  # of one directional derivative
# Of a state's size, within which friction is smooth: a body that sticks creeps by this share of its
# speed. At 1e-3 a second at rest is seen by any sensor of 0.1 %; at 1e-5 a minute is not.
_SMOOTH = 1e-5


@dataclass(frozen=True)
class RateTerm:
    """A term beside the rate of a state.

    The rate gains -tanh(x/width), -tanh(x/width)*exp(-abs(x)/speed), -x, -x*abs(x) or 1, times a
    coefficient. The exponent is that of A. Tustin (1947), J. IEE 94(IIA), 143-151.
    """

    name: str  # of its coefficient, a parameter of the FMU
    state: int  # place in the FMU's continuous states
    form: str  # COULOMB, STRIBECK, VISCOUS, QUADRATIC or CONSTANT
    typical: float  # size of the coefficient, in its unit; bounds are 1000 times that
    unit: str  # of the coefficient, empty for none
    scale: float  # typical size of the state; the speed of a Stribeck term begins at a third of it
    state_unit: str  # of the state and of the speed, empty for none
    text: str  # what it is, for people


def write_extended(
    inner: Path,
    out: Path,
    terms: Sequence[RateTerm],
    coefficients: Mapping[str, float],
    parameters: Mapping[str, float],
) -> None:
    """Write an FMU with terms beside the rates of another one.

    Parameters
    ----------
    coefficients : start values of terms by name, 0 for others; and of speeds, NAME.speed.
    parameters : values of the inner FMU's own, by its names.
    """
    # An extra: what extended FMUs are compiled with; running them needs none.
    from workbench.models.compiler.assembly import (
        PLATFORMS,
        compile_files,
        digest,
        digest_file,
        native,
        pack,
    )

    description = read_description(inner)
    refuse_unfit(description)
    library = description.library(MODEL_EXCHANGE)
    with tempfile.TemporaryDirectory() as scratch:
        folder, sources = Path(scratch) / _IDENTIFIER, Path(scratch) / "c"
        resources = folder / "resources" / _INNER
        with zipfile.ZipFile(inner) as archive:
            # Beside its binary may be libraries that this one loads.
            folders = ("resources/", f"{PurePosixPath(library).parent}/")
            archive.extractall(
                resources,
                [n for n in archive.namelist() if n == DESCRIPTION or n.startswith(folders)],
            )
        text = (resources / DESCRIPTION).read_text(encoding="utf-8")
        sources.mkdir()
        header = _header(description, library, terms, coefficients, parameters)
        code = Path(__file__).with_suffix(".c").read_text()
        # The token changes with all that changes behaviour, and is in the code.
        token = f"{{{digest([header, code, description.sha256])[:32]}}}"
        (sources / "added.h").write_text(f'#define GUID "{token}"\n{header}')
        (sources / "added.c").write_text(code)
        for file in _HEADERS.glob("fmi2*.h"):
            shutil.copyfile(file, sources / file.name)
        fmi2_name, _, target, suffix = PLATFORMS[native()]
        binary = folder / "binaries" / fmi2_name / f"{_IDENTIFIER}{suffix}"
        compile_files(sources, binary, ["added.c"], target, ["-ldl"])
        described = _described(text, token, description, terms, coefficients, parameters)
        (folder / DESCRIPTION).write_bytes(described)
        pack(folder, out)
    # Else what was found is found again, around this one.
    if derivatives_hold(description) and not remembers_steps(description):
        fmu_cache.remember(digest_file(out))


def refuse_unfit(description: Description) -> None:
    """Refuse an FMU around which there can be none."""
    if description.version != "2.0" or MODEL_EXCHANGE not in description.interfaces:
        raise InputError(
            where=str(description.path),
            found=f"FMI {description.version}, {' and '.join(description.interfaces)}",
            expected="Model Exchange of FMI 2.0, whose rates can be added to",
            remedy="export the model so, or leave terms beside rates out",
        )


def _header(
    description: Description,
    library: str,
    terms: Sequence[RateTerm],
    coefficients: Mapping[str, float],
    parameters: Mapping[str, float],
) -> str:
    """What `added.c` must know."""
    references = {v.name: v.reference for v in description.variables}
    first = max(references.values()) + 1
    rows = [
        f"{{{term.state}, {term.form.upper()}, {coefficients.get(term.name, 0.0)!r}, "
        f"{_SMOOTH * term.scale!r}, {_speed(term, coefficients)!r}}}"
        for term in terms
    ]
    values = [repr(float(value)) for value in parameters.values()]
    # C knows no empty arrays: one more entry than is used.
    return f"""\
#define INNER_GUID "{description.token}"
#define INNER_LIBRARY "{_INNER}/{library}"
#define INNER_RESOURCES "{_INNER}/resources"
#define FIRST {first}u
#define TERMS {len(terms)}u
#define STATES {len(description.states)}u
#define CHANGED {len(parameters)}u
#define KNOWNS {_MOST_KNOWNS}
#define OWN_VARIABLES (2 * TERMS + 1)
enum {{ COULOMB, STRIBECK, VISCOUS, QUADRATIC, CONSTANT }};
typedef struct {{ size_t state; int form; double start, width, speed; }} Term;
static const Term terms[] = {{{", ".join([*rows, "{0, CONSTANT, 0.0, 1.0, 1.0}"])}}};
static const fmi2ValueReference states[] = {_array(references, description.states)};
static const fmi2ValueReference rates[] = {_array(references, description.rates)};
static const fmi2ValueReference changed[] = {_array(references, parameters)};
static const fmi2Real values[] = {{{", ".join([*values, "0.0"])}}};
"""


def _speed(term: RateTerm, coefficients: Mapping[str, float]) -> float:
    return float(coefficients.get(f"{term.name}.{SPEED}", term.scale / 3.0))


def _array(references: Mapping[str, int], names: Sequence[str] | Mapping[str, float]) -> str:
    return "{" + ", ".join([*(f"{references[name]}u" for name in names), "0u"]) + "}"


def _described(
    text: str,
    token: str,
    inner: Description,
    terms: Sequence[RateTerm],
    coefficients: Mapping[str, float],
    parameters: Mapping[str, float],
) -> bytes:
    """The model description of the inner FMU with coefficients of terms."""
    root = ElementTree.fromstring(text)
    root.set("guid", token)
    root.set("description", f"{root.get('description', root.get('modelName'))}, extended")
    for alone in root.findall("CoSimulation"):
        root.remove(alone)
    exchange = root.find("ModelExchange")
    variables, structure = root.find("ModelVariables"), root.find("ModelStructure")
    assert exchange is not None
    assert variables is not None
    for part in list(exchange):
        exchange.remove(part)
    exchange.set("modelIdentifier", _IDENTIFIER)
    exchange.set("canSerializeFMUstate", "false")
    units = root.find("UnitDefinitions")
    own_units = ElementTree.Element("UnitDefinitions") if units is None else units
    known = {unit.get("name") for unit in own_units}
    asked = [unit for term in terms for unit in (term.unit, term.state_unit)]
    for unit in dict.fromkeys(unit for unit in asked if unit not in {*known, ""}):
        ElementTree.SubElement(own_units, "Unit", name=unit)
    if units is None and len(own_units):  # an empty one is not valid
        root.insert(list(root).index(exchange) + 1, own_units)
    for variable in variables:
        if (value := parameters.get(variable.get("name", ""))) is not None:
            next(iter(variable.iterfind("Real"))).set("start", repr(float(value)))
    first = max(v.reference for v in inner.variables) + 1

    def add(name: str, reference: int, text: str, **real: str) -> None:
        """Add a tunable parameter; an empty unit is none."""
        of_all = {"causality": "parameter", "variability": "tunable", "description": text}
        place = {"name": name, "valueReference": str(reference), **of_all}
        entry = ElementTree.SubElement(variables, "ScalarVariable", place)
        ElementTree.SubElement(entry, "Real", {key: value for key, value in real.items() if value})

    for k, term in enumerate(terms):
        add(
            term.name,
            first + k,
            term.text,
            start=repr(coefficients.get(term.name, 0.0)),
            nominal=repr(term.typical),
            min=repr(-1e3 * term.typical if term.form == CONSTANT else 0.0),
            max=repr(1e3 * term.typical),
            unit=term.unit,
        )
        if term.form == STRIBECK:
            add(
                f"{term.name}.{SPEED}",
                first + len(terms) + k,
                "at which 1/e of it is left",
                start=repr(_speed(term, coefficients)),
                nominal=repr(term.scale),
                min=repr(_SMOOTH * term.scale),
                max=repr(1e3 * term.scale),
                unit=term.state_unit,
            )
    # A rate depends on its own state now, which the inner FMU need not say.
    for unknown in structure.iterfind("Derivatives/Unknown") if structure is not None else ():
        for key in ("dependencies", "dependenciesKind"):
            unknown.attrib.pop(key, None)
    described: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return described
