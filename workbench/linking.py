"""Laws and loops by way of LLVM: a law is optimised and translated with the loop that takes it up.

numba makes machine code of every function for itself, and again of all that a function calls,
level by level. Here the functions that compiled code calls stay as they are until Python calls one
that holds them, which saves a third of the time to compile the observers.
"""

from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.environment import lookup_environment


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
        """Nothing: the whole gives each of its parts its environment."""


class _Whole(JITCodeLibrary):  # type: ignore[misc]
    """Code that Python calls, with the parts that it holds."""

    def _finalize_final_module(self) -> None:
        super()._finalize_final_module()
        for variable in self._final_module.global_variables:
            if (environment := lookup_environment(variable.name)) is not None:
                self._codegen.set_env(variable.name, environment)


class PartCompiler(Compiler):  # type: ignore[misc]
    """Compiles what other compiled code calls."""

    def __init__(self, typing: Any, target: Any, library: None, *rest: Any) -> None:
        super().__init__(typing, target, _Part(target.codegen(), "part"), *rest)


class WholeCompiler(Compiler):  # type: ignore[misc]
    """Compiles what Python calls."""

    def __init__(self, typing: Any, target: Any, library: None, *rest: Any) -> None:
        whole = _Whole(target.codegen(), "whole")
        whole.enable_object_caching()
        super().__init__(typing, target, whole, *rest)
