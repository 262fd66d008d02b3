"""`workbench export`: an observer with its gains as an FMU, and in an SSP package."""

import argparse
import hashlib
import json
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from workbench.commands.arguments import Commands, require_compiler
from workbench.errors import InputError
from workbench.observers import (
    DisturbanceGains,
    DisturbanceObserver,
    FilterNoise,
    ParameterEstimator,
    ParameterGains,
)
from workbench.tuning import DEFAULTS, gain_names, read_gains, to_vector, write_whole

if TYPE_CHECKING:
    from workbench.compiler import BuiltFMU  # an extra, needed by this command alone

_Gains: TypeAlias = DisturbanceGains | ParameterGains

_PACKAGE = Path("modelica/WheelsetRig/package.mo")
_REFERENCE = Path("fmus/fmi2/Reference.fmu")
_OBSERVERS = (DisturbanceObserver.name, ParameterEstimator.name)  # written in Modelica too


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    export = commands.add_parser(
        "export",
        description="Write an observer with its gains as a Co-Simulation FMU for all platforms, "
        "which runs in any FMI tool without Python, and an SSP 1.0 package in which it observes "
        "the reference model. One communication step takes one sample. Needs the extra "
        "[compiler].",
        epilog="examples:\n"
        "  python -m workbench export\n"
        "  python -m workbench export --gains results/tune/disturbance_observer/gains.toml\n"
        "  python -m workbench export --estimator parameter_estimator --fmi 3 --out /tmp/export",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    which = export.add_mutually_exclusive_group()
    which.add_argument(
        "--gains",
        type=Path,
        metavar="FILE",
        help="gains.toml of 'workbench tune', which names the observer (default: gains tuned on "
        "the project's cases)",
    )
    which.add_argument(
        "--estimator",
        choices=_OBSERVERS,
        default=DisturbanceObserver.name,
        help="observer with these tuned gains (default: %(default)s)",
    )
    export.add_argument(
        "--fmi",
        type=int,
        choices=(2, 3),
        default=2,
        help="version of the FMU; SSP 1.0 packages hold FMI 2.0 (default: %(default)s)",
    )
    export.add_argument(
        "--reference",
        type=Path,
        default=_REFERENCE,
        metavar="FILE",
        help="FMU (FMI 2.0) that the package connects the observer to (default: %(default)s)",
    )
    export.add_argument(
        "--out",
        type=Path,
        default=Path("results/export"),
        metavar="DIR",
        help="where to write (default: %(default)s)",
    )
    export.set_defaults(run=_export)


def _export(options: argparse.Namespace) -> int:
    require_compiler()
    from workbench.compiler import source_hash
    from workbench.export import OBSERVERS, ObserverModel, build_observer, write_package

    source = options.gains or DEFAULTS / f"{options.estimator}.toml"
    estimator, gains, text = _gains(source)
    name = OBSERVERS[estimator]
    observer = ObserverModel(_PACKAGE, f"{_PACKAGE.parent.name}.Observers.{name}", gains, text)
    with tempfile.TemporaryDirectory() as scratch:

        def build(fmi: int) -> "BuiltFMU":
            path = Path(scratch) / f"fmi{fmi}" / f"{name}.fmu"
            return build_observer(observer, path, fmi, lambda done: _show(name, fmi, done))

        packed = build(2)
        built = packed if options.fmi == 2 else build(3)
        ssp = Path(scratch) / f"{name}.ssp"
        write_package(packed.path, options.reference, ssp)
        summary = {
            "estimator": estimator,
            "gains": dict(zip(gain_names(gains), to_vector(gains).tolist(), strict=True)),
            "effect": gains.effect.tolist(),
            "fmu": _identity(built),
            "package": {
                "file": ssp.name,
                "sha256": _sha256(ssp),
                "observer": _identity(packed),
                "reference": {"file": options.reference.name, "sha256": _sha256(options.reference)},
            },
            "provenance": {
                "workbench": version("wheelset-workbench"),
                "packages": {p: version(p) for p in ("rumoca", "casadi", "ziglang", "fmpy")},
                "source_sha256": source_hash(_PACKAGE),
                "gains": source.name,
            },
        }
        # Nothing is written before everything is made.
        options.out.mkdir(parents=True, exist_ok=True)
        for file in (built.path, ssp):
            write_whole(options.out / file.name, file.read_bytes())
        content = json.dumps(summary, indent=2) + "\n"
        write_whole(options.out / "summary.json", content.encode())
    print(f"written: {options.out / built.path.name}, {ssp.name} and summary.json beside it")
    return 0


def _gains(path: Path) -> tuple[str, _Gains, str]:
    """Name of the estimator, its gains, and the text of their file."""
    estimator, found = read_gains(path)
    if isinstance(found, FilterNoise):
        raise InputError(
            where=str(path),
            found=f"estimator = '{estimator}'",
            expected=f"one of {', '.join(_OBSERVERS)}, which are models in Modelica",
            remedy="tune one of these and export its gains",
        )
    return estimator, found, path.read_text()


def _show(name: str, fmi: int, platform: str) -> None:
    print(f"{name}, FMI {fmi}.0: {platform}", flush=True)


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
