"""The contents of a tree file: elements with their places, and the findings of reading them."""
