"""Questions asked of a diagnosis, or of many recordings."""
