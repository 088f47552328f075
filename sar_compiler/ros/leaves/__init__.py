"""Base classes of leaves that use ROS 2. The modules can be imported without ROS."""
