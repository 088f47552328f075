"""The nodes of Nav2's distributions: `--model nav2:jazzy`.

Controls and decorators mean what each distribution's sources say, and what can run without Nav2 does. Leaves have no class:
they are known by their ports and answers, so that trees can be checked, simulated and verified.
"""

from sar_compiler.nodes.nav2 import described, free_nodes
from sar_compiler.nodes.spec import NodeSpec

VERSIONS = ("jazzy", "kilted", "main")


def specs(version: str) -> list[NodeSpec]:
    """Return the records of the nodes of a distribution."""
    return [*free_nodes.specs(version), *described.specs(version)]
