"""The contents of a tree file: elements with their locations, and the findings of reading them."""
