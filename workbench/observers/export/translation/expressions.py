"""Expressions of laws in C."""

import ast
import builtins
import math
import operator
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from workbench.errors import InputError
from workbench.observers.export.translation.values import (
    BOOL,
    DOUBLE,
    INT,
    Array,
    Number,
    Record,
    Several,
    Value,
    c_number,
    common,
    expression,
    field,
    number,
)

# --- functions of numbers ---


# By name of the function of numbers in C; of all numpy and Python have under a name.
_REAL = {
    "sqrt": (np.sqrt, math.sqrt),
    "exp": (np.exp, math.exp),
    "log": (np.log, math.log),
    "sin": (np.sin, math.sin),
    "cos": (np.cos, math.cos),
    "tan": (np.tan, math.tan),
    "asin": (np.arcsin, math.asin),
    "acos": (np.arccos, math.acos),
    "atan": (np.arctan, math.atan),
    "atan2": (np.arctan2, math.atan2),
    "sinh": (np.sinh, math.sinh),
    "cosh": (np.cosh, math.cosh),
    "tanh": (np.tanh, math.tanh),
    "hypot": (np.hypot, math.hypot),
    "floor": (np.floor,),
    "ceil": (np.ceil,),
    "fabs": (np.abs, np.fabs, math.fabs),
}
_TRUTH = {
    "isnan": (np.isnan, math.isnan),
    "isinf": (np.isinf, math.isinf),
    "isfinite": (np.isfinite, math.isfinite),
}
_ONE, _TWO = 1, 2


def of_numbers(function: Any, given: Sequence[Value]) -> Value | None:
    """A function of numbers; None if it is another one."""
    if function is builtins.len and len(given) == _ONE and isinstance(given[0].type, Array):
        return given[0].sizes[0]
    if not given or not all(isinstance(argument.type, Number) for argument in given):
        return None
    listed = ", ".join(argument.text for argument in given)
    for table, kind in ((_REAL, DOUBLE), (_TRUTH, BOOL)):
        for name, functions in table.items():
            if any(function is known for known in functions):
                count = _TWO if name in ("atan2", "hypot") else _ONE
                return (
                    expression(kind, f"{name}({listed})", *given) if len(given) == count else None
                )
    return _builtin(function, given)


def _builtin(function: Any, given: Sequence[Value]) -> Value | None:
    first = given[0]
    if function is builtins.min or function is builtins.max:
        return _extreme("python_least" if function is builtins.min else "python_most", given)
    if len(given) > _ONE:
        return None
    if function is builtins.abs:
        name = "fabs" if first.kind == DOUBLE else "abs"
        return expression(
            common(first.kind, INT), f"{name}({first.text})", first, natural=first.kind != DOUBLE
        )
    if function is builtins.float:
        return expression(DOUBLE, f"(double){first.operand}", first)
    if function is builtins.int:
        return expression(INT, f"(int){first.operand}", first, natural=first.natural)
    if function is builtins.bool:
        return expression(BOOL, f"{first.operand} != 0", first)
    return None


def _extreme(name: str, given: Sequence[Value]) -> Value | None:
    """The least or largest, the first of equal ones, by comparisons in Python's order."""
    if len(given) < _TWO:
        return None
    result = given[0]
    for argument in given[1:]:
        kind = common(common(result.kind, argument.kind), INT)
        of = name if kind == DOUBLE else f"{name}_int"
        natural = kind == INT and result.natural and argument.natural
        result = expression(
            kind, f"{of}({result.text}, {argument.text})", result, argument, natural=natural
        )
    return result


# --- elements, rows and pieces of arrays ---


Piece: TypeAlias = tuple[Value | None, Value | None]  # first element, and that after the last one


def sizes_of(array: Value) -> tuple[Value, ...]:
    """Sizes of an array, for each axis."""
    assert isinstance(array.type, Array)
    return array.sizes


def element(index: Value, size: Value) -> str:
    """An index as C takes it: from the end where Python's is negative."""
    if index.known is not None:
        known = int(index.known)
        if known < 0 and size.known is not None:
            return str(known + int(size.known))
        if known >= 0:
            return str(known)
    return index.text if index.natural else f"python_index({index.text}, {size.text})"


def view(array: Value, indices: Sequence[Value | Piece]) -> Value:
    """An element of an array, or the part that some indices leave."""
    type_ = array.type
    assert isinstance(type_, Array)
    terms = [array.offset] if array.offset else []
    sizes: list[Value] = []
    strides: list[int] = []
    for axis, stride in enumerate(type_.strides):
        size = array.sizes[axis]
        if axis >= len(indices):
            sizes.append(size)
            strides.append(stride)
            continue
        index = indices[axis]
        if isinstance(index, tuple):
            first, size = _piece(index, size)
            sizes.append(size)
            strides.append(stride)
        else:
            first = element(index, size)
        if first != "0":
            terms.append(_times(first, stride))
    offset = " + ".join(terms)
    if len(terms) == 1 and offset.startswith("("):
        offset = offset[1:-1]
    if not sizes:
        return Value(Number(type_.kind), f"{array.text}[{offset or '0'}]", reads=not type_.constant)
    shape = tuple(int(size.known) if size.known is not None else None for size in sizes)
    left = Array(type_.kind, shape, tuple(strides), type_.constant)
    return Value(left, array.text, offset=offset, sizes=tuple(sizes))


def _times(index: str, stride: int) -> str:
    if stride == 1:
        return index if index.isidentifier() or index.isdigit() else f"({index})"
    if index.isdigit():
        return str(int(index) * stride)
    return f"{stride} * {index}" if index.isidentifier() else f"{stride} * ({index})"


def _piece(piece: Piece, size: Value) -> tuple[str, Value]:
    """First element of a slice, and its size."""
    first, last = (
        _end(end, size, instead) for end, instead in zip(piece, (number(0), size), strict=True)
    )
    if first.known is not None and last.known is not None:
        return first.text, number(max(int(last.known - first.known), 0))
    if first.known == 0:
        return "0", last
    return first.text, expression(INT, f"python_length({first.text}, {last.text})", natural=True)


def _end(end: Value | None, size: Value, instead: Value) -> Value:
    if end is None:
        return instead
    if end.known is not None and size.known is not None:
        known, count = int(end.known), int(size.known)
        return number(min(max(known + count if known < 0 else known, 0), count))
    if end.known == 0:
        return end
    return expression(INT, f"python_end({end.text}, {size.text})", natural=True)


# --- expressions ---


Found: TypeAlias = Value | tuple[Value, ...]

_OPERATORS: dict[type[ast.AST], tuple[str, Callable[[Any, Any], Any]]] = {
    ast.Add: ("+", operator.add),
    ast.Sub: ("-", operator.sub),
    ast.Mult: ("*", operator.mul),
    ast.Div: ("/", operator.truediv),
    ast.FloorDiv: ("//", operator.floordiv),
    ast.Pow: ("**", operator.pow),
    ast.Lt: ("<", operator.lt),
    ast.LtE: ("<=", operator.le),
    ast.Gt: (">", operator.gt),
    ast.GtE: (">=", operator.ge),
    ast.Eq: ("==", operator.eq),
    ast.NotEq: ("!=", operator.ne),
}
_NOTHING = object()


class Expressions(ABC):
    """What one function of Python can see, and its expressions in C.

    Statements that an expression needs before it go to `lines`.
    """

    def __init__(self, where: Callable[[ast.AST], str], names: dict[str, Any]) -> None:
        self._where = where
        self._globals = names
        self.own: set[str] = set()  # names of the function, which are none of the module
        self.env: dict[str, Value] = {}
        self.lines: list[str] = []
        self._temporaries = 0

    @abstractmethod
    def called(self, node: ast.Call, function: Any, given: Sequence[Value]) -> Value:
        """A call of another compiled function."""

    def refused(self, node: ast.AST, found: str) -> InputError:
        """The error for Python that has no translation."""
        return InputError(
            where=self._where(node),
            found=f"{found}: {ast.unparse(node).splitlines()[0]}",
            expected="loops, branches, calls of compiled functions, and arithmetic on numbers and "
            "elements of arrays, of which C is made for an FMU",
            remedy="write it with these",
        )

    def temporary(self, value: Value) -> Value:
        """A number whose value is kept from now on."""
        self._temporaries += 1
        name = f"kept{self._temporaries}"
        type_ = "double" if value.kind == DOUBLE else "int"
        self.lines.append(f"const {type_} {name} = {value.text};")
        return replace(value, text=name, reads=False, acts=False)

    def operands(self, nodes: Sequence[ast.expr]) -> list[Value]:
        """Values of expressions, as Python evaluates them: one after the other.

        What an earlier one reads is kept where a later one changes memory, and C may call functions
        in any order, so that what they give is kept, too.
        """
        parts = self.with_statements(self.value, nodes)
        last = max(
            (k for k, (operand, lines) in enumerate(parts) if lines or operand.acts), default=-1
        )
        values = []
        for k, (operand, lines) in enumerate(parts):
            self.lines += lines
            changes = operand.acts and len(parts) > 1
            kept = isinstance(operand.type, Number) and (changes or (k < last and operand.reads))
            values.append(self.temporary(operand) if kept else operand)
        return values

    # --- any expression ---

    def value(self, node: ast.expr) -> Value:
        """One value."""
        value = self.resolve(node)
        if isinstance(value, tuple):
            raise self.refused(node, "a tuple where one value is needed")
        return value

    def number(self, node: ast.expr) -> Value:
        """One number."""
        return self._require_number(node, self.value(node))

    def _require_number(self, node: ast.expr, value: Value) -> Value:
        if not isinstance(value.type, Number):
            raise self.refused(node, "an array or tuple where a number is needed")
        return value

    def numbers(self, nodes: Sequence[ast.expr]) -> list[Value]:
        """Operands that are numbers."""
        values = self.operands(nodes)
        for node, value in zip(nodes, values, strict=True):
            self._require_number(node, value)
        return values

    def resolve(self, node: ast.expr) -> Found:
        """One value or several."""
        method = getattr(self, f"_{type(node).__name__.lower()}", None)
        if method is None:
            raise self.refused(node, "an expression that is not translated")
        result: Found = method(node)
        return result

    def _constant(self, node: ast.Constant) -> Value:
        if not isinstance(node.value, bool | int | float):
            raise self.refused(node, "a constant that is no number")
        return number(node.value)

    def _name(self, node: ast.Name) -> Value:
        if node.id in self.env:
            return self.env[node.id]
        return self._outside(node)

    def _outside(self, node: ast.expr) -> Value:
        """A constant of the module, or of numpy."""
        value = self.object(node)
        value = value.item() if isinstance(value, np.generic) else value
        if not isinstance(value, bool | int | float):
            raise self.refused(node, "a name that is no number here")
        return number(value)

    def object(self, node: ast.expr) -> Any:
        """What a name outside of the function stands for."""
        if isinstance(node, ast.Name) and node.id not in self.own:
            return self._globals.get(node.id, getattr(builtins, node.id, _NOTHING))
        if isinstance(node, ast.Attribute):
            return getattr(self.object(node.value), node.attr, _NOTHING)
        return _NOTHING

    def _tuple(self, node: ast.Tuple) -> tuple[Value, ...]:
        return tuple(self.operands(node.elts))

    def _attribute(self, node: ast.Attribute) -> Found:
        if self.object(node) is not _NOTHING:
            return self._outside(node)
        of = self.value(node.value)
        if isinstance(of.type, Record):
            value = field(of, node.attr)
            if value is None:
                raise self.refused(node, "a field that is not there")
            return value
        if isinstance(of.type, Array) and node.attr in ("size", "shape"):
            sizes = sizes_of(of)
            if node.attr == "shape":
                return sizes
            if len(sizes) == 1:
                return sizes[0]
            total = number(1)
            for size in sizes:
                total = self._operation(node, ast.Mult(), total, size)
            return total
        raise self.refused(node, "an attribute that is not translated")

    def _subscript(self, node: ast.Subscript) -> Value:
        listed = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        of = self.resolve(node.value)
        if isinstance(of, tuple):
            index = self.number(node.slice)
            if not isinstance(index.known, int) or not -len(of) <= index.known < len(of):
                raise self.refused(node, "an index that is not known in advance")
            return of[index.known]
        if isinstance(of.type, Several):
            index = self._index(listed[0])
            if len(listed) > 1:
                raise self.refused(node, "more indices than there are")
            return Value(of.type.of, f"&{of.text}[{element(index, number(of.type.count))}]")
        if not isinstance(of.type, Array):
            raise self.refused(node, "an index of what is no array")
        indices = [
            self._piece(index) if isinstance(index, ast.Slice) else self._index(index)
            for index in listed
        ]
        if len(indices) > len(of.type.shape):
            raise self.refused(node, "more indices than there are")
        return view(of, indices)

    def _index(self, node: ast.expr) -> Value:
        index = self.number(node)
        if index.kind == DOUBLE:
            raise self.refused(node, "an index that is no whole number")
        return self.temporary(index) if index.acts else index

    def _piece(self, node: ast.Slice) -> tuple[Value | None, Value | None]:
        if node.step is not None:
            raise self.refused(node, "a slice with a step")
        ends = [None if end is None else self._index(end) for end in (node.lower, node.upper)]
        # What may change before the view is used is kept.
        kept = [self.temporary(e) if e and e.known is None and e.reads else e for e in ends]
        return kept[0], kept[1]

    # --- arithmetic ---

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            of = self.test(node.operand)
            return expression(BOOL, f"!{of.operand}", of)
        of = self.number(node.operand)
        if isinstance(node.op, ast.UAdd):
            return of
        if not isinstance(node.op, ast.USub):
            raise self.refused(node, "an operator that is not translated")
        if of.known is not None:
            return number(-of.known)
        return expression(common(of.kind, INT), f"-{of.operand}", of)

    def _binop(self, node: ast.BinOp) -> Value:
        left, right = self.numbers([node.left, node.right])
        return self._operation(node, node.op, left, right)

    def _operation(self, node: ast.AST, op: ast.AST, left: Value, right: Value) -> Value:
        if type(op) not in _OPERATORS:
            raise self.refused(node, "an operator that is not translated")
        sign, act = _OPERATORS[type(op)]
        kind = common(common(left.kind, right.kind), INT)
        if left.known is not None and right.known is not None:
            try:
                return number(act(left.known, right.known))
            except ArithmeticError:
                raise self.refused(node, "constants without a result") from None
        natural = left.natural and right.natural and sign != "-" and kind == INT
        if sign == "/":
            above = left.operand if DOUBLE in (left.kind, right.kind) else f"(double){left.operand}"
            return expression(DOUBLE, f"{above} / {right.operand}", left, right)
        if sign == "**":
            if right.known == 2 and right.kind == INT:
                name = "python_square" if kind == DOUBLE else "python_square_int"
                return expression(kind, f"{name}({left.text})", left, natural=kind == INT)
            return expression(DOUBLE, f"pow({left.text}, {right.text})", left, right)
        if sign == "//":
            if not (kind == INT and left.natural and right.natural):
                raise self.refused(
                    node, "a division of numbers that may be negative, or no whole ones"
                )
            sign = "/"
        return expression(
            kind, f"{left.operand} {sign} {right.operand}", left, right, natural=natural
        )

    # --- comparisons and choices ---

    def _compare(self, node: ast.Compare) -> Value:
        operands = self.numbers([node.left, *node.comparators])
        parts = []
        for op, left, right in zip(node.ops, operands, operands[1:], strict=False):
            if type(op) not in _OPERATORS:
                raise self.refused(node, "a comparison that is not translated")
            sign, act = _OPERATORS[type(op)]
            if left.known is not None and right.known is not None:
                parts.append(number(bool(act(left.known, right.known))))
            else:
                text = f"{left.operand} {sign} {right.operand}"
                parts.append(expression(BOOL, text, left, right))
        if len(parts) == 1:
            return parts[0]
        return expression(BOOL, " && ".join(part.text for part in parts), *parts)

    def _ifexp(self, node: ast.IfExp) -> Value:
        test = self.test(node.test)
        ways = self.with_statements(self.number, [node.body, node.orelse])
        (then, before), (other, instead) = ways
        kind = common(then.kind, other.kind)
        if not before and not instead:
            # Operands of a choice are evaluated in order, and only those that are chosen.
            text = f"{test.operand} ? {then.operand} : {other.operand}"
            return expression(kind, text, test, then, other, natural=then.natural and other.natural)
        name = self._variable(kind)
        self.branch(
            test.text, [*before, f"{name} = {then.text};"], [*instead, f"{name} = {other.text};"]
        )
        return Value(Number(kind), name)

    def _boolop(self, node: ast.BoolOp) -> Value:
        """The operand that decides, as in Python."""
        values = self.with_statements(self.number, node.values)
        kinds = {value.kind for value, _ in values}
        if DOUBLE in kinds:
            raise self.refused(node, "a number that is no whole one as a truth")
        if kinds == {BOOL} and not any(before for _, before in values[1:]):
            return self._join_truths(node.op, values)
        kind = INT if INT in kinds else BOOL
        first, before = values[0]
        self.lines += before
        name = self._variable(kind, f" = {first.text}")
        self.decide(node.op, name, values[1:])
        return Value(Number(kind), name)

    def decide(self, op: ast.boolop, name: str, values: Sequence[tuple[Value, list[str]]]) -> None:
        """Let operands that follow change a variable that has not decided."""
        undecided = f"{name} == 0" if isinstance(op, ast.Or) else f"{name} != 0"
        for value, before in values:
            self.branch(undecided, [*before, f"{name} = {value.text};"], [])

    def _join_truths(self, op: ast.boolop, values: Sequence[tuple[Value, list[str]]]) -> Value:
        self.lines += values[0][1]
        sign = " || " if isinstance(op, ast.Or) else " && "
        return expression(BOOL, sign.join(v.operand for v, _ in values), *(v for v, _ in values))

    def with_statements(
        self, translate: Callable[[ast.expr], Value], nodes: Sequence[ast.expr]
    ) -> list[tuple[Value, list[str]]]:
        """Values of expressions, each with the statements that it needs before it."""
        values, outer = [], self.lines
        for node in nodes:
            self.lines = []
            values.append((translate(node), self.lines))
        self.lines = outer
        return values

    def test(self, node: ast.expr) -> Value:
        """A truth; any whole number but zero is one."""
        if isinstance(node, ast.BoolOp):
            tests = self.with_statements(self.test, node.values)
            values = [(self._truth(node, test), before) for test, before in tests]
            if not any(before for _, before in values[1:]):
                return self._join_truths(node.op, values)
        return self._truth(node, self.number(node))

    def _truth(self, node: ast.expr, value: Value) -> Value:
        if value.kind == DOUBLE:
            raise self.refused(node, "a number that is no whole one as a truth")
        return value

    def _variable(self, kind: str, start: str = "") -> str:
        self._temporaries += 1
        name = f"chosen{self._temporaries}"
        self.lines.append(f"{c_number(kind)} {name}{start};")
        return name

    def branch(self, test: str, then: Sequence[str], other: Sequence[str]) -> None:
        """Add a branch."""
        self.lines.append(f"if ({test}) {{")
        self.lines += [f"    {line}" for line in then]
        if other:
            self.lines.append("} else {")
            self.lines += [f"    {line}" for line in other]
        self.lines.append("}")

    # --- calls ---

    def _call(self, node: ast.Call) -> Value:
        if node.keywords:
            raise self.refused(node, "an argument by name")
        function = self.object(node.func)
        nodes = []
        for argument in node.args:
            of = argument.value if isinstance(argument, ast.Starred) else None
            if of is not None and not isinstance(of, ast.Tuple):
                raise self.refused(node, "an argument of several that are not written out")
            nodes += of.elts if of is not None else [argument]
        given = self.operands(nodes)
        known = of_numbers(function, given)
        return known if known is not None else self.called(node, function, given)
