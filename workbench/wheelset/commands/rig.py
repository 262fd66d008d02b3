"""`workbench rig`: recordings from the virtual rig."""

import argparse
import dataclasses
import time
from collections.abc import Sequence
from concurrent.futures import as_completed
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from workbench.commands.arguments import Commands, add_system, add_workers, positive
from workbench.files import claimed
from workbench.fmu import CoSimulation
from workbench.pool import Pool
from workbench.system import REFERENCE
from workbench.systems import load_system, model_path
from workbench.wheelset.rig import (
    CONSTANT_PADS,
    ORDINARY_PADS,
    SCENARIOS,
    STANDARD,
    Effects,
    Scenario,
    check_files,
    plant,
    select,
    simulate,
    write_recording,
)


def add(commands: Commands) -> None:
    """Add the command to the parser."""
    rig = commands.add_parser(
        "rig",
        description="Make recordings by co-simulation of the multibody model with drive, brake, "
        "wheel-slide protection, pads and sensors. Each case folder also holds truth.csv and "
        "truth.json, which no estimator reads. The same seed gives the same bytes.",
        epilog=_epilog(),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    rig.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="where to write the case folders"
    )
    rig.add_argument(
        "--case",
        action="append",
        default=[],
        metavar="NAME",
        help="scenario, may be repeated (default: the fourteen standard ones)",
    )
    rig.add_argument(
        "--seed",
        type=_seed,
        default=1,
        metavar="N",
        help="of tolerances and noise (default: %(default)s)",
    )
    rig.add_argument(
        "--effect",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="plant an effect, or change one of the pads; may be repeated",
    )
    rig.add_argument(
        "--pads",
        choices=("ordinary", "constant"),
        default="ordinary",
        help="friction of dry pads: with speed, temperature and force, or constant as in the "
        "nominal model (default: %(default)s)",
    )
    _add_making(rig)
    rig.set_defaults(run=_rig)


def _add_making(rig: argparse.ArgumentParser) -> None:
    """Add what says how recordings are made and written."""
    rig.add_argument(
        "--rate",
        type=positive,
        default=200,
        metavar="HZ",
        help="of the recording, a divisor of 1000 (default: %(default)s)",
    )
    rig.add_argument(
        "--truth-every",
        type=positive,
        default=1,
        metavar="N",
        help="write the truth of every Nth sample only (default: %(default)s)",
    )
    rig.add_argument(
        "--fmu",
        type=Path,
        metavar="FILE",
        help="multibody model, with Co-Simulation (default: the reference model of the system)",
    )
    add_system(rig)
    add_workers(rig)


def _epilog() -> str:
    effects = "\n".join(
        f"  {field.name:<18} [{field.metadata['unit']}]".ljust(28) + field.metadata["text"]
        for field in dataclasses.fields(Effects)
    )
    pads = ", ".join(
        f"{name}={gain:g}" for name, gain in dataclasses.asdict(ORDINARY_PADS).items() if gain
    )
    scenarios = "\n".join(f"  {name:<26} {scenario.title}" for name, scenario in SCENARIOS.items())
    return f"""\
examples:
  python -m workbench rig --out /tmp/rig
  python -m workbench rig --case locked_wheel --out /tmp/rig
  python -m workbench rig --pads constant --effect fx_gain=0.015 --seed 7 --out /tmp/rig

scenarios, of which the first {len(STANDARD)} are standard:
{scenarios}

effects, zero if not given:
{effects}
  phiW is the angle of the wheelset; phases are drawn for each stop.
  Ordinary pads have {pads}."""


def _seed(text: str) -> int:
    """Type of an argument that is a whole number of 0 or more."""
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{value} is below 0")
    return value


def _rig(options: argparse.Namespace) -> int:
    scenarios = select(options.case)
    pads = ORDINARY_PADS if options.pads == "ordinary" else CONSTANT_PADS
    effects = plant(pads, options.effect)
    with claimed(options.out):
        return _recorded(options, scenarios, effects)


def _recorded(options: argparse.Namespace, scenarios: Sequence[Scenario], effects: Effects) -> int:
    check_files([options.out / scenario.name for scenario in scenarios], options.rate)
    fmu = options.fmu or model_path(load_system(options.system), REFERENCE)
    with CoSimulation(fmu):
        pass  # a file that is no FMU is refused here, once
    begin = time.perf_counter()
    done = 0
    interrupted = False
    order = _Order(effects, options.seed, options.rate, options.truth_every, fmu, options.out)
    # A stop that is under way at Ctrl-C is finished and kept, in a process even if it is alone.
    workers = min(options.workers, len(scenarios))
    with Pool(workers, nullcontext, order, isolated=True) as pool:
        tasks = [pool.submit(_make, scenario) for scenario in scenarios]
        try:
            for task in as_completed(tasks):
                line = task.result()
                done += 1
                elapsed = time.perf_counter() - begin
                left = elapsed / done * (len(tasks) - done)
                print(
                    f"[{done:>3}/{len(tasks)}] {line}  {elapsed:5.1f} s, about {left:.0f} s left",
                    flush=True,
                )
        except KeyboardInterrupt:
            interrupted = True
            pool.finish()
    kept = sum(task.done() and not task.cancelled() for task in tasks)
    print(f"{kept} of {len(tasks)} cases in {options.out}")
    return 130 if interrupted else 0


@dataclass(frozen=True)
class _Order:
    """What is made of every scenario; see `simulate` and `write_recording`."""

    effects: Effects
    seed: int
    rate: int
    every: int
    fmu: Path
    out: Path


def _make(order: _Order, scenario: Scenario) -> str:
    """Make and write one case; returns a line for people."""
    stop = simulate(scenario, order.seed, order.effects, order.fmu)
    write_recording(stop, order.effects, order.rate, order.out / scenario.name, order.every)
    seconds = stop.standstill - stop.drawn.coasting
    return f"{scenario.name:<26} stopped in {seconds:5.1f} s"
