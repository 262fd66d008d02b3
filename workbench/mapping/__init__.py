"""Channels of a recorder become signals of a system: proposed, named by the user, merged."""

from workbench.mapping.merge import Measured, merge
from workbench.mapping.names import TIME, NamedChannel, listed, parse_named, read_named
from workbench.mapping.proposal import ProposedMapping, propose
from workbench.mapping.reading import (
    COLUMNS,
    Told,
    has_own_names,
    read_measured,
    stored_columns,
    usable,
)

__all__ = [
    "COLUMNS",
    "TIME",
    "Measured",
    "NamedChannel",
    "ProposedMapping",
    "Told",
    "has_own_names",
    "listed",
    "merge",
    "parse_named",
    "propose",
    "read_measured",
    "read_named",
    "stored_columns",
    "usable",
]
