"""Monitoring of a ticked tree by Groot2: nodes by number, their statuses, and the protocol."""

PUBLIC_MODULES = ("groot2_extension",)
"""The modules that other parts may import."""
