"""Tokens of Modelica source, and a place among them."""

import re
from pathlib import Path
from typing import NamedTuple

from workbench.errors import InputError

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
                raise self.refusal("Modelica; a string or a comment may lack its end")
            if match.lastgroup != "gap":
                self._tokens.append(Token(str(match.lastgroup), match[0], at, match.end()))
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
        if self.token.kind != "name" or self.token.text in _KEYWORDS:
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
