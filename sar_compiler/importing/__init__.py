"""Import of runs that other programs recorded: logs of BehaviorTree.CPP become journals."""

PUBLIC_MODULES = ("import_run",)
"""The modules that other parts may import."""
