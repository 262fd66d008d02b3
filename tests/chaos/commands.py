"""Commands that take long, made short: what they are given, and what of their results counts."""

import json
from pathlib import Path
from typing import Any

from tests.chaos.harness import ROOT, Command
from tests.recordings import write_beginnings


def commands(folder: Path) -> tuple[Command, ...]:
    """All of them; their recordings are written into a folder first."""
    write_beginnings(folder)
    search = ("--cases", str(folder), "--budget", "15", "--population", "4", "--workers", "2")
    return (
        Command(
            "tune",
            ("workbench", "tune", "parameter_estimator", *search, "--out"),
            ("--resume",),
            lambda out: (out / "gains.toml").read_text(),
        ),
        Command("power", ("tests.chaos.power",), (), _verdicts),
        Command(
            "simulate",
            ("workbench", "simulate", str(folder), "--estimator", "ekf", "--csv", "--out"),
            (),
            _tables,
        ),
        Command(
            "monitor",
            (*("workbench", "monitor", str(ROOT / "cases"), "--workers", "2"), "--out"),
            (),
            _tables,
        ),
    )


def _tables(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in out.rglob("*.csv")}


def _verdicts(out: Path) -> list[dict[str, Any]]:
    """Verdicts in the order of the plan, without how long they took."""
    _, *lines = (out / "sets.jsonl").read_text().splitlines()
    verdicts = [{**json.loads(line), "seconds": None, "checksum": None} for line in lines]
    return sorted(verdicts, key=lambda verdict: json.dumps(verdict["planting"]))
