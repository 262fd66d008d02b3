"""A page as a report on paper, printed by a browser that is there."""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from workbench.errors import InputError, WorkerError
from workbench.runtime.files import write_whole

_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "msedge")
_LONGEST = 120  # [s] that a page may take; it takes some five


def browser() -> str:
    """The program that prints."""
    for name in _BROWSERS:
        if program := shutil.which(name):
            return program
    raise InputError(
        where="command line, --pdf",
        found=f"none of {', '.join(_BROWSERS)}",
        expected="Chromium or a browser made from it, which prints the page",
        remedy="install chromium, or leave --pdf out and print index.html from any browser",
    )


def print_page(page: Path) -> Path:
    """Print a page to `report.pdf` beside it; returns its path.

    What is folded on the page is left out, but for the tables that its answer rests on.

    Raises
    ------
    InputError
        If there is no browser.
    WorkerError
        If the browser fails.
    """
    program = browser()
    with tempfile.TemporaryDirectory() as folder:
        printed = Path(folder) / "report.pdf"
        # The sandbox of the browser does not work for root; the page is the workbench's own.
        free = ["--no-sandbox"] if os.name == "posix" and os.geteuid() == 0 else []
        switches = "headless disable-gpu no-first-run disable-background-networking "
        switches += "disable-component-update disable-sync no-pdf-header-footer "
        switches += "virtual-time-budget=10000"
        command = [
            program,
            *free,
            *(f"--{switch}" for switch in switches.split()),
            f"--user-data-dir={Path(folder) / 'profile'}",
            f"--print-to-pdf={printed}",
            page.resolve().as_uri(),
        ]
        try:
            run = subprocess.run(
                command, capture_output=True, text=True, check=False, timeout=_LONGEST
            )
        except subprocess.TimeoutExpired:
            raise WorkerError(f"{program} has not printed {page} in {_LONGEST} s") from None
        if run.returncode or not printed.is_file():
            raise WorkerError(f"{program} did not print {page}: {run.stderr.strip()[-300:]}")
        report = page.with_name("report.pdf")
        write_whole(report, printed.read_bytes())
    return report
