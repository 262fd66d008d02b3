"""Laws become machine code with the loops that take them up, once.

numba translates every function by itself, and again all that it calls, level by level. Here a
function that compiled code calls stays LLVM code until Python calls one that holds it.
"""

import hashlib
import operator
import os
import pickle
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache, cached_property
from pathlib import Path
from typing import Any, ClassVar

import llvmlite
import numba
from llvmlite import ir
from numba import types
from numba.core import caching, cgutils, serialize
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    infer_getattr,
    intrinsic,
    lower_cast,
    lower_getattr_generic,
    models,
    overload,
    register_model,
)

from workbench.models.fmu_cache import cache_folder


class Bundle(types.Type):  # type: ignore[misc]
    """Address of a tuple.

    Parameters
    ----------
    content : type of the tuple.
    """

    def __init__(self, content: types.BaseTuple) -> None:
        self.content = content
        super().__init__(f"Bundle({content})")

    @property
    def key(self) -> types.Type:
        """What tells it from others: classes of one name may have other fields."""
        return self.content


def handed(kind: types.Type) -> types.Type:
    """Type of what a law is given, by that of the value: named tuples and tuples of these."""
    return Bundle(kind) if _is_named(kind) else kind


def _is_named(kind: types.Type) -> bool:
    if isinstance(kind, types.BaseNamedTuple):
        return True
    return isinstance(kind, types.BaseTuple) and any(_is_named(one) for one in kind.types)


@register_model(Bundle)
class _Address(models.PrimitiveModel):  # type: ignore[misc]
    """A pointer."""

    def __init__(self, manager: Any, kind: Bundle) -> None:
        place = manager.lookup(kind.content).get_data_type().as_pointer()
        super().__init__(manager, kind, place)


@lower_cast(types.BaseTuple, Bundle)  # type: ignore[untyped-decorator]
def _write_down(context: Any, builder: Any, kind: Any, bundle: Bundle, value: Any) -> Any:
    """Address of a tuple on the stack of who hands it on."""
    place = cgutils.alloca_once(builder, context.get_data_type(bundle.content))
    _store(context, builder, kind, value, place)
    # What is read by this address never changes (`_words`), which is true from here on only: no
    # instruction, but LLVM moves nothing across it.
    passed = ir.FunctionType(place.type, [place.type])
    return builder.asm(passed, "", "=r,0,~{memory}", [place], side_effect=True)


def _store(context: Any, builder: Any, kind: types.Type, value: Any, place: Any) -> None:
    if isinstance(kind, types.BaseTuple):
        for k, one in enumerate(kind.types):
            at = cgutils.gep_inbounds(builder, place, 0, k)
            _store(context, builder, one, builder.extract_value(value, k), at)
    else:
        builder.store(context.data_model_manager[kind].as_data(builder, value), place)


def _member(context: Any, builder: Any, kind: types.Type, at: Any) -> Any:
    """Member of a tuple at an address: what lies there, or the address if it goes by that."""
    if isinstance(handed(kind), Bundle):
        return at
    value = _words(builder, at)
    if isinstance(kind, types.Array):
        return value
    return context.data_model_manager[kind].from_data(builder, value)


def _words(builder: Any, at: Any) -> Any:
    """What lies at an address, word by word, so that LLVM leaves out what is not used."""
    kind = at.type.pointee
    if not isinstance(kind, ir.Aggregate):
        word = builder.load(at)
        word.set_metadata("invariant.load", builder.module.add_metadata([]))
        return word
    value = ir.Constant(kind, ir.Undefined)
    for k in range(len(kind)):
        part = _words(builder, cgutils.gep_inbounds(builder, at, 0, k))
        value = builder.insert_value(value, part, k)
    return value


@infer_getattr
class _Field(AttributeTemplate):  # type: ignore[misc]
    key = Bundle

    def generic_resolve(self, bundle: Bundle, name: str) -> types.Type | None:
        """Type of a field."""
        content = bundle.content
        if not isinstance(content, types.BaseNamedTuple) or name not in content.fields:
            return None
        return handed(content.types[content.fields.index(name)])


@lower_getattr_generic(Bundle)  # type: ignore[untyped-decorator]
def _field(context: Any, builder: Any, bundle: Bundle, place: Any, name: str) -> Any:
    index = bundle.content.fields.index(name)
    at = cgutils.gep_inbounds(builder, place, 0, index)
    return _member(context, builder, bundle.content.types[index], at)


@intrinsic  # type: ignore[untyped-decorator]
def _item(typing: Any, bundle: Any, index: Any) -> Any:
    """Member of a tuple whose members are of one type, by its number."""
    kind = bundle.content.dtype

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        place, number = given
        at = builder.gep(place, [cgutils.intp_t(0), number], inbounds=True)
        return _member(context, builder, kind, at)

    return handed(kind)(bundle, types.intp), generate


@overload(operator.getitem)
def _get_item(bundle, index):  # type: ignore[no-untyped-def]
    if isinstance(bundle, Bundle) and isinstance(bundle.content, types.UniTuple):
        return lambda bundle, index: _item(bundle, index)
    return None


try:
    import fcntl
except ImportError:  # Windows: there each process compiles for itself
    fcntl = None  # type: ignore[assignment]

_DIGEST = hashlib.sha256().digest_size


_PACKAGE = Path(__file__).parents[1]


_PATIENCE = 120.0  # [s]: several times what any function here takes to compile


@cache
def _folder() -> Path:
    """Folder of compiled code, one for each state of the sources that it is made of.

    numba renews a compiled function when its own file changes, not when one that it calls does.
    """
    files = sorted(_PACKAGE.rglob("*.py"))
    sources = (file.read_bytes() for file in files)
    laws = [
        source
        for source in sources
        if b"workbench.models.native import" in source or b"numba" in source
    ]
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
