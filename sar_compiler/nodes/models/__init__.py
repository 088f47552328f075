"""Nodes that are only described: reading and writing of a `TreeNodesModel`."""
