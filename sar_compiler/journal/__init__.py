"""The journal of a mission: its facts, on the disk before anybody acts on them, and beside them what was watched.

Nobody else writes to the file of a journal. What is shown of a mission afterwards is read from it.
"""
