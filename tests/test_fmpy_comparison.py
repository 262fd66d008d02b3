"""Any FMU that is at hand: its open loop is that of FMPy, or it is refused in words."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from workbench.models.description import MODEL_EXCHANGE, read_description
from workbench.observers.fmpy_comparison import (
    LIMIT,
    NO_REFERENCE,
    REFUSED,
    RIGHT,
    compare_with_fmpy,
)

# Folders of FMUs from elsewhere, such as those of docs/foreign-fmus.md, which are not ours to ship.
FOLDERS = os.environ.get("WORKBENCH_FMUS", "").split(os.pathsep)
ELSEWHERE = sorted(path for folder in FOLDERS if folder for path in Path(folder).rglob("*.fmu"))
SLAVE = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Integer, Real


class Spring(Fmi2Slave):
    def __init__(self, **options):
        super().__init__(**options)
        self.x, self.v, self.u, self.steps = 1.0, 0.0, 0.0, 0
        self.register_variable(Real("x", causality=Fmi2Causality.output))
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Integer("steps", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.v += step_size * (self.u - 4.0 * self.x)
        self.x += step_size * self.v
        self.steps += 1
        return True
"""


@pytest.mark.skipif(not ELSEWHERE, reason="WORKBENCH_FMUS names no folder of FMUs")
@pytest.mark.parametrize("path", ELSEWHERE, ids=lambda path: path.name)
def test_an_fmu_from_elsewhere_is_right_or_refused_in_words(path):
    comparison = compare_with_fmpy(path)
    assert comparison.verdict in (RIGHT, REFUSED, NO_REFERENCE), comparison
    if comparison.verdict == RIGHT:
        assert comparison.difference <= LIMIT
    else:
        assert (
            "expected" in comparison.reason
            or path.name in comparison.reason
            or "FMPy" in (comparison.reason)
        )


def test_co_simulation_in_python_runs_as_in_fmpy(tmp_path):
    pytest.importorskip("pythonfmu", reason="builds the FMU")
    (tmp_path / "spring.py").write_text(SLAVE)
    build = ["-m", "pythonfmu", "build", "-f", "spring.py", "-d", "."]
    subprocess.run([sys.executable, *build], cwd=tmp_path, check=True, capture_output=True)
    path = tmp_path / "Spring.fmu"
    assert MODEL_EXCHANGE not in read_description(path).interfaces
    assert compare_with_fmpy(path).verdict == RIGHT
