"""The interface to ROS 2: the runner of trees, the wait for their requirements, parameters, servers."""
