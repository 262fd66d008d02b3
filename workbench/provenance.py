"""What made a result: versions of the software, and the models by their hash."""

import platform
import subprocess
from collections.abc import Sequence
from contextlib import ExitStack
from importlib.metadata import version
from typing import Any

from workbench.resources import CHECKOUT
from workbench.system import System
from workbench.systems import open_model


def software(packages: Sequence[str]) -> dict[str, Any]:
    """Versions of the workbench, of Python and of packages."""
    return {
        "workbench": version("wheelset-workbench"),
        "commit": commit(),
        "python": platform.python_version(),
        "packages": {package: version(package) for package in packages},
    }


def models(system: System, roles: Sequence[str]) -> dict[str, dict[str, str]]:
    """File, model and hash of the FMU of each role."""
    found = {}
    with ExitStack() as stack:
        for role in roles:
            fmu = stack.enter_context(open_model(system, role))
            found[role] = {"file": fmu.path.name, "model": fmu.name, "sha256": fmu.sha256}
    return found


def commit() -> str | None:
    """Commit of the checkout that this package is run from, "-dirty" if changed; None if none."""
    if CHECKOUT is None or not (CHECKOUT / ".git").exists():
        return None
    git = ["git", "--no-optional-locks", "-C", str(CHECKOUT)]
    describe = ["describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        answer = subprocess.run([*git, *describe], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return answer.stdout.strip()
