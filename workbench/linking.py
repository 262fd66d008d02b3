"""Laws become machine code with the loops that take them up, once.

numba translates every function by itself, and again all that it calls, level by level. Here a
function that compiled code calls stays LLVM code until Python calls one that holds it.
"""

from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler


class _Part(JITCodeLibrary):  # type: ignore[misc]
    """Code without a life of its own: linked into what calls it, never run by itself."""

    def _optimize_final_module(self) -> None:
        """Nothing: what takes it up is optimised as a whole."""

    def _finalize_final_module(self) -> None:
        self._verify_declare_only_symbols()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """None, as of a function that is not defined."""
        return 0

    @property
    def codegen(self) -> "_Part":
        """Whom its environment is given to; see `set_env`."""
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """Nothing: only what needs Python's objects needs one, and laws have none."""


class PartCompiler(Compiler):  # type: ignore[misc]
    """Compiles what other compiled code calls; given to numba as `pipeline_class`."""

    def __init__(self, typing: Any, target: Any, library: None, *rest: Any) -> None:
        super().__init__(typing, target, _Part(target.codegen(), "part"), *rest)
