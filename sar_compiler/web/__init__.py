"""The browser page of a run: live, or replayed from a journal.

A page receives entries, as from `Journal.add_listener` and `JournalFile.stream`. They are folded here (`page_state`). A browser
receives the state and its changes, and draws them. Nothing here imports ROS or knows a mission.
"""

PUBLIC_MODULES = ("edit_page", "run_page")
"""The modules that other parts may import."""
