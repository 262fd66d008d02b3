"""What decides about the numbers that a process computes, so that two can be compared.

This module is sent to workers as it is, since they may lack the project: it needs nothing of it.
"""

import hashlib
import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path


def fingerprint(modules: Sequence[str], packages: Sequence[str]) -> dict[str, str]:
    """Hashes of sources and versions of packages in this process; "none" of what it lacks.

    Parameters
    ----------
    modules : whose sources count, packages with all that is in them.
    packages : whose versions count.
    """
    versions = {"python": platform.python_version()}
    for package in packages:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "none"
    for module in modules:
        try:
            spec = find_spec(module)
        except ImportError:
            spec = None
        digest = hashlib.sha256()
        for root in (spec.submodule_search_locations or ()) if spec else ():
            for file in sorted(Path(root).rglob("*.py")):
                digest.update(file.relative_to(root).as_posix().encode() + b"\0")
                digest.update(file.read_bytes())
        if spec and spec.origin and not spec.submodule_search_locations:
            digest.update(Path(spec.origin).read_bytes())
        versions[f"code of {module}"] = digest.hexdigest()[:16] if spec else "none"
    return versions


def difference(ours: dict[str, str], theirs: dict[str, str]) -> str:
    """What a process has otherwise, in words; empty if nothing."""
    return ", ".join(
        f"{name} {theirs.get(name, 'none')}, here {value}"
        for name, value in ours.items()
        if theirs.get(name) != value
    )
