"""The types of ports that share a key: trees, and what BehaviorTree.CPP makes of them."""
