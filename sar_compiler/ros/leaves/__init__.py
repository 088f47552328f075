"""The base classes of leaves that use ROS 2. The modules of this package can be imported without ROS."""
