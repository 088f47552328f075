"""The ticking of trees: nodes, scripts, clocks, and what leaves and runners agree on; py_trees only, no ROS."""
