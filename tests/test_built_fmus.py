"""The FMUs of the repository are those that its sources give, byte for byte."""

import hashlib
import json

import pytest

from workbench.__main__ import main
from workbench.models.compiler import source_hash
from workbench.runtime.resources import fmus
from workbench.system.installed import built_models


def test_fmus_are_those_of_their_manifest_and_it_is_of_these_sources():
    """Libraries and the compiler, whose code is among the sources; nothing is built."""
    manifest = json.loads((fmus() / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["source_sha256"] == source_hash(*built_models())
    held = {
        path.relative_to(fmus()).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in fmus().rglob("*.fmu")
    }
    assert held == {name: one["sha256"] for name, one in manifest["fmus"].items()}


@pytest.mark.long
def test_fmus_match_their_sources():
    """Builds all of them for all platforms, unless this machine has built these sources before."""
    assert main(["fmu", "build", "--all", "--check"]) == 0
