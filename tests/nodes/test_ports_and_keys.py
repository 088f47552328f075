"""Tests of ports: literals, keys, and keys that nodes share."""

import enum
import math
from datetime import timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.compiler import bind_main, compile_tree, preview_tree
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import Kind, NodeSpec
from sar_compiler.nodes.values import ConversionError, Milliseconds, Seconds, literal_value, value_type_of
from sar_compiler.runtime.ports import InOut, Input, Output, PortError
from tests.trees import document, errors, forest, forest_of


class Colour(enum.IntEnum):
    RED = 1
    GREEN = 2


class Leaf(Behaviour):
    def update(self) -> Status:
        return Status.SUCCESS


class Read(Leaf):
    def __init__(
        self,
        name: str,
        *,
        number: Input[float] | None = None,
        count: Input[int] | None = None,
        text: Input[str] | None = None,
        flag: Input[bool] | None = None,
        colour: Input[Colour] | None = None,
        numbers: Input[list[int]] | None = None,
        reals: Input[list[float]] | None = None,
        wait: Input[timedelta] | None = None,
        patience: Input[Seconds] | None = None,
        pause: Input[Milliseconds] | None = None,
        thing: Input[object] | None = None,
    ) -> None:
        super().__init__(name)
        self.ports = {
            "number": number,
            "count": count,
            "text": text,
            "flag": flag,
            "colour": colour,
            "numbers": numbers,
            "reals": reals,
            "wait": wait,
            "patience": patience,
            "pause": pause,
            "thing": thing,
        }


class Write(Leaf):
    def __init__(
        self,
        name: str,
        to: Output[object],
        number: Output[float] | None = None,
        both: InOut[int] | None = None,
    ) -> None:
        super().__init__(name)
        self.to, self.number, self.both = to, number, both


class Fixed(Leaf):
    def __init__(self, name: str, text: str = "", numbers: list[int] | None = None) -> None:
        super().__init__(name)
        self.text, self.numbers = text, numbers


REGISTRY = Registry(
    [
        *default_registry().specs(),
        *(NodeSpec(cls.__name__, cls, Kind.ACTION) for cls in (Read, Write, Fixed)),
    ]
)


def compiled_nodes(body, parameters=None):
    """Return the behaviours of a compiled tree by name, and the tree under the empty name."""
    tree = compile_tree(bind_main(forest(body), REGISTRY), {}, parameters or {})
    return {node.name: node for node in tree.root.iterate()} | {"": tree}


def locate_findings(body):
    return [(f.code, f.span.line, f.span.column, f.suggestion) for f in errors(forest(body), REGISTRY)]


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ('number="1.5"', 1.5),
        ('number="2"', 2.0),
        ('number="-inf"', -math.inf),
        ('number="Infinity"', math.inf),
        ('reals="0.5;inf"', [0.5, math.inf]),
        ('count="-3"', -3),
        ('text="a {x} b"', "a {x} b"),
        ('text="{x"', "{x"),
        ('text="{}"', "{}"),
        ('flag="TRUE"', True),
        ('flag="0"', False),
        ('colour="GREEN"', Colour.GREEN),
        ('colour="2"', Colour.GREEN),
        ('numbers="1;2;3"', [1, 2, 3]),
        ('numbers=""', []),
        ('wait="500ms"', timedelta(seconds=0.5)),
        ('patience="500ms"', 0.5),
        ('patience="2"', 2.0),
        ('pause="1.5s"', 1500),
        ('pause="2"', 2),
        ('thing="plain"', "plain"),
        ("""thing='json:{"x": [1, 2.5, null]}'""", {"x": [1, 2.5, None]}),
    ],
)
def test_literal_is_converted_to_type_of_port(written, value):
    assert locate_findings(f"<Read {written}/>") == []
    port = compiled_nodes(f"<Read {written}/>")["Read"].ports[written.split("=")[0]]
    assert port.get() == value
    assert port.entry is None


@pytest.mark.parametrize(
    ("written", "suggestion"),
    [
        ('count="12abc"', None),
        ('count="2.0"', "2"),
        ('number="fast"', None),
        ('number="+inf"', None),
        ('number="infi"', None),
        ('count="inf"', None),
        ('flag="yes"', None),
        ('colour="GREN"', "GREEN"),
        ('colour="3"', None),
        ('thing="json:{"', None),
        ('thing="json:' + "[" * 100_000 + '"', None),
    ],
)
def test_unsuitable_literal_is_located(written, suggestion):
    ((code, line, column, suggested),) = locate_findings(f"<Read {written}/>")
    assert (code, line, column) == ("wrong-value", 3, len("<Read ") + written.index('"') + 2)
    assert suggested == suggestion


def test_float_port_accepts_nan():
    assert math.isnan(compiled_nodes('<Read number="nan"/>')["Read"].ports["number"].get())


@pytest.mark.parametrize("written", ["inf", "-inf", "nan"])
def test_attribute_that_is_no_port_must_be_finite(written):
    assert locate_findings(f'<Timeout duration="{written}"><Read/></Timeout>') == [
        ("wrong-value", 3, 20, None)
    ]


def test_unsuitable_item_of_list_is_located():
    ((code, line, column, _),) = locate_findings('<Read numbers="1;two;3"/>')
    assert (code, line, column) == ("wrong-value", 3, len('<Read numbers="1;') + 1)


@pytest.mark.parametrize("written", ["{heard}", " {heard} ", "{=}", "="])
def test_key_is_written_in_braces_or_defaults_to_port_name(written):
    key = "heard" if "heard" in written else "text"
    nodes = compiled_nodes(f'<Sequence><Write to="{{{key}}}"/><Read text="{written}"/></Sequence>')
    nodes["Write"].to.set("hello")
    assert nodes["Read"].ports["text"].get() == "hello"


def test_spaces_in_braces_belong_to_key():
    nodes = compiled_nodes('<Sequence><Write to="{ a }"/><Read text="{a}"/></Sequence>')
    nodes["Write"].to.set("hello")
    with pytest.raises(PortError, match="the key 'a' has no value"):
        nodes["Read"].ports["text"].get()


def test_unwritten_key_gives_default_or_raises_error_with_key():
    port = compiled_nodes('<Read number="{speed}"/>')["Read"].ports["number"]
    assert port.get(0.5) == 0.5
    with pytest.raises(PortError, match=r"number: \{speed\}: the key 'speed' has no value"):
        port.get()


@pytest.mark.parametrize(
    ("port", "held", "value"),
    [
        ("number", 3, 3.0),
        ("number", "2.5", 2.5),
        ("number", "inf", math.inf),
        ("count", 3.0, 3),
        ("count", "3", 3),
        ("text", 3, "3"),
        ("flag", 1, True),
        ("flag", "false", False),
        ("colour", 2, Colour.GREEN),
        ("colour", 2.0, Colour.GREEN),
        ("colour", "RED", Colour.RED),
        ("numbers", "1;2", [1, 2]),
        ("numbers", [1, 2], [1, 2]),
        ("wait", 2.5, timedelta(seconds=2.5)),
        ("wait", "1min", timedelta(minutes=1)),
        ("patience", "2min", 120.0),
        ("patience", 2, 2.0),
        ("pause", "2min", 120_000),
        ("pause", 2.0, 2),
        ("thing", None, None),
    ],
)
def test_value_of_key_is_converted_when_read(port, held, value):
    node = compiled_nodes(f'<Read {port}="{{k}}"/>', {"k": None})["Read"]
    node.ports[port].entry.write(held)
    assert node.ports[port].get() == value
    assert type(node.ports[port].get()) is type(value)


@pytest.mark.parametrize(
    ("port", "held"),
    [
        ("count", 2.5),
        ("count", "2.5"),
        ("count", "3 "),
        ("count", math.inf),
        ("count", math.nan),
        ("number", 10**400),
        ("number", "3m"),
        ("flag", 2),
        ("colour", 3),
        ("colour", "BLUE"),
        ("numbers", "1;x"),
        ("numbers", {1}),
        ("wait", "soon"),
        ("patience", "2m"),
        ("pause", 0.5),
        ("pause", -1),
        ("text", [1]),
    ],
)
def test_unsuitable_value_of_key_raises_error_with_port_and_key(port, held):
    node = compiled_nodes(f'<Read {port}="{{k}}"/>')["Read"]
    node.ports[port].entry.write(held)
    with pytest.raises(PortError, match=rf"{port}: \{{k\}}: "):
        node.ports[port].get()


VALUES = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text()
    | st.binary()
    | st.lists(st.integers())
)


@given(
    st.sampled_from([int, float, str, bool, Colour, timedelta, list[int], list[str]]),
    VALUES | st.integers(10**300, 10**400),
)
def test_any_value_is_converted_or_raises_conversion_error(annotation, value):
    value_type = value_type_of(annotation)
    assert value_type is not None
    assert value_type.python is not None
    try:
        fitted = value_type.fit(value)
    except ConversionError:
        return
    assert isinstance(fitted, value_type.python)
    assert value_type.fit(fitted) is fitted


def test_output_must_be_key():
    assert locate_findings('<Write to="goal"/>') == [("wrong-value", 3, 12, "{goal}")]
    (finding,) = errors(forest('<Write to="1 m"/>'), REGISTRY)
    assert (finding.suggestion, finding.hint) == (None, 'write to="{key}"')


def test_inout_port_may_be_constant_that_cannot_be_written():
    node = compiled_nodes('<Write to="{a}" both="3"/>')["Write"]
    assert node.both.get() == 3
    with pytest.raises(PortError, match="both is a constant"):
        node.both.set(4)


def test_inout_port_reads_and_writes_same_entry():
    node = compiled_nodes('<Write to="{a}" both="{a}"/>')["Write"]
    node.both.set(4)
    assert node.both.get() == 4
    assert node.both.entry == node.to.entry


def test_port_that_is_not_given_has_default_of_constructor():
    assert compiled_nodes("<Read/>")["Read"].ports["number"] is None


def test_attribute_that_is_no_port_accepts_mission_parameters():
    nodes = compiled_nodes('<Fixed numbers="{@ids}" text="{@who}"/>', {"ids": [4, 5], "who": "me"})
    assert (nodes["Fixed"].numbers, nodes["Fixed"].text) == ([4, 5], "me")


SHARED = {
    "a number and an integer": ('<Write to="{x}" number="{k}"/>', '<Read count="{k}"/>', "count"),
    "an integer and a text": ('<Read count="{k}"/>', '<Read text="{k}"/>', "text"),
    "a colour and an integer": ('<Read colour="{k}"/>', '<Read count="{k}"/>', "count"),
}


@pytest.mark.parametrize("name", SHARED)
def test_key_of_two_types_is_reported_at_second_port(name):
    first, second, port = SHARED[name]
    column = second.index("{k}") + 1
    assert locate_findings(f"<Sequence>\n{first}\n{second}</Sequence>") == [
        ("key-of-two-types", 5, column, None)
    ]
    (finding,) = errors(forest(f"<Sequence>\n{first}\n{second}</Sequence>"), REGISTRY)
    assert finding.message.startswith(f"{port}: 'k' is ")
    assert "(line 4)" in finding.message


@pytest.mark.parametrize(
    "body",
    [
        '<Sequence><Read text="{k}"/><Read count="{k}"/><Read number="{k}"/></Sequence>',
        '<Sequence><Read count="{k}"/><Read thing="{k}"/><Read count="{k}"/></Sequence>',
        '<Sequence><Read count="{k}"/><Read number="{K}"/></Sequence>',
    ],
)
def test_strings_and_untyped_ports_may_share_key_with_any_type(body):
    assert locate_findings(body) == []


def file_with_two_trees(outer, inner):
    return forest_of(
        f'<root BTCPP_format="4" main_tree_to_execute="Main">\n<BehaviorTree ID="Main">{outer}</BehaviorTree>\n'
        f'<BehaviorTree ID="B">{inner}</BehaviorTree></root>'
    )


def test_type_of_key_is_tracked_into_subtrees():
    outer = '<Sequence><Read count="{k}"/><SubTree ID="B" x="{k}"/></Sequence>'
    (finding,) = errors(file_with_two_trees(outer, '<Read number="{x}"/>'), REGISTRY)
    assert (finding.code, finding.span.line) == ("key-of-two-types", 3)
    assert "(line 2)" in finding.message


def test_keys_of_subtree_are_separate_unless_remapped():
    outer = '<Sequence><Read count="{k}"/><SubTree ID="B"/></Sequence>'
    assert errors(file_with_two_trees(outer, '<Read number="{k}"/>'), REGISTRY) == []


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("7", 7),
        ("-7", -7),
        ("1e3", 1000.0),
        ("0.5", 0.5),
        ("true", "true"),
        ("7 ", "7 "),
        ("", ""),
        ("1;2", "1;2"),
        (str(2**63 - 1), 2**63 - 1),
        (str(2**63), float(2**63)),
        ("1e999", "1e999"),
    ],
)
def test_constant_for_subtree_is_number_if_whole_text_is_number(text, value):
    assert literal_value(text) == value
    assert type(literal_value(text)) is type(value)


def test_preview_needs_no_values_of_keys():
    body = '<Sequence><Read number="{a}" thing="{b}"/><Fixed text="{@c}" numbers="{d}"/></Sequence>'
    assert preview_tree(bind_main(forest_of(document(body)), REGISTRY)).root.name == "Sequence"
