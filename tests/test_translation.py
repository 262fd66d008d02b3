"""Compiled Python in C: the same numbers, and words about what has no translation."""

import ctypes
import math
import subprocess
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.models.native import compiled
from workbench.observers.export.translation import Array, Data, Number, Program
from workbench.observers.export.translation.values import DOUBLE, contents

from .processes import COMPILER

HELPERS = Path(__file__).parent.parent / "workbench" / "observers" / "export" / "law.c"
LENGTH, ROWS, COLUMNS = 5, 3, 4
_SHARE = 0.25
VECTOR = Array(DOUBLE, (LENGTH,), (1,), constant=False)
MATRIX = Array(DOUBLE, (ROWS, COLUMNS), (COLUMNS, 1), constant=False)


# --- what a law may do; each gets a vector, a matrix and a number, and returns a number ---


@compiled
def from_the_end(a, m, x):
    last = -1
    a[last] += m[-1, -2]
    for i in range(-3, 0):
        a[i] *= 2.0
    return a[last] - a[last - 1]


@compiled
def _total(values):
    total = 0.0
    for i in range(values.size):
        total += values[i] * (i + 1)
    return total


@compiled
def pieces(a, m, x):
    n = int(abs(x))
    total = _total(a[n:]) + 2.0 * _total(a[:n]) + 3.0 * _total(a[-n:]) + 5.0 * _total(a[1:-1])
    return total + 7.0 * _total(m[:, 1]) + 11.0 * _total(m[2, 1:]) + 13.0 * _total(m[:n, 0])


@compiled
def _rank(a, i, j):
    """The larger of two elements, where it stands, and how far they are apart."""
    if a[i] > a[j]:
        return i, a[i] - a[j]
    return j, a[j] - a[i]


@compiled
def swaps(a, m, x):
    a[0], a[1], a[2] = a[1], a[2], a[0]
    first, second = 1.0, x
    first, second = second, first
    m[0, 0] = m[1, 1] = a[3] = first - 2.0 * second
    place, apart = _rank(a, 3, 4)
    m[2, 0], m[2, 1] = _rank(a, 0, 1)
    return place + apart


@compiled
def extremes(a, m, x):
    a[0] = min(max(a[0], -_SHARE), _SHARE)
    a[1] = max(np.nan, a[1]) if x > 0.0 else max(a[1], np.nan)
    a[2] = min(np.nan, a[2]) if x > 0.0 else min(a[2], np.nan)
    a[3] = max(a[2], a[3], a[4])
    return 1.0 * max(int(x), 2, -3) + abs(int(x)) + abs(x)


@compiled
def _note(a, value):
    """Write what was asked for behind what was asked for before."""
    a[4] = 10.0 * a[4] + value
    return value


@compiled
def first_that_decides(a, m, x):
    a[4] = 0.0
    status = _note(a, 0) or _note(a, 2) or _note(a, 3)
    status = status or _note(a, 4)
    other = int(x) and _note(a, 5)
    if _note(a, 0) or (x > 0.0 and _note(a, 6) > 0):
        status += 100
    chosen = 7 if x > 0.0 else _note(a, 8)
    return 1000.0 * chosen + status + 0.5 * other


@compiled
def order_of_calls(a, m, x):
    a[4] = 1.0
    total = a[4] + _note(a, 2.0) * a[4] - _note(a, 3.0) / a[4]
    a[0] += _note(a, 4.0)
    a[4] += _note(a, 5.0)
    m[int(_note(a, 1.0)), 0] = a[4] + _note(a, 6.0)
    return total + m[1, 0]


@compiled
def kinds(a, m, x):
    total, count, seen = 0, 3, False
    for i in range(LENGTH):
        seen = seen or a[i] > 0.0
        total += a[i] if i > 0 else 1
    half = count / 2
    whole = (count + 4) // 2
    return total + half + whole + 10.0 * seen + (x > 0.0) + count**2 + x**2 + 2.0**count


@compiled
def loops(a, m, x):
    end, total = 4, 0.0
    for i in range(end):
        end = 1
        if i == 2:
            continue
        total += a[i]
    for i in range(LENGTH - 1, -1, -2):
        for j in range(i):
            total = 0.5 * total + a[i] * a[j]
    k = 0
    while True:
        k += 1
        if k > 3 or (x > 0.0 and not k < 2):
            break
    while k < 10 and total < 1e3:
        k += 1
    return total + 1.0 * k


@compiled
def choices(a, m, x):
    sign = -1 if x < 0.0 else 1 if x > 0.0 else 0
    if -1.0 < x <= 1.0:
        part = x
    elif not x > 0.0:
        part = -1.0
    else:
        part = 1.0
    row = m[1]
    size, columns = m.shape
    row[0] = part
    return sign * 100.0 + _total(row) + size * columns + m.size + len(a)


@compiled
def functions(a, m, x):
    total = np.sqrt(abs(x)) + np.exp(-x * x) + np.log(1.0 + abs(x)) + math.sin(x) * np.tanh(x)
    gone = np.isnan(x) or not np.isfinite(a[0])
    return np.inf if gone else total + np.arctan2(x, 2.0) + np.floor(x) + np.hypot(x, 1.0)


LAWS = (
    *(from_the_end, pieces, swaps, extremes, first_that_decides, order_of_calls, kinds, loops),
    *(choices, functions),
)


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> ctypes.CDLL:
    """All of the laws, in one library; warnings of the compiler are errors."""
    if COMPILER is None:
        pytest.skip("needs a C compiler")
    folder = tmp_path_factory.mktemp("laws")
    text = HELPERS.read_text()
    helpers = text[text.index("/* Python --") : text.index("/* estimator_begin")]
    parts = ["#include <math.h>", "#include <stdlib.h>", helpers]
    for law in LAWS:
        program = Program({})
        name = program.add(law, [VECTOR, MATRIX, Number(DOUBLE)])
        call = f"double run(double *a, double *m, double x) {{ return {name}(a, m, x); }}"
        own = f"{program.text(name)}\n{call}"
        # Each law has functions of its own, under names that others have too.
        for used in {word for word in own.replace("(", " ").split() if word.startswith("law_")}:
            own = own.replace(f"{used}(", f"{law.__name__}_{used}(")
        own = own.replace("LawResult_", f"{law.__name__}_LawResult_")
        parts.append(own.replace("double run(", f"double run_{law.__name__}("))
    (folder / "laws.c").write_text("\n".join(parts))
    command = [COMPILER, "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O2"]
    command += ["-ffp-contract=off", "-fPIC", "-shared", "laws.c", "-o", "laws.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "laws.so"))


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
@pytest.mark.parametrize("x", [-2.5, -0.5, 0.0, 0.5, 2.5, 3.0])
def test_c_gives_the_bits_that_compiled_python_gives(library, law, x):
    rng = np.random.default_rng(4)
    a, m = rng.standard_normal(LENGTH), rng.standard_normal((ROWS, COLUMNS))
    b, n = a.copy(), m.copy()
    run = getattr(library, f"run_{law.__name__}")
    run.restype = ctypes.c_double
    of = ctypes.c_void_p(b.ctypes.data), ctypes.c_void_p(n.ctypes.data), ctypes.c_double(x)
    expected = law(a, m, x)
    # Elementary functions of two libraries differ in the last bit.
    np.testing.assert_allclose(run(*of), expected, rtol=1e-14 if law is functions else 0.0)
    np.testing.assert_array_equal(b, a)
    np.testing.assert_array_equal(n, m)


# --- what has no translation ---


@compiled
def goes_over_an_array(a, m, x):
    for value in a:
        x += value
    return x


@compiled
def assigns_a_piece(a, m, x):
    a[1:] = x
    return x


@compiled
def names_an_array_twice(a, m, x):
    row = m[0]
    if x > 0.0:
        row = m[1]
    return row[0]


@compiled
def uses_a_counter_later(a, m, x):
    for i in range(3):
        x += a[i]
    return x + i


@compiled
def has_a_remainder(a, m, x):
    return x % 2.0


@compiled
def adds_arrays(a, m, x):
    return (a + a)[0]


@compiled
def calls_numpy(a, m, x):
    return np.sum(a)


@compiled
def calls_itself(a, m, x):
    return x if x < 1.0 else calls_itself(a, m, x - 1.0)


@pytest.mark.parametrize(
    ("law", "line", "message"),
    [
        (goes_over_an_array, 1, "a loop that is not over a range: for value in a"),
        (assigns_a_piece, 1, r"a part of an array that is assigned to: a\[1:\]"),
        (names_an_array_twice, 3, "an array whose name has another meaning .*: row"),
        (uses_a_counter_later, 3, "a name that is no number here: i"),
        (has_a_remainder, 1, "an operator that is not translated: x % 2.0"),
        (adds_arrays, 1, r"an array or tuple where a number is needed: a"),
        (calls_numpy, 1, r"a call of what is no compiled function: np.sum\(a\)"),
        (calls_itself, -1, "'calls_itself', which calls itself"),
    ],
    ids=lambda item: getattr(item, "__name__", None),
)
def test_what_has_no_translation_is_refused_with_file_and_line(law, line, message):
    # A decorator is the first line, the second has the name.
    first = law.py_func.__code__.co_firstlineno
    where = rf"test_translation\.py, line {first + 1 + line}: found {message}"
    with pytest.raises(InputError, match=where):
        Program({}).add(law, [VECTOR, MATRIX, Number(DOUBLE)])


def test_settings_are_not_written_to():
    constant = Array(DOUBLE, (LENGTH,), (1,), constant=True)
    with pytest.raises(InputError, match="what the law may only read, but is assigned to"):
        Program({}).add(from_the_end, [constant, MATRIX, Number(DOUBLE)])


class _Inner(NamedTuple):
    place: np.ndarray
    short: float


class _Outer(NamedTuple):
    several: tuple[_Inner, ...]
    grid: np.ndarray
    on: bool


def test_named_tuples_become_structs_of_the_same_contents():
    inner = _Inner(np.array([3, -1]), math.inf)
    value = _Outer((inner, inner._replace(short=0.1)), np.zeros((2, 3)), True)
    data = Data("here")
    data.type_of(value, "settings")
    assert (
        "typedef struct {\n    int place[2];\n    double short_;\n} LawInner;" in data.definitions()
    )
    assert "    LawInner several[2];\n    double grid[6];\n    int on;\n" in data.definitions()
    assert contents(value) == "{{{{3, -1}, INFINITY}, {{3, -1}, 0.1}}, {0}, 1}"


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("text", "str, which has no fixed size"),
        (np.zeros((3, 4))[:, 1], "an array that is not contiguous"),
        (np.zeros(2, np.float32), "an array of float32"),
        ((1.0, 2.0), "a tuple that is not of named tuples of one type"),
        (np.array([1, -(2**40)]), "a whole number beyond 2147483647"),
        (2**40, "a whole number beyond 2147483647"),
    ],
    ids=["text", "column", "single", "tuple", "far", "large"],
)
def test_what_has_no_fixed_size_is_refused(value, message):
    with pytest.raises(InputError, match=rf"here, memory\.grid: found {message}"):
        Data("here").type_of(_Outer((_Inner(np.zeros(1), 0.0),), value, True), "memory")
