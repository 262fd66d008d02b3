"""Statements of laws in C."""

import ast
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from workbench.observers.export.translation.expressions import Expressions
from workbench.observers.export.translation.values import (
    DOUBLE,
    INT,
    Array,
    Number,
    Results,
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
        (start, before), *rest = self.with_statements(self.number, [first, *later])
        if {INT} != {value.kind for value, _ in [(start, before), *rest]}:
            return False
        self.lines += before
        name = self._give(target.id, start, constant=False)
        self.decide(value.op, name, rest)
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
