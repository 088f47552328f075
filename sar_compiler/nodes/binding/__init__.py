"""Binding of a file's elements to nodes, values, keys and references."""
