"""Nodes that are only described: what a `TreeNodesModel` says, and how one is written."""
