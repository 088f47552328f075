"""Tools for programs that write trees, and a person's approval of their proposals."""

PUBLIC_MODULES = ("call_limits", "mcp_server", "proposal", "suggestion_fixes")
"""The modules that other parts may import."""
