"""A leaf's constructor is its manifest."""

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


def test_registering_leaves_the_class_as_it_was():
    assert leaves.Say("s", "hi", leaves.Radio("a")).given["message"] == "hi"


def test_parameters_get_their_roles_from_their_annotations():
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


def test_a_parameter_is_required_where_the_constructor_has_no_default():
    required = [name for name, parameter in spec_of(leaves.Say).parameters.items() if parameter.required]
    assert required == ["message", "radio"]


def test_a_leaf_may_refer_to_a_class_that_is_defined_after_it():
    assert spec_of(leaves.Say).parameters["after"].target is leaves.Listen


def test_descriptions_come_from_the_docstring():
    spec = spec_of(leaves.Say)
    assert spec.doc == "Say something."
    assert spec.parameters["message"].doc == "What to say; it may be long."
    assert spec.parameters["times"].doc == "How often."
    assert spec.parameters["service"].doc == ""


def test_facts_given_to_register_are_kept():
    spec = spec_of(leaves.Say)
    assert spec.statuses == {"SUCCESS", "FAILURE"}
    assert spec.effects == "speaks"
    assert spec.uses == (Use("service", "{service}"),)


def refused(cls, kind=Kind.ACTION):
    with pytest.raises(RegistrationError) as caught:
        Registry([NodeSpec("Tag", cls, kind)]).variants("Tag")
    return str(caught.value)


def test_a_parameter_without_an_annotation_is_refused_by_name():
    class Leaf(Behaviour):
        def __init__(self, name: str, speed) -> None: ...

    assert "parameter 'speed'" in refused(Leaf)
    assert "no annotation" in refused(Leaf)


def test_a_parameter_of_a_type_that_cannot_be_written_is_refused_with_what_can():
    class Leaf(Behaviour):
        def __init__(self, name: str, table: dict[str, int]) -> None: ...

    assert "mission_context" in refused(Leaf)


def test_annotations_that_name_nothing_are_refused():
    class Leaf(Behaviour):
        def __init__(self, name: str, other: "Nowhere") -> None: ...  # type: ignore[name-defined]  # noqa: F821

    assert "cannot be resolved" in refused(Leaf)


def test_a_leaf_without_a_name_is_refused():
    class Leaf(Behaviour):
        def __init__(self) -> None: ...

    assert "no parameter 'name'" in refused(Leaf)


@pytest.mark.parametrize(("kind", "wanted"), [(Kind.CONTROL, "children"), (Kind.DECORATOR, "child")])
def test_a_control_or_decorator_must_take_what_stands_in_it(kind, wanted):
    class Node(Behaviour):
        def __init__(self, name: str) -> None: ...

    assert f"without a parameter '{wanted}'" in refused(Node, kind)


@pytest.mark.parametrize("tag", ["M M", "", "2nd", "a:b", "M/", "-m", 3, None])
def test_a_tag_that_cannot_be_written_in_a_file_is_refused(tag):
    with pytest.raises(RegistrationError, match="a tag is one word of letters"):
        register(tag, kind=Kind.ACTION)


@pytest.mark.parametrize("tag", ["M", "_m", "Detect_2", "a-b.c", "Überfahrt"])
def test_a_tag_is_any_name_of_xml(tag):
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
def test_an_argument_of_another_type_is_refused_with_what_to_write(arguments, words):
    with pytest.raises(RegistrationError) as caught:
        register("M", **{"kind": Kind.ACTION, **arguments})
    assert str(caught.value) == words


def test_arguments_of_any_name_are_no_attributes():
    class Leaf(Still):
        def __init__(self, name: str, *args: int, **kwargs: int) -> None: ...

    assert list(NodeSpec("Leaf", Leaf, Kind.ACTION).parameters) == ["name"]


def test_a_module_gives_the_classes_that_carry_the_mark_themselves():
    registry = Registry()
    registry.add_module(leaves)
    assert [spec.tag for spec in registry] == ["Listen", "Say"]


def test_a_class_may_be_found_twice_but_a_tag_has_one_meaning():
    registry = Registry()
    registry.add_module(leaves)
    registry.add_module(leaves)

    @register("Say", kind=Kind.ACTION)
    class Impostor(Behaviour): ...

    with pytest.raises(
        RegistryError, match=r"two classes are registered as <Say>: .*leaves\.Say and .*Impostor"
    ):
        registry.add(getattr(Impostor, MARK))


def test_the_shipped_leaves_come_in_by_entry_point():
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


def test_every_shipped_node_describes_itself_and_its_outcomes():
    for spec in default_registry():
        assert spec.doc, spec.tag
        assert spec.statuses <= {"SUCCESS", "FAILURE", "RUNNING"}, spec.tag
        assert spec.statuses, spec.tag


def test_a_module_of_leaves_may_lie_in_the_current_folder(tmp_path, monkeypatch):
    (tmp_path / "my_leaves_in_a_folder.py").write_text(
        "from tests.nodes.leaves import Say\n", encoding="utf-8"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    assert "Say" in load_registry(["my_leaves_in_a_folder"])


@pytest.mark.parametrize("name", ["no_such_module", "tests.nodes.broken_leaves"])
def test_a_module_that_cannot_be_imported_is_named_with_the_reason(name):
    with pytest.raises(RegistryError, match=rf"'{name}' \(--nodes\) cannot be imported: \w+: "):
        load_registry([name])


def test_an_unknown_tag_has_no_spec():
    assert default_registry().get("Nonsense") is None
    assert default_registry().nearest("Sequnce") == "Sequence"


def test_the_fields_of_a_dataclass_are_a_constructor_as_any():
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


def test_a_class_is_marked_as_context_with_or_without_brackets():
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


def test_a_description_of_a_parameter_is_that_of_the_nearest_class_that_has_one():
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
def test_what_is_no_class_of_behaviours_is_refused(thing):
    with pytest.raises(RegistrationError, match="is not a behaviour class; derive it from"):
        register("Tag", kind=Kind.ACTION)(thing)


def test_a_meaning_in_other_words_than_semantics_is_refused():
    with pytest.raises(
        RegistrationError, match=r"semantics is the string 'sequence'; write for example Semantics\.sequence"
    ):
        register("Tag", kind=Kind.CONTROL, semantics="sequence")  # type: ignore[arg-type]


OWN = load_registry(["tests.analysis.verify.own_controls"])


@pytest.mark.parametrize(("children", "codes"), [(1, ["missing-child"]), (2, []), (3, ["too-many-children"])])
def test_a_control_of_ones_own_has_as_many_children_as_it_says(children, codes):
    body = f"<OwnRecovery>{'<Success/>' * children}</OwnRecovery>"
    assert [each.code for each in check(forest(body), OWN)] == codes


@pytest.mark.parametrize("count", [2, (0, 1), (3, 2), (1, "many"), (True, None, 2)])
def test_a_number_of_children_that_is_none_is_refused(count):
    with pytest.raises(RegistrationError, match=r"child_count is .*; write the minimum and maximum"):
        register("Tag", kind=Kind.CONTROL, child_count=count)


@pytest.mark.parametrize("count", [(1, 1), (1, None), (2, 3)])
def test_a_number_of_children_is_at_least_one(count):
    @register("Own", kind=Kind.CONTROL, child_count=count)
    class Own(Composite):
        def __init__(self, name: str, children: list[Behaviour]) -> None:
            super().__init__(name, children)

    assert spec_of(Own).child_count == count


def test_a_number_of_children_is_for_controls():
    with pytest.raises(RegistrationError, match="child_count is allowed only for controls"):
        register("Tag", kind=Kind.DECORATOR, child_count=(1, 1))


@pytest.mark.parametrize(("limit", "codes"), [("0", ["short-timeout"]), ("2", [])])
def test_a_limit_of_ones_own_is_read_off_the_attribute_that_the_meaning_names(limit, codes):
    body = f"<Sequence><OwnLimit seconds='{limit}'><Sleep msec='5'/></OwnLimit><Success/></Sequence>"
    assert [each.code for each in check(forest(body), OWN)] == codes


@pytest.mark.parametrize(
    ("tag", "words"),
    [
        ("OwnSlip", "OwnSlip raised IndexError: list index out of range, for 'Here' on line 3"),
        ("OwnGap", "OwnGap returned None. Return an outcome set, for example the set of a child"),
    ],
)
def test_a_function_of_the_semantics_that_goes_wrong_is_told_with_its_class_at_the_node(tag, words):
    (finding,) = check(forest(f'<{tag} name="Here"><Success/></{tag}>'), OWN)
    place = "the function 'possible' in the semantics of tests.analysis.verify.own_controls."
    assert (finding.code, finding.span.line) == ("faulty-class", 3)
    assert finding.message.startswith(f"<{tag}>: {place}{words}")
