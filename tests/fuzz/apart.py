"""Files that are read in a process each, read in one for all: fuzzing waits for no other."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.fuzz.harness import LONGEST, Hang
from workbench.errors import WorkerError
from workbench.recordings import formats
from workbench.recordings.formats.contents import Contents
from workbench.runtime.pool import Pool


@contextmanager
def one_process() -> Iterator[None]:
    """Have readers that need a process use the same one."""
    with Pool(1, _quiet, None, limit=LONGEST) as pool, pytest.MonkeyPatch.context() as patch:

        def apart(module: str, path: Path, raw: bytes) -> Contents:
            try:
                return pool.submit(_read, module, path, raw).result()
            except WorkerError as error:
                if "took longer" in str(error):
                    raise Hang from None
                raise

        patch.setattr(formats, "_in_own_process", apart)
        yield


@contextmanager
def _quiet(_: None) -> Iterator[None]:
    """Say nothing of what libraries leave half made: a process of its own ends before that."""
    sys.unraisablehook = lambda _: None
    yield


def _read(_: None, module: str, path: Path, raw: bytes) -> Contents:
    return formats._here(module, path, raw)
