"""Write a mission as a tree file, have it checked, run it on ROS 2."""
