"""Channels of a recorder become signals of a system: proposed, named by the user, merged."""

from workbench.mapping.merge import Measured, merge
from workbench.mapping.names import TIME, NamedChannel, listed, parse_named, read_named
from workbench.mapping.parting import propose_recordings
from workbench.mapping.proposal import ProposedMapping, propose
from workbench.mapping.reading import has_own_names, read_measured
from workbench.mapping.recordings import ProposedRecording, ProposedRecordings
from workbench.mapping.told import COLUMNS, Told, stored_columns

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
