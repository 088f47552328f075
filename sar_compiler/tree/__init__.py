"""The contents of a tree file: elements with their locations, and findings about its syntax."""
