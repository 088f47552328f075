"""Tests of the port types of built-in nodes, against the list that BehaviorTree.CPP 4.10 writes."""

from pathlib import Path

from sar_compiler.checks.btcpp_conversion import convert_to_btcpp
from sar_compiler.nodes.btcpp import BUILT_IN
from sar_compiler.nodes.btcpp.port_types import is_untyped
from sar_compiler.nodes.cpp_names import normalize
from sar_compiler.nodes.language.node_rules import language_spec
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import Kind
from tests.trees import document, forest_of


def listed_port_types():
    """Return the types of the ports of each node, as `writeTreeNodesModelXML` writes them."""
    nodes: dict[str, dict[str, str]] = {}
    for line in Path(__file__).with_name("built_in_nodes.txt").read_text(encoding="utf-8").splitlines():
        if line.startswith(" "):
            _, port, *cpp = line.split(maxsplit=2)
            list(nodes.values())[-1][port] = cpp[0] if cpp else ""
        else:
            nodes[line] = {}
    return nodes


def test_built_in_nodes_match_registered_nodes_of_btcpp():
    assert set(listed_port_types()) == BUILT_IN
    specs = default_registry().specs()
    assert {spec.tag for spec in specs if spec.semantics.counterpart.built_in} == BUILT_IN - {"SubTree"}


def test_port_types_of_built_in_nodes_match_btcpp():
    nodes, compared = listed_port_types(), 0
    for spec in default_registry().specs():
        for parameter in spec.ports if spec.semantics.counterpart.built_in else ():
            cpp, said = parameter.value_type.cpp, nodes[spec.tag].get(parameter.name)
            if said is None or (spec.tag, parameter.name) == ("ScriptCondition", "code"):
                continue  # py_trees' attribute of that tag; a script, which is a string in a file
            compared += 1
            assert normalize(cpp) == normalize(said), (spec.tag, parameter.name)
            assert is_untyped(normalize(cpp)) or cpp
    assert compared > 40


def test_decorator_unknown_to_btcpp_is_converted_with_finding_and_model():
    slow = language_spec(Kind.DECORATOR, "SlowDown", "kernel.turning:TurningNode", "Takes its time.")
    registry = Registry([*default_registry().specs(), slow])
    converted = convert_to_btcpp(forest_of(document("<SlowDown><AlwaysSuccess/></SlowDown>")), registry)
    assert [(each.code, each.message) for each in converted.losses] == [
        ("no-counterpart", "BehaviorTree.CPP has no <SlowDown>")
    ]
    assert '<Decorator ID="SlowDown"' in converted.text
