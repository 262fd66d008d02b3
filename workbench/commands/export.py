"""`workbench export`: an observer with its gains as an FMU, and in an SSP package."""

import argparse
import hashlib
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.commands.extras import require_compiler
from workbench.commands.output import Done, Output
from workbench.errors import InputError, closest
from workbench.files import claimed, write_json, write_whole
from workbench.observers import Estimator, Gains, choose
from workbench.observers.gains_file import read_gains, tuned_file
from workbench.system import REFERENCE, System
from workbench.systems import load_system, model_path, open_model

if TYPE_CHECKING:
    from workbench.compiler import BuiltFMU  # an extra, needed by this command alone


def run(options: argparse.Namespace, output: Output) -> Done:
    """Write the observer as an FMU, and the package."""
    require_compiler()
    from workbench.export import ObserverModel, build_observer, write_package

    system = load_system(options.system)
    kind, gains, source = _gains(system, options.estimator, options.gains)
    observer = ObserverModel(system, kind, gains, source.read_text(encoding="utf-8"))
    reference: Path = options.reference or model_path(system, REFERENCE)
    name = observer.model.rpartition(".")[2]
    with claimed(options.out), tempfile.TemporaryDirectory() as scratch:

        def build(fmi: int) -> "BuiltFMU":
            path = Path(scratch) / f"fmi{fmi}" / f"{name}.fmu"
            return build_observer(
                observer, path, fmi, lambda done: output.stage(f"{name}, FMI {fmi}.0: {done}")
            )

        packed = build(2)
        built = packed if options.fmi == 2 else build(3)
        ssp = Path(scratch) / f"{name}.ssp"
        write_package(system, packed.path, reference, ssp)
        package = {
            "file": ssp.name,
            "sha256": _sha256(ssp),
            "observer": _identity(packed),
            "reference": {"file": reference.name, "sha256": _sha256(reference)},
        }
        summary = _summary(system, gains, source, built) | {"package": package}
        # Nothing is written before everything is made.
        for file in (built.path, ssp):
            write_whole(options.out / file.name, file.read_bytes())
        write_json(options.out / "summary.json", summary)
    output.result(
        f"written: {options.out / built.path.name}, {ssp.name} and summary.json beside it"
    )
    return Done(summary)


def _gains(
    system: System, asked: str | None, path: Path | None
) -> tuple[type[Estimator], Gains, Path]:
    """The estimator, its gains, and their file."""
    classes = system.export.classes
    if not classes:
        raise InputError(
            where=str(system.source),
            found="no [export.classes]",
            expected="Modelica classes of estimators, which become FMUs",
            remedy='name one, such as disturbance_observer = "Observers.DisturbanceObserver"',
        )
    if asked is not None and asked not in classes:
        raise InputError(
            where=f"--estimator {asked}",
            found=f"an estimator without a model in Modelica{closest(asked, classes)}",
            expected=f"one of {', '.join(classes)}",
            remedy="choose one of these",
        )
    kinds = choose(system, list(classes) if path else [asked or next(iter(classes))])
    reasoned = {}
    for name, kind in kinds.items():
        with open_model(system, kind.role) as fmu:
            reasoned[name] = kind.reasoned(fmu, system)
    if path is None:
        (name,) = kinds
        path = tuned_file(system, name)
    if path is None:
        raise InputError(
            where=f"system '{system.name}'",
            found="no tuned gains that come with it",
            expected="gains.toml of 'python -m workbench tune'",
            remedy="tune the estimator, and give the file with --gains",
        )
    gains = read_gains(path, reasoned)
    return kinds[gains.estimator], gains, path


def _summary(system: System, gains: Gains, source: Path, built: "BuiltFMU") -> dict[str, Any]:
    from workbench.compiler import source_hash

    return {
        "estimator": gains.estimator,
        "gains": dict(zip(gains.names, gains.values.tolist(), strict=True)),
        **{name: values.tolist() for name, values in gains.design.items()},
        "fmu": _identity(built),
        "provenance": {
            "workbench": version("wheelset-workbench"),
            "packages": {p: version(p) for p in ("rumoca", "casadi", "ziglang", "fmpy")},
            "source_sha256": source_hash(system.library),
            "gains": source.name,
        },
    }


def _identity(built: "BuiltFMU") -> dict[str, Any]:
    return {
        "file": built.path.name,
        "model": built.model,
        "fmi": f"{built.fmi}.0",
        "token": built.token,
        "sha256": built.sha256,
    }


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
