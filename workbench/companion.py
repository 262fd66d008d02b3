"""What a system's companion brings: a Python package, or a module alone, of this machine."""

from importlib import import_module
from importlib.util import find_spec
from types import ModuleType


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
