"""Base classes of leaves that use ROS 2; they can be imported without ROS."""
