"""A server of Groot2's protocol, so that Groot2 can monitor a ticked tree."""

PUBLIC_MODULES = ("groot2_extension",)
"""The modules of this package that other packages may import."""
