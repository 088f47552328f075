"""What tags and attributes of BehaviorTree.CPP 3 and of earlier py_trees are called today."""

from collections.abc import Mapping

FORMER_TAGS: Mapping[str, str] = {
    "BlackboardCheckBool": "Precondition",
    "BlackboardCheckDouble": "Precondition",
    "BlackboardCheckInt": "Precondition",
    "BlackboardCheckString": "Precondition",
    "Chooser": "Selector",
    "FallbackStar": "Fallback",
    "ReactiveSelector": "ReactiveFallback",
    "SequenceStar": "SequenceWithMemory",
    "SubTreePlus": "SubTree",
}

FORMER_ATTRIBUTES: Mapping[str, str] = {
    "__autoremap": "_autoremap",
    "__shared_blackboard": "_autoremap",
}
"""Of a `SubTree`."""
