"""Where the files are that come with the package: Modelica, FMUs, recorded cases.

A wheel holds them itself, in `workbench/data`; a checkout has them at its top level.
"""

import subprocess
from importlib.metadata import version
from pathlib import Path

DISTRIBUTION = "observer-workbench"  # the name that pip knows

_PACKAGE = Path(__file__).resolve().parents[1]
_DATA = _PACKAGE / "data"
_ROOT = _DATA if _DATA.is_dir() else _PACKAGE.parent

# Top level of the sources that this package is run from; None if it was installed from a wheel.
CHECKOUT = None if _ROOT == _DATA else _ROOT


def modelica() -> Path:
    """Folder of the Modelica libraries, one folder each."""
    return _ROOT / "modelica"


def fmus() -> Path:
    """Folder of the built FMUs, `fmi2` and `fmi3`, with `manifest.json`."""
    return _ROOT / "fmus"


def cases() -> Path:
    """Folder of the recorded cases, one folder each."""
    return _ROOT / "cases"


def own_version() -> str:
    """Version of this workbench, as it is installed."""
    return version(DISTRIBUTION)


def installing(extra: str) -> str:
    """Say how an extra is installed: in a checkout with the versions that it pins."""
    if CHECKOUT is None:
        return f"pip install '{DISTRIBUTION}[{extra}]'"
    return f"pip install -e '.[{extra}]' -c constraints.txt"


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
