"""Compiled functions of Python in C, and their statements: each once for each set of types."""

import ast
import inspect
import re
import textwrap
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import FunctionType
from typing import Any

from workbench.errors import InputError
from workbench.observers.export.translation.expressions import Expressions
from workbench.observers.export.translation.values import (
    DOUBLE,
    INT,
    Array,
    Number,
    Results,
    Type,
    Value,
    c_number,
    common,
    declaration,
    name_in_c,
    number,
)

# --- where names are given a value ---


@dataclass
class _Use:
    path: tuple[int, ...]  # of the blocks around
    statement: int
    gives: bool  # by an assignment that is this very statement


@dataclass
class Names:
    """What a function does with its names."""

    # how often each is given a value, as an argument too; loops' counters left out
    assigned: Counter[str] = field(default_factory=Counter)
    counters: set[str] = field(default_factory=set)  # of loops
    # those that C can declare where they are first assigned
    local: set[str] = field(default_factory=set)


def names_of(function: ast.FunctionDef) -> Names:
    """Study a function."""
    names = Names()
    for node in ast.walk(function):
        if isinstance(node, ast.For) and isinstance(node.target, ast.Name):
            names.counters.add(node.target.id)
        elif isinstance(node, ast.Assign):
            names.assigned.update(name for target in node.targets for name in _targets(target))
        elif isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
            names.assigned[node.target.id] += 1
    parameters = [argument.arg for argument in function.args.args]
    names.assigned.update(parameters)
    uses: dict[str, list[_Use]] = {}
    for name, use in _uses(function.body, (id(function),)):
        uses.setdefault(name, []).append(use)
    names.local = {
        name for name in names.assigned if name not in parameters and _declared_there(uses[name])
    }
    return names


def _declared_there(uses: list[_Use]) -> bool:
    """Whether the first use gives a value in the block that has all of them."""
    home = uses[0].path
    for use in uses:
        shared = [a for a, b in zip(home, use.path, strict=False) if a == b]
        home = home[: len(shared)]
    return uses[0].gives and uses[0].path == home


def _targets(node: ast.expr) -> Iterator[str]:
    if isinstance(node, ast.Name):
        yield node.id
    elif isinstance(node, ast.Tuple):
        for elt in node.elts:
            yield from _targets(elt)


def _uses(block: list[ast.stmt], path: tuple[int, ...]) -> Iterator[tuple[str, _Use]]:
    """Uses of names, in the order in which they run."""
    for statement in block:
        blocks = [
            inner
            for name in ("body", "orelse")
            if isinstance(inner := getattr(statement, name, None), list) and inner
        ]
        heads: list[ast.AST] = [statement]
        if isinstance(statement, ast.If | ast.While):
            heads = [statement.test]
        elif isinstance(statement, ast.For):
            heads = [statement.iter]
        given = list(_assigned_names(statement))
        for head in heads:
            for node in ast.walk(head):
                if isinstance(node, ast.Name) and node.id not in given:
                    yield node.id, _Use(path, id(statement), False)
        if isinstance(statement, ast.Assign):
            read = {n.id for n in ast.walk(statement.value) if isinstance(n, ast.Name)}
            for name in given:
                yield name, _Use(path, id(statement), name not in read)
        for inner in blocks:
            yield from _uses(inner, (*path, id(inner)))


def _assigned_names(statement: ast.stmt) -> Iterator[str]:
    if isinstance(statement, ast.Assign):
        for target in statement.targets:
            yield from _targets(target)


# --- statements ---


class Statements(Expressions):
    """The body of one function of Python in C.

    Parameters
    ----------
    kinds : of variables and of what is returned, by name, as far as they are known; extended.
    """

    def __init__(
        self,
        function: ast.FunctionDef,
        where: Callable[[ast.AST], str],
        names: dict[str, Any],
        kinds: dict[str, str],
    ) -> None:
        super().__init__(where, names)
        self.names = names_of(function)
        self.own = {*self.names.assigned, *self.names.counters}
        self.kinds = kinds
        self.acts = False  # whether it changes memory or the model
        # whether a kind turned out wider than was known, so that the text is not right yet
        self.changed = False
        self.declared: list[str] = []  # declarations at the top
        self.returned: int | None = None  # how many numbers it returns, None: not known yet
        self._open: set[str] = set()  # variables that are declared
        self._here: set[str] = set()  # arrays and records that were named in this block

    @property
    def result(self) -> Results:
        """What is returned."""
        return Results(tuple(self.kinds[f"return {k}"] for k in range(self.returned or 0)))

    def argument(self, name: str, value: Value) -> None:
        """Give an argument its value."""
        self.env[name] = value
        if isinstance(value.type, Number):
            self.kinds.setdefault(name, value.type.kind)
            self._open.add(name)

    # --- blocks ---

    def block(self, statements: Sequence[ast.stmt]) -> list[str]:
        """Lines of a block."""
        outer, self.lines = self.lines, []
        env, opened, here = dict(self.env), set(self._open), self._here
        self._here = set()
        for statement in statements:
            self.statement(statement)
        lines, self.lines, self._here = self.lines, outer, here
        # What is declared in a block ends with it.
        at_top = self._open - self.names.local
        self.env = {name: variable for name, variable in self.env.items() if name in at_top} | env
        self._open = opened | at_top
        return lines

    def statement(self, node: ast.stmt) -> None:
        """Translate one statement."""
        method = getattr(self, f"_{type(node).__name__.lower()}", None)
        if method is None:
            raise self.refused(node, "a statement that is not translated")
        method(node)

    def _pass(self, node: ast.Pass) -> None:
        pass

    def _break(self, node: ast.Break) -> None:
        self.lines.append("break;")

    def _continue(self, node: ast.Continue) -> None:
        self.lines.append("continue;")

    def _expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            return
        value = self.value(node.value)
        if value.acts:
            self.lines.append(f"{value.text};")

    def _if(self, node: ast.If) -> None:
        test = self.test(node.test)
        self.branch(test.text, self.block(node.body), self.block(node.orelse))

    def _while(self, node: ast.While) -> None:
        if node.orelse:
            raise self.refused(node, "a loop with an else")
        ((test, before),) = self.with_statements(self.test, [node.test])
        head = f"while ({test.text}) {{"
        leave: list[str] = []
        if before or test.known:
            head = "for (;;) {"
            leave = (
                before if test.known else [*before, f"if (!({test.text})) {{", "    break;", "}"]
            )
        self.lines += [head, *_indent([*leave, *self.block(node.body)]), "}"]

    def _for(self, node: ast.For) -> None:
        call, target = node.iter, node.target
        if not (isinstance(call, ast.Call) and self.object(call.func) is range) or node.orelse:
            raise self.refused(node, "a loop that is not over a range")
        if not isinstance(target, ast.Name) or target.id in {*self.names.assigned, *self.env}:
            raise self.refused(node, "a counter that has a value elsewhere, or no name")
        ends = [self._index(argument) for argument in call.args]
        if len(ends) == 1:
            ends = [number(0), *ends]
        first, last = ends[0], self.temporary(ends[1]) if self._moves(ends[1]) else ends[1]
        step = ends[2].known if len(ends) == 3 else 1
        if not isinstance(step, int) or step == 0:
            raise self.refused(node, "a range with a step that is not known in advance")
        name = name_in_c(target.id)
        advance = {1: f"{name}++", -1: f"{name}--"}.get(step, f"{name} += {step}")
        low = last.known is not None and last.known >= -1
        self.env[target.id] = Value(Number(INT), name, natural=first.natural if step > 0 else low)
        body = self.block(node.body)
        del self.env[target.id]
        stays = f"{name} {'<' if step > 0 else '>'} {last.operand}"
        self.lines.append(f"for (int {name} = {first.text}; {stays}; {advance}) {{")
        self.lines += [*_indent(body), "}"]

    def _moves(self, end: Value) -> bool:
        """Whether a loop may change its own end."""
        within = set(re.findall(r"[A-Za-z_]\w*", end.text))
        changing = {
            name_in_c(variable) for variable, count in self.names.assigned.items() if count > 1
        }
        return end.known is None and (end.reads or bool(within & changing))

    def _return(self, node: ast.Return) -> None:
        returned = () if node.value is None else self.resolve(node.value)
        values = returned if isinstance(returned, tuple) else (returned,)
        if not all(isinstance(value.type, Number) for value in values):
            raise self.refused(node, "a result that is no number")
        if self.returned not in (None, len(values)):
            raise self.refused(node, "a result of another size than before")
        self.returned = len(values)
        for k, value in enumerate(values):
            self._widen(f"return {k}", value.kind)
        if len(values) > 1:
            listed = ", ".join(value.text for value in values)
            self.lines.append(f"return ({self.result.name}){{{listed}}};")
        else:
            self.lines.append(f"return {values[0].text};" if values else "return;")

    # --- assignments ---

    def _assign(self, node: ast.Assign) -> None:
        (first, *others) = node.targets
        if isinstance(first, ast.Tuple):
            if others:
                raise self.refused(node, "a tuple that is assigned twice")
            self._assign_several(node, first)
            return
        if not others and self._decide(first, node.value):
            return
        value = self.value(node.value)
        if others and value.known is None and isinstance(value.type, Number):
            value = self.temporary(value)
        for target in node.targets:
            self._store(target, value)

    def _decide(self, target: ast.expr, value: ast.expr) -> bool:
        """`status = status or ...`, without a second variable; whether it was that."""
        if not isinstance(target, ast.Name) or not isinstance(value, ast.BoolOp):
            return False
        first, *later = value.values
        used = {n.id for statement in later for n in ast.walk(statement) if isinstance(n, ast.Name)}
        if target.id in used:
            return False
        (start, before), *others = self.with_statements(self.number, [first, *later])
        if {INT} != {value.kind for value, _ in [(start, before), *others]}:
            return False
        self.lines += before
        name = self._give(target.id, start, constant=False)
        self.decide(value.op, name, others)
        return True

    def _give(self, name: str, value: Value, constant: bool) -> str:
        """Give a variable a value, and declare it where that is due; its name in C."""
        kind, written = self._widen(name, value.kind), name_in_c(name)
        if name in self.names.local and name not in self._open:
            fixed = "const " * (constant and self.names.assigned[name] == 1)
            self.lines.append(f"{fixed}{c_number(kind)} {written} = {value.text};")
        elif value.text != written:
            self.lines.append(f"{written} = {value.text};")
        if name not in self.names.local and name not in self._open:
            self.declared.append(f"{c_number(kind)} {written} = 0;")
        self._open.add(name)
        self.env[name] = Value(Number(kind), written)
        return written

    def _widen(self, name: str, kind: str) -> str:
        known = self.kinds.get(name)
        wider = kind if known is None else common(known, kind)
        self.kinds[name] = wider
        self.changed = self.changed or known not in (None, wider)
        return wider

    def _assign_several(self, node: ast.Assign, target: ast.Tuple) -> None:
        assigned = self.resolve(node.value)
        values = list(assigned) if isinstance(assigned, tuple) else self._parts(node, assigned)
        if len(values) != len(target.elts):
            raise self.refused(node, "another number of values than of names")
        written = {elt.id for elt in target.elts if isinstance(elt, ast.Name)}
        read = {n.id for n in ast.walk(node.value) if isinstance(n, ast.Name)}
        if len(written) < len(target.elts) or written & read:
            # A later value may stand where an earlier one goes.
            values = [self.temporary(value) if self._is_open(value) else value for value in values]
        for elt, value in zip(target.elts, values, strict=True):
            self._store(elt, value)

    @staticmethod
    def _is_open(value: Value) -> bool:
        return isinstance(value.type, Number) and value.known is None

    def _parts(self, node: ast.Assign, value: Value) -> list[Value]:
        """Numbers of a call that gives several."""
        if not isinstance(value.type, Results):
            raise self.refused(node, "one value for several names")
        self._temporaries += 1
        name = f"given{self._temporaries}"
        self.lines.append(f"{declaration(value.type, name)} = {value.text};")
        return [Value(Number(kind), f"{name}.part{k}") for k, kind in enumerate(value.type.kinds)]

    def _store(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self._name_it(target, value)
        elif isinstance(target, ast.Subscript) and isinstance(value.type, Number):
            value = self.temporary(value) if value.acts else value
            place = self._place(target)
            self.lines.append(f"{place.text} = {_conversion(place, value)};")
        else:
            raise self.refused(target, "what is not assigned to, or no number that is assigned")

    def _place(self, target: ast.Subscript) -> Value:
        """An element that is assigned to."""
        of, place = self.resolve(target.value), self.value(target)
        if isinstance(of, tuple) or not isinstance(of.type, Array):
            raise self.refused(target, "what is no array")
        if not isinstance(place.type, Number):
            raise self.refused(target, "a part of an array that is assigned to")
        if of.type.constant:
            raise self.refused(target, "what the law may only read, but is assigned to")
        self.acts = True
        return place

    def _name_it(self, target: ast.Name, value: Value) -> None:
        if isinstance(value.type, Results):
            raise self.refused(target, "no number, or several, under one name")
        if not isinstance(value.type, Number):
            self._alias(target, value)
        elif self.names.assigned[target.id] == 1 and value.known is not None:
            self.env[target.id] = value
        else:
            self._give(target.id, value, constant=True)
            if self.names.assigned[target.id] == 1:
                self.env[target.id] = replace(self.env[target.id], natural=value.natural)

    def _alias(self, target: ast.Name, value: Value) -> None:
        """A name for an array or a record."""
        name = name_in_c(target.id)
        if target.id in self._here:
            self._temporaries += 1
            name = f"{name}_{self._temporaries}"
        elif target.id in self.env or target.id in self._open:
            raise self.refused(
                target, "an array whose name has another meaning outside of a branch"
            )
        sizes = tuple(
            self.temporary(size) if size.known is None and self._moves(size) else size
            for size in value.sizes
        )
        self._here.add(target.id)
        self.lines.append(f"{declaration(value.type, name)} = {value.address};")
        self.env[target.id] = Value(value.type, name, sizes=sizes)

    def _augassign(self, node: ast.AugAssign) -> None:
        value = self.number(node.value)
        if isinstance(node.target, ast.Name):
            place = self.number(ast.copy_location(ast.Name(node.target.id, ast.Load()), node))
        elif isinstance(node.target, ast.Subscript):
            place = self._place(node.target)
        else:
            raise self.refused(node, "what cannot be assigned to")
        sign = {ast.Add: "+=", ast.Sub: "-=", ast.Mult: "*=", ast.Div: "/="}.get(type(node.op))
        before = place
        if value.acts:
            before, value, sign = self.temporary(place), self.temporary(value), None
        after = self._operation(node, node.op, before, value)
        if isinstance(node.target, ast.Name):
            kind = self._widen(node.target.id, after.kind)
            place = self.env[node.target.id] = Value(Number(kind), place.text)
        if sign is None or place.kind != DOUBLE:
            self.lines.append(f"{place.text} = {_conversion(place, after)};")
        else:
            self.lines.append(f"{place.text} {sign} {value.text};")


def _conversion(place: Value, value: Value) -> str:
    whole = place.kind != DOUBLE and value.kind == DOUBLE
    return f"(int){value.operand}" if whole else value.text


def _indent(lines: Sequence[str]) -> list[str]:
    return [f"    {line}" for line in lines]


_MOST_PASSES = 9  # a kind widens twice at most, and only some variables depend on each other


@dataclass(frozen=True)
class Primitive:
    """A function that is written in C."""

    name: str  # in C
    arguments: int  # how many it takes


@dataclass(frozen=True)
class _Translated:
    name: str
    result: Results
    acts: bool


class Program:
    """All functions that a law calls, in C.

    Parameters
    ----------
    primitives : functions that are written in C; they return a status.
    """

    def __init__(self, primitives: dict[FunctionType, Primitive]) -> None:
        self._primitives = primitives
        self._done: dict[tuple[FunctionType, tuple[Type, ...]], _Translated | None] = {}
        self._texts: dict[str, str] = {}  # by name in C
        self._structs: dict[str, str] = {}

    def text(self, name: str) -> str:
        """C of a function and of all that it calls, each before those that call it."""
        needed, texts = {name}, []
        for own, text in reversed(self._texts.items()):
            if own in needed:
                needed.update(re.findall(r"\blaw_\w+(?=\()", text))
                texts.append(text)
        return "\n".join([*self._structs.values(), *reversed(texts)])

    def add(self, law: Any, given: Sequence[Type]) -> str:
        """Translate a compiled function for arguments of some types; returns its name in C.

        Raises
        ------
        InputError
            If it, or one that it calls, has what is not translated; with file and line.
        """
        function = _function(law)
        assert function is not None, law
        return self._translation_of(function, tuple(given)).name

    def call(
        self, refused: Callable[[str], InputError], called: Any, given: Sequence[Value]
    ) -> Value:
        """A call of a compiled function."""
        function = _function(called)
        if function is None:
            raise refused("a call of what is no compiled function")
        primitive = self._primitives.get(function)
        if primitive is not None:
            if len(given) != primitive.arguments:
                raise refused(f"a call that does not have {primitive.arguments} arguments")
            listed = ", ".join(argument.address for argument in given)
            return Value(Number(INT), f"{primitive.name}({listed})", acts=True)
        if len(given) != function.__code__.co_argcount:
            raise refused(f"a call that does not have {function.__code__.co_argcount} arguments")
        done = self._translation_of(function, tuple(argument.type for argument in given))
        listed = ", ".join(
            text for argument in given for text in (argument.address, *_open_sizes(argument))
        )
        text = f"{done.name}({listed})"
        of = Number(done.result.kinds[0]) if len(done.result.kinds) == 1 else done.result
        return Value(of, text, reads=True, acts=done.acts)

    def _translation_of(self, function: FunctionType, given: tuple[Type, ...]) -> _Translated:
        key = function, given
        if key not in self._done:
            self._done[key] = None
            self._done[key] = self._translate(function, given)
        done = self._done[key]
        if done is None:
            raise InputError(
                where=f"{function.__code__.co_filename}, line {function.__code__.co_firstlineno}",
                found=f"'{function.__name__}', which calls itself",
                expected="functions that do not, since memory of an FMU is fixed",
                remedy="write a loop",
            )
        return done

    def _translate(self, function: FunctionType, given: tuple[Type, ...]) -> _Translated:
        tree, where = _source(function)
        kinds: dict[str, str] = {}
        for _ in range(_MOST_PASSES):
            body = _Body(self, tree, where, function.__globals__, kinds)
            signature = _arguments(body, tree, given)
            lines = body.block(tree.body)
            if not body.changed:
                break
        result = body.result
        if len(result.kinds) > 1:
            self._structs[result.name] = result.definition
        name = self._name(function)
        lines = _without_unused([*body.declared, *lines])
        text = "\n".join(lines)
        used = [
            f"(void){parameter};"
            for parameter in signature
            if not re.search(rf"\b{parameter}\b", text)
        ]
        shown = ", ".join(signature.values()) or "void"
        says = (inspect.getdoc(function) or "").split("\n")[0]
        self._texts[name] = "\n".join(
            [
                *_comment(f"{function.__module__}.{function.__name__}: {says}".rstrip(": ")),
                f"static {result.name} {name}({shown}) {{",
                *(f"    {line}" for line in [*used, *lines]),
                "}",
                "",
            ]
        )
        return _Translated(name, result, body.acts)

    def _name(self, function: FunctionType) -> str:
        base = f"law_{function.__name__.strip('_')}"
        taken = {function.name for function in self._done.values() if function is not None}
        if base not in taken:
            return base
        return next(
            candidate for k in range(2, len(taken) + 3) if (candidate := f"{base}_{k}") not in taken
        )


class _Body(Statements):
    """A body that calls functions of a program."""

    def __init__(
        self,
        program: Program,
        function: ast.FunctionDef,
        where: Callable[[ast.AST], str],
        names: dict[str, Any],
        kinds: dict[str, str],
    ) -> None:
        super().__init__(function, where, names, kinds)
        self._program = program

    def called(self, node: ast.Call, function: Any, given: Sequence[Value]) -> Value:
        result = self._program.call(lambda found: self.refused(node, found), function, given)
        self.acts = self.acts or result.acts
        return result


def _function(called: Any) -> FunctionType | None:
    """The Python behind a compiled function."""
    function = getattr(called, "py_func", None)
    return function if isinstance(function, FunctionType) else None


def _source(function: FunctionType) -> tuple[ast.FunctionDef, Callable[[ast.AST], str]]:
    """The tree of a function, and where a part of it stands."""
    code = function.__code__
    try:
        text, first = inspect.getsourcelines(function)
    except OSError:
        raise InputError(
            where=f"{function.__module__}.{function.__name__}",
            found="no source of this function",
            expected="a module in a file, of which C is made",
            remedy="write it to a file",
        ) from None
    (tree,) = ast.parse(textwrap.dedent("".join(text))).body
    assert isinstance(tree, ast.FunctionDef)
    file = Path(code.co_filename)

    def where(node: ast.AST) -> str:
        return f"{file}, line {first - 1 + getattr(node, 'lineno', 1)}"

    return tree, where


def _arguments(body: Statements, tree: ast.FunctionDef, given: Sequence[Type]) -> dict[str, str]:
    """Give a body its arguments; their declarations by name in C."""
    declarations = {}
    for argument, type_ in zip(tree.args.args, given, strict=True):
        name = name_in_c(argument.arg)
        sizes: list[Value] = []
        declarations[name] = declaration(type_, name)
        if isinstance(type_, Number) and body.names.assigned[argument.arg] > 1:
            declarations[name] = declarations[name].removeprefix("const ")
        for axis, size in enumerate(type_.shape if isinstance(type_, Array) else ()):
            if size is None:
                size_name = f"{name}_size{axis}"
                declarations[size_name] = f"const int {size_name}"
                sizes.append(Value(Number(INT), size_name, natural=True))
            else:
                sizes.append(number(size))
        body.argument(argument.arg, Value(type_, name, sizes=tuple(sizes)))
    return declarations


def _comment(text: str) -> list[str]:
    """A comment of C."""
    first, *others = textwrap.wrap(text.replace("*/", ""), 94)
    lines = [f"/* {first}", *(f" * {line}" for line in others)]
    return [*lines[:-1], f"{lines[-1]} */"]


def _open_sizes(value: Value) -> list[str]:
    """Sizes that a function must be told."""
    return [size.text for size in value.sizes if size.known is None]


def _without_unused(lines: list[str]) -> list[str]:
    """The lines without names that nothing uses, as a size that is known now needs no array."""
    while True:
        text = "\n".join(lines)
        kept = [
            line
            for line in lines
            if not (
                declared := re.match(
                    r"\s*const \w+ \*?(?:const )?(\w+) = |\s*\w+ \*const (\w+) = ", line
                )
            )
            or len(re.findall(rf"\b{declared[1] or declared[2]}\b", text)) > 1
            or "law_" in line
            or "plant_" in line
        ]
        if len(kept) == len(lines):
            return kept
        lines = kept
