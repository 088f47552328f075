"""The kernel: what ticks trees.

A tree in flat form is a list of nodes over lists of cells, which are all that it remembers between two ticks, but for
the blackboard and for what leaves keep to themselves.
"""
