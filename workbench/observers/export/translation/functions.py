"""Compiled functions of Python in C: each once for each set of types that it is called with."""

import ast
import inspect
import re
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FunctionType
from typing import Any

from workbench.errors import InputError
from workbench.observers.export.translation.statements import Statements
from workbench.observers.export.translation.values import (
    INT,
    Array,
    Number,
    Results,
    Type,
    Value,
    declaration,
    name_in_c,
    number,
)

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
