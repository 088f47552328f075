"""Edits of tree files as edits of what is written: everything that an operation does not concern stays byte for byte.

`operations` has the operations, and `names` the locations of a name. An editor applies their edits to its text, so that its undo
takes them back.
"""

PUBLIC_MODULES = ("names", "operations", "text_edits")
"""The modules that other parts may import."""
