"""Time of FMI calls against plain C: `bench.c` with the sources of an FMU, one program a model."""

import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import fmpy
import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.models.compiler.assembly import FLAGS, PLATFORMS
from workbench.models.description import Description

_PROGRAM = Path(__file__).parent / "bench.c"
# Many short repeats: their median does not see that the machine does something else in between.
_REPEATS = 201
_REPEAT = 5e-4  # s, rough duration of one repeat of the derivatives
_STEPS = 100


@dataclass(frozen=True)
class CallTimes:
    """Medians over repeats [s]; every evaluation is at another state and input.

    Attributes
    ----------
    derivatives : one evaluation by a plain call of the model's C function.
    derivatives_fmi : fmi2SetContinuousStates, fmi2SetReal of all inputs, fmi2GetDerivatives.
    nonzeros : the nonzeros of the Jacobian, by a plain call of the model's C function.
    jacobian : d[der(x), w]/d[x, u], w outputs and local variables, as a full matrix: the nonzeros,
        put to places that are known beforehand.
    jacobian_fmi : the same matrix: states and inputs set, one fmi2GetDirectionalDerivative a
        column.
    step : one Co-Simulation step, with other inputs than before.
    """

    states: int
    inputs: int
    derivatives: float
    derivatives_fmi: float
    nonzeros: float
    jacobian: float
    jacobian_fmi: float
    step: float

    def ratios(self) -> Mapping[str, float]:
        """Time through FMI over plain time."""
        return {
            "derivatives": self.derivatives_fmi / self.derivatives,
            "jacobian": self.jacobian_fmi / self.jacobian,
        }


def time_sources(description: Description, points: NDArray[np.float64], step: float) -> CallTimes:
    """Compile the sources of an FMI 2.0 FMU with the FMUs' own flags, and time them.

    Parameters
    ----------
    description : of an FMU with C sources.
    points : (p, n + m) states and inputs at which the model is evaluated, in its own order.
    step : of Co-Simulation [s].

    Raises
    ------
    InputError
        If the FMU has no sources, or they do not compile or run.
    """
    evaluations = max(100, int(_REPEAT / (50e-9 * max(1, len(description.states)))))
    sizes = f"{len(points)} {evaluations} {_REPEATS} {_STEPS} {step}"
    lines = [sizes, *(" ".join(map(repr, point)) for point in points.tolist())]
    with tempfile.TemporaryDirectory() as scratch:
        program = _compile(description.path, Path(scratch))
        run = subprocess.run(
            [program], input="\n".join(lines), capture_output=True, text=True, check=False
        )
    if run.returncode != 0:
        raise InputError(
            where=str(description.path),
            found=run.stderr.strip() or f"exit status {run.returncode}",
            expected="calls that succeed and give what the plain calls give",
            remedy="check the FMU with 'workbench fmu check'",
        )
    rows = np.array([line.split() for line in run.stdout.splitlines()], float)
    inputs = len(description.names("input"))
    return CallTimes(len(description.states), inputs, *(1e-9 * np.median(rows, axis=0)).tolist())


def _compile(fmu: Path, folder: Path) -> Path:
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder, [n for n in archive.namelist() if n.startswith("sources/")])
    sources = folder / "sources"
    files = sorted(str(path) for path in sources.glob("*.c"))
    targets = {fmi3: target for _, fmi3, target, _ in PLATFORMS.values()}
    target = targets[fmpy.platform_tuple]
    command = [sys.executable, "-m", "ziglang", "cc", "-target", target, *FLAGS, f"-I{sources}"]
    run = subprocess.run(
        [*command, *files, str(_PROGRAM), "-lm", "-o", str(folder / "bench")],
        capture_output=True,
        text=True,
        check=False,
    )
    if not files or run.returncode != 0:
        raise InputError(
            where=str(fmu),
            found=run.stderr.strip()[-2000:] if files else "no C sources",
            expected="C sources of FMI 2.0 that compile",
            remedy="build the FMU with 'workbench fmu build'",
        )
    return folder / "bench"
