"""Channels of a recorder become signals of a system: proposed, named by the user, merged."""

from workbench.recordings.channels.merge import Measured, merge
from workbench.recordings.channels.names import TIME, NamedChannel, listed, parse_named, read_named
from workbench.recordings.channels.parting import propose_recordings
from workbench.recordings.channels.proposal import ProposedMapping, propose
from workbench.recordings.channels.reading import has_own_names, read_measured
from workbench.recordings.channels.recordings import ProposedRecording, ProposedRecordings
from workbench.recordings.channels.told import COLUMNS, Told, stored_columns

__all__ = [
    "COLUMNS",
    "TIME",
    "Measured",
    "NamedChannel",
    "ProposedMapping",
    "ProposedRecording",
    "ProposedRecordings",
    "Told",
    "has_own_names",
    "listed",
    "merge",
    "parse_named",
    "propose",
    "propose_recordings",
    "read_measured",
    "read_named",
    "stored_columns",
]
