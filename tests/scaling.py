"""How a fleet scales with the workers of a Dask cluster on this machine.

`python -m tests.scaling 1 2` watches 50 trains of 20 days, one stop a day, by one worker, then by
two. All trains ride the same stops, which the virtual rig makes; each is a machine of its own to
who watches. Needs the extra [cluster].
"""

import argparse
import io
import json
import shutil
import tempfile
from collections.abc import Iterable
from contextlib import redirect_stdout
from pathlib import Path

from distributed import LocalCluster

from workbench.__main__ import main as workbench
from workbench.machines.train.stops import USUAL, Faults, draw_train, simulate_stop, write_stop
from workbench.recordings.datasets import write_cases


def write_fleet(folder: Path, trains: int, days: int) -> None:
    """Folders of trains, each with the same stops, a day each."""
    train, sound = draw_train(1, 0.0), Faults()
    (dry, *_) = USUAL
    with tempfile.TemporaryDirectory() as recorded:
        for day in range(1, days + 1):
            write_stop(
                simulate_stop(dry, day, train, sound), day, sound, Path(recorded, f"{day:03}")
            )
        write_cases("train", Path(recorded), folder / "001")
    for number in range(2, trains + 1):
        shutil.copytree(folder / "001", folder / f"{number:03}")


def watch(fleet: Path, workers: int) -> tuple[int, float]:
    """Stops that count, and wall time by so many workers, from connecting to the last file [s]."""
    options = {"n_workers": workers, "threads_per_worker": 1, "dashboard_address": ":0"}
    with tempfile.TemporaryDirectory() as out, LocalCluster(processes=True, **options) as cluster:
        words = f"monitor {fleet} --system train --fleet --quiet --out {out} --cluster".split()
        with redirect_stdout(io.StringIO()):
            status = workbench([*words, cluster.scheduler_address])
        summary = json.loads(Path(out, "fleet.json").read_text())
    refused = [machine["machine"] for machine in summary["machines"] if machine["refusal"]]
    if status or refused:
        raise SystemExit(f"not watched: {', '.join(refused) or status}")
    return summary["recordings"], summary["seconds"]


def report(trains: int, days: int, counts: Iterable[int]) -> Iterable[str]:
    """A line for each number of workers: time, and its share of linear from the first number on."""
    with tempfile.TemporaryDirectory() as folder:
        write_fleet(Path(folder), trains, days)
        first = 0.0
        for workers in counts:
            recordings, seconds = watch(Path(folder), workers)
            first = first or seconds * workers
            share = first / (seconds * workers)
            amount = f"{trains} trains of {days} days, {recordings} stops that count"
            yield f"{amount}, {workers} workers: {seconds:.0f} s, {share:.2f} of linear"


def main() -> None:
    """Print the report for numbers of workers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("workers", type=int, nargs="+", help="numbers of workers, in turn")
    parser.add_argument("--trains", type=int, default=50, help="machines of the fleet")
    parser.add_argument("--days", type=int, default=20, help="of each, with one stop a day")
    options = parser.parse_args()
    for line in report(options.trains, options.days, options.workers):
        print(line, flush=True)


if __name__ == "__main__":
    main()
