"""Stands in for py_trees_ros, which is not on PyPI: the published interface, and nothing else."""
