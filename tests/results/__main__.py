"""`python -m tests.results`: shows that a change of the code changes no result.

    python -m tests.results write DIR [--only NAME ...] [--recordings FOLDER]
    python -m tests.results compare A B [--only NAME ...] [--no-pages]

`write` runs small calls of every command, and keeps what they say and write. `compare` lists what
differs between two such folders, or between two files of refusals; see `tests/results/refusals.py`.
"""

import argparse
import os
import sys
from pathlib import Path

from tests.results.calls import PARTS
from tests.results.comparison import compare, listed
from tests.results.writing import write


def main(arguments: list[str] | None = None) -> int:
    """Return 1 if results differ."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.results",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    jobs = parser.add_subparsers(required=True, metavar="JOB", dest="job")
    writing = jobs.add_parser("write", help="run commands, and keep their results")
    writing.add_argument("folder", type=Path, metavar="DIR", help="where to keep them")
    writing.add_argument(
        "--recordings", type=Path, metavar="FOLDER", help="that are not part of the repository"
    )
    writing.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="parts at a time")
    comparing = jobs.add_parser("compare", help="compare two folders, or two files of refusals")
    comparing.add_argument("before", type=Path, metavar="A")
    comparing.add_argument("after", type=Path, metavar="B")
    comparing.add_argument("--no-pages", action="store_true", help="leave pages out")
    for job in (writing, comparing):
        job.add_argument(
            "--only", nargs="+", choices=PARTS, default=[], metavar="NAME", help=", ".join(PARTS)
        )
    options = parser.parse_args(arguments)
    if options.job == "write":
        recordings = options.recordings and options.recordings.resolve()
        write(options.folder, options.only or list(PARTS), recordings, options.jobs)
        return 0
    differences = compare(options.before, options.after, options.only)
    if options.no_pages:
        differences = [difference for difference in differences if difference.group != "pages"]
    print(listed(differences) or "the same")
    return 1 if differences else 0


if __name__ == "__main__":
    sys.exit(main())
