"""Mutants that no test can find, because they change nothing that anybody sees."""

EQUIVALENT: list[tuple[str, str, str, str]] = []
"""Each with its module, the line's text, the change, and why it is no mistake."""
