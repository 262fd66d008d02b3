"""The template of all pages: one file each, readable without scripts."""

import hashlib
import json
import re
from collections.abc import Mapping
from datetime import datetime
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from workbench.pages.figures import DARK, LIGHT


def rendered(summary: Mapping[str, Any], page: object) -> str:
    """A page of a summary."""
    run = summary["provenance"]["run"]
    template = _environment().get_template("page.html")
    return template.render(summary=summary, run=run, report=number_of(summary), page=page)


def number_of(summary: Mapping[str, Any]) -> str:
    """Number of the report on a summary: its date, and the first digits of its SHA-256.

    >>> number_of({"provenance": {"run": {"date": "2026-11-23T04:05:06+00:00"}}})
    '20261123-00e93ccf'
    """
    content = json.dumps(summary, sort_keys=True).encode()
    date = str(summary["provenance"]["run"]["date"])[:10].replace("-", "")
    return f"{date}-{hashlib.sha256(content).hexdigest()[:8]}"


@cache
def _environment() -> Environment:
    environment = Environment(
        autoescape=True,
        loader=PackageLoader("workbench", "pages"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"anchor": anchor, "day": _day}
    environment.filters["form"] = lambda block: type(block).__name__.lower()  # name of its macro
    environment.globals["colours"] = {"light": LIGHT, "dark": DARK}
    return environment


def _day(date: str) -> str:
    """A date for people.

    >>> _day("2026-11-23T04:05:06+00:00")
    '23 November 2026, 04:05 UTC'
    """
    return f"{datetime.fromisoformat(date):%-d %B %Y, %H:%M} UTC"


def anchor(name: str) -> str:
    """Place of a recording on a page."""
    return re.sub(r"\s", "_", name)
