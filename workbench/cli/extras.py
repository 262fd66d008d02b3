"""Extras of the package: what each is for, what it lacks, and how it is installed."""

import re
import tomllib
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.util import find_spec

from workbench.errors import InputError
from workbench.runtime import resources
from workbench.runtime.resources import DISTRIBUTION, installing

PURPOSES = {
    "compiler": "Modelica to FMU: diagnose, power, export, bench, systems without a built FMU",
    "files": "import of Excel, MDF, TDMS, MAT 7.3, Parquet",
    "cluster": "tune, monitor --fleet on a Dask cluster; recordings at URLs",
    "completion": "workbench completion",
    "docs": "make docs",
    "notebooks": "make notebooks",
    "dev": "make test",
}


def missing_packages(extra: str) -> list[str]:
    """Packages of an extra that are not installed; of the core, where it is empty.

    What only some platforms need is not looked for.
    """
    missing = []
    for requirement in _requirements(extra):
        named, _, marker = requirement.partition(";")
        package = re.split(r"[^\w.-]", named.strip(), maxsplit=1)[0]
        if "platform" in marker:
            continue
        try:
            version(package)
        except PackageNotFoundError:
            missing.append(package)
    return missing


def _requirements(extra: str) -> list[str]:
    """As a checkout says now, or a wheel said when it was built."""
    if resources.CHECKOUT is not None:
        text = (resources.CHECKOUT / "pyproject.toml").read_text(encoding="utf-8")
        project = tomllib.loads(text)["project"]
        listed = project["optional-dependencies"][extra] if extra else project["dependencies"]
        return list(map(str, listed))
    matches = {r: re.search(r"extra == ['\"](.*?)['\"]", r) for r in requires(DISTRIBUTION) or ()}
    return [r for r, match in matches.items() if (match[1] if match else "") == extra]


def require_compiler() -> None:
    """Refuse to go on without the extra that holds the Modelica compiler."""
    for name in ("rumoca", "casadi", "ziglang"):
        require(name, "compiler", "which holds the Modelica compiler", "workbench.models.compiler")


def require(package: str, extra: str, purpose: str, where: str) -> None:
    """Refuse to go on without a package of an extra."""
    if find_spec(package) is None:
        raise InputError(
            where=where,
            found=f"no package '{package}'",
            expected=f"the extra [{extra}], {purpose}",
            remedy=installing(extra),
        )
