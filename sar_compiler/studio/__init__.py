"""The graphical editor: a page that shows a tree's drawing and text, and the functions that the page calls.

The page is in `static`. It sends requests over HTTP (`web.edit_page`), to which `tree_studio` responds.
"""

PUBLIC_MODULES = ("edited_document", "tree_studio")
"""The modules that other parts may import."""
