"""The FMUs of the repository are those that its sources give, byte for byte."""

import pytest

pytest.importorskip("casadi")
pytest.importorskip("rumoca")

from workbench.__main__ import main


def test_fmus_match_their_sources() -> None:
    """Builds all of them for all platforms, unless this machine has built these sources before."""
    assert main(["fmu", "build", "--all", "--check"]) == 0
