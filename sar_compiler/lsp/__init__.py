"""The language server: what editors ask about tree files while they are typed."""

PUBLIC_MODULES = ("features",)
"""The modules that other parts may import."""
