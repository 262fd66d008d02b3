"""What made a result: command, date, versions of the software, models and data by their hash."""

import hashlib
import platform
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from workbench.recordings.case import Case
from workbench.runtime.resources import commit, own_version
from workbench.system.registry import open_model
from workbench.system.system import System


def run_of(command: str, system: System, data: Mapping[str, Path]) -> dict[str, Any]:
    """Who asks when, of what, for what: the same of every command.

    Parameters
    ----------
    data : files that were read, by recording; one that is none has no hash.
    """
    hashes = {
        name: hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else None
        for name, path in data.items()
    }
    return {
        "command": command,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "workbench": own_version(),
        "commit": commit(),
        "system": system.name,
        "title": system.title,
        "data": hashes,
    }


def sources(cases: Iterable[Case]) -> dict[str, Path]:
    """Files of recordings, by their names."""
    return {case.name: case.source for case in cases}


def software(packages: Sequence[str]) -> dict[str, Any]:
    """Versions of the workbench, of Python and of packages."""
    return {
        "workbench": own_version(),
        "commit": commit(),
        "python": platform.python_version(),
        "packages": {package: version(package) for package in packages},
    }


def models(system: System, roles: Sequence[str]) -> dict[str, dict[str, str]]:
    """File, model and hash of the FMU of each role."""
    by_role = {}
    with ExitStack() as stack:
        for role in roles:
            fmu = stack.enter_context(open_model(system, role))
            by_role[role] = {"file": fmu.path.name, "model": fmu.name, "sha256": fmu.sha256}
    return by_role
