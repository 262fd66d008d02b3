"""Verdicts on sets of recordings, one line of a file each, which a killed run leaves whole."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from workbench.diagnosis import Diagnosis
from workbench.errors import InputError
from workbench.runtime.files import (
    append_line,
    check_checksum,
    previous_path,
    read_text,
    with_checksum,
    write_whole,
)
from workbench.studies.power.planting import Planting, Repertoire


@dataclass(frozen=True)
class NamedCause:
    """A cause that was named."""

    effect: str
    parameters: Mapping[str, tuple[float, float, float]]  # (value, low, high) by name, SI
    confusable_with: tuple[str, ...]

    @property
    def group(self) -> set[str]:
        """All effects that this may be, by its own account."""
        return {self.effect, *self.confusable_with}


@dataclass(frozen=True)
class SetVerdict:
    """Verdict on one set of recordings."""

    planting: Planting
    verdict: str  # of the diagnosis, or "failed"
    causes: tuple[NamedCause, ...]  # strongest first
    # before, after: held-out error of both models, None if nothing was found
    before: float | None
    after: float | None
    seconds: float  # of computing
    error: str = ""  # why it failed
    # size that was planted, over the standard deviation of its estimate about the nominal model;
    # None if that was not one effect of the catalogue
    clearness: float | None = None
    # names of each cause of what is partly explained, strongest first: its own, then its twins'
    parts: tuple[tuple[str, ...], ...] = ()

    @property
    def first(self) -> str:
        """The strongest cause, or the verdict without one."""
        return self.causes[0].effect if self.causes else self.verdict


def verdict_of(
    planting: Planting, diagnosis: Diagnosis, repertoire: Repertoire, seconds: float
) -> SetVerdict:
    """Keep of a diagnosis what statistics need."""
    causes = tuple(
        NamedCause(
            cause.effect.name,
            {
                name: (float(parameter.value), float(parameter.low), float(parameter.high))
                for name, parameter in cause.parameters.items()
            },
            cause.confusable_with,
        )
        for cause in diagnosis.causes * (diagnosis.verdict == "found")
    )
    gain = diagnosis.gain
    before, after = (None, None) if gain is None else (gain.before, gain.after)
    clearness = None
    if planting.kind == "single":
        ((name, size),) = planting.gains.items()
        planted = repertoire.plantable(name)
        if (score := planted.score_of(diagnosis)) is not None:
            clearness = float(abs(size) / score.sigma)
    parts = tuple(
        (cause.effect.name, *cause.confusable_with)
        for cause in diagnosis.causes * (diagnosis.verdict == "partly explained")
    )
    return SetVerdict(
        planting,
        diagnosis.verdict,
        causes,
        before,
        after,
        seconds,
        clearness=clearness,
        parts=parts,
    )


class Journal:
    """A file of verdicts: a line that says what they depend on, then one line for each set.

    Each has a checksum; a line that is damaged is left out, so that its set is diagnosed again, and
    so is a second one on a set. The file that an earlier run left is kept beside it.

    Parameters
    ----------
    identity : all that a verdict depends on; only verdicts of the same may stand together.
    resume : whether to go on from what is there, instead of beginning anew.

    Raises
    ------
    InputError
        If the file is no journal, or one of other verdicts.
    """

    def __init__(self, path: Path, identity: Mapping[str, Any], *, resume: bool) -> None:
        self.results: list[SetVerdict] = []  # in the order of the file
        self.damaged: list[int] = []  # numbers of the lines that were left out
        self._path = path
        if path.exists():
            text = read_text(path, "run without --resume, or give another --out")
            if resume:
                self._parse(text, identity)
            write_whole(previous_path(path), text)
        contents = [identity, *map(asdict, self.results)]
        write_whole(path, "".join(f"{with_checksum(content)}\n" for content in contents))

    def append(self, result: SetVerdict) -> None:
        """Add a verdict; it is on the disk when this returns."""
        self.results.append(result)
        append_line(self._path, with_checksum(asdict(result)))

    def _parse(self, text: str, identity: Mapping[str, Any]) -> None:
        # What follows the last line feed was being written when the run was killed.
        head, *lines = text.split("\n")[:-1] or [""]
        try:
            written = check_checksum(head)
        except (ValueError, RecursionError) as error:
            raise InputError(
                where=f"{self._path}, line 1",
                found=f"no verdicts as they were written ({error})",
                expected="what an earlier run wrote",
                remedy=f"put {previous_path(self._path).name} in its place, if it is there, or run "
                "without --resume",
            ) from None
        if written != identity:
            other = next((key for key in identity if written.get(key) != identity[key]), "more")
            raise InputError(
                where=str(self._path),
                found=f"verdicts of another run (other: {other})",
                expected="the same seed, recordings, FMUs and code",
                remedy="give another --out, or run without --resume",
            )
        for number, line in enumerate(lines, start=2):
            try:
                result = _read_verdict(check_checksum(line))
                if any(earlier.planting == result.planting for earlier in self.results):
                    raise ValueError("a second verdict on a set")
                self.results.append(result)
            except (ValueError, KeyError, TypeError, RecursionError):
                self.damaged.append(number)


def _read_verdict(content: dict[str, Any]) -> SetVerdict:
    causes = tuple(
        NamedCause(
            cause["effect"],
            {name: tuple(values) for name, values in cause["parameters"].items()},
            tuple(cause["confusable_with"]),
        )
        for cause in content["causes"]
    )
    planting = content["planting"]
    planting = Planting(**{**planting, "effects": tuple(planting["effects"])})
    parts = tuple(map(tuple, content["parts"]))
    return SetVerdict(**{**content, "planting": planting, "causes": causes, "parts": parts})
