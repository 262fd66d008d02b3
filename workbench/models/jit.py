"""Compiling with numba: functions that call one another become one piece of machine code.

numba translates every function by itself, and again all that it calls, level by level. Here a
function that compiled code calls stays LLVM code until Python calls one that holds it. Three
things make that fast, in this order below:

1. Code is kept between runs, compiled by one process while others that need it wait.
2. Named tuples go to compiled functions by address (`TupleReference`), not field by field.
3. `jit` makes functions that are linked into their callers; only those that Python calls get what
   Python needs to call them.
"""

import hashlib
import operator
import os
import pickle
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache, cached_property
from pathlib import Path
from typing import Any, ClassVar

import llvmlite
import numba
from llvmlite import ir
from llvmlite.binding import parse_assembly
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

from workbench.models.fmu_cache import cache_folder, seal

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

_PACKAGE = Path(__file__).parents[1]
_DIGEST = hashlib.sha256().digest_size
_PATIENCE = 120.0  # [s]: several times what any function here takes to compile
# States of the sources whose code is kept, of some 20 MB each: installations and checkouts that a
# user works with in turn. What was not used for the longest time is dropped.
_STATES = 8

# --- code that is kept between runs ---


@cache
def _folder() -> Path:
    """Folder of compiled code, one for each state of the sources that it is made of.

    numba renews a compiled function when its own file changes, not when one that it calls does.
    """
    files = sorted(_PACKAGE.rglob("*.py"))
    sources = (file.read_bytes() for file in files)
    compiled = [s for s in sources if b"workbench.models.native import" in s or b"numba" in s]
    place = cache_folder() / "loops" / hashlib.sha256(b"".join(compiled)).hexdigest()[:16]
    with suppress(OSError):
        place.mkdir(parents=True, exist_ok=True)
        os.utime(place)  # of use, which decides what is dropped
        for old in sorted(place.parent.iterdir(), key=lambda kept: -kept.stat().st_mtime)[_STATES:]:
            shutil.rmtree(old, ignore_errors=True)
    return place


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

    def reduce(self, code: Any) -> Any:
        """What is kept of code: of that for LLVM the names alone, as nothing is linked with it."""
        (name, kind, (machine, _)), *rest = super().reduce(code)
        module = code.library._get_module_for_linking()
        defined = [
            *(f'define void @"{f.name}"() {{ ret void }}' for f in _defined(module.functions)),
            *(f'@"{v.name}" = global i8 0' for v in _defined(module.global_variables)),
        ]
        names = parse_assembly("\n".join(defined)).as_bitcode()
        return ((name, kind, (machine, names)), *rest)


def _defined(symbols: Iterable[Any]) -> list[Any]:
    return [symbol for symbol in symbols if not symbol.is_declaration]


class _CodeFile:
    """The code of one function, by signature."""

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
        return seal(self._state, content)


@cache
def _lock_descriptor() -> int:
    """File of which a process locks a byte while it compiles; closing it would end all locks."""
    _folder().mkdir(parents=True, exist_ok=True)
    return os.open(_folder() / "turns", os.O_RDWR | os.O_CREAT, 0o600)


class _CompileLock:
    """Lock for compiling one function; the system releases it with the process.

    Where it locks no parts of files, a file is the lock, and of no effect once it is old.
    """

    def __init__(self, path: Path) -> None:
        # Functions that share a byte wait for each other, which costs time alone.
        self._byte = int.from_bytes(hashlib.sha256(str(path).encode()).digest()[:4], "little")
        self._file = path.with_suffix(".lock")

    def acquire(self) -> None:
        """Wait until no other process holds it, but not for one that is stopped while it does."""
        end = time.monotonic() + _PATIENCE
        while self._is_held_elsewhere() and time.monotonic() < end:
            time.sleep(0.02)

    def release(self) -> None:
        """Let the next one read what was compiled."""
        with suppress(OSError):
            if fcntl is None:
                self._file.unlink()
            else:
                fcntl.lockf(_lock_descriptor(), fcntl.LOCK_UN, 1, self._byte)

    def _is_held_elsewhere(self) -> bool:
        """Whether another process holds it; else this one does, where there is a place for it."""
        try:
            if fcntl is not None:
                fcntl.lockf(_lock_descriptor(), fcntl.LOCK_EX | fcntl.LOCK_NB, 1, self._byte)
                return False
            self._file.parent.mkdir(parents=True, exist_ok=True)
            self._file.touch(exist_ok=False)
        except BlockingIOError:
            return True
        except FileExistsError:
            with suppress(OSError):  # it was released meanwhile
                if time.time() - self._file.stat().st_mtime > _PATIENCE:
                    self._file.unlink()
            return True
        except OSError:  # no place for the file, or one on which nothing can be locked
            pass
        return False


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
        self._cache_file = _CodeFile(path, state)
        self._lock = _CompileLock(path)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Code for a signature; None if this process has to compile it, until `compiled`."""
        code = super().load_overload(sig, target_context)
        if code is None:
            self._lock.acquire()
            code = super().load_overload(sig, target_context)
        return code

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        """Key of code for a signature; functions that a closure holds count by their sources.

        numba takes the objects themselves, which differ from process to process.
        """
        held = [cell.cell_contents for cell in self._py_func.__closure__ or ()]
        if not held or not all(isinstance(function, _LinkedFunction) for function in held):
            return super()._index_key(sig, codegen)
        stamps = [CodeCache(f.py_func)._impl.locator.get_source_stamp() for f in held]
        return sig, codegen.magic_tuple(), self._py_func.__code__.co_code, tuple(stamps)

    def compiled(self) -> None:
        """Release the lock once the function is compiled, or cannot be."""
        self._lock.release()


# --- tuples by address ---


class TupleReference(types.Type):  # type: ignore[misc]
    """Address of a tuple."""

    def __init__(self, content: types.BaseTuple) -> None:
        self.content = content
        super().__init__(f"TupleReference({content})")

    @property
    def key(self) -> types.Type:
        """Identity among types: two classes of one name may have different fields."""
        return self.content


def argument_type(value_type: types.Type) -> types.Type:
    """Type by which a value is passed: named tuples, and tuples of these, go by address."""
    return TupleReference(value_type) if _is_named(value_type) else value_type


def _is_named(value_type: types.Type) -> bool:
    if isinstance(value_type, types.BaseNamedTuple):
        return True
    return isinstance(value_type, types.BaseTuple) and any(
        _is_named(member) for member in value_type.types
    )


@register_model(TupleReference)
class _Address(models.PrimitiveModel):  # type: ignore[misc]
    """A pointer."""

    def __init__(self, manager: Any, value_type: TupleReference) -> None:
        place = manager.lookup(value_type.content).get_data_type().as_pointer()
        super().__init__(manager, value_type, place)


@lower_cast(types.BaseTuple, TupleReference)  # type: ignore[untyped-decorator]
def _write_down(
    context: Any, builder: Any, value_type: Any, reference: TupleReference, value: Any
) -> Any:
    """Address of a tuple on the stack of who hands it on."""
    place = cgutils.alloca_once(builder, context.get_data_type(reference.content))
    _store(context, builder, value_type, value, place)
    # What is read by this address never changes (`_words`), which is true from here on only: no
    # instruction, but LLVM moves nothing across it.
    passed = ir.FunctionType(place.type, [place.type])
    return builder.asm(passed, "", "=r,0,~{memory}", [place], side_effect=True)


def _store(context: Any, builder: Any, value_type: types.Type, value: Any, place: Any) -> None:
    if isinstance(value_type, types.BaseTuple):
        for k, member in enumerate(value_type.types):
            at = cgutils.gep_inbounds(builder, place, 0, k)
            _store(context, builder, member, builder.extract_value(value, k), at)
    else:
        builder.store(context.data_model_manager[value_type].as_data(builder, value), place)


def _member(context: Any, builder: Any, value_type: types.Type, at: Any) -> Any:
    """Member of a tuple at an address: what lies there, or the address if it goes by that."""
    if isinstance(argument_type(value_type), TupleReference):
        return at
    value = _words(builder, at)
    if isinstance(value_type, types.Array):
        return value
    return context.data_model_manager[value_type].from_data(builder, value)


def _words(builder: Any, at: Any) -> Any:
    """What lies at an address, word by word, so that LLVM leaves out what is not used."""
    value_type = at.type.pointee
    if not isinstance(value_type, ir.Aggregate):
        word = builder.load(at)
        word.set_metadata("invariant.load", builder.module.add_metadata([]))
        return word
    value = ir.Constant(value_type, ir.Undefined)
    for k in range(len(value_type)):
        part = _words(builder, cgutils.gep_inbounds(builder, at, 0, k))
        value = builder.insert_value(value, part, k)
    return value


@infer_getattr
class _Field(AttributeTemplate):  # type: ignore[misc]
    key = TupleReference

    def generic_resolve(self, reference: TupleReference, name: str) -> types.Type | None:
        """Type of a field."""
        content = reference.content
        if not isinstance(content, types.BaseNamedTuple) or name not in content.fields:
            return None
        return argument_type(content.types[content.fields.index(name)])


@lower_getattr_generic(TupleReference)  # type: ignore[untyped-decorator]
def _field(context: Any, builder: Any, reference: TupleReference, place: Any, name: str) -> Any:
    index = reference.content.fields.index(name)
    at = cgutils.gep_inbounds(builder, place, 0, index)
    return _member(context, builder, reference.content.types[index], at)


@intrinsic  # type: ignore[untyped-decorator]
def _item(typing: Any, reference: Any, index: Any) -> Any:
    """Member of a tuple whose members are of one type, by its number."""
    value_type = reference.content.dtype

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        place, number = given
        at = builder.gep(place, [cgutils.intp_t(0), number], inbounds=True)
        return _member(context, builder, value_type, at)

    return argument_type(value_type)(reference, types.intp), generate


@overload(operator.getitem)
def _get_item(reference, index):  # type: ignore[no-untyped-def]
    if isinstance(reference, TupleReference) and isinstance(reference.content, types.UniTuple):
        return lambda reference, index: _item(reference, index)
    return None


# --- functions that are linked into their callers ---


class _LinkedLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code that is linked into its callers and never run by itself."""

    def _optimize_final_module(self) -> None:
        """Nothing: callers are optimised as a whole, with this code in them."""

    def _finalize_final_module(self) -> None:
        self._verify_declare_only_symbols()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """None, as of a function that is not defined."""
        return 0

    @property
    def codegen(self) -> "_LinkedLibrary":
        """Whom its environment is given to; see `set_env`."""
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """Nothing: only functions with Python objects need an environment."""


class _LinkedCompiler(Compiler):  # type: ignore[misc]
    """Compiles what other compiled code calls."""

    def __init__(self, typing: Any, target: Any, library: None, *rest: Any) -> None:
        super().__init__(typing, target, _LinkedLibrary(target.codegen(), "part"), *rest)


class _PythonEntry(CPUDispatcher):  # type: ignore[misc]
    """What Python calls in place of a linked function; its code is kept between runs."""

    def __init__(self, function: "_LinkedFunction", options: dict[str, Any]) -> None:
        def entry(*given: Any) -> Any:
            return function(*given)

        super().__init__(entry, targetoptions=options)
        with suppress(RuntimeError):  # a function without a file is compiled in each process
            self._cache = CodeCache(function.py_func)

    def compile(self, sig: Any) -> Any:
        """Code for a signature, kept or made."""
        try:
            return super().compile(sig)
        finally:
            if isinstance(self._cache, CodeCache):
                self._cache.compiled()


class _LinkedFunction(CPUDispatcher):  # type: ignore[misc]
    """A function that is linked into compiled callers; Python calls it by way of an entry.

    An entry takes named tuples apart, which would take longer to compile than most functions do,
    and most are called by compiled code alone.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        bare = {**options, "no_cpython_wrapper": True}
        super().__init__(function, targetoptions=bare, pipeline_class=_LinkedCompiler)
        self._options = options

    @cached_property
    def entry(self) -> _PythonEntry:
        """The function as Python calls it."""
        return _PythonEntry(self, self._options)

    def __call__(self, *given: Any) -> Any:
        return self.entry(*given)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """See numba's dispatcher: types of a call, whose tuples go by address."""
        signature, folded = self._compiler.fold_argument_types(args, kws)
        template, _, *rest = super().get_call_template(
            [argument_type(value) for value in folded], {}
        )
        return template, signature, *rest


def jit(*, inline: bool = False) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that compiles functions which allocate no arrays.

    All arrays belong to the caller, so that references need not be counted (`_nrt`), which took
    two thirds of a step. No wrapper for callers in C is compiled.

    Parameters
    ----------
    inline : whether LLVM always inlines them into their callers.
    """
    options = {
        "nopython": True,
        "error_model": "numpy",
        "_nrt": False,
        "no_cfunc_wrapper": True,
        "forceinline": inline,
    }
    return lambda function: _LinkedFunction(function, options)
