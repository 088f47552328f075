"""Monitoring of a ticked tree with Groot2."""

PUBLIC_MODULES = ("groot2_extension",)
"""The modules that other parts may import."""
