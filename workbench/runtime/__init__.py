"""Processes, files, caches and progress; knows no model."""
