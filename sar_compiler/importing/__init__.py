"""Conversion of runs of other programs, such as logs of BehaviorTree.CPP, to journals."""

PUBLIC_MODULES = ("import_run", "live_run")
"""The modules that other packages may import."""
