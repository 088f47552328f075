"""The registered nodes of BehaviorTree.CPP and of py_trees."""
