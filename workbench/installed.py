"""Which systems come with the workbench, without reading more of them than their names."""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from workbench import resources

FILE = "system.toml"


def system_files() -> dict[str, Path]:
    """System files by name."""
    return {content.get("name", path.parent.name): path for path, content in _contents().items()}


def companions() -> list[str]:
    """Python packages that these systems bring along."""
    found = (content.get("companion") for content in _contents().values())
    return [name for name in found if name]


@cache
def _contents() -> dict[Path, dict[str, Any]]:
    paths = sorted(resources.modelica().glob(f"*/{FILE}"))
    return {path: tomllib.loads(path.read_text(encoding="utf-8")) for path in paths}
