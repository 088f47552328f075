"""The nodes of the registry as a palette for Groot2."""

from collections.abc import Iterable

from sar_compiler.nodes.models.palette import describe
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.tree.model import ROOT_TAG
from sar_compiler.tree.synthetic import synthetic_element, synthetic_file
from sar_compiler.tree.xml_writer import write_xml


def palette(specs: Iterable[NodeSpec]) -> str:
    """Return a file with the `TreeNodesModel` of all nodes that are not built into BehaviorTree.CPP."""
    return write_xml(synthetic_file(synthetic_element(ROOT_TAG, {"BTCPP_format": "4"}, [describe(specs)])))
