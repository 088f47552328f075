"""Tests of the compiler: it builds stock py_trees objects and leaves, and connects them."""

import py_trees
import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import OneShotPolicy, Status

from sar_compiler.compiler import bind_main, compile_tree, preview_tree
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import Kind, NodeSpec, Use
from sar_compiler.runtime.clock import Clock, ManualClock
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.forest import Forest
from search_and_rescue.record import MissionRecord
from search_and_rescue.zone_manager import ZoneManager
from tests.nodes import leaves
from tests.nodes.leaves import Radio
from tests.trees import forest, forest_of


@pytest.fixture(scope="module")
def registry() -> Registry:
    registry = Registry(default_registry().specs())
    registry.add_module(leaves)
    return registry


def compile_body(body, registry, context=None, parameters=None):
    context = {Radio: Radio("1")} if context is None else context
    return compile_tree(bind_main(forest(body), registry), context, parameters or {})


def findings_of(body, registry, **arguments):
    with pytest.raises(TreeError) as caught:
        compile_body(body, registry, **arguments)
    return [(f.code, f.span.line, f.span.column, f.suggestion) for f in caught.value.findings]


@pytest.mark.parametrize(
    ("tag", "cls", "memory"),
    [
        ("Sequence", py_trees.composites.Sequence, True),
        ('Sequence memory="false"', py_trees.composites.Sequence, False),
        ("Selector", py_trees.composites.Selector, True),
        ('Selector memory="false"', py_trees.composites.Selector, False),
        ("Fallback", py_trees.composites.Selector, True),
        ("ReactiveSequence", py_trees.composites.Sequence, False),
        ("ReactiveFallback", py_trees.composites.Selector, False),
    ],
)
def test_control_is_compiled_to_stock_composite_with_memory_flag(tag, cls, memory, registry):
    root = compile_body(f"<{tag}><Success/><Failure/></{tag.split()[0]}>", registry).root
    assert type(root) is cls
    assert root.memory is memory
    assert [child.name for child in root.children] == ["Success", "Failure"]


def test_node_is_named_by_its_attribute_or_tag(registry):
    root = compile_body('<Sequence name="All of it"><Success/></Sequence>', registry).root
    assert [node.name for node in root.iterate()] == ["Success", "All of it"]


def test_oneshot_element_is_compiled_to_stock_decorator(registry):
    root = compile_body('<OneShot policy="ON_SUCCESSFUL_COMPLETION"><Success/></OneShot>', registry).root
    assert type(root) is py_trees.decorators.OneShot
    assert root.policy is OneShotPolicy.ON_SUCCESSFUL_COMPLETION


def test_oneshot_attribute_wraps_node_with_derived_name(registry, monkeypatch):
    root = compile_body('<Failure name="Once" oneshot="ON_COMPLETION"/>', registry).root
    assert type(root) is py_trees.decorators.OneShot
    assert (root.name, root.decorated.name) == ("OnceOneShot", "Once")
    assert root.policy is OneShotPolicy.ON_COMPLETION
    root.tick_once()
    monkeypatch.setattr(root.decorated, "update", lambda: Status.SUCCESS)
    root.tick_once()
    assert root.status is Status.FAILURE


@pytest.mark.parametrize(
    ("tag", "cls", "attribute"),
    [
        ('Retry num_failures="3"', py_trees.decorators.Retry, ("num_failures", 3)),
        ('Repeat num_success="2"', py_trees.decorators.Repeat, ("num_success", 2)),
        ("Inverter", py_trees.decorators.Inverter, ("name", "Inverter")),
        ("SuccessIsRunning", py_trees.decorators.SuccessIsRunning, ("name", "SuccessIsRunning")),
        ("FailureIsSuccess", py_trees.decorators.FailureIsSuccess, ("name", "FailureIsSuccess")),
    ],
)
def test_decorator_is_compiled_to_stock_class_with_arguments(tag, cls, attribute, registry):
    root = compile_body(f"<{tag}><Success/></{tag.split()[0]}>", registry).root
    assert type(root) is cls
    assert getattr(root, attribute[0]) == attribute[1]
    assert root.decorated.name == "Success"


def test_leaf_receives_attribute_values_and_mission_context(registry):
    radio = Radio("7")
    leaf = compile_body('<Say message="hi" times="3"/>', registry, {Radio: radio}).root
    assert leaf.given == {"message": "hi", "radio": radio, "times": 3, "after": None, "spare": radio}


def test_node_reference_is_resolved_before_its_definition(registry):
    root = compile_body('<Sequence><Listen to="B"/><Say name="B" message="hi"/></Sequence>', registry).root
    listen, say = root.children
    assert listen.to is say


def test_reference_to_oneshot_node_is_decorated_node(registry):
    root = compile_body(
        '<Sequence><Say message="hi" oneshot="ON_COMPLETION"/><Listen/></Sequence>', registry
    ).root
    once, listen = root.children
    assert once.decorated is listen.to


def test_circular_references_are_reported(registry):
    body = '<Sequence>\n<Say message="hi" after="Listen"/>\n<Listen/></Sequence>'
    assert [(code, line) for code, line, *_ in findings_of(body, registry)] == [
        ("circular-reference", 4),
        ("circular-reference", 5),
    ]


def test_reference_to_parent_is_reported():
    class Inside(Behaviour):
        def __init__(self, name: str, around: py_trees.composites.Sequence) -> None:
            super().__init__(name)

        def update(self) -> Status:
            return Status.SUCCESS

    inner = Registry([*default_registry().specs(), NodeSpec("Inside", Inside, Kind.ACTION)])
    with pytest.raises(TreeError, match="circular-reference"):
        compile_body("<Sequence><Inside/></Sequence>", inner)


def test_root_blackboard_key_reads_mission_parameter(registry):
    body = '<Timeout duration="{@patience}"><Running/></Timeout>'
    for patience in (3, 3.0, "3"):
        root = compile_body(body, registry, {Clock: ManualClock()}, {"patience": patience}).root
        assert root.duration == 3.0


def test_unknown_parameter_is_reported_with_nearest_name(registry):
    body = '<Timeout duration="{@patiense}"><Running/></Timeout>'
    found = findings_of(body, registry, context={Clock: ManualClock()}, parameters={"patience": 3})
    assert found == [("unknown-key", 3, 20, "{@patience}")]


def test_parameter_of_wrong_type_is_reported_at_key(registry):
    body = '<Timeout duration="{patience}"><Running/></Timeout>'
    found = findings_of(body, registry, context={Clock: ManualClock()}, parameters={"patience": "long"})
    assert found == [("wrong-value", 3, 20, None)]


def test_missing_context_is_reported_at_leaf(registry):
    assert findings_of('<Say message="hi"/>', registry, context={}) == [("missing-context", 3, 1, None)]


def test_exception_in_constructor_is_reported_with_message(registry):
    class Picky(Behaviour):
        def __init__(self, name: str, speed: float) -> None:
            message = "too fast"
            raise ValueError(message)

        def update(self) -> Status:
            return Status.SUCCESS

    picky = Registry([NodeSpec("Picky", Picky, Kind.ACTION)])
    with pytest.raises(TreeError, match=r"3:1: error\[constructor-failed\]: .*ValueError: too fast"):
        compile_body('<Picky speed="99"/>', picky)


def test_constructor_without_super_call_is_reported(registry):
    class Hollow(Behaviour):
        def __init__(self, name: str) -> None:
            del name

        def update(self) -> Status:
            return Status.SUCCESS

    hollow = Registry([NodeSpec("Hollow", Hollow, Kind.ACTION)])
    with pytest.raises(TreeError, match=r"constructor-failed.*did not call super\(\)\.__init__\(name\)"):
        compile_body("<Hollow/>", hollow)


def test_tree_with_findings_is_not_bound(registry):
    with pytest.raises(TreeError, match="unknown-node"):
        bind_main(forest("<Sequense/>"), registry)


def test_requested_tree_replaces_main_tree(registry):
    text = (
        '<root main_tree_to_execute="A"><BehaviorTree ID="A"><Success/></BehaviorTree>'
        '<BehaviorTree ID="B"><Failure/></BehaviorTree></root>'
    )
    assert compile_tree(bind_main(forest_of(text), registry, "B"), {}, {}).root.name == "Failure"
    with pytest.raises(TreeError, match=r"missing-main-tree.*no tree 'C' \(known: A, B\)"):
        bind_main(forest_of(text), registry, "C")


def test_tree_lists_its_uses_with_names_filled_in(registry):
    tree = compile_body(
        '<Sequence><Say message="a" oneshot="ON_COMPLETION"/><Say message="b" service="shout"/><Say message="c"/></Sequence>',
        registry,
    )
    assert tree.uses() == [Use("service", "speak"), Use("service", "shout")]


def test_every_behaviour_has_its_element(registry):
    tree = compile_body('<Sequence>\n<Success oneshot="ON_COMPLETION"/>\n</Sequence>', registry)
    lines = {node.name: tree.origins[node.id].bound.element.line for node in tree.root.iterate()}
    assert lines == {"Sequence": 3, "SuccessOneShot": 4, "Success": 4}


def test_preview_needs_no_mission(registry):
    tree = preview_tree(
        bind_main(forest('<Timeout duration="{@t}"><Say message="{@m}"/></Timeout>'), registry)
    )
    leaf = tree.root.children[0]
    assert isinstance(leaf, leaves.Say)
    radio = leaf.given["radio"]
    assert isinstance(radio, Radio)
    assert radio.channel == "preview"
    assert leaf.given["spare"] is None  # an optional context object
    assert tree.origins[leaf.id].attributes["message"] == "{@m}"
    assert tree.origins[tree.root.id].attributes["duration"] == "{@t}"


def test_shipped_tree_compiles_to_stock_classes_and_nine_leaves():
    tree = preview_tree(
        bind_main(Forest.from_file(read_tree_file("trees/search_and_rescue.xml")), default_registry())
    )
    classes = [f"{type(node).__module__}.{type(node).__qualname__}" for node in tree.root.iterate()]
    stock = {name for name in classes if name.startswith("py_trees.")}
    assert stock == {
        "py_trees.composites.Sequence",
        "py_trees.composites.Selector",
        "py_trees.decorators.OneShot",
    }
    assert len([name for name in classes if name.startswith("search_and_rescue.")]) == 9


def test_all_leaves_of_tree_share_one_zone_manager():
    zones = ZoneManager([{"id": "a", "x": 0.0, "y": 0.0, "yaw": 0.0}], {"x": 0.0, "y": 0.0, "yaw": 0.0})
    binding = bind_main(Forest.from_file(read_tree_file("trees/search_and_rescue.xml")), default_registry())
    record = MissionRecord()
    context = {ZoneManager: zones, MissionRecord: record, Clock: ManualClock()}
    tree = compile_tree(binding, context, {})
    kept = [each for leaf in tree.root.iterate() for each in vars(leaf).values()]
    held = [each for each in kept if isinstance(each, ZoneManager)]
    assert len(held) >= 5
    assert all(each is zones for each in held)
