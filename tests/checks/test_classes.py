"""Tests that abstract classes are found without creating an instance."""

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.checks.rules import CheckContext
from sar_compiler.checks.rules.single_nodes import check_classes
from sar_compiler.leaves import ActionLeaf
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import Kind, NodeSpec
from tests.trees import class_of, errors, forest


class Half(Behaviour):
    """A behaviour without update()."""


class Whole(Half):
    def update(self) -> Status:
        return Status.SUCCESS


class Drive(ActionLeaf):
    """An action leaf without goal()."""


REGISTRY = Registry(
    [*default_registry().specs(), *(NodeSpec(cls.__name__, cls, Kind.ACTION) for cls in (Half, Whole, Drive))]
)


def test_first_node_of_abstract_class_is_reported_with_missing_method():
    found = errors(forest("<Sequence>\n<Whole/>\n<Half/>\n<Half/>\n</Sequence>"), REGISTRY)
    assert [(f.code, f.span.line, f.span.column) for f in found] == [("constructor-failed", 5, 1)]
    assert found[0].message == f"<Half> cannot be created: its class {__name__}.Half has no update()"


def test_leaf_of_project_base_class_is_reported_with_missing_method():
    (finding,) = check_classes(CheckContext(forest("<Drive/>"), REGISTRY))
    assert finding.message.endswith("has no goal()")


def test_no_shipped_node_is_abstract():
    assert [
        spec.tag for spec in default_registry() if getattr(class_of(spec), "__abstractmethods__", ())
    ] == []
