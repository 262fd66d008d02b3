"""Recordings of some files, each with the channels that are proposed for it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from workbench.errors import InputError
from workbench.recordings.channels.names import NamedChannel
from workbench.recordings.channels.proposal import ProposedMapping
from workbench.recordings.formats import RecordedFile


@dataclass(frozen=True, eq=False)
class ProposedRecording:
    """One recording, with the channels that are proposed for it.

    Attributes
    ----------
    name : of the sheet, group or structure that holds it; empty: the files hold it alone.
    files : that hold it, without what other recordings hold.
    """

    name: str
    files: tuple[RecordedFile, ...]
    proposal: ProposedMapping

    @property
    def where(self) -> str:
        """Files and sheet, for messages."""
        return where(self.files, self.name)


@dataclass(frozen=True, eq=False)
class ProposedRecordings:
    """All recordings of some files.

    Attributes
    ----------
    held : those that can be imported, in the order of the file.
    refused : why others cannot.
    beside : what else the file holds, in words.
    """

    held: tuple[ProposedRecording, ...]
    refused: tuple[InputError, ...] = ()
    beside: tuple[str, ...] = ()

    @property
    def certain(self) -> bool:
        """Whether nobody need be asked."""
        return all(one.proposal.certain for one in self.held)

    @property
    def problems(self) -> list[str]:
        """Why signals that are needed have no channel, in words."""
        return _once(one.proposal.problems for one in self.held)

    @property
    def doubts(self) -> list[str]:
        """What somebody must confirm, in words."""
        return _once(one.proposal.doubts for one in self.held)

    @property
    def unmatched(self) -> list[str]:
        """Why channels are not taken for signals that recordings may be without, in words."""
        return _once(one.proposal.unmatched for one in self.held)

    @property
    def left(self) -> list[str]:
        """Channels that nobody takes."""
        return _once(one.proposal.left for one in self.held)

    @property
    def named(self) -> dict[str, NamedChannel]:
        """Channels by signal, as they are stored; the first recording that has one tells."""
        found: dict[str, NamedChannel] = {}
        for one in self.held:
            found = {**one.proposal.named, **found}
        return found


def _once(lists: Iterable[Iterable[str]]) -> list[str]:
    return list(dict.fromkeys(text for texts in lists for text in texts))


def where(files: Sequence[RecordedFile], name: str) -> str:
    """Files and the part of them that is meant, for messages."""
    paths = ", ".join(str(file.path) for file in files)
    return f"{paths}, '{name}'" if name else paths
