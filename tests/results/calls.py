"""What is asked of the command line: small calls of every command, by part.

A part is a folder of its own; the name of a call is that of its results in it, which later calls
of the same part may read. `{cases}` are the recordings that come along, `{modelica}` the libraries,
`{fmus}` the built models, `{recordings}` those that are not part of the repository. One process
works on each, as progress has no order with more. What no command makes is made by a function,
which is given the folder of the part.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

Call = str | Callable[[Path], object]

CASES = Path(__file__).parents[2] / "cases"
COMMANDS = (
    *("simulate", "tune", "diagnose", "next", "distance", "monitor", "power", "observability"),
    *("export", "fmu", "fmu build", "fmu info", "fmu check", "results", "systems", "import"),
    *("prepare", "new", "doctor", "completion", "bench", "rig", "accuracy"),
)
ESTIMATORS = (
    *("open_loop", "direct_inversion", "disturbance_observer", "parameter_estimator", "ekf"),
    *("arrow", "ukf", "mhe", "imm", "smoother", "disturbance_observer_disc"),
)
_EVERY = " ".join(f"--estimator {name}" for name in ESTIMATORS)
_DRY, _FAST, _WET = ("{cases}/01_dry_80_1.5", "{cases}/03_dry_120_3.6", "{cases}/08_wet_120_3.6")
_SLIDE = "{cases}/09_wet_160_4.2_wsp"
_SEARCH = "--population 4 --seed 3 --workers 1"
_STOPS = "--case 01_dry_80_1.5 --case 03_dry_120_3.6"
_POWER = f"power --effects BrakeFade --sizes 4 --repeats 1 --clean 0 --pairs 0 {_STOPS} --workers 1"
_FAULTS = ("pads_axle", "radius_axle")


def recorded(folder: Path) -> None:
    """Write a stop as a German recorder does: semicolons, decimal commas, names of its own."""
    _, *rows = (CASES / "01_dry_80_1.5" / "measured.csv").read_text().splitlines()
    head = "Zeit [s];Bremsdruck [bar];Antriebsmoment [N.m];v_Rad [rad/s];v_Rolle [rad/s];Fx [N]"
    own = [row.replace(",", ";").replace(".", ",") for row in rows[::4]]
    (folder / "stop.csv").write_text("\n".join([head, *own]) + "\n")


def changed_effect(folder: Path) -> None:
    """Let the tank's only effect be one that does not explain what its recordings show."""
    library = folder / "tank" / "package.mo"
    library.write_text(library.read_text().replace("nominal + k*h", "nominal + k*nominal"))


def _published(system: str, source: str, cases: str, more: str = "") -> dict[str, str]:
    """Cases of a published set, and what is diagnosed of some of them."""
    named = " ".join(f"cases/{case}" for case in cases.split())
    return {
        "cases": f"prepare {system} --from {{recordings}}/real/{source} --out cases",
        "diagnose": f"diagnose --system {system} {named} {more} --workers 1 --out diagnose",
    }


PARTS: Mapping[str, Mapping[str, Call]] = {
    "help": {
        "workbench": "--help",
        **{name.replace(" ", "_"): f"{name} --help" for name in COMMANDS},
    },
    "installed": {
        "version": "--version",
        "systems": "systems",
        "systems_json": "systems --json",
        "doctor": "doctor",
        "completion": "completion bash",
        "sets": "prepare cascaded_tanks",
        "effects": "diagnose --list",
        "effects_train": "diagnose --list --system train",
        "rig": "rig --list",
    },
    "refused": {
        "folder": "simulate nowhere --json --out out",
        "estimator": f"simulate {_DRY} --estimator kalman --out out",
        "gains": "export --gains {cases}/01_dry_80_1.5/case.toml --out out",
        "effect": f"diagnose {_DRY} --effects Seepag --out out",
        "system": "observability --system {cases}/01_dry_80_1.5/case.toml --out out",
        "result": "next {cases} --out out",
        "summary": "results {cases} --json",
        "fmu": "fmu check {cases}/01_dry_80_1.5/case.toml",
        "column": f"import {_DRY}/truth.json --yes --out out",
        "history": "monitor {cases}/01_dry_80_1.5 --out out",
        "option": "tune ekf --budget 0 --out out",
    },
    "tank": {
        "tank": "new tank",
        "simulate": "simulate --system tank --workers 1 --out simulate",
        "tune": f"tune ekf --system tank --budget 3 --folds 2 {_SEARCH} --out tune",
        "tuned": "simulate --system tank --gains tune/gains.toml --estimator ekf --workers 1 "
        "--out tuned",
        "diagnose": "diagnose --system tank --certainty --workers 1 --out diagnose",
        "held_out": "diagnose --system tank --held-out 04_* --workers 1 --json --out held_out",
        "next": "next diagnose --system tank --workers 1 --out next",
        "monitor": "monitor tank/recordings --system tank --workers 1 --out monitor",
        "observability": "observability --system tank --workers 1 --out observability",
        "export": "export --system tank --estimator ekf --platforms native --out export",
        "build": "fmu build tank/package.mo Tank.Observer --fmi 3 --out build/Tank.fmu",
        "info": "fmu info build/Tank.fmu",
        "results": "results simulate tuned",
        "results_json": "results diagnose --json",
    },
    "propose": {
        "tank": "new tank",
        "changed": changed_effect,
        "propose": "diagnose --system tank --propose --workers 1 --out propose",
    },
    "simulate": {
        "standard": "simulate --workers 1 --out standard",
        "every": f"simulate {_DRY} {_SLIDE} {_EVERY} --workers 1 --out every",
        "untuned": f"simulate {_DRY} --untuned --workers 1 --json --quiet --out untuned",
        "observability": f"observability {_DRY} {_SLIDE} --workers 1 --out observability",
        "results": "results untuned standard",
    },
    "tune": {
        "observer": f"tune disturbance_observer --cases {_FAST} {_WET} --budget 4 {_SEARCH} "
        "--out observer",
        "resumed": f"tune disturbance_observer --cases {_FAST} {_WET} --budget 5 {_SEARCH} "
        "--resume --out observer",
        "estimator": f"tune parameter_estimator --cases {_FAST} --budget 3 {_SEARCH} "
        "--scale-error 0 --full-evaluation --out estimator",
        "judged": f"tune ekf --cases {_FAST} --budget 2 --judge-by smoother {_SEARCH} --out judged",
    },
    "rig": {
        "stops": "rig --seed 2 --case 07_wet_80_1.5 --truth-every 4 --workers 1 --out stops",
        "planted": "rig --seed 7 --case 01_dry_80_1.5 --pads constant --effect fx_gain=0.015 "
        "--workers 1 --out planted",
        "accuracy": f"accuracy stops {_EVERY} --out accuracy",
    },
    "diagnose": {"wheelset": f"diagnose {_DRY} {_FAST} {_WET} --workers 1 --out wheelset"},
    "power": {
        "power": f"{_POWER} --out power",
        "plan": f"power --plan --effects BrakeFade --sizes 4 {_STOPS} --workers 1 --out plan",
    },
    "export": {
        "observer": "export --platforms native --out observer",
        **{
            name: f"export --estimator {name} --fmi {fmi} --platforms native --out {name}"
            for name, fmi in (("ekf", 2), ("ukf", 3), ("imm", 2), ("mhe", 3))
        },
        "train": "export --system train --estimator ekf --platforms native --out train",
    },
    "fmu": {
        "info": "fmu info {fmus}/fmi3/FullObserver.fmu",
        "info_json": "fmu info {fmus}/fmi2/Reference.fmu --json",
        "check": "fmu check {fmus}/fmi2/MinimalObserver.fmu --instantiations 20",
        "check_json": "fmu check {fmus}/fmi3/TwoVehicles.fmu --instantiations 20 --json",
        "build": "fmu build {modelica}/WheelsetRig/package.mo WheelsetRig.MinimalObserver "
        "--out build/MinimalObserver.fmu",
    },
    "import": {
        "recorder": recorded,
        "import": "import stop.csv --condition wheel_rail=dry --condition discs=dry,dry,dry --yes "
        "--out import",
        "simulate": "simulate import --estimator ekf --workers 1 --out simulate",
        "unasked": "import stop.csv --out unasked",
    },
    "train": {
        "stops": "rig --system train --seed 4 --effect pads[3]=0.15 --workers 1 --out stops",
        "simulate": "simulate --system train stops --estimator ekf --workers 1 --out simulate",
        "distance": "distance --system train stops --samples 100 --safety 2 --workers 1 "
        "--out distance",
        "asked": "distance --system train stops --ask speed='140 km/h' --ask rail=wet "
        "--samples 100 --safety 0 --plain 200 --workers 1 --out asked",
        "monitor": "monitor stops --system train --workers 1 --out monitor",
    },
    "train_faults": {
        name: line
        for fault in _FAULTS
        for name, line in (
            (
                f"{fault}_stops",
                f"prepare train --from {{recordings}}/train/labelled/{fault} --out {fault}_stops",
            ),
            (fault, f"diagnose --system train {fault}_stops --workers 1 --out {fault}"),
        )
    },
    "wheelset_faults": {
        "cylinder_lag": "diagnose {recordings}/labelled/cylinder_lag/01_dry_80_1.5 "
        "{recordings}/labelled/cylinder_lag/03_dry_120_3.6 --workers 1 --out cylinder_lag",
    },
    "tanks": {
        **_published("cascaded_tanks", "cascaded_tanks", "estimation test", "--held-out test"),
        "propose": "diagnose --system cascaded_tanks cases --held-out test "
        "--effects SensorCurvature --propose --workers 1 --out propose",
    },
    "servo": _published("servo_pendulum", "servo_pendulum", "kp200_up_and_down kp200_sin_sin"),
    "air": _published("air_supply", "metro_air_supply", "cycle_1 cycle_2 cycle_4"),
    "seal": _published("seal_friction", "pneumatic_cylinder", "O-ring_1bar O-ring_3bar"),
    "chamber": _published("leaking_chamber", "pneumatic_cylinder", "Ultimaker_020_above"),
}
