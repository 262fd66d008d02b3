"""Systems and plugins that are installed; finding them imports nothing that takes time."""

import tomllib
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from workbench.errors import unknown_name
from workbench.runtime import resources
from workbench.system.plugins import Plugin, distributed_plugins, find_plugin

FILE = "system.toml"


def system_files() -> dict[str, Path]:
    """System files by name: those of the workbench, then those of installed plugins."""
    return {
        content.get("name", path.parent.name): path
        for path, content in {**_own(), **_brought()}.items()
    }


def usual_system() -> str:
    """Name of the system that is meant where none is named: the first that comes with recordings.

    Commands without any arguments work on it.
    """
    # Of the workbench's own: looking for plugins would take each command 10 ms.
    names = (
        content.get("name", path.parent.name)
        for path, content in _own().items()
        if "cases" in content
    )
    return str(next(names))


def installed_plugins() -> list[Plugin]:
    """Plugins of the workbench's own systems, then those of installed distributions."""
    own = (content["plugin"] for content in _own().values() if "plugin" in content)
    return list({**{place: find_plugin(place) for place in own}, **distributed_plugins()}.values())


def built_models() -> dict[Path, list[str]]:
    """Models whose FMUs come with the workbench: dotted names by library, its `package.mo`."""
    by_library = {}
    for path, content in _own().items():
        models = content["models"].values()
        built = [
            model["class"]
            for model in models
            if (path.parent / model.get("fmu", "")).resolve().is_relative_to(resources.fmus())
        ]
        if built:
            by_library[path.with_name("package.mo")] = [
                f"{path.parent.name}.{name}" for name in built
            ]
    return by_library


def system_path(which: str | Path) -> Path:
    """The file of a system, by its name, its file, or the folder that holds its file."""
    known, path = system_files(), Path(which)
    if str(which) in known:
        return known[str(which)]
    with suppress(OSError):  # a name that is too long is none
        path = path / FILE if path.is_dir() else path
        if path.is_file():
            return path
    raise unknown_name(
        str(which),
        known,
        where=f"system '{which}'",
        found="no such file, and no system of this name",
        expected=f"a system file, or one of {', '.join(known)}",
        remedy="correct the name or path; 'workbench systems' lists what is installed",
    )


@cache
def _own() -> dict[Path, dict[str, Any]]:
    return _contents(sorted(resources.modelica().glob(f"*/{FILE}")))


def _brought() -> dict[Path, dict[str, Any]]:
    """System files that come with plugins of installed distributions."""
    files = (plugin.system for plugin in distributed_plugins().values())
    return _contents([path for path in files if path is not None])


def _contents(paths: list[Path]) -> dict[Path, dict[str, Any]]:
    return {path: tomllib.loads(path.read_text(encoding="utf-8")) for path in paths}
