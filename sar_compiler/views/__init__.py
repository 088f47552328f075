"""Trees, findings and missions as text, JSON, XML and pictures."""

PUBLIC_MODULES = ("difference", "drawing", "findings", "mission_view", "nodes", "numbered_tree", "run_tree")
"""The modules that other parts may import."""
