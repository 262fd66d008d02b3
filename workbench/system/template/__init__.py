"""What a new system begins with: a commented system file, a small library, a few recordings.

The recordings are made by equations of their own, with a wall that seeps, which the model lacks.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from workbench.errors import InputError
from workbench.runtime.files import write_whole

AREA, OUTLET, SEEPAGE = 0.5, 1.05e-3, 4e-4  # [m2], [m2], [m2/s] of the tank that is recorded
_GRAVITY, _STEP, _SAMPLES = 9.81, 0.5, 1200  # [m/s2], [s]
_NOISE = 5e-5, 2e-3  # of inflow [m3/s] and level [m]
_FILES = ("system.toml", "package.mo")
_RECORDINGS = 4


def write_system(folder: Path, seepage: float = SEEPAGE) -> list[Path]:
    """Write a new system into a folder; returns its files.

    Parameters
    ----------
    seepage : of the tank that is recorded [m2/s].
    """
    here = Path(__file__).parent
    paths = [folder / name for name in _FILES]
    refuse_present(paths)
    for path in paths:
        write_whole(path, (here / path.name).read_bytes())
    for number in range(1, _RECORDINGS + 1):
        paths += _record(folder / "recordings" / f"{number:02}_steps", number, seepage)
    return paths


def refuse_present(paths: Sequence[Path]) -> None:
    """Refuse to write over files of a system."""
    for path in paths:
        if path.exists():
            raise InputError(
                where=str(path),
                found="a file",
                expected="a folder without a system",
                remedy="choose another folder, or remove the file",
            )


def _record(folder: Path, number: int, seepage: float) -> list[Path]:
    """Ten minutes of a pump that is set anew every two."""
    rng = np.random.default_rng(number)
    time = _STEP * np.arange(_SAMPLES)
    inflow = np.repeat(rng.uniform(1e-3, 7e-3, 5), _SAMPLES // 5)
    outlet = OUTLET * (1.0 + 0.02 * rng.standard_normal())
    level, levels = rng.uniform(0.6, 1.4), []
    fine = 50  # Euler steps of a sample, whose error is a hundredth of the noise
    for flow in inflow:
        levels.append(level)
        for _ in range(fine):
            leaves = outlet * np.sqrt(2.0 * _GRAVITY * max(level, 0.0)) + seepage * level
            level += _STEP / fine * (flow - leaves) / AREA
    measured = np.column_stack([inflow, levels]) + _NOISE * rng.standard_normal((_SAMPLES, 2))
    rows = [
        f"{t:.1f},{1e3 * u:.4f},{1e3 * h:.2f}" for t, (u, h) in zip(time, measured, strict=True)
    ]
    case = f'title = "Steps of the pump, day {number}"\n\n[measurement]\nfile = "measured.csv"\n'
    write_whole(folder / "case.toml", case)
    write_whole(folder / "measured.csv", "\n".join(["time [s],inflow [l/s],h [mm]", *rows]) + "\n")
    return [folder / "case.toml", folder / "measured.csv"]
