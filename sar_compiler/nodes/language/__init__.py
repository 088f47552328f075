"""The nodes of BehaviorTree.CPP and of py_trees: what each tag means."""
