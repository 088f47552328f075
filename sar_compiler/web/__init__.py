"""The browser page of a run. It shows a live run or replays a run from a journal.

The server receives the entries of a journal from `Journal.add_listener` or `JournalFile.stream`, and computes the state of the page
(`page_state`). A browser receives the state and its changes, and draws them. This package does not import ROS or any mission.
"""

PUBLIC_MODULES = ("edit_page", "run_page")
"""The modules that other parts may import."""
