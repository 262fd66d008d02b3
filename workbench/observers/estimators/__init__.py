"""One file an estimator; a new one is found by itself."""
