"""Templates of the pages, and what all of them share: one file each, readable without scripts."""

import hashlib
import json
import re
from collections.abc import Callable, Mapping
from datetime import datetime
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from workbench.pages.figures import DARK, LIGHT
from workbench.pages.views import percent
from workbench.system.units import with_interval


def _spaced(name: str) -> str:
    return name.replace("_", " ")


def rendered(
    template: str,
    summary: Mapping[str, Any],
    label: Callable[[str], str] = _spaced,
    **content: object,
) -> str:
    """A page of a summary.

    Parameters
    ----------
    label : name of an estimator or of an entry, for people.
    content : what the template asks for beside the summary.
    """
    run = summary["provenance"]["run"]
    found = _environment(label).get_template(template)
    return found.render(summary=summary, run=run, report=number_of(summary), **content)


def number_of(summary: Mapping[str, Any]) -> str:
    """Number of the report on a summary: its date, and the first digits of its SHA-256.

    >>> number_of({"provenance": {"run": {"date": "2026-11-23T04:05:06+00:00"}}})
    '20261123-00e93ccf'
    """
    content = json.dumps(summary, sort_keys=True).encode()
    date = str(summary["provenance"]["run"]["date"])[:10].replace("-", "")
    return f"{date}-{hashlib.sha256(content).hexdigest()[:8]}"


def _environment(label: Callable[[str], str]) -> Environment:
    """Where the pages find templates, filters and the colours of curves."""
    found = Environment(
        autoescape=True,
        loader=PackageLoader("workbench", "pages"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters |= {
        "label": label,
        "percent": percent,
        "anchor": _anchor,
        "significant": _significant,
        "day": _day,
        "lab": _lab,
    }
    found.globals["colours"] = {"light": LIGHT, "dark": DARK}
    return found


def _lab(one: Mapping[str, Any]) -> str:
    """A size with its interval, as people in a laboratory say it."""
    return with_interval(one["value"], one["low"], one["high"], one["unit"])


def _day(date: str) -> str:
    """A date for people.

    >>> _day("2026-11-23T04:05:06+00:00")
    '23 November 2026, 04:05 UTC'
    """
    return f"{datetime.fromisoformat(date):%-d %B %Y, %H:%M} UTC"


def _anchor(name: str) -> str:
    return re.sub(r"\s", "_", name)


def _significant(value: object) -> str:
    """A setting, in a column if it is a number."""
    return f"{value:>9.4g}" if isinstance(value, (int, float)) else str(value)
