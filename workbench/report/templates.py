"""Templates of the pages, and what all of them share: one file each, readable without scripts."""

import re
from collections.abc import Callable

from jinja2 import Environment, PackageLoader, StrictUndefined

from workbench.report.figures import DARK, LIGHT
from workbench.report.views import percent


def _spaced(name: str) -> str:
    return name.replace("_", " ")


def environment(label: Callable[[str], str] = _spaced) -> Environment:
    """Where the pages find templates, filters and the colours of curves.

    Parameters
    ----------
    label : name of an estimator or of an entry, for people.
    """
    found = Environment(
        autoescape=True,
        loader=PackageLoader("workbench", "report"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters |= {
        "label": label,
        "percent": percent,
        "anchor": _anchor,
        "significant": _significant,
    }
    found.globals["colours"] = {"light": LIGHT, "dark": DARK}
    return found


def _anchor(name: str) -> str:
    return re.sub(r"\s", "_", name)


def _significant(value: object) -> str:
    """A setting, in a column if it is a number."""
    return f"{value:>9.4g}" if isinstance(value, (int, float)) else str(value)
