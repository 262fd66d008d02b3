"""`workbench doctor`: what is installed, what is missing, what does not work, what to do."""

import argparse
import hashlib
import json
import os
import platform
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

from workbench.cli.arguments import Commands, nearby
from workbench.cli.extras import PURPOSES, missing_packages
from workbench.cli.output import CommandResult, Output
from workbench.errors import FMUError, InputError
from workbench.runtime.files import require_writable
from workbench.runtime.resources import CHECKOUT, fmus, installing
from workbench.system.installed import built_models

# dx/dt = -x: the smallest model that needs every part of the compiler.
_MODEL = """package Small
  model Decay
    Real x(start=1.0, fixed=true);
  equation
    der(x) = -x;
  end Decay;
end Small;
"""


def add(commands: Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    return commands.add_parser(
        "doctor",
        help=text,
        description="Say what is installed, what is missing and what each extra is for; compare "
        "the FMUs that come along with their manifest; compile a small model, and run the result; "
        "look at the folder of what is kept between runs; say what to do. Exit status: 0 sound, "
        "1 something does not work as it is.",
        epilog="examples:\n  python -m workbench doctor\n  python -m workbench doctor --json",
    )


@dataclass(frozen=True)
class Inspection:
    """One thing that was looked at.

    Attributes
    ----------
    state : "missing" is an extra that is not installed; "wrong" does not work as it is.
    remedy : what to do, empty where nothing is needed.
    """

    name: str
    state: Literal["ok", "missing", "wrong"]
    found: str
    remedy: str = ""


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Look at everything."""
    findings = []
    for finding in _findings():
        findings.append(finding)
        output.result(f"{finding.state:<8} {finding.name:<20} {finding.found}")
        if finding.remedy:
            output.result(f"{'':<8} {'':<20} to do: {finding.remedy}")
    wrong = any(finding.state == "wrong" for finding in findings)
    return CommandResult(
        {"findings": [asdict(finding) for finding in findings]}, status=1 if wrong else 0
    )


def _findings() -> Iterator[Inspection]:
    where = "a wheel" if CHECKOUT is None else f"the checkout {CHECKOUT}"
    yield Inspection("workbench", "ok", f"{version('wheelset-workbench')} from {where}")
    yield Inspection("Python", "ok", f"{platform.python_version()}, {sys.executable}")
    yield Inspection("machine", "ok", f"{platform.platform()}, {os.cpu_count()} processors")
    core = missing_packages("")
    yield Inspection(
        "core packages",
        "wrong" if core else "ok",
        f"without {', '.join(core)}" if core else "complete",
        "pip install wheelset-workbench" if core else "",
    )
    for extra, purpose in PURPOSES.items():
        lacking = missing_packages(extra)
        yield Inspection(
            f"extra [{extra}]",
            "missing" if lacking else "ok",
            f"for {purpose}" + (f"; without {', '.join(lacking)}" if lacking else ""),
            installing(extra) if lacking else "",
        )
    yield from _manifest(json.loads((fmus() / "manifest.json").read_text(encoding="utf-8")))
    if not missing_packages("compiler"):
        yield _sources()
        yield _compiled()
    yield _kept()


def _manifest(manifest: Mapping[str, Any]) -> Iterator[Inspection]:
    """Whether the FMUs are those that were built."""
    for name, listed in manifest["fmus"].items():
        path = fmus() / name
        state = "as in the manifest"
        if not path.is_file():
            state = "no such file"
        elif hashlib.sha256(path.read_bytes()).hexdigest() != listed["sha256"]:
            state = f"its SHA-256 is not that of {nearby(fmus() / 'manifest.json')}"
        sound = state.startswith("as")
        yield Inspection(
            f"fmus/{name}", "ok" if sound else "wrong", state, "" if sound else _anew()
        )


def _anew() -> str:
    """How FMUs are had again."""
    return "install the wheel again" if CHECKOUT is None else "make fmus"


def _sources() -> Inspection:
    """Whether the Modelica sources are those that the FMUs were built from."""
    from workbench.models.compiler import source_hash  # an extra

    manifest = json.loads((fmus() / "manifest.json").read_text(encoding="utf-8"))
    same = manifest["source_sha256"] == source_hash(*built_models())
    state = "those that the FMUs were built from" if same else "not those of the FMUs"
    return Inspection("Modelica sources", "ok" if same else "wrong", state, "" if same else _anew())


def _compiled() -> Inspection:
    """Whether a model can be compiled here, and runs."""
    from workbench.models.compiler import build, native  # an extra
    from workbench.models.fmu import FMU

    with tempfile.TemporaryDirectory() as scratch:
        package, path = Path(scratch) / "package.mo", Path(scratch) / "Decay.fmu"
        package.write_text(_MODEL, encoding="utf-8")
        try:
            build(package, "Small.Decay", path, platforms=[native()])
            with FMU(path) as fmu:
                state = f"compiled and ran a model with the state {', '.join(fmu.states)}"
        except (InputError, FMUError, OSError) as error:
            remedy = f"{installing('compiler')}, in an environment of its own"
            return Inspection("compiler", "wrong", str(error), remedy)
    return Inspection("compiler", "ok", state)


def _kept() -> Inspection:
    """Whether what is compiled can be kept between runs; without that, commands begin slowly."""
    from workbench.models.fmu_cache import cache_folder

    folder = cache_folder()
    try:
        require_writable(folder / "doctor")
    except InputError as error:
        remedy = "set XDG_CACHE_HOME to a folder that can be written"
        return Inspection("cache", "wrong", f"{folder}: {error.found}", remedy)
    files = [path for path in folder.rglob("*") if path.is_file()]
    size = sum(path.stat().st_size for path in files) / 1e6
    return Inspection("cache", "ok", f"{folder}: {len(files)} files, {size:.0f} MB; may be deleted")
