"""Tests of replacements for described nodes in a file: each error has one finding, with its location."""

import pytest

from sar_compiler.analysis.assumptions import apply_controls
from sar_compiler.compiler import bind_main
from sar_compiler.documents.yaml_files import parse_yaml
from sar_compiler.nodes.registry import default_registry
from tests.trees import forest_of

TREE = """<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main">
<Both><Twice><Grab/></Twice><Grab/><Both><Grab/></Both></Both></BehaviorTree><BehaviorTree ID="Other"><Rare><Grab/></Rare></BehaviorTree>
<TreeNodesModel><Action ID="Grab"/><Control ID="Both"/><Decorator ID="Twice"/><Decorator ID="Rare"/></TreeNodesModel></root>"""


def apply_replacements(text):
    """Apply the replacements of a file; return the findings, and the tags of the tree's controls and decorators."""
    forest, registry = forest_of(TREE), default_registry()
    binding = bind_main(forest, registry)
    document = parse_yaml(text, "scenario.yaml", "")
    apply_controls(document, document.root, binding, registry, forest.files)
    found = [(f.code, f.span.column, f.suggestion) for f in document.findings]
    return found, [node.spec.tag for node in binding.all_nodes() if not node.spec.kind.is_leaf]


def test_replacement_is_applied_to_each_node_of_its_tag():
    assert apply_replacements("{Both: Fallback, Twice: Inverter}") == (
        [],
        ["Fallback", "Inverter", "Fallback"],
    )


def test_tag_of_another_tree_may_have_replacement():
    assert apply_replacements("{Rare: Inverter, Twice: Inverter}") == ([], ["Both", "Inverter", "Both"])


@pytest.mark.parametrize(
    ("text", "finding"),
    [
        ("{Boht: Fallback}", ("unknown-node", 2, "Both")),
        ("{Grab: Fallback}", ("unknown-node", 2, None)),
        ("{Sequence: Fallback}", ("unknown-node", 2, None)),
        ("{Both: Falback}", ("unknown-node", 8, "Fallback")),
        ("{Both: Success}", ("wrong-value", 8, None)),
        ("{Both: Inverter}", ("wrong-value", 8, None)),
        ("{Both: IfThenElse}", ("wrong-value", 8, None)),
        ("{Twice: Delay}", ("wrong-value", 9, None)),
        ("{Twice: Both}", ("unknown-node", 9, None)),
    ],
)
def test_invalid_replacement_is_reported_with_location(text, finding):
    assert apply_replacements(text)[0] == [finding]
