"""The hot loop's view of an FMU: its own C functions, called from compiled Python.

numba compiles the laws of the observers once; which FMU they run on is an argument, an `Instance` with
the addresses of the FMU's functions, so that another FMU needs no compilation. Everything here may
also be called from ordinary Python.
"""

import hashlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
import platformdirs
from numba import njit, types
from numba.core import caching
from numba.core.types import WrapperAddressProtocol
from numba.experimental import function_type as _first_class_functions  # noqa: F401  registers them
from numpy.typing import NDArray

from workbench.errors import FMUError
from workbench.fmu import FMU, Matrix, Vector


def _folder() -> Path:
    """Folder of compiled code, one for each state of the sources that hold laws and loops.

    numba renews a compiled function when its own file changes, not when one that it calls does.
    """
    files = sorted(Path(__file__).parent.rglob("*.py"))
    sources = (file.read_bytes() for file in files)
    compiled_ones = b"".join(source for source in sources if b"workbench.kernel import" in source)
    state = hashlib.sha256(compiled_ones).hexdigest()[:16]
    return Path(platformdirs.user_cache_dir("wheelset-workbench")) / state


_FOLDER = _folder()


class _Locator(caching.UserWideCacheLocator):  # type: ignore[misc]
    def __init__(self, function: Any, file: str) -> None:
        super().__init__(function, file)
        self._cache_path = str(_FOLDER / self.get_suitable_cache_subpath(file))


class _CodeCache(caching.CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes: ClassVar = [_Locator]


class _Cache(caching.FunctionCache):  # type: ignore[misc]
    """numba's cache of a function in our folder; numba's own setting is left to the user."""

    _impl_class = _CodeCache


def _compiler(inline: str) -> Callable[[Callable[..., Any]], Any]:
    """Make a decorator of laws and loops, whose compiled code is kept between runs.

    Their arrays belong to the caller and they allocate none, so that references need not be
    counted (`_nrt`), which took two thirds of a step.
    """

    def compile_(function: Callable[..., Any]) -> Any:
        dispatcher = njit(error_model="numpy", _nrt=False, inline=inline)(function)
        # Where nothing can be kept (no file, no writable folder) each process compiles anew.
        with suppress(RuntimeError):
            dispatcher._cache = _Cache(function)
        return dispatcher

    return compile_


compiled = _compiler(inline="never")
inlined = _compiler(inline="always")

_WORD = types.intp
_ARRAY_CALL = types.int32(_WORD, _WORD, _WORD)
_REAL_CALL = types.int32(_WORD, _WORD, _WORD, _WORD, _WORD)
_DIRECTIONAL_2 = types.int32(_WORD, _WORD, _WORD, _WORD, _WORD, _WORD, _WORD)
_DIRECTIONAL_3 = types.int32(_WORD, _WORD, _WORD, _WORD, _WORD, _WORD, _WORD, _WORD, _WORD)

OK, REFUSED, SINGULAR = 0, 1, 2


class _Function(WrapperAddressProtocol):  # type: ignore[misc]
    """A C function as numba takes it: address and signature."""

    def __init__(self, address: int, signature: Any) -> None:
        self._address = address
        self._signature = signature

    def __wrapper_address__(self) -> int:
        return self._address

    def signature(self) -> Any:
        return self._signature


class Instance(NamedTuple):
    """One FMU instance, its functions and the buffers they read and write.

    Attributes
    ----------
    address : of the FMU instance.
    set_states, derivatives, set_real, get_real : functions of the FMU. FMI 2.0 takes no length of
        values in set_real and get_real; the register it would be in is not read.
    directional_2, directional_3 : directional derivatives; only that of `fmi` is called.
    fmi : 2 or 3 with directional derivatives, 0 for differences.
    x, dx : (n,) states and their derivatives.
    u, y : (m,) inputs, (l,) outputs.
    jacobian : (n + q, n + l) derivatives of [dx; y] (columns) by [x; last q inputs] (rows).
    seed : (1,) one.
    *_at : addresses of the buffers and of the value references.
    keep : what must live as long as the addresses.
    """

    address: int
    set_states: Any
    derivatives: Any
    set_real: Any
    get_real: Any
    directional_2: Any
    directional_3: Any
    fmi: int
    x: Vector
    dx: Vector
    u: Vector
    y: Vector
    jacobian: Matrix
    seed: Vector
    x_at: int
    dx_at: int
    u_at: int
    y_at: int
    jacobian_at: int
    seed_at: int
    inputs_at: int
    outputs_at: int
    unknowns_at: int
    knowns_at: int
    keep: tuple[NDArray[np.uint32], ...]


def instance(
    fmu: FMU, inputs: Sequence[str], corrections: Sequence[str], outputs: Sequence[str]
) -> Instance:
    """Prepare an FMU for compiled loops; the FMU must outlive the result.

    Parameters
    ----------
    inputs : measured.
    corrections : inputs that an observer sets, (q,).
    outputs : what estimates are made of, (l,).
    """
    n, m, q, k = len(fmu.states), len(inputs), len(corrections), len(outputs)
    references = {
        "inputs": fmu.variables([*inputs, *corrections]).references,
        "outputs": fmu.variables(outputs).references,
        "unknowns": np.concatenate([fmu.rate_references, fmu.variables(outputs).references]),
        "knowns": fmu.variables([*fmu.states, *corrections]).references,
    }
    x, dx, u, y = np.zeros(n), np.zeros(n), np.zeros(m + q), np.zeros(k)
    jacobian, seed = np.zeros((n + q, n + k)), np.ones(1)
    version = int(fmu.version[0]) if fmu.has_directional_derivatives else 0
    directional = fmu.function_address("directional")
    return Instance(
        address=fmu.instance_address,
        set_states=_Function(fmu.function_address("set_states"), _ARRAY_CALL),
        derivatives=_Function(fmu.function_address("derivatives"), _ARRAY_CALL),
        set_real=_Function(fmu.function_address("set"), _REAL_CALL),
        get_real=_Function(fmu.function_address("get"), _REAL_CALL),
        directional_2=_Function(directional, _DIRECTIONAL_2),
        directional_3=_Function(directional, _DIRECTIONAL_3),
        fmi=version,
        x=x,
        dx=dx,
        u=u,
        y=y,
        jacobian=jacobian,
        seed=seed,
        x_at=x.ctypes.data,
        dx_at=dx.ctypes.data,
        u_at=u.ctypes.data,
        y_at=y.ctypes.data,
        jacobian_at=jacobian.ctypes.data,
        seed_at=seed.ctypes.data,
        inputs_at=references["inputs"].ctypes.data,
        outputs_at=references["outputs"].ctypes.data,
        unknowns_at=references["unknowns"].ctypes.data,
        knowns_at=references["knowns"].ctypes.data,
        keep=tuple(references.values()),
    )


@inlined
def set_inputs(model, first, count):  # type: ignore[no-untyped-def]
    """Set `count` inputs from number `first` on to model.u; returns a status."""
    references, values = model.inputs_at + 4 * first, model.u_at + 8 * first
    status = model.set_real(model.address, references, count, values, count)
    return REFUSED if status > 1 else OK


@inlined
def set_states(model):  # type: ignore[no-untyped-def]
    """Set the states to model.x; returns a status."""
    n = model.x.size
    return REFUSED if n and model.set_states(model.address, model.x_at, n) > 1 else OK


@inlined
def place(model):  # type: ignore[no-untyped-def]
    """Put the FMU at the states model.x and the inputs model.u; returns a status."""
    return set_inputs(model, 0, model.u.size) or set_states(model)


@inlined
def evaluate(model):  # type: ignore[no-untyped-def]
    """Derivatives of the states into model.dx; returns a status."""
    n = model.dx.size
    return REFUSED if model.derivatives(model.address, model.dx_at, n) > 1 else OK


@inlined
def read(model):  # type: ignore[no-untyped-def]
    """Outputs into model.y; returns a status."""
    n = model.y.size
    status = model.get_real(model.address, model.outputs_at, n, model.y_at, n)
    return REFUSED if status > 1 else OK


@inlined
def differentiate(model, row, count):  # type: ignore[no-untyped-def]
    """One row of the Jacobian, by state or correction `row`, into model.jacobian; a status.

    Where the FMU has no directional derivatives, all rows are written; see `linearise`.
    """
    if model.fmi == 0:
        return _differences(model)
    known = model.knowns_at + 4 * row
    out = model.jacobian_at + 8 * model.jacobian.shape[1] * row
    if model.fmi == 2:
        status = model.directional_2(
            model.address, model.unknowns_at, count, known, 1, model.seed_at, out
        )
    else:
        status = model.directional_3(
            model.address, model.unknowns_at, count, known, 1, model.seed_at, 1, out, count
        )
    return REFUSED if status > 1 else OK


@inlined
def linearise(model, count):  # type: ignore[no-untyped-def]
    """Jacobian at the present point into model.jacobian; returns a status.

    The first `count` columns are written: n for the derivatives, n + l for the outputs too.
    Afterwards the FMU is where it was; model.dx and model.y are undefined.
    """
    if model.fmi == 0:
        return _differences(model)
    for j in range(model.jacobian.shape[0]):
        if differentiate(model, j, count):
            return REFUSED
    return OK


@compiled
def _differences(model):  # type: ignore[no-untyped-def]
    """Central differences; the step balances truncation and rounding (cube root of eps)."""
    rows, columns = model.jacobian.shape
    n, m = model.x.size, model.u.size
    first = m - (rows - n)  # of the corrections
    for j in range(rows):
        centre = model.x[j] if j < n else model.u[first + j - n]
        step = 6e-6 * max(abs(centre), 1e-3)
        for side in (1.0, -1.0, 0.0):
            if j < n:
                model.x[j] = centre + side * step
            else:
                model.u[first + j - n] = centre + side * step
            if place(model):
                return REFUSED
            if side == 0.0:
                continue
            if evaluate(model) or read(model):
                return REFUSED
            for i in range(columns):
                value = model.dx[i] if i < n else model.y[i - n]
                if side > 0.0:
                    model.jacobian[j, i] = value
                else:
                    model.jacobian[j, i] = (model.jacobian[j, i] - value) / (2.0 * step)
    return OK


@compiled
def solve(a, b):  # type: ignore[no-untyped-def]
    """Solve a x = b in place: a (n, n) is destroyed, b (n,) or (n, k) becomes x; returns a status.

    Gaussian elimination with partial pivoting; for the few unknowns of an observer it is several
    times faster than a call into LAPACK.
    """
    n = a.shape[0]
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if not abs(a[pivot, k]) > 0.0:
            return SINGULAR
        if pivot != k:
            for j in range(n):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
            for j in range(b.shape[1]):
                b[k, j], b[pivot, j] = b[pivot, j], b[k, j]
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, n):
            factor = a[i, k] * inverse
            if factor != 0.0:
                for j in range(k + 1, n):
                    a[i, j] -= factor * a[k, j]
                for j in range(b.shape[1]):
                    b[i, j] -= factor * b[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(b.shape[1]):
            total = b[k, j]
            for i in range(k + 1, n):
                total -= a[k, i] * b[i, j]
            b[k, j] = total / a[k, k]
    return OK


def checked(status: int, fmu: FMU) -> None:
    """Turn a status of a compiled loop into an exception.

    Raises
    ------
    FMUError
        If the FMU refused a call, with what it logged; or an implicit step had no solution.
    """
    if status == REFUSED:
        raise fmu.refusal("a call of the observer's loop", 3)
    if status == SINGULAR:
        raise FMUError(f"{fmu.path.name}: the implicit step has no solution at this point")
