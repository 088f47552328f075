"""The graphical editor: a page with the tree drawn beside its text, and the queries of that page.

The page is in `static`. It asks `tree_studio` over HTTP (`web.edit_page`).
"""

PUBLIC_MODULES = ("tree_studio",)
"""The modules that other parts may import."""
