"""The description of a run's tree in the journal."""

import math
from typing import Any

from py_trees.behaviour import Behaviour

from sar_compiler.compiler.outline import outline
from sar_compiler.compiler.sketch import Drawable
from sar_compiler.json_values import json_data
from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.runtime.walking import pre_order
from sar_compiler.views.drawing import drawn_nodes


def describe_tree(tree: Drawable) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the description of a tree for the journal: the data of the mission, and the data of the run."""
    looks = [[each.shape.value, each.sign] for each in drawn_nodes(tree)]
    of_run = {"tree_id": tree.name, "looks": looks, "constant": _constants(tree), "limits": _limits(tree)}
    return {"tree": json_data(outline(tree))}, of_run


def _bound_node(tree: Drawable, behaviour: Behaviour) -> BoundNode:
    return tree.origins[behaviour.id].bound


def _constants(tree: Drawable) -> list[int]:
    """Return the numbers of leaves with a constant status. Such a leaf cannot explain a failure."""
    nodes = ((number, each, _bound_node(tree, each).spec) for number, each in enumerate(pre_order(tree.root)))
    return [number for number, each, spec in nodes if not each.children and len(set(spec.statuses)) == 1]


def _limits(tree: Drawable) -> dict[str, float]:
    """Return the time limits, in seconds, that are known before the run, by node number."""
    limits: dict[str, float] = {}
    for number, each in enumerate(pre_order(tree.root)):
        bound = _bound_node(tree, each)
        if any(_bound_node(tree, child) is bound for child in each.children):
            continue  # the wrapper of a node's condition has the node's spec
        limit_sec = bound.spec.semantics.limit_sec
        limit = limit_sec(bound) if limit_sec is not None and len(each.children) == 1 else None
        if limit is not None and math.isfinite(limit):
            limits[str(number)] = limit
    return limits
