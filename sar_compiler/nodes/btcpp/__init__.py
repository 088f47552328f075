"""Trees in the words of BehaviorTree.CPP."""
