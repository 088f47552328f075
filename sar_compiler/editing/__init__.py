"""Edits of tree files as edits of their text: every byte that an operation does not concern stays unchanged.

`operations` has the operations, and `names` the locations of a name. An editor applies their edits to its text, so that its undo
takes them back.
"""

PUBLIC_MODULES = ("names", "operations", "text_edits")
"""The modules that other parts may import."""
