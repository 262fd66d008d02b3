"""Tables of cells as people and recorders lay them out: names, units, then samples."""
