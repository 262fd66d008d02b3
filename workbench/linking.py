"""Laws become machine code with the loops that take them up, once.

numba translates every function by itself, and again all that it calls, level by level. Here a
function that compiled code calls stays LLVM code until Python calls one that holds it.
"""

from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher

from workbench.bundles import handed
from workbench.code_cache import CodeCache


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


class _PartCompiler(Compiler):  # type: ignore[misc]
    """Compiles what other compiled code calls."""

    def __init__(self, typing: Any, target: Any, library: None, *rest: Any) -> None:
        super().__init__(typing, target, _Part(target.codegen(), "part"), *rest)


class _Entry(CPUDispatcher):  # type: ignore[misc]
    """What Python calls in place of a law, with its code, which is kept between runs."""

    def __init__(self, law: "_Law", options: dict[str, Any]) -> None:
        def entry(*given: Any) -> Any:
            return law(*given)

        super().__init__(entry, targetoptions=options)
        with suppress(RuntimeError):  # a function without a file is compiled in each process
            self._cache = CodeCache(law.py_func)

    def compile(self, sig: Any) -> Any:
        """Code for a signature, kept or made."""
        try:
            return super().compile(sig)
        finally:
            if isinstance(self._cache, CodeCache):
                self._cache.compiled()


class _Law(CPUDispatcher):  # type: ignore[misc]
    """A function that compiled code takes up, and Python calls by way of an entry.

    What an entry does, which takes named tuples apart, would take longer to compile than most laws
    do, and most are called by others alone.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        bare = {**options, "no_cpython_wrapper": True}
        super().__init__(function, targetoptions=bare, pipeline_class=_PartCompiler)
        self._options = options

    @cached_property
    def entry(self) -> _Entry:
        """The function as Python calls it."""
        return _Entry(self, self._options)

    def __call__(self, *given: Any) -> Any:
        return self.entry(*given)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """See numba's dispatcher: types of a call, whose bundles go by address."""
        signature, folded = self._compiler.fold_argument_types(args, kws)
        template, _, *rest = super().get_call_template([handed(one) for one in folded], {})
        return template, signature, *rest


def law(*, inline: bool = False) -> Callable[[Callable[..., Any]], Any]:
    """Make a decorator of laws and loops.

    Their arrays belong to the caller and they allocate none, so that references need not be
    counted (`_nrt`), which took two thirds of a step. A wrapper for callers in C is compiled for
    nobody.

    Parameters
    ----------
    inline : whether LLVM puts them into what calls them, whatever they are.
    """
    options = {
        "nopython": True,
        "error_model": "numpy",
        "_nrt": False,
        "no_cfunc_wrapper": True,
        "forceinline": inline,
    }
    return lambda function: _Law(function, options)
