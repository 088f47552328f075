"""Nodes, scripts, the blackboard and clocks: everything that ticks a tree with py_trees, without ROS."""
