"""Tests of the palette for Groot2."""

import pytest

from sar_compiler.checks import check
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.models import compare_models, read_models
from sar_compiler.nodes.models.palette import is_built_in, palette
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import Direction, ParameterRole
from sar_compiler.nodes.values import type_of_cpp_name
from sar_compiler.tree.xml import parse_xml
from tests.nodes import leaves, port_leaves
from tests.trees import forest

REGISTRY = default_registry()
BUILT_IN = {tag for tag, specs in REGISTRY.by_tag().items() if is_built_in(specs)} | {"SubTree"}


@pytest.fixture
def registry():
    registry = Registry(REGISTRY.specs())
    registry.add_module(leaves)
    registry.add_module(port_leaves)
    return registry


def models_of(registry):
    collector = FindingCollector()
    models = read_models([parse_xml(palette(registry))], collector)
    assert collector.findings == []
    return models


def test_palette_has_every_node_missing_in_behaviortree_cpp(registry):
    assert set(models_of(registry).nodes) == set(registry.by_tag()) - BUILT_IN


def test_all_42_nodes_of_behaviortree_cpp_are_registered():
    assert len(BUILT_IN) == 42
    assert BUILT_IN - {"SubTree"} <= set(REGISTRY.by_tag())


def test_palette_is_consistent_with_registry(registry):
    collector = FindingCollector()
    compare_models(models_of(registry), registry, collector)
    assert collector.findings == []


def test_every_attribute_is_port_with_direction_and_type(registry):
    for tag, model in models_of(registry).nodes.items():
        written = {
            parameter.name: parameter
            for spec in registry.variants(tag)
            for parameter in spec.attributes
            if parameter.role is not ParameterRole.NAME
        }
        assert set(model.ports) == set(written)
        for name, port in model.ports.items():
            parameter = written[name]
            assert port.direction is (parameter.direction or Direction.INPUT)
            read = type_of_cpp_name(port.type_name)
            python = parameter.value_type.python if parameter.value_type else str
            assert (read.python if read else None) in (python, str)


def test_every_default_converts_to_default_of_constructor(registry):
    for tag, model in models_of(registry).nodes.items():
        for spec in registry.variants(tag):
            for parameter in spec.attributes:
                if (
                    parameter.role is ParameterRole.ATTRIBUTE
                    and not parameter.required
                    and parameter.default is not None
                ):
                    text = model.ports[parameter.name].default
                    assert parameter.value_type.convert(text) == parameter.default


def test_port_has_description_from_docstring(registry):
    text = palette(registry)
    assert 'type="int" default="1">How often.</input_port>' in " ".join(text.split())
    assert '<input_port name="to" type="std::string">The name of a Say node.</input_port>' in text
    assert '<output_port name="heard" type="std::string">What was heard.</output_port>' in text
    assert '<inout_port name="anything">' in text
    assert '<input_port name="path" type="std::vector&lt;double>" default="0.5;1.0">' in " ".join(
        text.split()
    )


def test_palette_is_used_to_check_leaves_that_are_not_installed(registry):
    described = parse_xml(palette(registry))
    body = '<Sequence><Say message="hi" times="often"/><Sey/></Sequence>'
    findings = check(forest(body), REGISTRY, [described])
    assert [(finding.code, finding.suggestion) for finding in findings] == [
        ("wrong-value", None),
        ("unknown-node", "Say"),
    ]
