"""`python -m tests.chaos`: long commands are ended at random moments, go on, and are compared."""

import argparse
import sys
import tempfile
from collections import Counter
from itertools import cycle
from pathlib import Path
from random import Random

from tests.chaos.commands import commands
from tests.chaos.harness import KINDS, can_starve, disturb, undisturbed


def main() -> int:
    """Returns 1 if something did not hold."""
    parser = argparse.ArgumentParser(prog="python -m tests.chaos", description=__doc__)
    parser.add_argument("--count", type=int, default=200, help="ends of all commands together")
    parser.add_argument("--seed", type=int, default=1, help="of the moments")
    parser.add_argument("--command", action="append", help="only this one; may be repeated")
    options = parser.parse_args()
    disturbances = KINDS if can_starve() else KINDS[:-1]
    if disturbances != KINDS:
        print("no full disk: this machine lets users mount none")
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(prefix="chaos-") as scratch:
        wanted = [
            undisturbed(command, Path(scratch) / command.name)
            for command in commands(Path(scratch) / "cases")
            if options.command is None or command.name in options.command
        ]
        every = cycle([(usual, disturbance) for usual in wanted for disturbance in disturbances])
        for number, (usual, disturbance) in zip(range(options.count), every, strict=False):
            folder = Path(scratch) / f"{number}"
            random = Random(f"{options.seed} {number}")
            failures = disturb(usual, disturbance, random, folder)
            counts[f"{usual.command.name}, {disturbance}: {'fails' if failures else 'holds'}"] += 1
            for failure in failures:
                print(
                    f"{usual.command.name}, {disturbance}, number {number}: {failure}", flush=True
                )
    print("\n".join(f"{event} {count}" for event, count in sorted(counts.items())))
    return 1 if any("fails" in event for event in counts) or not counts else 0


if __name__ == "__main__":
    sys.exit(main())
