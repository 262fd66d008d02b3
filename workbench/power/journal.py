"""Verdicts on sets of recordings, one line of a file each, which a killed run leaves whole."""

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from workbench.diagnosis import Diagnosis
from workbench.errors import InputError
from workbench.files import write_whole
from workbench.power.planting import Planting, Repertoire


@dataclass(frozen=True)
class Named:
    """A cause that was named.

    Attributes
    ----------
    parameters : (value, low, high) by name, SI.
    """

    effect: str
    parameters: Mapping[str, tuple[float, float, float]]
    confusable_with: tuple[str, ...]

    @property
    def group(self) -> set[str]:
        """All effects that this may be, by its own account."""
        return {self.effect, *self.confusable_with}


@dataclass(frozen=True)
class Diagnosed:
    """What was said of one set of recordings.

    Attributes
    ----------
    verdict : of the diagnosis, or "failed".
    causes : strongest first.
    before, after : held-out error of both models, None if nothing was found.
    seconds : of computing.
    error : why it failed.
    clearness : size that was planted, over the standard deviation of its estimate about the
        nominal model; None if that was not one effect of the catalogue.
    """

    planting: Planting
    verdict: str
    causes: tuple[Named, ...]
    before: float | None
    after: float | None
    seconds: float
    error: str = ""
    clearness: float | None = None

    @property
    def first(self) -> str:
        """What is said first: the strongest cause, or the verdict."""
        return self.causes[0].effect if self.causes else self.verdict


def diagnosed(
    planting: Planting, diagnosis: Diagnosis, repertoire: Repertoire, seconds: float
) -> Diagnosed:
    """Keep what statistics need of a diagnosis."""
    causes = tuple(
        Named(
            cause.effect.name,
            {
                name: (float(one.value), float(one.low), float(one.high))
                for name, one in cause.parameters.items()
            },
            cause.confusable_with,
        )
        for cause in diagnosis.causes
    )
    gain = diagnosis.gain
    before, after = (None, None) if gain is None else (gain.before, gain.after)
    clearness = _clearness(planting, diagnosis, repertoire)
    return Diagnosed(
        planting, diagnosis.verdict, causes, before, after, seconds, clearness=clearness
    )


def _clearness(planting: Planting, diagnosis: Diagnosis, repertoire: Repertoire) -> float | None:
    if planting.kind != "single":
        return None
    ((name, gain),) = planting.gains.items()
    planted = repertoire.plantable(name)
    sigmas = [
        score.sigma
        for score in diagnosis.scores
        if score.effect.name == planted.effect and dict(score.shape) == dict(planted.shapes)
    ]
    return float(abs(gain) / sigmas[0]) if sigmas else None


class Journal:
    """A file of verdicts: a line that says what they depend on, then one line for each set.

    Parameters
    ----------
    identity : all that a verdict depends on; only verdicts of the same may stand together.
    resume : whether to go on from what is there, instead of beginning anew.

    Attributes
    ----------
    results : in the order of the file.

    Raises
    ------
    InputError
        If the file is no journal, or one of other verdicts.
    """

    def __init__(self, path: Path, identity: Mapping[str, Any], *, resume: bool) -> None:
        self.results: list[Diagnosed] = []
        self._path = path
        if resume and path.exists():
            self._read(identity)
        lines = [json.dumps(identity), *(_line(one) for one in self.results)]
        write_whole(path, "".join(f"{line}\n" for line in lines))

    def append(self, result: Diagnosed) -> None:
        """Add a verdict; it is on the disk when this returns."""
        self.results.append(result)
        with self._path.open("a") as file:
            file.write(_line(result) + "\n")
            file.flush()
            os.fsync(file.fileno())

    def _read(self, identity: Mapping[str, Any]) -> None:
        # What follows the last line feed was being written when the run was killed.
        head, *lines = self._path.read_text().split("\n")[:-1] or [""]
        try:
            found = json.loads(head)
            self.results = [_result(json.loads(line)) for line in lines]
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(
                where=str(self._path),
                found=f"no verdicts ({error})",
                expected="what an earlier run wrote",
                remedy="remove the file, or run without --resume",
            ) from None
        if found != identity:
            other = next((key for key in identity if found.get(key) != identity[key]), "more")
            raise InputError(
                where=str(self._path),
                found=f"verdicts of another run (other: {other})",
                expected="the same seed, recordings, FMUs and code",
                remedy="give another --out, or run without --resume",
            )


def _line(result: Diagnosed) -> str:
    return json.dumps(asdict(result))


def _result(content: dict[str, Any]) -> Diagnosed:
    causes = tuple(
        Named(
            one["effect"],
            {name: tuple(values) for name, values in one["parameters"].items()},
            tuple(one["confusable_with"]),
        )
        for one in content["causes"]
    )
    planted = content["planting"]
    planting = Planting(**{**planted, "effects": tuple(planted["effects"])})
    return Diagnosed(**{**content, "planting": planting, "causes": causes})
