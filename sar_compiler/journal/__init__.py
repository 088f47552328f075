"""The journal of a mission: what is true of it, written before the world is told, and beside it what was watched.

Nobody else writes to the file of a journal. What is shown of a mission afterwards is read from it.
"""
