"""Machines as plugins: what a machine brings beside its system file, declared once.

A package declares a `Plugin` and names it as an entry point of the group `workbench.machines`:

    [project.entry-points."workbench.machines"]
    my_machine = "my_package:PLUGIN"

A system file names it by that name, or by its place: `plugin = "my_package:PLUGIN"`.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from workbench.errors import InputError, unknown_name

if TYPE_CHECKING:
    from workbench.system.tables import Table

GROUP = "workbench.machines"


@dataclass(frozen=True)
class Plugin:
    """What a machine brings; all of it may be missing.

    A text names an object, `package.module:name`, or a module: it is imported when it is used, so
    that a plugin costs nothing before. Declare it where nothing else is imported.

    Attributes
    ----------
    system : system file that is installed with the plugin, and found by the name in it.
    commands : module and line of help by name; the module is as those of `workbench.cli`.
    summaries : JSON Schemas of what these commands write, by what was asked.
    estimators : package whose modules define estimators of this machine alone.
    gains : folder of tuned gains, `ESTIMATOR.toml`.
    validity : rules on where an estimate is one, by quantity; see `observers.replay`.
    balances : forms what a measurement has beyond the model; see `diagnosis.inference.residuals`.
    virtual_rig, recorded_sets : recordings with known effects; see `studies.power.virtual_rig`.
    published : recordings that anybody can have; see `recordings.datasets.PublishedSet`.
    loops : estimators written other ways, which `workbench bench` measures ours against.
    """

    system: Path | None = None
    commands: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    summaries: str = ""
    estimators: str = ""
    gains: Path | None = None
    validity: str = ""
    balances: str = ""
    virtual_rig: str = ""
    recorded_sets: str = ""
    published: str = ""
    loops: str = ""


def load(place: str) -> Any:
    """Import what a plugin names; None where it names nothing."""
    return resolve_name(place) if place else None


@cache
def _places() -> dict[str, str]:
    """Where plugins of installed distributions are declared, by their names."""
    return {entry.name: entry.value for entry in entry_points(group=GROUP)}


def place_of(plugin: str) -> str:
    """Where a plugin is declared, `package.module:name`, by its name or by that."""
    return _places().get(plugin, plugin) if plugin.isidentifier() else plugin


def plugin_of(file: "Table") -> str:
    """The plugin that a system file names; until the next version also as `companion`."""
    if "companion" in file.content and "plugin" not in file.content:
        warnings.warn(
            f"{file.where}: 'companion' is called 'plugin' now; rename it, since the next version "
            "does not know it",
            FutureWarning,
            stacklevel=2,
        )
        return file.text("companion", "")
    return file.text("plugin", "")


@cache
def find_plugin(plugin: str) -> Plugin:
    """The plugin that a system file names; an empty one where it names none."""
    if not plugin:
        return Plugin()
    place = place_of(plugin)
    try:
        value = resolve_name(place)
    except (ImportError, AttributeError, ValueError) as error:
        raise unknown_name(
            plugin,
            _places(),
            where=f"plugin '{plugin}'",
            found=f"{type(error).__name__}: {error}",
            expected=f"an entry point of the group '{GROUP}', or 'package.module:NAME' of a Plugin",
            remedy="install the distribution that has it, or correct the name",
        ) from None
    return value if isinstance(value, Plugin) else _by_module_names(place, value)


@cache
def distributed_plugins() -> dict[str, Plugin]:
    """Plugins of installed distributions, by place; one that is broken is left out with a word."""
    plugins = {}
    for place in _places().values():
        try:
            plugins[place] = find_plugin(place)
        except InputError as error:
            warnings.warn(str(error), stacklevel=2)
    return plugins


# Modules that a package was asked for until it declared them.
_MODULES = {
    "estimators": "estimators",
    "validity": "claims:CLAIMS",
    "balances": "balances:balances",
    "virtual_rig": "planting:virtual_rig",
    "recorded_sets": "recorded:recorded_sets",
    "published": "published:PUBLISHED",
    "loops": "benchmark",
}


def _by_module_names(place: str, module: Any) -> Plugin:
    """Parts of a package or module that declares no plugin."""
    warnings.warn(
        f"{place} declares no workbench.Plugin: its parts are found by the names of its modules, "
        "in this version for the last time",
        FutureWarning,
        stacklevel=3,
    )
    if not hasattr(module, "__path__"):
        return Plugin(published=f"{place}:PUBLISHED" if hasattr(module, "PUBLISHED") else "")
    parts: dict[str, Any] = {
        part: f"{place}.{own}"
        for part, own in _MODULES.items()
        if find_spec(f"{place}.{own.partition(':')[0]}")
    }
    gains = Path(module.__path__[0]) / "gains"
    return Plugin(gains=gains if gains.is_dir() else None, **parts)
