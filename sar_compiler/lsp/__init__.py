"""The language server: answers editors' requests about tree files during editing."""

PUBLIC_MODULES = ("features",)
"""The modules that other parts may import."""
