"""The types of ports that share a key: trees, and the verdicts of BehaviorTree.CPP."""
