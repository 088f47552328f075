"""Ticking of trees with py_trees, without ROS: nodes, scripts and clocks."""
