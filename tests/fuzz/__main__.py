"""`python -m tests.fuzz`: many mutants of every kind of file, and a report by class."""

import argparse
import sys
import tempfile
import time
from pathlib import Path

from tests.fuzz.apart import one_process
from tests.fuzz.harness import Report, fuzz
from tests.fuzz.targets import targets


def main() -> int:
    """Returns 1 if a mutant was not read as it should."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument(
        "--count", type=int, default=100_000, help="mutants of all targets together"
    )
    parser.add_argument("--seed", type=int, default=1, help="the same seed makes the same mutants")
    parser.add_argument("--target", help="only one of them, such as 'case'")
    parser.add_argument("--number", type=int, help="only one mutant, which a report has named")
    parser.add_argument(
        "--out", type=Path, default=Path("build/fuzz"), help="where those that fail are kept"
    )
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder, one_process():
        wanted = [
            target for target in targets(Path(folder)) if options.target in (None, target.name)
        ]
        numbers = range(-(-options.count // max(1, len(wanted))))
        if options.number is not None:
            numbers = range(options.number, options.number + 1)
        whole = Report()
        for target in wanted:
            begin = time.perf_counter()
            report = fuzz(target, options.seed, numbers, options.out)
            whole.outcomes |= report.outcomes
            whole.failures += report.failures
            _tell(report, target.name, time.perf_counter() - begin)
    print(
        f"{len(whole.failures)} failures" + (f", kept in {options.out}" if whole.failures else "")
    )
    return 1 if whole.failures or not wanted else 0


def _tell(report: Report, name: str, seconds: float) -> None:
    counts = report.outcomes[name]
    listed = ", ".join(f"{outcome} {count}" for outcome, count in counts.most_common())
    print(f"{name}: {counts.total()} in {seconds:.0f} s: {listed}", flush=True)
    seen: set[str] = set()
    for failure in report.failures:
        if (reason := failure.message.split(":")[0][:60]) not in seen:
            seen.add(reason)
            print(f"  {failure}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
