"""From whitened residuals to a verdict: fit, search, selection."""
