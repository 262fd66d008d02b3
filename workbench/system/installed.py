"""The systems that come with the workbench, by name, and the packages that they bring along.

Reading their files needs no model, no numbers, and nothing that takes long to import: the command
line asks here before it knows its command.
"""

import tomllib
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

from workbench.runtime import resources

FILE = "system.toml"


def companion_part(companion: str, name: str) -> ModuleType | None:
    """A module of a companion package; None where it has none.

    Parameters
    ----------
    companion : dotted name, empty for none. Only a part that is there is imported.
    """
    spec = find_spec(companion) if companion else None
    if spec is None or spec.submodule_search_locations is None:
        return None
    part = f"{companion}.{name}"
    return import_module(part) if find_spec(part) else None


def system_files() -> dict[str, Path]:
    """System files by name."""
    return {content.get("name", path.parent.name): path for path, content in _contents().items()}


def usual_system() -> str:
    """Name of the system that is meant where none is named: the first that comes with recordings.

    Commands without any arguments work on it.
    """
    with_cases = [path for path, content in _contents().items() if "cases" in content]
    return next(name for name, path in system_files().items() if path in with_cases)


def built_models() -> dict[Path, list[str]]:
    """Models whose FMUs come with the workbench: dotted names by library, its `package.mo`."""
    found = {}
    for path, content in _contents().items():
        models = content["models"].values()
        built = [model["class"] for model in models if _is_kept(path.parent / model.get("fmu", ""))]
        if built:
            found[path.with_name("package.mo")] = [f"{path.parent.name}.{one}" for one in built]
    return found


def companions() -> list[str]:
    """Python packages that these systems bring along."""
    found = (content.get("companion") for content in _contents().values())
    return [name for name in found if name]


def _is_kept(fmu: Path) -> bool:
    return fmu.resolve().is_relative_to(resources.fmus())


@cache
def _contents() -> dict[Path, dict[str, Any]]:
    paths = sorted(resources.modelica().glob(f"*/{FILE}"))
    return {path: tomllib.loads(path.read_text(encoding="utf-8")) for path in paths}
