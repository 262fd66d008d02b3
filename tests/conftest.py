"""What several test files share: the repository's own FMUs, cases and sources."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from workbench.case import Case, read_case
from workbench.fmu import FMU

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def minimal_path() -> Path:
    return ROOT / "fmus" / "fmi2" / "MinimalObserver.fmu"


@pytest.fixture(scope="session")
def reference_path() -> Path:
    return ROOT / "fmus" / "fmi2" / "Reference.fmu"


@pytest.fixture
def minimal(minimal_path: Path) -> Iterator[FMU]:
    with FMU(minimal_path) as fmu:
        yield fmu


@pytest.fixture(scope="session")
def dry_case() -> Case:
    return read_case(ROOT / "cases" / "03_dry_120_3.6")
