"""One machine as a value: what its system file says."""
