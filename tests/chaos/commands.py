"""Commands that take long, made short: what they are given, and what of their results counts."""

import json
from pathlib import Path
from typing import Any

import pandas as pd

from tests.chaos.harness import ROOT, Command

CASES = ("03_dry_120_3.6", "08_wet_120_3.6")
SAMPLES = slice(700, 1900)  # 6 s: first pressure and the beginning of the stop


def commands(folder: Path) -> tuple[Command, ...]:
    """All of them; their recordings are written into a folder first."""
    _write_cases(folder)
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
            ("workbench", "simulate", str(folder), "--estimator", "ekf", "--out"),
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


def _write_cases(folder: Path) -> None:
    for name in CASES:
        (folder / name).mkdir(parents=True)
        source = ROOT / "cases" / name
        (folder / name / "case.toml").write_text((source / "case.toml").read_text())
        table = pd.read_csv(source / "measured.csv").iloc[SAMPLES]
        table.to_csv(folder / name / "measured.csv", index=False)


def _tables(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in out.rglob("*.csv")}


def _verdicts(out: Path) -> list[dict[str, Any]]:
    """Verdicts in the order of the plan, without how long they took."""
    _, *lines = (out / "sets.jsonl").read_text().splitlines()
    found = [{**json.loads(line), "seconds": None, "checksum": None} for line in lines]
    return sorted(found, key=lambda one: json.dumps(one["planting"]))
