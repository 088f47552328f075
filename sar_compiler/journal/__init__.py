"""The journal of a mission: its facts, on the disk before anybody acts on them, and beside them what was watched.

Nobody else writes to the file of a journal. What is shown of a mission afterwards is read from it.
"""

PUBLIC_MODULES = (
    "chain",
    "condition",
    "database",
    "errors",
    "following",
    "georeference",
    "journal",
    "journal_entries",
    "mission_state",
    "node_ends",
    "opening",
    "recorded_events",
    "refused_start",
    "situation",
    "status_watch",
)
"""The modules that other parts may import."""
