"""From the elements of a file to nodes, values, keys and references."""
