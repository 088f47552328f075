"""The frame of the mission's positions."""

MAP_FRAME = "map"
"""The frame of every position that the mission sends or receives."""
