"""Scripted runs of a tree, without robot and ROS, on a simulated clock."""
