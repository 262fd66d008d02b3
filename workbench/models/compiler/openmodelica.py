"""Modelica to FMU by OpenModelica, the second compiler, where it is installed.

FMI 2.0 only. Three of its defaults do not serve observers. Its Co-Simulation is explicit Euler,
which a stiff motion does not survive: CVODE is asked for. An output that is a state gets an alias,
which becomes the state in its place, so that its start value could not be set: no aliases. The
tolerance of CVODE is that of the model's experiment when the FMU is built, whatever a tool asks of
the FMU later: a tight one is written there, in omc's copy of the model alone.

Without aliases its directional derivatives are wrong (1.26.9): there are no rows for outputs that
are states, but the others are looked up as if there were, so that one output's are given for
another, without an error. They are no longer offered, and whoever needs them takes differences.
omc has to build them all the same: an FMU that it builds without names each state twice.
Source: OpenModelica User's Guide, chapters "FMI and TLM" and "Options".
"""

import io
import re
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from workbench.errors import InputError
from workbench.models.compiler.ccode import identifier
from workbench.models.modelica import check, packages, read_library
from workbench.runtime.files import write_whole

_OPTIONS = (
    "--fmiFlags=s:cvode",
    "-d=-disableDirectionalDerivatives",
    "--preOptModules-=introduceOutputAliases",
)
_OFFERED, _WITHDRAWN = (
    f'providesDirectionalDerivative="{value}"'.encode() for value in ("true", "false")
)
# So far below the 1e-6 of a usual experiment that CVODE is no part of the error of a comparison.
_TOLERANCE = 1e-9
_MESSAGE = re.compile(
    r"\[(?P<file>[^\]\n]*?):(?P<line>\d+):\d+-\d+:\d+:\w+\] "
    r"(?P<kind>Error|Warning|Notification): (?P<text>.*)"
)
_UNPLACED = re.compile(r"^\"?Error: (?P<text>.*)", re.MULTILINE)
_COUNTS = re.compile(r"has (\d+) equation\(s\) and (\d+) variable\(s\)")


@dataclass(frozen=True)
class Message:
    """An error of omc: `place` is file:line, empty where omc gives none."""

    place: str
    text: str


def build_with_omc(package: Path, models: Sequence[str], folder: Path) -> list[Path]:
    """Build FMUs with OpenModelica: FMI 2.0, Model Exchange and Co-Simulation with CVODE.

    Parameters
    ----------
    package : `package.mo` of the library.
    models : dotted names of the models.
    folder : where the FMUs go; a file changes only when its model has been built.

    Returns
    -------
    fmus : paths of the FMUs, in the order of `models`.

    Raises
    ------
    InputError
        If omc is not installed, or refuses a model.
    """
    omc = shutil.which("omc")
    if omc is None:
        raise InputError(
            where="--compiler omc",
            found="no program 'omc' on the PATH",
            expected="an installation of OpenModelica",
            remedy="install it from https://openmodelica.org, or leave the option out",
        )
    library = read_library(package)
    for model in models:
        check(library, model)
    return [_build(omc, package, model, folder) for model in models]


def script(package: Path, model: str, used: Sequence[Path] = ()) -> str:
    """Commands for omc: load, count equations and unknowns, set the tolerance, build.

    Parameters
    ----------
    used : `package.mo` of libraries that the model's library uses.

    Examples
    --------
    >>> print(script(Path("/lib/Rig/package.mo"), "Rig.Minimal"))
    loadFile("/lib/Rig/package.mo"); getErrorString();
    checkModel(Rig.Minimal); getErrorString();
    addClassAnnotation(Rig.Minimal, annotate=experiment(Tolerance=1e-09)); getErrorString();
    buildModelFMU(Rig.Minimal, version="2.0", fmuType="me_cs", fileNamePrefix="Minimal");
    getErrorString();
    <BLANKLINE>
    """
    paths = [package.as_posix().replace('"', '\\"') for package in (*used, package)]
    name = identifier(model)
    return (
        "".join(f'loadFile("{path}"); getErrorString();\n' for path in paths)
        + f"checkModel({model}); getErrorString();\n"
        f"addClassAnnotation({model}, annotate=experiment(Tolerance={_TOLERANCE})); "
        "getErrorString();\n"
        f'buildModelFMU({model}, version="2.0", fmuType="me_cs", fileNamePrefix="{name}");\n'
        "getErrorString();\n"
    )


def errors_in(output: str) -> list[Message]:
    """Errors in what omc printed, in its order; warnings are left out.

    Examples
    --------
    >>> errors_in("[/lib/A/package.mo:3:5-3:20:writable] Error: Class Foo not found in scope A.")
    [Message(place='/lib/A/package.mo:3', text='Class Foo not found in scope A.')]
    """
    placed = [
        Message(f"{match['file']}:{match['line']}", match["text"].rstrip('"'))
        for match in _MESSAGE.finditer(output)
        if match["kind"] == "Error"
    ]
    unplaced = [Message("", match["text"].rstrip('"')) for match in _UNPLACED.finditer(output)]
    # The unplaced ones sum up: "Error occurred while flattening model".
    counts = _COUNTS.search(output)
    if not placed and not unplaced and counts and counts[1] != counts[2]:
        # omc calls such a check successful.
        return [Message("", f"{counts[1]} equations, {counts[2]} unknowns")]
    return placed + unplaced


def _build(omc: str, package: Path, model: str, folder: Path) -> Path:
    name = f"{identifier(model)}.fmu"
    library, *used = (file.resolve() for file in packages(package))
    with tempfile.TemporaryDirectory() as scratch:
        (Path(scratch) / "build.mos").write_text(script(library, model, used))
        run = subprocess.run(
            [omc, *_OPTIONS, "build.mos"], cwd=scratch, capture_output=True, text=True, check=False
        )
        built = Path(scratch) / name
        errors = errors_in(run.stdout + run.stderr)
        if errors or not built.is_file():
            printed = (run.stdout + run.stderr).strip()[-500:]
            first = errors[0] if errors else Message("", printed or "nothing printed")
            raise InputError(
                where=first.place or f"omc, model {model}",
                found=first.text,
                expected="Modelica that OpenModelica translates to an FMU",
                remedy="correct the source; the workbench's own compiler may say more",
            )
        write_whole(folder / name, _without_directional_derivatives(built))
    return folder / name


def _without_directional_derivatives(fmu: Path) -> bytes:
    """The FMU, whose description no longer offers them; all else in it as it was."""
    written = io.BytesIO()
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(written, "w") as target:
        for entry in source.infolist():
            data = source.read(entry)
            if entry.filename == "modelDescription.xml":
                data = data.replace(_OFFERED, _WITHDRAWN)
            target.writestr(entry, data)
    return written.getvalue()
