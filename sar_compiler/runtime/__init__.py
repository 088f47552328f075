"""The modules that are needed to tick a tree without ROS: nodes, scripts, the blackboard and clocks."""
