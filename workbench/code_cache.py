"""Compiled laws and loops, kept between runs: numba's cache in our folder, in files that are whole.

numba's own files are read as they are, so that a damaged one stops every program that meets it, and
two processes that write at once can give one function the code of another. Here a function has one
file, which begins with the hash of what follows, and is replaced as a whole.
"""

import hashlib
import os
import pickle
import tempfile
import time
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import llvmlite
import numba
from numba.core import caching, serialize

from workbench.shelf import cache_folder

try:
    import fcntl
except ImportError:  # Windows: there each process compiles for itself
    fcntl = None  # type: ignore[assignment]

_DIGEST = hashlib.sha256().digest_size
_PACKAGE = Path(__file__).parent
_PATIENCE = 120.0  # [s]: several times what any function here takes to compile


@cache
def _folder() -> Path:
    """Folder of compiled code, one for each state of the sources that it is made of.

    numba renews a compiled function when its own file changes, not when one that it calls does.
    """
    files = sorted(_PACKAGE.rglob("*.py"))
    sources = (file.read_bytes() for file in files)
    laws = [one for one in sources if b"workbench.kernel import" in one or b"numba" in one]
    state = hashlib.sha256(b"".join(laws)).hexdigest()[:16]
    return cache_folder() / state


class _Locator(caching.UserWideCacheLocator):  # type: ignore[misc]
    """Our own functions are found by what they are, wherever the package lies."""

    def __init__(self, function: Any, file: str) -> None:
        super().__init__(function, file)
        self._own = Path(file).is_relative_to(_PACKAGE)
        inside = Path(file).parent.relative_to(_PACKAGE) if self._own else None
        self._cache_path = str(_folder() / (inside or self.get_suitable_cache_subpath(file)))

    def get_source_stamp(self) -> Any:
        """What code depends on besides the function."""
        return _folder().name if self._own else super().get_source_stamp()

    def ensure_cache_path(self) -> None:
        """Nothing: a folder that can only be read is of use, too."""


class _CodeCache(caching.CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes: ClassVar = [_Locator]


class _File:
    """The code of one function, by signature.

    Parameters
    ----------
    path : of the file.
    state : of all that the code depends on besides the signature.
    """

    def __init__(self, path: Path, state: str) -> None:
        self._path, self._state = path, state.encode()

    def load(self, key: Any) -> Any:
        """Code for a signature; None if there is none, or none that is whole."""
        kept = self._read().get(key)
        return None if kept is None else pickle.loads(kept)

    def save(self, key: Any, code: Any) -> None:
        """Keep code, where that can be."""
        content = serialize.dumps({**self._read(), key: serialize.dumps(code)})
        with suppress(OSError):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            handle, part = tempfile.mkstemp(dir=self._path.parent, suffix=".part")
            try:
                with os.fdopen(handle, "wb") as stream:
                    stream.write(self._digest(content) + content)
                Path(part).replace(self._path)
            finally:
                Path(part).unlink(missing_ok=True)

    def flush(self) -> None:
        """Forget the code of this function."""
        with suppress(OSError):
            self._path.unlink()

    def _read(self) -> dict[Any, bytes]:
        try:
            kept = self._path.read_bytes()
        except OSError:
            return {}
        content = kept[_DIGEST:]
        if kept[:_DIGEST] != self._digest(content):
            return {}
        entries: dict[Any, bytes] = pickle.loads(content)
        return entries

    def _digest(self, content: bytes) -> bytes:
        return hashlib.sha256(self._state + b"\0" + content).digest()


@cache
def _turns() -> int:
    """File of which a process holds a byte while it compiles; closing it would end all turns.

    Raises
    ------
    OSError
        If it cannot be made.
    """
    _folder().mkdir(parents=True, exist_ok=True)
    return os.open(_folder() / "turns", os.O_RDWR | os.O_CREAT, 0o600)


class _Turn:
    """Compiling one function, one process at a time; the system ends it with the process."""

    def __init__(self, path: Path) -> None:
        # Functions that share a byte wait for each other, which costs time alone.
        self._byte = int.from_bytes(hashlib.sha256(str(path).encode()).digest()[:4], "little")

    def take(self) -> None:
        """Wait until no other process has it, or is stopped while it has."""
        end = time.monotonic() + _PATIENCE
        while fcntl is not None and time.monotonic() < end:
            try:
                fcntl.lockf(_turns(), fcntl.LOCK_EX | fcntl.LOCK_NB, 1, self._byte)
            except BlockingIOError:
                time.sleep(0.02)
            except OSError:  # no place for the file, or one on which nothing can be locked
                return
            else:
                return

    def end(self) -> None:
        """Let the next one read what was compiled."""
        if fcntl is not None:
            with suppress(OSError):
                fcntl.lockf(_turns(), fcntl.LOCK_UN, 1, self._byte)


class CodeCache(caching.FunctionCache):  # type: ignore[misc]
    """numba's cache of a function in our folder; numba's own setting is left to the user.

    What several processes need at once is compiled by one of them, while the others wait.
    """

    _impl_class = _CodeCache

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        stamp = self._impl.locator.get_source_stamp()
        state = f"{numba.__version__} {llvmlite.__version__} {stamp}"
        path = Path(self._cache_path, f"{self._impl.filename_base}.code")
        self._cache_file = _File(path, state)
        self._turn = _Turn(path)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Code for a signature; None if this process has to compile it, until `compiled`."""
        code = super().load_overload(sig, target_context)
        if code is None:
            self._turn.take()
            code = super().load_overload(sig, target_context)
        return code

    def compiled(self) -> None:
        """What had to be compiled is, or cannot be."""
        self._turn.end()
