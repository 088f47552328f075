"""Missions: their interface, the choice of a tree's mission, the end of a run; shipped ones have a folder each."""

ENTRY_POINTS = "sar_compiler.missions"
"""The group of entry points by which missions are found."""
