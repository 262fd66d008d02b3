"""Where the names of a function are given a value, and where C declares them."""

import ast
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field


@dataclass
class _Use:
    path: tuple[int, ...]  # of the blocks around
    statement: int
    gives: bool  # by an assignment that is this very statement


@dataclass
class Names:
    """What a function does with its names.

    Attributes
    ----------
    assigned : how often each is given a value, as an argument too; loops' counters left out.
    counters : of loops.
    local : those that C can declare where they are first assigned.
    """

    assigned: Counter[str] = field(default_factory=Counter)
    counters: set[str] = field(default_factory=set)
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
