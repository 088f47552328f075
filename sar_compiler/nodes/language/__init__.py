"""Specs of the built-in nodes, which are the nodes of BehaviorTree.CPP and of py_trees.

The modules name the classes by their import paths (`nodes.declaring`), so that they do not import py_trees.
"""

from sar_compiler.nodes.language import controls, decorators, leaves

SPECS = [*controls.SPECS, *decorators.SPECS, *leaves.SPECS]
"""The specs of all built-in nodes, including `SubTree`."""
