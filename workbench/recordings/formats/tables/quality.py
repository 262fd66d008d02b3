"""Columns that say which samples of another one are good."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence

from workbench.recordings.formats.tables.cells import Label, is_clock

# A column that says which samples of another one, or of the one beside it, are good; words that
# say so, and the code of OPC from which on samples are.
_VALID = ("validity", "valid", "g\u00fcltig", "gueltig")
_VERDICT = re.compile(
    r"((?!is[ _])(?P<own>.+?)[ _.])?(?P<word>quality|qual|qualit\u00e4t|status|flag"
    rf"|(is[ _]?)?({'|'.join(_VALID)})"
    r"|(?<=_)q)([ _]?(code|flag))?",
    re.IGNORECASE,
)
_OF_MACHINES = ("status", "flag")  # unless they say of one column that it is good
_FEW_STATES = 3  # more are no verdicts, but a measure
_GOOD, _OPC_GOOD = frozenset(("good", "ok", "valid", "gut", "true", "g")), 192
_BAD = frozenset(("bad", "uncertain", "invalid", "error", "fault", "schlecht", "unsicher"))


def leave_out_bad(
    labels: Sequence[Label], columns: Sequence[Sequence[str]], numbers: dict[int, list[str]]
) -> Iterator[tuple[int, str, str]]:
    """Empty the cells that another column calls bad, as servers of plants do; say of which.

    And what may be verdicts of another column, which somebody must say.
    """
    verdicts = {
        i: match for i, (name, _) in enumerate(labels) if (match := _VERDICT.fullmatch(name))
    }
    values = [k for k in numbers if k not in verdicts and not is_clock(labels[k], columns[k])]
    for i, match in verdicts.items():
        own = (match["own"] or "").casefold()
        judged = [
            k
            for k in values
            if (labels[k][0].casefold() == own if own else len(verdicts) == 1 or k == i - 1)
        ]
        states = [cell.strip().casefold() for cell in columns[i]]
        counts = Counter(filter(None, states)).most_common(_FEW_STATES + 1)
        unclear = _is_of_machine(states, match["word"])
        good = _good_states(states, match["word"])
        bad = [k for k, state in enumerate(states) if state and state not in good]
        if not judged or not bad or (unclear and (not own or len(counts) > _FEW_STATES)):
            continue
        if unclear:
            codes = ", ".join(sorted(state for state, _ in counts))
            yield from ((k, "", f"'{labels[i][0]}' beside it with {codes}") for k in judged)
            continue
        left = set(bad) if good else set()
        called = f"{len(bad)} samples that '{labels[i][0]}' calls {columns[i][bad[0]]!r} are gaps"
        unknown = f"'{labels[i][0]}' may tell good samples from bad ones; all were taken"
        for k in judged:
            numbers[k] = ["" if n in left else cell for n, cell in enumerate(numbers[k])]
            yield k, called if good else unknown, ""


def _is_of_machine(states: Sequence[str], word: str) -> bool:
    """Whether states, in a column of some name, may be those of a machine."""
    words = {_first_word(state) for state in states if state}
    return word.casefold() in _OF_MACHINES and not (words <= _GOOD | _BAD or "good" in words)


def _good_states(states: Sequence[str], word: str) -> set[str]:
    """States of good samples; of few codes that are not known, what most samples have."""
    good = {state for state in states if _is_good(state, word)}
    counts = Counter(filter(None, states)).most_common(_FEW_STATES + 1)
    usual = len(counts) in range(1, _FEW_STATES + 1) and 2 * counts[0][1] > len(states)
    return good or ({counts[0][0]} if usual else set())


def _is_good(state: str, word: str) -> bool:
    """Whether a state, in a column of some name, says that a sample is good."""
    is_valid = state == "1" and word.casefold().endswith(_VALID)
    of_opc = state.isdecimal() and int(state) & _OPC_GOOD == _OPC_GOOD
    return _first_word(state) in _GOOD or is_valid or of_opc


def _first_word(state: str) -> str:
    """What a state begins with: Good, Local Override is a good one."""
    return re.split(r"[\W_]", state, maxsplit=1)[0]
