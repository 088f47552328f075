"""Operations on tree files. Each operation is a set of text edits that leave every other byte unchanged.

`operations` contains the operations on elements. `names` finds the locations of a name, for renaming. Editors apply the
edits to their text, so that the user can undo them.
"""

PUBLIC_MODULES = ("names", "operations", "text_edits")
"""The modules that other parts may import."""
