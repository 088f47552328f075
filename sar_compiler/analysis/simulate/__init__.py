"""Scripted runs of a tree on a simulated clock, without a robot and without ROS."""
