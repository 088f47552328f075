"""The nodes of BehaviorTree.CPP and of py_trees.

The modules declare the meanings of tags, and name the classes by their import paths (`nodes.declaring`), so that
they do not import py_trees.
"""

from sar_compiler.nodes.language import controls, decorators, leaves

SPECS = [*controls.SPECS, *decorators.SPECS, *leaves.SPECS]
"""The specs of all tags of the language, and of `SubTree`."""
