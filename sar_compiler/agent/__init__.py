"""What programs that write trees can do with the project, and what a person approves of it."""

PUBLIC_MODULES = ("call_limits", "mcp_server", "mending", "proposal")
"""The modules that other parts may import."""
