"""Examples of docstrings print what they say."""

import doctest
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

from .processes import ROOT

# All of the program is imported while tests are collected, for none to be imported first by a test
# that has something replaced. The way of pytest looks for examples in each file of tests, too.
PATHS = [path.relative_to(ROOT).with_suffix("") for path in (ROOT / "workbench").rglob("*.py")]
NAMES = sorted(".".join(path.parts).removesuffix(".__init__") for path in PATHS)
MODULES = [import_module(name) for name in NAMES]
EXAMPLES = [module for module in MODULES if ">>> " in Path(str(module.__file__)).read_text()]


@pytest.mark.parametrize("module", EXAMPLES, ids=lambda module: module.__name__)
def test_examples_of_docstrings_print_what_they_say(module: ModuleType) -> None:
    failed, tried = doctest.testmod(module)
    assert tried
    assert not failed
