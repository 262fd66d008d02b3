"""Commands for the wheelset alone."""
