"""A stand-in for py_trees_ros, which is not on PyPI, with the published interface only."""
