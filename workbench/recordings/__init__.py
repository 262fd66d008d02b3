"""Recordings of a machine: files of loggers, matching of channels, case folders."""
