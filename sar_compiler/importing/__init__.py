"""Convert logs of BehaviorTree.CPP to journals."""

PUBLIC_MODULES = ("import_run", "live_run")
"""The modules that other parts may import."""
