"""What leaves that work with ROS 2 derive from; it can be imported without ROS."""
