"""What others see of a tree while it is ticked: its nodes by number, their statuses, Groot2's protocol."""

PUBLIC_MODULES = ("groot2_extension",)
"""The modules that other parts may import."""
