"""`workbench doctor`: what is installed, what is missing, what does not work, what to do."""

import argparse
import hashlib
import json
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from workbench.cli.arguments import Commands, nearby
from workbench.cli.extras import PURPOSES, missing_packages
from workbench.cli.output import CommandResult, Output
from workbench.errors import FMUError, InputError
from workbench.runtime.files import require_writable
from workbench.runtime.resources import CHECKOUT, DISTRIBUTION, fmus, installing, own_version
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
    parser = commands.add_parser(
        "doctor",
        help=text,
        description="Say what is installed, what is missing, and what each extra is for. Check "
        "the FMUs against their manifest, compile and run a small model, and inspect "
        "the cache. Say what to do. Exit status: 0 sound, "
        "1 something does not work as it is.",
        epilog="examples:\n  workbench doctor\n  workbench doctor --json\n"
        "  workbench doctor --clean",
    )
    parser.add_argument(
        "--clean",
        action="store_true",
        help="delete the cache first: compiled loops, built FMUs, findings of 'fmu check'. "
        "Commands make again what they need, which takes up to a minute",
    )
    return parser


@dataclass(frozen=True)
class Inspection:
    """State of one part of the installation."""

    name: str
    # "missing" is an extra that is not installed; "wrong" does not work as it is
    state: Literal["ok", "missing", "wrong"]
    found: str
    remedy: str = ""  # what to do, empty where nothing is needed


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Inspect the installation."""
    findings = []
    if options.clean:
        output.result(_clean())
    for finding in _inspect():
        findings.append(finding)
        output.result(f"{finding.state:<8} {finding.name:<20} {finding.found}")
        if finding.remedy:
            output.result(f"{'':<8} {'':<20} to do: {finding.remedy}")
    wrong = any(finding.state == "wrong" for finding in findings)
    return CommandResult(
        {"findings": [asdict(finding) for finding in findings]}, status=1 if wrong else 0
    )


def _inspect() -> Iterator[Inspection]:
    where = "a wheel" if CHECKOUT is None else f"the checkout {CHECKOUT}"
    yield Inspection("workbench", "ok", f"{own_version()} from {where}")
    yield Inspection("Python", "ok", f"{platform.python_version()}, {sys.executable}")
    yield Inspection("machine", "ok", f"{platform.platform()}, {os.cpu_count()} processors")
    core = missing_packages("")
    yield Inspection(
        "core packages",
        "wrong" if core else "ok",
        f"without {', '.join(core)}" if core else "complete",
        f"pip install {DISTRIBUTION}" if core else "",
    )
    for extra, purpose in PURPOSES.items():
        lacking = missing_packages(extra)
        yield Inspection(
            f"extra [{extra}]",
            "missing" if lacking else "ok",
            f"for {purpose}" + (f"; without {', '.join(lacking)}" if lacking else ""),
            installing(extra) if lacking else "",
        )
    path = fmus() / "manifest.json"
    manifest = json.loads(path.read_text(encoding="utf-8"))
    again = "install the wheel again" if CHECKOUT is None else "make fmus"
    for name, listed in manifest["fmus"].items():
        fmu = fmus() / name
        if not fmu.is_file():
            yield Inspection(f"fmus/{name}", "wrong", "no such file", again)
        elif hashlib.sha256(fmu.read_bytes()).hexdigest() != listed["sha256"]:
            state = f"its SHA-256 is not that of {nearby(path)}"
            yield Inspection(f"fmus/{name}", "wrong", state, again)
        else:
            yield Inspection(f"fmus/{name}", "ok", "as in the manifest")
    if not missing_packages("compiler"):
        from workbench.models.compiler import source_hash  # an extra

        if manifest["source_sha256"] == source_hash(*built_models()):
            yield Inspection("Modelica sources", "ok", "those that the FMUs were built from")
        else:
            yield Inspection("Modelica sources", "wrong", "not those of the FMUs", again)
        yield _inspect_compiler()
    yield _inspect_cache()


def _inspect_compiler() -> Inspection:
    from workbench.models.compiler import build, native  # an extra
    from workbench.models.fmu import FMU

    with tempfile.TemporaryDirectory() as folder:
        package, path = Path(folder) / "package.mo", Path(folder) / "Decay.fmu"
        package.write_text(_MODEL, encoding="utf-8")
        try:
            build(package, "Small.Decay", path, platforms=[native()])
            with FMU(path) as fmu:
                state = f"compiled and ran a model with the state {', '.join(fmu.states)}"
        except (InputError, FMUError, OSError) as error:
            remedy = f"{installing('compiler')}, in an environment of its own"
            return Inspection("compiler", "wrong", str(error), remedy)
    return Inspection("compiler", "ok", state)


def _inspect_cache() -> Inspection:
    """Whether compiled code can be kept between runs; without a cache commands begin slowly."""
    from workbench.models.fmu_cache import cache_folder

    folder = cache_folder()
    try:
        require_writable(folder / "doctor")
    except InputError as error:
        remedy = "set XDG_CACHE_HOME to a folder that can be written"
        return Inspection("cache", "wrong", f"{folder}: {error.found}", remedy)
    parts = {"fmus": "FMUs", "known": "hashes", "findings": "findings"}
    sizes: dict[str, int] = {}
    for path, size in _cached(folder):
        part = parts.get(path.relative_to(folder).parts[0], "compiled loops")
        sizes[part] = sizes.get(part, 0) + size
    listed = ", ".join(f"{part} {size / 1e6:.0f} MB" for part, size in sorted(sizes.items()))
    total = f"{sum(sizes.values()) / 1e6:.0f} MB" + (f" ({listed})" if listed else "")
    return Inspection("cache", "ok", f"{folder}: {total}; 'workbench doctor --clean' deletes it")


def _cached(folder: Path) -> Iterator[tuple[Path, int]]:
    for parent, _, names in os.walk(folder):
        for path in (Path(parent, name) for name in names):
            with suppress(FileNotFoundError):  # other programs keep and delete files meanwhile
                yield path, path.stat().st_size


def _clean() -> str:
    """Delete what the cache holds. Other programs work on: they make anew what they miss."""
    from workbench.models.fmu_cache import cache_folder

    folder = cache_folder()
    before = sum(size for _, size in _cached(folder))
    for path in folder.iterdir() if folder.is_dir() else ():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
    after = sum(size for _, size in _cached(folder))
    return f"cleaned  {folder}: {(before - after) / 1e6:.0f} MB deleted"
