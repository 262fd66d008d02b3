"""`workbench export`: an observer with its gains as an FMU, and in an SSP package."""

from __future__ import annotations

import argparse
import hashlib
import tempfile
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.cli import arguments
from workbench.cli.extras import require_compiler
from workbench.cli.output import CommandResult, Output
from workbench.runtime.files import locked_folder, write_json, write_whole
from workbench.runtime.resources import own_version

if TYPE_CHECKING:
    from workbench.models.compiler import BuiltFMU
    from workbench.observers import Estimator, Gains
    from workbench.system.system import System


def add(commands: arguments.Commands, text: str) -> argparse.ArgumentParser:
    """Add the command to the parser; `text` is its line in the list of all."""
    export = commands.add_parser(
        "export",
        help=text,
        description="Write an estimator with its gains as a Co-Simulation FMU for all platforms, "
        "which runs in any FMI tool without Python. If the system has a reference "
        "model, also write an SSP 1.0 package that connects both. One communication "
        "step takes one sample. "
        "Needs the extra [compiler].",
        epilog="examples:\n"
        "  workbench export\n"
        "  workbench export --gains results/tune/disturbance_observer/gains.toml\n"
        "  workbench export --estimator mhe --fmi 3 --out /tmp/export\n"
        "  workbench export --estimator imm --gains results/tune/ekf/gains.toml",
    )
    export.add_argument(
        "--gains",
        type=Path,
        metavar="FILE",
        help="gains.toml of 'workbench tune', which names the estimator unless --estimator does "
        "(default: tuned gains of the system, else model-based ones)",
    )
    export.add_argument(
        "--estimator",
        metavar="NAME",
        help="estimator (default: the first that [export.classes] of the system names, else ekf)",
    )
    arguments.add_system(export)
    export.add_argument(
        "--fmi",
        type=int,
        choices=(2, 3),
        default=2,
        help="version of the FMU; SSP 1.0 packages hold FMI 2.0 (default: %(default)s)",
    )
    arguments.add_platforms(export, "the FMU", "all")
    arguments.add_reference(export, "(FMI 2.0) that the package connects the observer to")
    arguments.add_out(export, "results/export")
    arguments.add_isolated(export)
    return export


def run(options: argparse.Namespace, output: Output) -> CommandResult:
    """Write the observer as an FMU, and the package."""
    from workbench.errors import InputError
    from workbench.system.registry import load_system, model_path, open_model
    from workbench.system.system import REFERENCE

    require_compiler()
    from workbench.models.compiler import PLATFORMS, native
    from workbench.observers.export import build_observer, model_name, write_package

    system = load_system(options.system)
    chosen = _choose(system, options.estimator, options.gains)
    role = chosen.estimator.role
    if not system.model(role).modelica:
        raise InputError(
            where=f"{system.source}, [models.{role}]",
            found="an FMU, and no 'class'",
            expected="the Modelica class of the model, which is compiled together with the "
            "estimator",
            remedy="put the Modelica library beside the system file and name its class. Without "
            "source, estimators run in the workbench alone: workbench simulate",
        )
    reference: Path | None = options.reference
    if reference is None and REFERENCE in system.models:
        reference = model_path(system, REFERENCE)
    platforms = tuple(PLATFORMS) if options.platforms == "all" else (native(),)
    with (
        locked_folder(options.out),
        tempfile.TemporaryDirectory() as folder,
        open_model(system, role) as fmu,
    ):
        estimator = chosen.estimator(fmu, system, chosen.gains)
        name = model_name(estimator).rpartition(".")[2]

        def build(fmi: int) -> BuiltFMU:
            return build_observer(
                estimator,
                Path(folder) / f"fmi{fmi}" / f"{name}.fmu",
                fmi,
                chosen.text,
                lambda platform: output.stage(f"{name}, FMI {fmi}.0: {platform}"),
                platforms,
            )

        built = build(options.fmi)
        summary = _summary(system, chosen, built)
        files = [built.path]
        if reference is not None:
            packed = built if built.fmi == 2 else build(2)
            ssp = Path(folder) / f"{name}.ssp"
            write_package(system, packed.path, reference, ssp)
            files.append(ssp)
            summary["package"] = {
                "file": ssp.name,
                "sha256": _sha256(ssp),
                "observer": _identity(packed),
                "reference": {"file": reference.name, "sha256": _sha256(reference)},
            }
        # Nothing is written before everything is made.
        for file in files:
            write_whole(options.out / file.name, file.read_bytes())
        write_json(options.out / "summary.json", summary)
    beside = " and ".join([*(file.name for file in files[1:]), "summary.json"])
    output.result(f"written: {options.out / built.path.name}, {beside} beside it")
    return CommandResult(summary)


@dataclass(frozen=True)
class _Choice:
    """An estimator with its gains, the text of their file, and where they are from."""

    estimator: type[Estimator]
    gains: Gains
    text: str
    source: str


def _choose(system: System, name: str | None, path: Path | None) -> _Choice:
    """The estimator that is named, that of the gains, or the first that has a class."""
    from workbench.observers import choose, estimators_of
    from workbench.observers.estimators.kalman import ExtendedKalmanFilter
    from workbench.observers.gains import estimator_of, format_gains, read_gains, tuned_file
    from workbench.system.registry import open_model

    known = estimators_of(system)
    if name is None:
        usual = next(iter(system.export.classes), ExtendedKalmanFilter.name)
        name = usual if path is None else estimator_of(path, known)
    estimator = choose(system, [name])[name]
    tuned = estimator.tuned_as or estimator.name
    with open_model(system, estimator.role) as fmu:
        gains = estimator.default_gains(fmu, system)
    path = path or tuned_file(system, tuned)
    if path is None:
        return _Choice(estimator, gains, format_gains(gains, estimator.meaning, {}), gains.source)
    gains = read_gains(path, {tuned: gains})
    return _Choice(estimator, gains, path.read_text(encoding="utf-8"), path.name)


def _summary(system: System, chosen: _Choice, built: BuiltFMU) -> dict[str, Any]:
    from workbench.models.compiler import source_hash

    gains = chosen.gains
    return {
        "estimator": chosen.estimator.name,
        "gains": dict(zip(gains.names, gains.values.tolist(), strict=True)),
        **{name: values.tolist() for name, values in gains.design.items()},
        "fmu": _identity(built),
        "provenance": {
            "workbench": own_version(),
            "packages": {p: version(p) for p in ("rumoca", "casadi", "ziglang", "fmpy")},
            "source_sha256": source_hash(system.library),
            "gains": chosen.source,
        },
    }


def _identity(built: BuiltFMU) -> dict[str, Any]:
    return {
        "file": built.path.name,
        "model": built.model,
        "fmi": f"{built.fmi}.0",
        "token": built.token,
        "sha256": built.sha256,
    }


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
