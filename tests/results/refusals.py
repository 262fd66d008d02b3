"""Pytest plugin that keeps which InputErrors are made while each test runs.

    python -m pytest -p tests.results.refusals --refusals FILE ...

Only what the process of the test makes counts, and only while its function runs: fixtures that
tests share are made by whichever comes first. Workers of xdist hand theirs over with their reports.
Of property tests none count: Hypothesis takes examples from constants in all code that is loaded.
"""

import json
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest

from tests.results.rules import PLACES, applied
from workbench.errors import InputError

_PROPERTY = "refusals"
_ROOT = str(Path(__file__).parents[2])


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the file to write to."""
    # A text, not a path: workers are given all options, in plain values.
    parser.addoption("--refusals", metavar="FILE", help="keep the InputErrors of each test (JSON)")


def pytest_configure(config: pytest.Config) -> None:
    """Watch if it is asked for."""
    if config.getoption("--refusals"):
        config.pluginmanager.register(_Watch(), "watch-refusals")


class _Watch:
    """Notes what is made in this process, and gathers what workers hand over."""

    def __init__(self) -> None:
        self._texts: set[str] = set()
        self._tests: dict[str, dict[str, set[str]]] = {}
        self._patch = pytest.MonkeyPatch()
        usual, texts = InputError.__init__, self._texts

        def noted(error: InputError, **parts: str) -> None:
            usual(error, **parts)
            texts.add(applied(PLACES, "", str(error).replace(_ROOT, "<root>")))

        self._patch.setattr(InputError, "__init__", noted)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Generator[None, Any, Any]:
        """Hand what a test's function made over with its report."""
        self._texts.clear()
        try:
            return (yield)
        finally:
            drawn = getattr(getattr(item, "obj", None), "is_hypothesis_test", False)
            texts = [] if drawn else sorted(self._texts)
            item.user_properties.append((_PROPERTY, [item.name, texts]))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Gather; tests of one name in several files count together, as files may be renamed."""
        for key, value in report.user_properties if report.when == "call" else ():
            if key == _PROPERTY:
                name, texts = value
                test = self._tests.setdefault(name, {"files": set(), "refusals": set()})
                test["files"].add(report.location[0])
                test["refusals"].update(texts)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Write what was gathered, once, where workers report to."""
        self._patch.undo()
        if not hasattr(session.config, "workerinput"):
            content = {
                name: {key: sorted(values) for key, values in test.items()}
                for name, test in sorted(self._tests.items())
            }
            path = Path(session.config.getoption("--refusals"))
            path.write_text(
                json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
            )
