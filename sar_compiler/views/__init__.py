"""Output for people and tools."""

PUBLIC_MODULES = ("difference", "drawing", "findings", "mission_view", "nodes", "numbered_tree", "run_tree")
"""The modules that other parts may import."""
