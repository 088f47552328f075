"""`SubTree`: a use of another tree."""

from py_trees.decorators import PassThrough

from sar_compiler.nodes import outcome_sets
from sar_compiler.nodes.semantics import Counterpart, Semantics
from sar_compiler.nodes.spec import Kind, NodeSpec, Parameter, Role, Signature, Skipping, Skips
from sar_compiler.nodes.values import value_type_of
from sar_compiler.runtime.decorators import SubTree
from sar_compiler.tree.model import SUBTREE_TAG

SUBTREE = NodeSpec(
    SUBTREE_TAG,
    PassThrough,
    Kind.DECORATOR,
    frozenset({"SUCCESS", "FAILURE", "RUNNING"}),
    semantics=Semantics(outcome_sets.passing, steady=True, counterpart=Counterpart(built_in=True)),
    skipping=Skipping(Skips.FROM_CHILD, SubTree),
    signature=Signature(
        doc="Another tree of the file. Its other attributes say which keys around it its keys stand for.",
        described={
            "name": Parameter("name", Role.NAME, required=False, value_type=value_type_of(str)),
            "child": Parameter("child", Role.CHILD, required=True),
        },
    ),
    child_count=(0, 0),
    former_tags=("SubTreePlus",),
)
"""The node that a `SubTree` is compiled to; its attributes are handled by binding."""
FORMER_ATTRIBUTES = {"__autoremap": "_autoremap", "__shared_blackboard": "_autoremap"}
"""The names of a `SubTree`'s attributes in BehaviorTree.CPP 3."""
