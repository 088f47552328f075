"""A run of a mission, from its tree file to its result."""
