"""Recordings as a model predicts them, with derivatives."""
