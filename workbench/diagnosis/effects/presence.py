"""Where an effect can be, and whether recordings can show it: what their conditions say."""

from collections.abc import Sequence

from workbench.diagnosis.data.samples import Samples
from workbench.diagnosis.effects.catalogue import Effect, Unless, Where
from workbench.errors import InputError
from workbench.recordings.case import Case


class Presence:
    """Of effects, in one set of recordings.

    Parameters
    ----------
    recordings : the cases, made ready.
    beside : others of the same machine.
    """

    def __init__(
        self, cases: Sequence[Case], recordings: Sequence[Samples], beside: Sequence[Case]
    ) -> None:
        self._cases = [*cases, *beside]
        self._recordings = recordings

    def at(self, effect: Effect, k: int) -> bool:
        """Whether recording k can have an effect: where the conditions say, if those of any do."""
        where = effect.where
        return where is None or not self.told(where) or self.share(where, k) > 0.0

    def share(self, said: Where | Unless, k: int) -> float:
        """Share of what a condition of recording k says that is one state."""
        states = self._cases[k].conditions.get(said.condition)
        if states is None:
            raise InputError(
                where=f"conditions of {self._cases[k].name}",
                found=f"no '{said.condition}', which an effect of the library asks for",
                expected="a condition that recordings have",
                remedy="correct the annotation of the effect",
            )
        entries = states if isinstance(states, tuple) else (states,)
        return entries.count(said.state) / len(entries)

    def told(self, said: Where | Unless) -> bool:
        """Whether the conditions of any recording say so."""
        return any(self.share(said, k) > 0.0 for k in range(len(self._cases)))

    def unseen(self, effect: Effect) -> str:
        """Why these recordings cannot show an effect; empty if they can."""
        unless, falling = effect.unless, effect.falling
        if unless is not None and self.told(unless):
            return unless.because
        if falling is not None and not any(
            recording.falls(falling.signal) for recording in self._recordings
        ):
            return falling.because
        if effect.restarted and not any(
            recording.restarted.any() for recording in self._recordings
        ):
            return effect.restarted
        return effect.hidden
