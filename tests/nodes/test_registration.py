"""Tests of the registration of nodes: their constructors define their attributes."""

import sys
from dataclasses import dataclass, field

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite

from sar_compiler.checks import check
from sar_compiler.leaves import Kind, register
from sar_compiler.missions import mission_context
from sar_compiler.nodes.registry import Registry, RegistryError, default_registry, load_registry
from sar_compiler.nodes.spec import MARK, NodeSpec, ParameterRole, RegistrationError, Use
from sar_compiler.runtime.context import PreviewError, preview_of
from tests.nodes import leaves
from tests.trees import forest


class Still(Behaviour):
    def update(self) -> Status:
        return Status.SUCCESS


def spec_of(cls):
    return getattr(cls, MARK)


def test_register_does_not_change_class():
    assert leaves.Say("s", "hi", leaves.Radio("a")).given["message"] == "hi"


def test_parameter_roles_come_from_annotations():
    roles = {name: parameter.role for name, parameter in spec_of(leaves.Say).parameters.items()}
    assert roles == {
        "name": ParameterRole.NAME,
        "message": ParameterRole.ATTRIBUTE,
        "radio": ParameterRole.CONTEXT,
        "times": ParameterRole.ATTRIBUTE,
        "after": ParameterRole.REFERENCE,
        "spare": ParameterRole.CONTEXT,
        "service": ParameterRole.ATTRIBUTE,
    }


def test_parameter_without_default_is_required():
    required = [name for name, parameter in spec_of(leaves.Say).parameters.items() if parameter.required]
    assert required == ["message", "radio"]


def test_leaf_may_reference_class_defined_later():
    assert spec_of(leaves.Say).parameters["after"].target is leaves.Listen


def test_descriptions_come_from_docstring():
    spec = spec_of(leaves.Say)
    assert spec.doc == "Say something."
    assert spec.parameters["message"].doc == "What to say; it may be long."
    assert spec.parameters["times"].doc == "How often."
    assert spec.parameters["service"].doc == ""


def test_arguments_of_register_are_stored():
    spec = spec_of(leaves.Say)
    assert spec.statuses == {"SUCCESS", "FAILURE"}
    assert spec.effects == "speaks"
    assert spec.uses == (Use("service", "{service}"),)


def rejection_message(cls, kind=Kind.ACTION):
    with pytest.raises(RegistrationError) as caught:
        Registry([NodeSpec("Tag", cls, kind)]).variants("Tag")
    return str(caught.value)


def test_parameter_without_annotation_is_rejected_by_name():
    class Leaf(Behaviour):
        def __init__(self, name: str, speed) -> None: ...

    assert "parameter 'speed'" in rejection_message(Leaf)
    assert "no annotation" in rejection_message(Leaf)


def test_parameter_of_unsupported_type_is_rejected_with_alternative():
    class Leaf(Behaviour):
        def __init__(self, name: str, table: dict[str, int]) -> None: ...

    assert "mission_context" in rejection_message(Leaf)


def test_unresolvable_annotation_is_rejected():
    class Leaf(Behaviour):
        def __init__(self, name: str, other: "Nowhere") -> None: ...  # type: ignore[name-defined]  # noqa: F821

    assert "cannot be resolved" in rejection_message(Leaf)


def test_leaf_without_name_parameter_is_rejected():
    class Leaf(Behaviour):
        def __init__(self) -> None: ...

    assert "no parameter 'name'" in rejection_message(Leaf)


@pytest.mark.parametrize(("kind", "wanted"), [(Kind.CONTROL, "children"), (Kind.DECORATOR, "child")])
def test_control_or_decorator_must_accept_children(kind, wanted):
    class Node(Behaviour):
        def __init__(self, name: str) -> None: ...

    assert f"without a parameter '{wanted}'" in rejection_message(Node, kind)


@pytest.mark.parametrize("tag", ["M M", "", "2nd", "a:b", "M/", "-m", 3, None])
def test_invalid_tag_is_rejected(tag):
    with pytest.raises(RegistrationError, match="a tag is one word of letters"):
        register(tag, kind=Kind.ACTION)


@pytest.mark.parametrize("tag", ["M", "_m", "Detect_2", "a-b.c", "Überfahrt"])
def test_tag_may_be_any_xml_name(tag):
    register(tag, kind=Kind.ACTION)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"kind": "action"}, "<M>: kind is the string 'action'; write Kind.ACTION"),
        (
            {"kind": "leaf"},
            "<M>: kind is the string 'leaf'; write Kind.CONTROL or Kind.DECORATOR or Kind.ACTION or Kind.CONDITION",
        ),
        (
            {"outcomes": {"SUCCESS"}},
            '<M>: outcomes contains the string \'SUCCESS\'; write Status.SUCCESS, or Outcome("SUCCESS", "label")',
        ),
        (
            {"outcomes": [True]},
            '<M>: outcomes contains True; write Status.SUCCESS, Status.FAILURE or Status.RUNNING, or Outcome("SUCCESS", "label")',
        ),
        (
            {"outcomes": "SUCCESS"},
            "<M>: outcomes is the string 'SUCCESS'; write a list or tuple, such as {Status.SUCCESS}",
        ),
        (
            {"uses": ["odometry"]},
            (
                "<M>: uses contains the string 'odometry'; "
                "write Use.action(name), Use.service(name), Use.topic(name), Use.transforms() or Use.nav2()"
            ),
        ),
        (
            {"uses": Use.topic("odometry")},
            (
                "<M>: uses is Use(kind='topic', name='odometry'); "
                'write a list or tuple, such as [Use.topic("...")]'
            ),
        ),
    ],
)
def test_argument_of_wrong_type_is_rejected_with_remedy(arguments, words):
    with pytest.raises(RegistrationError) as caught:
        register("M", **{"kind": Kind.ACTION, **arguments})
    assert str(caught.value) == words


def test_variadic_parameters_are_no_attributes():
    class Leaf(Still):
        def __init__(self, name: str, *args: int, **kwargs: int) -> None: ...

    assert list(NodeSpec("Leaf", Leaf, Kind.ACTION).parameters) == ["name"]


def test_module_contributes_only_directly_registered_classes():
    registry = Registry()
    registry.add_module(leaves)
    assert [spec.tag for spec in registry] == ["Listen", "Say"]


def test_class_may_be_added_twice_but_tag_has_one_class():
    registry = Registry()
    registry.add_module(leaves)
    registry.add_module(leaves)

    @register("Say", kind=Kind.ACTION)
    class Impostor(Behaviour): ...

    with pytest.raises(
        RegistryError, match=r"two classes are registered as <Say>: .*leaves\.Say and .*Impostor"
    ):
        registry.add(getattr(Impostor, MARK))


def test_shipped_leaves_are_loaded_by_entry_point():
    mission = {
        "ZonesRemaining",
        "IsSurvivorDetected",
        "NavigateToZone",
        "NavigateToBase",
        "DetectSurvivor",
        "BroadcastSurvivorTF",
        "NotifyBase",
        "AdvanceZone",
        "LogNoDetection",
    }
    assert mission <= {spec.tag for spec in default_registry()}


def test_every_shipped_node_has_description_and_statuses():
    for spec in default_registry():
        assert spec.doc, spec.tag
        assert spec.statuses <= {"SUCCESS", "FAILURE", "RUNNING"}, spec.tag
        assert spec.statuses, spec.tag


def test_module_of_leaves_may_be_in_current_folder(tmp_path, monkeypatch):
    (tmp_path / "my_leaves_in_a_folder.py").write_text(
        "from tests.nodes.leaves import Say\n", encoding="utf-8"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    assert "Say" in load_registry(["my_leaves_in_a_folder"])


@pytest.mark.parametrize("name", ["no_such_module", "tests.nodes.broken_leaves"])
def test_module_that_cannot_be_imported_is_reported_with_reason(name):
    with pytest.raises(RegistryError, match=rf"'{name}' \(--nodes\) cannot be imported: \w+: "):
        load_registry([name])


def test_unknown_tag_has_no_spec_and_typo_has_nearest_tag():
    assert default_registry().get("Nonsense") is None
    assert default_registry().nearest("Sequnce") == "Sequence"


def test_dataclass_fields_are_constructor_parameters():
    @dataclass(eq=False)
    class Call(Still):
        name: str
        times: int = 1
        radio: leaves.Radio = field(default_factory=lambda: leaves.Radio("b"))

        def __post_init__(self):
            super().__init__(self.name)

    parameters = NodeSpec("Call", Call, Kind.ACTION).parameters
    assert [*parameters] == ["name", "times", "radio"]
    radio = parameters["radio"]
    assert (radio.role, radio.required, radio.default) == (ParameterRole.CONTEXT, False, None)


def test_mission_context_works_with_and_without_parentheses():
    @mission_context
    class Bare: ...

    @mission_context(preview=lambda: 7)
    class Previewed: ...

    class Port:
        def __init__(self, number: int) -> None: ...

    assert isinstance(preview_of(Bare), Bare)
    with pytest.raises(PreviewError, match=r"a placeholder for the context object Port.*missing 1 required"):
        preview_of(mission_context(Port))
    assert preview_of(Previewed) == 7


def test_parameter_description_comes_from_nearest_class_that_has_one():
    class Drive(Still):
        """Drives.

        Args:
            name: The node's name.
            speed: How fast.
        """

        def __init__(self, name: str, speed: float) -> None: ...

    class Crawl(Drive):
        """Crawls.

        Args:
            speed: How slowly.
        """

    (spec,) = Registry([NodeSpec("Crawl", Crawl, Kind.ACTION)]).variants("Crawl")
    assert [each.doc for each in spec.parameters.values()] == ["The node's name.", "How slowly."]
    assert spec.doc == "Crawls."


@pytest.mark.parametrize("thing", [lambda name: name, type("Loose", (), {})])
def test_object_that_is_no_behaviour_class_is_rejected(thing):
    with pytest.raises(RegistrationError, match="is not a behaviour class; derive it from"):
        register("Tag", kind=Kind.ACTION)(thing)


def test_semantics_of_wrong_type_is_rejected():
    with pytest.raises(
        RegistrationError, match=r"semantics is the string 'sequence'; write for example Semantics\.sequence"
    ):
        register("Tag", kind=Kind.CONTROL, semantics="sequence")  # type: ignore[arg-type]


OWN = load_registry(["tests.analysis.verify.own_controls"])


@pytest.mark.parametrize(("children", "codes"), [(1, ["missing-child"]), (2, []), (3, ["too-many-children"])])
def test_user_control_must_have_declared_number_of_children(children, codes):
    body = f"<OwnRecovery>{'<Success/>' * children}</OwnRecovery>"
    assert [each.code for each in check(forest(body), OWN)] == codes


@pytest.mark.parametrize("count", [2, (0, 1), (3, 2), (1, "many"), (True, None, 2)])
def test_invalid_child_count_is_rejected(count):
    with pytest.raises(RegistrationError, match=r"child_count is .*; write the minimum and maximum"):
        register("Tag", kind=Kind.CONTROL, child_count=count)


@pytest.mark.parametrize("count", [(1, 1), (1, None), (2, 3)])
def test_child_count_of_at_least_one_is_accepted(count):
    @register("Own", kind=Kind.CONTROL, child_count=count)
    class Own(Composite):
        def __init__(self, name: str, children: list[Behaviour]) -> None:
            super().__init__(name, children)

    assert spec_of(Own).child_count == count


def test_child_count_is_rejected_for_decorators():
    with pytest.raises(RegistrationError, match="child_count is allowed only for controls"):
        register("Tag", kind=Kind.DECORATOR, child_count=(1, 1))


@pytest.mark.parametrize(("limit", "codes"), [("0", ["short-timeout"]), ("2", [])])
def test_time_limit_of_user_decorator_is_read_from_declared_attribute(limit, codes):
    body = f"<Sequence><OwnLimit seconds='{limit}'><Sleep msec='5'/></OwnLimit><Success/></Sequence>"
    assert [each.code for each in check(forest(body), OWN)] == codes


@pytest.mark.parametrize(
    ("tag", "words"),
    [
        ("OwnSlip", "OwnSlip raised IndexError: list index out of range, for 'Here' on line 3"),
        ("OwnGap", "OwnGap returned None. Return an outcome set, for example the set of a child"),
    ],
)
def test_failing_semantics_function_is_reported_at_node_with_class(tag, words):
    (finding,) = check(forest(f'<{tag} name="Here"><Success/></{tag}>'), OWN)
    place = "the function 'possible' in the semantics of tests.analysis.verify.own_controls."
    assert (finding.code, finding.span.line) == ("faulty-class", 3)
    assert finding.message.startswith(f"<{tag}>: {place}{words}")
