"""Ticking of trees: nodes, scripts, clocks, and the interface between leaves and runners; with py_trees, without ROS."""
