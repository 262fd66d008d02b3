"""Reader of Modelica source: the structure of classes alone.

Equations are passed over, and values are kept as text. What cannot be read is refused with its
file and line.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NamedTuple

from workbench.errors import InputError
from workbench.models.modelica.classes import Class, Component, Connection, Extends, Modifier

_TOKEN = re.compile(
    r"(?P<gap>\s+|//[^\n]*|/\*.*?\*/)"
    r'|(?P<string>"(?:[^"\\]|\\.)*")'
    r"|(?P<name>[A-Za-z_]\w*|'(?:[^'\\]|\\.)+')"
    r"|(?P<number>\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)"
    r"|(?P<sign>:=|==|<=|>=|<>|\.[-+*/^]|/(?!\*)|[-+*^=<>()\[\]{},;:.])",
    re.ASCII | re.DOTALL,
)
_ESCAPED = {"n": "\n", "t": "\t", "r": "\r", "a": "\a", "b": "\b", "f": "\f", "v": "\v"}
# fmt: off
KINDS = frozenset({
    "class", "model", "block", "record", "connector", "type", "package", "function", "operator",
})
CLASS_PREFIXES = frozenset({"encapsulated", "partial", "pure", "impure", "expandable"})
PREFIXES = frozenset({
    "redeclare", "final", "inner", "outer", "replaceable", "flow", "stream", "discrete",
    "parameter", "constant", "input", "output",
})
SECTIONS = frozenset({"equation", "algorithm", "initial"})
# Words that an operand follows, so that a string after them is no description.
OPERATORS = frozenset({"and", "or", "not", "if", "then", "else", "elseif", "for", "in"})
_KEYWORDS = KINDS | CLASS_PREFIXES | PREFIXES | SECTIONS | OPERATORS | {
    "annotation", "break", "connect", "constrainedby", "der", "each", "elsewhen", "end",
    "enumeration", "extends", "external", "false", "import", "loop", "protected", "public",
    "return", "true", "when", "while", "within",
}
# fmt: on
VENDOR = "__Workbench"
EXPERIMENT = ("StartTime", "StopTime", "Interval", "Tolerance")
_BLOCKS = frozenset({"if", "for", "when", "while"})
_PROPAGATION = frozenset({"each", "final"})
LONGEST = 4096  # characters of a name; checks look at each as a beginning, and people never do
DEEPEST = 100  # brackets or classes within each other; people give up long before
CLOSING = {"(": ")", "[": "]", "{": "}"}


class Token(NamedTuple):
    """Its kind, its text as written, and where that begins and ends in the file.

    Kinds are string, name, number, sign; `end` comes once, after the last one.
    """

    kind: str
    text: str
    start: int
    end: int


class Cursor:
    """A place among the tokens of a file; comments are none.

    Raises
    ------
    InputError
        In all methods, with file and line, if the file goes on otherwise than they ask for.
    """

    def __init__(self, file: Path, text: str) -> None:
        self._file, self._text = file, text
        self._tokens: list[Token] = []
        self._next, at, depth = 0, 0, 0
        while at < len(text):
            match = _TOKEN.match(text, at)
            if match is None:
                self._tokens = [Token("error", text[at:].split("\n")[0][:30], at, at)]
                raise self.refusal(
                    "Modelica, whose names have the letters a to z; a string or a comment may lack "
                    "its end"
                )
            if match.lastgroup != "gap":
                self._tokens.append(Token(str(match.lastgroup), match[0], at, match.end()))
                if match.lastgroup == "name" and len(match[0]) > LONGEST:
                    self._next = len(self._tokens) - 1
                    raise self.refusal(f"names of at most {LONGEST} characters")
                depth += (match[0] in CLOSING) - (match[0] in CLOSING.values())
                if depth > DEEPEST:
                    self._next = len(self._tokens) - 1
                    raise self.refusal(f"at most {DEEPEST} brackets within each other")
            at = match.end()
        self._tokens.append(Token("end", "the end of the file", at, at))

    @property
    def token(self) -> Token:
        """Next token."""
        return self._tokens[self._next]

    @property
    def following(self) -> Token:
        """Token after the next one."""
        return self._tokens[min(self._next + 1, len(self._tokens) - 1)]

    @property
    def where(self) -> str:
        """File and line of the next token."""
        return f"{self._file}:{self._text.count(chr(10), 0, self.token.start) + 1}"

    def refusal(self, expected: str) -> InputError:
        """What to raise where something else was expected."""
        return InputError(
            where=self.where,
            found=f"'{self.token.text}'" if self.token.kind != "end" else self.token.text,
            expected=expected,
            remedy="correct the source",
        )

    def advance(self) -> Token:
        """Take the next token, whatever it is."""
        token = self.token
        if token.kind == "end":
            raise self.refusal("more")
        self._next += 1
        return token

    def sees(self, text: str) -> bool:
        """Whether a word or sign comes next."""
        return self.token.text == text

    def took(self, text: str) -> bool:
        """Take a word or sign if it comes next; returns whether it did."""
        taken = self.sees(text)
        self._next += taken
        return taken

    def expect(self, text: str) -> None:
        """Take a word or sign, which must come next."""
        if not self.took(text):
            raise self.refusal(f"'{text}'")

    def words(self, words: frozenset[str]) -> frozenset[str]:
        """Take those of some words that come next."""
        begin = self._next
        while self.token.text in words:
            self._next += 1
        return frozenset(token.text for token in self._tokens[begin : self._next])

    def one_of(self, words: frozenset[str]) -> str:
        """Take one of some words, which must come next."""
        if self.token.text not in words:
            raise self.refusal(f"one of {', '.join(sorted(words))}")
        return self.advance().text

    def identifier(self) -> str:
        """Take a name without dots, which must come next."""
        if self.token.text in _KEYWORDS:
            raise InputError(
                where=self.where,
                found=f"'{self.token.text}', a reserved word of Modelica",
                expected="a name",
                remedy="use another name, or correct the source",
            )
        if self.token.kind != "name":
            raise self.refusal("a name")
        return self.advance().text

    def name(self) -> str:
        """Take a dotted name; returns it as written."""
        parts = ["."] if self.took(".") else []
        parts.append(self.identifier())
        while self.sees(".") and self.following.kind == "name":
            self._next += 1
            parts += [".", self.identifier()]
        return "".join(parts)

    def string(self) -> str:
        """Take strings joined by +; returns them without quotes, empty if there is none."""
        text = ""
        while self.token.kind == "string":
            body = self.advance().text[1:-1]
            text += re.sub(r"\\(.)", lambda m: _ESCAPED.get(m[1], m[1]), body, flags=re.DOTALL)
            if not self.took("+"):
                return text
        return text

    def subscripts(self) -> None:
        """Pass over what may be in square brackets."""
        if self.sees("["):
            self.group()

    def group(self) -> None:
        """Pass over what is in brackets, and them."""
        opening = self.advance().text
        if opening not in CLOSING:
            self._next -= 1
            raise self.refusal("'('")
        self.skip(CLOSING[opening])
        self.advance()

    def skip(self, *ends: str) -> str:
        """Pass over what comes before one of some signs, outside of brackets; returns its text."""
        start = self.token.start
        while self.before(*ends):
            self.step()
        return self._text[start : self.token.start].rstrip()

    def step(self) -> None:
        """Pass over the next word or sign, and all in brackets if it opens some."""
        if self.token.text in CLOSING:
            self.group()
        else:
            self.advance()

    def before(self, *ends: str) -> bool:
        """Whether something comes before one of some signs, which must come."""
        if self.token.text in ends:
            return False
        if (
            self.token.kind == "end"
            or self.token.text in CLOSING.values()
            or (self.sees(";") and "]" not in ends)  # which separates rows of a matrix
        ):
            raise self.refusal(" or ".join(f"'{end}'" for end in ends))
        return True


@dataclass
class _Body:
    """What is found in a class while it is read."""

    extends: list[Extends] = field(default_factory=list)
    imports: list[tuple[str, str]] = field(default_factory=list)
    components: list[Component] = field(default_factory=list)
    equations: list[str] = field(default_factory=list)
    connections: list[Connection] = field(default_factory=list)
    annotation: "_Annotation | None" = None


@dataclass
class _Annotation:
    """What the workbench reads of an annotation: its own, and numbers of the experiment."""

    vendor: Mapping[str, Any] = field(default_factory=dict)
    experiment: dict[str, str] = field(default_factory=dict)


class Reader(Cursor):
    """Reads one file, by recursive descent."""

    def __init__(self, file: Path, text: str) -> None:
        super().__init__(file, text)
        self._classes: list[Class] = []
        self._owner = ""  # class that is being read

    def file(self, enclosing: str) -> list[Class]:
        """The class of the file and those within it, in order."""
        within = ""
        if self.took("within"):
            within = "" if self.sees(";") else self.name()
            self.expect(";")
        if within != enclosing:
            raise InputError(
                where=f"{self._file}:1",
                found=f"'within {within};'" if within else "no 'within'",
                expected=f"'within {enclosing};'" if enclosing else "no 'within'",
                remedy="correct it, or move the file to its package",
            )
        self.took("final")
        self._definition(enclosing, frozenset())
        self.expect(";")
        if self.token.kind != "end":
            raise self.refusal("one class in a file, and others within it")
        return self._classes

    # --- classes ---

    def _definition(self, enclosing: str, prefixes: frozenset[str]) -> None:
        prefixes |= self.words(CLASS_PREFIXES)
        if enclosing.count(".") > DEEPEST:
            raise self.refusal(f"at most {DEEPEST} classes within each other")
        kind = self.one_of(KINDS)
        if kind == "operator" and self.token.text in ("function", "record"):
            kind = self.advance().text
        where, place = self.where, len(self._classes)
        if self.sees("extends"):
            raise InputError(
                where=where,
                found=f"'{kind} extends {self.following.text}', which takes what it redeclares as "
                "its base",
                expected="a class that stands by itself",
                remedy=f"write it whole, 'redeclare {kind} {self.following.text}', with what it "
                "inherited",
            )
        short = self.identifier()
        name = f"{enclosing}.{short}" if enclosing else short
        outer, self._owner = self._owner, name
        if self.took("="):
            prefixes |= {"der"} & {self.token.text}  # the derivative of another function
            extends = self._alias()
            description = self.string()
            body = _Body(extends=extends)
            body.annotation = self._annotation() if self.sees("annotation") else None
        else:
            description, body = self.string(), _Body()
            self._composition(name, body)
        self._owner = outer
        annotation = body.annotation or _Annotation()
        constraint, constraining, _ = self._constraint()
        made = Class(
            name=name,
            kind=kind,
            prefixes=prefixes,
            constraint=constraint,
            constraining=constraining,
            description=description,
            extends=tuple(body.extends),
            imports=tuple(body.imports),
            components=tuple(body.components),
            equations=frozenset(body.equations),
            connections=tuple(body.connections),
            vendor=annotation.vendor,
            experiment=annotation.experiment,
            where=where,
        )
        self._classes.insert(place, made)

    def _alias(self) -> list[Extends]:
        """What stands after `type X =`."""
        if self.took("enumeration") or self.took("der"):
            self.group()
            return []
        self.words(PREFIXES)
        return [self._extends()]

    def _extends(self) -> Extends:
        where, base = self.where, self.name()
        self.subscripts()
        return Extends(base, Modifier(inner=self._modifiers()), where)

    def _composition(self, name: str, body: _Body) -> None:
        in_equations, access = False, frozenset[str]()
        short = name.rpartition(".")[2]
        while True:
            word = self.token.text
            if word == "end" and self.following.text == short:
                self.advance()
                self.advance()
                return
            if word in ("public", "protected"):
                access = frozenset({self.advance().text} - {"public"})
                in_equations = False
            elif word == "end" and not in_equations:
                raise self.refusal(f"'end {short}', or more of {short}")
            elif word in SECTIONS:
                self.advance()
                in_equations = True
            elif word == "annotation":
                if body.annotation is not None:
                    raise self.refusal("one annotation of a class")
                body.annotation = self._annotation()
                self.expect(";")
            elif in_equations or word == "external":
                self._statement(body)
            else:
                self._element(name, body, access)

    def _statement(self, body: _Body) -> None:
        left = self.token
        if left.kind == "name" and self.following.text == "=":
            body.equations.append(left.text)
        while self.before(";"):
            where = self.where
            if self.sees("end") and self.following.text not in _BLOCKS:
                raise self.refusal("';'")
            if self.took("connect"):
                body.connections.append(self._connection(where))
            elif self.sees("annotation"):
                self._inner_annotation()
            else:
                self.step()
        self.expect(";")

    def _connection(self, where: str) -> Connection:
        self.expect("(")
        left = self._reference()
        self.expect(",")
        right = self._reference()
        self.expect(")")
        return Connection((left, right), where)

    def _reference(self) -> tuple[str, ...]:
        """Names from component to component, without subscripts."""
        names = [self.identifier()]
        self.subscripts()
        while self.took("."):
            names.append(self.identifier())
            self.subscripts()
        return tuple(names)

    def _element(self, name: str, body: _Body, access: frozenset[str]) -> None:
        if self.took("import"):
            body.imports += self._import()
            self._inner_comment()
        elif self.took("extends"):
            body.extends.append(self._extends())
            self._inner_comment()
        else:
            prefixes = self.words(PREFIXES) | access
            if self.token.text in KINDS | CLASS_PREFIXES:
                self._definition(name, prefixes)
            else:
                body.components += self._components(prefixes)
        self.expect(";")

    def _import(self) -> list[tuple[str, str]]:
        target = self.name()
        if self.took("="):
            return [(target, self.name())]
        if self.took(".*"):
            return [("*", target)]
        if self.took("."):
            self.expect("{")
            names = [self.identifier()]
            while self.took(","):
                names.append(self.identifier())
            self.expect("}")
            return [(name, f"{target}.{name}") for name in names]
        return [(target.rpartition(".")[2], target)]

    def _components(self, prefixes: frozenset[str]) -> list[Component]:
        declared = self.name()
        self.subscripts()
        components = [self._component(declared, prefixes)]
        while self.took(","):
            components.append(self._component(declared, prefixes))
        return self._with_constraint(components)

    def _with_constraint(self, components: list[Component]) -> list[Component]:
        constraint, constraining, description = self._constraint()
        return [
            replace(
                component,
                constraint=constraint,
                constraining=constraining,
                description=component.description or description,
            )
            for component in components
        ]

    def _component(self, declared: str, prefixes: frozenset[str]) -> Component:
        where, name = self.where, self.identifier()
        self.subscripts()
        modifier = self._modification(where)
        if self.took("if"):
            self._expression()
        description = self._inner_comment()
        return Component(name, self._owner, declared, prefixes, modifier, description, where)

    def _constraint(self) -> tuple[str, Modifier, str]:
        """Constraining class, its modifier, and description; empty where there is none."""
        if not self.took("constrainedby"):
            return "", Modifier(), ""
        where, name = self.where, self.name()
        modifier = Modifier(inner=self._modifiers(), where=where)
        return name, modifier, self._inner_comment()

    # --- modifiers and values ---

    def _modification(self, where: str, final: bool = False) -> Modifier:
        inner = self._modifiers()
        given = self.took("=") or self.took(":=")
        return Modifier(self._expression() if given else "", inner, where, final)

    def _modifiers(self) -> dict[str, Modifier]:
        inner: dict[str, Modifier] = {}
        if not self.took("(") or self.took(")"):
            return inner
        while True:
            where, prefixes = self.where, self.words(PREFIXES | _PROPAGATION)
            if prefixes & {"redeclare", "replaceable"}:
                component = self._redeclaration(prefixes)
                name, made = component.name, Modifier("", {}, where, "final" in prefixes, component)
            else:
                name = self.name()
                made = self._modification(where, "final" in prefixes)
                self.string()
            if name in inner:
                raise InputError(
                    where=where,
                    found=f"a second modifier of '{name}'",
                    expected=f"one, which is in {inner[name].where}",
                    remedy="remove one of the two",
                )
            inner[name] = made
            if self.took(")"):
                return inner
            self.expect(",")

    def _redeclaration(self, prefixes: frozenset[str]) -> Component:
        """What is redeclared in a modifier; of a class the prefixes tell its kind."""
        kind = self.words(CLASS_PREFIXES | KINDS)
        if kind:
            where, name = self.where, self.identifier()
            self.expect("=")
            (base,) = self._alias() or [Extends("", Modifier(), where)]
            component = Component(
                name=name,
                owner=self._owner,
                type=base.name,
                prefixes=prefixes | kind,
                modifier=base.modifier,
                description=self._inner_comment(),
                where=where,
            )
        else:
            declared = self.name()
            self.subscripts()
            component = self._component(declared, prefixes)
        return self._with_constraint([component])[0]

    def _expression(self) -> str:
        """Text up to what cannot be of the same expression."""
        start, complete = self.token.start, False
        while True:
            kind, text = self.token.kind, self.token.text
            if text in CLOSING:
                self.group()
                complete = True
            elif text in (",", ";", ")", "annotation", "constrainedby") or (
                complete and (kind == "string" or text == "if")
            ):
                break
            else:
                self.advance()
                complete = kind in ("number", "string") or (
                    kind == "name" and text not in OPERATORS
                )
        if not complete:
            raise self.refusal("the rest of an expression")
        return self._text[start : self._tokens[self._next - 1].end]

    def _inner_comment(self) -> str:
        """Read the comment of what is inside a class; returns its description."""
        description = self.string()
        if self.sees("annotation"):
            self._inner_annotation()
        return description

    def _inner_annotation(self) -> None:
        """Pass over an annotation inside a class.

        One of the workbench is the class's: the ';' before it is missing, which would drop it.
        """
        misplaced = self.refusal("';' before the annotation of the class")
        annotation = self._annotation()
        if annotation.vendor or annotation.experiment:
            raise misplaced

    def _annotation(self) -> _Annotation:
        """Read what the workbench uses of an annotation; pass over all else."""
        annotation = _Annotation()
        self.expect("annotation")
        self.expect("(")
        while not self.took(")"):
            if self.took(VENDOR):
                annotation.vendor = self._tree()
            elif self.sees("experiment") and self.following.text == "(":
                self.advance()
                annotation.experiment = self._texts()
            else:
                self._refuse_misspelled(VENDOR, "experiment")
                self.skip(",", ")")
            if not self.sees(")"):
                self.expect(",")
        return annotation

    def _refuse_misspelled(self, *known: str) -> None:
        """Refuse a name that is nearly one of some: nobody would read it."""
        names = {name.lower(): name for name in known}
        if self.token.text in known:
            return
        if near := get_close_matches(self.token.text.lower(), names, n=1, cutoff=0.8):
            raise self.refusal(f"'{names[near[0]]}'")

    def _texts(self) -> dict[str, str]:
        """Values of an experiment by name, as they are written."""
        texts: dict[str, str] = {}
        self.expect("(")
        while not self.took(")"):
            self._refuse_misspelled(*EXPERIMENT)
            name = self.identifier()
            texts[name] = self.skip(",", ")").removeprefix("=").strip()
            self.took(",")
        return texts

    def _tree(self) -> dict[str, Any]:
        tree: dict[str, Any] = {}
        self.expect("(")
        while True:
            if (key := self.identifier()) in tree:
                raise self.refusal(f"one '{key}'")
            if self.sees("("):
                tree[key] = self._tree()
            else:
                self.expect("=")
                tree[key] = self._literal()
            if self.took(")"):
                return tree
            self.expect(",")

    def _literal(self) -> Any:
        if self.token.kind == "string":
            return self.string()
        if self.took("{"):
            values = [self._literal()]
            while self.took(","):
                values.append(self._literal())
            self.expect("}")
            return tuple(values)
        for word, value in (("true", True), ("false", False)):
            if self.took(word):
                return value
        sign = -1.0 if self.took("-") else 1.0
        if self.token.kind != "number":
            raise self.refusal("a number, a string, true, false or an array of them")
        return sign * float(self.advance().text)
