"""Tools for agents that write trees, and proposals that a person approves."""

PUBLIC_MODULES = ("call_limits", "mcp_server", "proposal", "suggestion_fixes")
"""The modules that other parts may import."""
