"""The edge to ROS 2: the runner of trees, the wait for what they need, parameters, the two servers."""
