"""Scripted runs of a tree: no robot, no ROS, a clock that is moved by hand."""
