"""The state of a search after a generation, in one file that is whole at any moment."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.arrays import Matrix, Vector
from workbench.errors import InputError
from workbench.runtime.files import (
    check_checksum,
    previous_path,
    read_text,
    with_checksum,
    write_whole,
)


@dataclass(frozen=True)
class Generation:
    """What one generation came to."""

    z: float  # objective of the best candidate
    # worst, second: cases that decide it: the worst, and the next one
    worst: str
    second: str
    margin: float  # by how much the worst exceeds the next, as a share of z
    candidates: int  # evaluated in this generation
    samples: int  # evaluated for them; `of` would have been needed for the full evaluation
    of: int
    unstable: dict[str, int]  # candidates that diverged or failed, by case
    crashed: int  # candidates that killed their workers or took too long
    seconds: float  # wall time

    @property
    def saved(self) -> float:
        """Share of the work that was not needed."""
        return 1.0 - self.samples / self.of


@dataclass(frozen=True, eq=False)
class Population:
    """Candidates of one generation; the best is the first."""

    members: Matrix  # (s, n) coordinates in 0..1
    z: Vector  # (s,) objective of each
    z_k: Matrix  # (s, k) objective of each in each case


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """Everything that the next generation depends on."""

    identity: str  # hash of what is tuned and how; only the same search may go on from here
    population: Population  # after the last generation of `history`
    converged: bool  # whether more generations gain nothing
    history: tuple[Generation, ...]  # of all generations, the initial one included


def save(checkpoint: Checkpoint, path: Path) -> None:
    """Write a checkpoint in place of the one before, which is kept beside it."""
    with suppress(OSError, InputError):  # there is none, or its folder has gone
        last = path.read_text()
        _parse(last, path)  # a damaged one does not take the place of a sound one
        write_whole(previous_path(path), last)
    population = checkpoint.population
    content = {
        "identity": checkpoint.identity,
        "members": population.members.tolist(),
        "z": population.z.tolist(),
        "z_k": population.z_k.tolist(),
        "converged": checkpoint.converged,
        "history": [vars(generation) for generation in checkpoint.history],
    }
    write_whole(path, with_checksum(content))


def load(
    path: Path, identity: str, warn: Callable[[str], None] = lambda message: None
) -> Checkpoint | None:
    """Read a checkpoint, or if it is damaged the one before; None if there is none yet.

    Parameters
    ----------
    warn : called if the one before is read.

    Raises
    ------
    InputError
        If neither is a sound checkpoint, or it is one of another search.
    """
    try:
        checkpoint = _read(path)
    except InputError as damaged:
        checkpoint = _read(previous_path(path))
        if checkpoint is None:
            raise
        warn(f"going on from the generation before the last: {damaged}")
    if checkpoint is not None and checkpoint.identity != identity:
        raise InputError(
            where=str(path),
            found="the checkpoint of another search",
            expected="the same FMU, cases, seed, population and weights",
            remedy="repeat the command of that search, or run without --resume",
        )
    return checkpoint


def _read(path: Path) -> Checkpoint | None:
    if not path.exists():
        return None
    return _parse(read_text(path, "run without --resume"), path)


def _parse(text: str, path: Path) -> Checkpoint:
    try:
        content = check_checksum(text)
        population = Population(*(np.array(content[name]) for name in ("members", "z", "z_k")))
        history = tuple(Generation(**generation) for generation in content["history"])
        return Checkpoint(content["identity"], population, content["converged"], history)
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(
            where=str(path),
            found=f"no checkpoint as it was written ({error})",
            expected="one that an earlier run wrote",
            remedy="remove the file, or run without --resume",
        ) from None
