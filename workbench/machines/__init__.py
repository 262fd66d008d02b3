"""Machines that come with the workbench, each a plugin."""
