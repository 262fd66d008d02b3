"""Estimators that know the wheelset and its rig."""
