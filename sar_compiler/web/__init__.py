"""The page of a run, in a browser: live, or of what a journal has.

A page is fed entries, as `Journal.listen` and `JournalFile.stream` have them. They are folded here (`page_state`); a browser is sent the state and its
changes, and draws them. Nothing here imports ROS or knows a mission.
"""

PUBLIC_MODULES = ("run_page",)
"""The modules that other parts may import."""
