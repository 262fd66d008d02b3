"""What a class says of itself in an annotation, asked for by type."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from workbench.errors import InputError, unknown_name


@dataclass(frozen=True)
class AnnotationReader:
    """Part of an annotation, whose keys are asked for by type.

    Attributes
    ----------
    where : it stands.
    content : by key.
    """

    where: str
    content: Mapping[str, Any]

    def only(self, *known: str) -> None:
        """Refuse other keys."""
        for key in self.content:
            if key not in known:
                raise unknown_name(
                    key,
                    known,
                    where=self.where,
                    expected=f"some of {', '.join(known)}",
                    remedy="correct or remove it",
                )

    def text(self, key: str, default: str | None = None) -> str:
        """A text, which may be left out if there is a default."""
        return str(self._of(key, str, "a text in quotes", default))

    def number(self, key: str) -> float:
        """A number above 0."""
        value = float(self._of(key, float, "a number above 0", None))
        if value <= 0.0:
            raise self._wrong(key, "a number above 0")
        return value

    def texts(self, key: str) -> tuple[str, ...]:
        """An array of texts."""
        return self._array(key, str, 'an array of texts, such as {"a", "b"}')

    def numbers(self, key: str) -> tuple[float, ...]:
        """An array of numbers, of which none is zero: a fit changes them by shares."""
        expected = "an array of numbers that are not 0, such as {0.5, 1.0}"
        values = self._array(key, float, expected)
        if 0.0 in values:
            raise self._wrong(key, expected)
        return values

    def part(self, key: str) -> "AnnotationReader":
        """What stands in its parentheses."""
        content = self._of(key, dict, f"{key}(...)", None)
        return AnnotationReader(f"{self.where}({key})", content)

    def _array(self, key: str, of: type, expected: str) -> tuple[Any, ...]:
        values = tuple(self._of(key, tuple, expected, None))
        if not all(isinstance(value, of) for value in values):
            raise self._wrong(key, expected)
        return values

    def _of(self, key: str, kind: type, expected: str, default: Any) -> Any:
        value = self.content.get(key, default)
        if not isinstance(value, kind):
            raise self._wrong(key, expected)
        return value

    def _wrong(self, key: str, expected: str) -> InputError:
        value = self.content.get(key)
        return InputError(
            where=self.where,
            found=f"no '{key}'" if value is None else f"{key} = {value!r}",
            expected=expected,
            remedy=f"give '{key}' in the annotation of the class",
        )
