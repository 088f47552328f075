"""The journal of a mission: observations, and events that are stored on disk before they take effect.

Only the mission's own process writes to the journal. Every display of the mission reads from it.
"""

PUBLIC_MODULES = (
    "chain",
    "command_objects",
    "database",
    "display",
    "errors",
    "georeference",
    "journal",
    "journal_entries",
    "journal_follower",
    "journal_opening",
    "last_run",
    "mission_state",
    "node_ends",
    "open_tasks",
    "recorded_events",
    "recorded_ticks",
    "refused_start",
    "resume_command",
    "spill_file",
    "status_line",
    "status_watch",
)
"""The modules that other parts may import."""
