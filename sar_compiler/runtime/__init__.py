"""How a tree is ticked: clocks and what leaves and runners agree on; py_trees only, no ROS."""
