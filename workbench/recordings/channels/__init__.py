"""Channels of a recorder become signals of a system: proposed, named by the user, merged."""

from workbench.recordings.channels.merge import MergedRecording, merge
from workbench.recordings.channels.names import (
    COLUMNS,
    TIME,
    NamedChannel,
    RecordingOptions,
    listed,
    parse_named,
    read_named,
    stored_columns,
)
from workbench.recordings.channels.proposal import ProposedMapping, propose
from workbench.recordings.channels.reading import has_own_names, read_measured
from workbench.recordings.channels.splitting import (
    ProposedRecording,
    ProposedRecordings,
    propose_recordings,
)

__all__ = [
    "COLUMNS",
    "TIME",
    "MergedRecording",
    "NamedChannel",
    "ProposedMapping",
    "ProposedRecording",
    "ProposedRecordings",
    "RecordingOptions",
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
