"""Missions: their interface, the choice of a tree's mission, the end of a run; shipped ones have a folder each."""
