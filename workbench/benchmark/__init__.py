"""How fast the observers are, beside FMPy's methods and plain C; results of all must agree."""
