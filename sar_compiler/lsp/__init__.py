"""The language server for tree files."""

PUBLIC_MODULES = ("features",)
"""The modules that other parts may import."""
