"""Tools for agents that write trees, and proposals for a person's approval."""

PUBLIC_MODULES = ("call_limits", "mcp_server", "proposal", "suggestion_fixes")
"""The modules that other parts may import."""
