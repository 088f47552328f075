"""Conversion of trees to BehaviorTree.CPP."""
