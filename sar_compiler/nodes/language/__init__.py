"""The nodes of BehaviorTree.CPP and of py_trees.

What a tag means is declared here, and what makes it is named by its import path (`nodes.declaring`): none of these
modules imports py_trees.
"""

from sar_compiler.nodes.language import controls, decorators, leaves

SPECS = [*controls.SPECS, *decorators.SPECS, *leaves.SPECS]
"""What each tag of the language means, and `SubTree`."""
