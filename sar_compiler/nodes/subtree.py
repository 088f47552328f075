"""`SubTree`: another tree of the file in this place."""

from py_trees.decorators import PassThrough

from sar_compiler.nodes.spec import Kind, NodeSpec, Parameter, Role, Skips
from sar_compiler.nodes.values import value_type_of
from sar_compiler.runtime.decorators import SubTree
from sar_compiler.tree.model import SUBTREE_TAG

SUBTREE = NodeSpec(
    tag=SUBTREE_TAG,
    kind=Kind.DECORATOR,
    cls=PassThrough,
    parameters={
        "name": Parameter("name", Role.NAME, required=False, value_type=value_type_of(str)),
        "child": Parameter("child", Role.CHILD, required=True),
    },
    skip_cls=SubTree,
    skips=Skips.FROM_CHILD,
    outcomes=frozenset({"SUCCESS", "FAILURE", "RUNNING"}),
    child_count=(0, 0),
    doc="Another tree of the file. Its other attributes say which keys around it its keys stand for.",
)
"""What a `SubTree` is compiled to; its attributes are the business of binding."""
