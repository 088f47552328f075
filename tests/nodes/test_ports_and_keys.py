"""Ports: literals, keys, and keys that nodes share."""

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


def made(body, parameters=None):
    """Return the behaviours of a tree by their names."""
    tree = compile_tree(bind_main(forest(body), REGISTRY), {}, parameters or {})
    return {node.name: node for node in tree.root.iterate()} | {"": tree}


def found(body):
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
def test_a_literal_has_the_type_of_its_port(written, value):
    assert found(f"<Read {written}/>") == []
    port = made(f"<Read {written}/>")["Read"].ports[written.split("=")[0]]
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
def test_a_literal_that_does_not_fit_is_a_finding_at_the_value(written, suggestion):
    ((code, line, column, suggested),) = found(f"<Read {written}/>")
    assert (code, line, column) == ("wrong-value", 3, len("<Read ") + written.index('"') + 2)
    assert suggested == suggestion


def test_a_port_for_real_numbers_takes_what_is_none():
    assert math.isnan(made('<Read number="nan"/>')["Read"].ports["number"].get())


@pytest.mark.parametrize("written", ["inf", "-inf", "nan"])
def test_what_is_no_port_must_be_finite(written):
    assert found(f'<Timeout duration="{written}"><Read/></Timeout>') == [("wrong-value", 3, 20, None)]


def test_an_item_of_a_list_that_does_not_fit_is_a_finding_at_the_item():
    ((code, line, column, _),) = found('<Read numbers="1;two;3"/>')
    assert (code, line, column) == ("wrong-value", 3, len('<Read numbers="1;') + 1)


@pytest.mark.parametrize("written", ["{heard}", " {heard} ", "{=}", "="])
def test_a_key_is_written_in_braces_or_left_to_the_name_of_the_port(written):
    key = "heard" if "heard" in written else "text"
    nodes = made(f'<Sequence><Write to="{{{key}}}"/><Read text="{written}"/></Sequence>')
    nodes["Write"].to.set("hello")
    assert nodes["Read"].ports["text"].get() == "hello"


def test_spaces_in_the_braces_belong_to_the_key():
    nodes = made('<Sequence><Write to="{ a }"/><Read text="{a}"/></Sequence>')
    nodes["Write"].to.set("hello")
    with pytest.raises(PortError, match="the key 'a' has no value"):
        nodes["Read"].ports["text"].get()


def test_a_key_that_nobody_has_written_is_an_error_that_names_it_or_the_default_given():
    port = made('<Read number="{speed}"/>')["Read"].ports["number"]
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
def test_what_a_key_holds_is_converted_when_it_is_read(port, held, value):
    node = made(f'<Read {port}="{{k}}"/>', {"k": None})["Read"]
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
def test_what_does_not_fit_whole_is_an_error_that_names_port_and_key(port, held):
    node = made(f'<Read {port}="{{k}}"/>')["Read"]
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
def test_any_value_fits_a_type_or_is_refused_in_words(annotation, value):
    value_type = value_type_of(annotation)
    assert value_type is not None
    assert value_type.python is not None
    try:
        fitted = value_type.fit(value)
    except ConversionError:
        return
    assert isinstance(fitted, value_type.python)
    assert value_type.fit(fitted) is fitted


def test_an_output_must_be_a_key():
    assert found('<Write to="goal"/>') == [("wrong-value", 3, 12, "{goal}")]
    (finding,) = errors(forest('<Write to="1 m"/>'), REGISTRY)
    assert (finding.suggestion, finding.hint) == (None, 'write to="{key}"')


def test_an_inout_port_may_be_a_constant_which_cannot_be_written():
    node = made('<Write to="{a}" both="3"/>')["Write"]
    assert node.both.get() == 3
    with pytest.raises(PortError, match="both is a constant"):
        node.both.set(4)


def test_an_inout_port_reads_and_writes_one_entry():
    node = made('<Write to="{a}" both="{a}"/>')["Write"]
    node.both.set(4)
    assert node.both.get() == 4
    assert node.both.entry == node.to.entry


def test_ports_that_are_not_written_are_left_to_the_constructor():
    assert made("<Read/>")["Read"].ports["number"] is None


def test_a_list_of_the_mission_reaches_an_attribute_that_is_fixed():
    nodes = made('<Fixed numbers="{@ids}" text="{@who}"/>', {"ids": [4, 5], "who": "me"})
    assert (nodes["Fixed"].numbers, nodes["Fixed"].text) == ([4, 5], "me")


SHARED = {
    "a number and an integer": ('<Write to="{x}" number="{k}"/>', '<Read count="{k}"/>', "count"),
    "an integer and a text": ('<Read count="{k}"/>', '<Read text="{k}"/>', "text"),
    "a colour and an integer": ('<Read colour="{k}"/>', '<Read count="{k}"/>', "count"),
}


@pytest.mark.parametrize("name", SHARED)
def test_a_key_of_two_types_is_a_finding_at_the_second_port(name):
    first, second, port = SHARED[name]
    column = second.index("{k}") + 1
    assert found(f"<Sequence>\n{first}\n{second}</Sequence>") == [("key-of-two-types", 5, column, None)]
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
def test_texts_and_anything_share_a_key_with_every_type(body):
    assert found(body) == []


def in_two_files(outer, inner):
    return forest_of(
        f'<root BTCPP_format="4" main_tree_to_execute="Main">\n<BehaviorTree ID="Main">{outer}</BehaviorTree>\n'
        f'<BehaviorTree ID="B">{inner}</BehaviorTree></root>'
    )


def test_the_type_of_a_key_is_followed_into_subtrees():
    outer = '<Sequence><Read count="{k}"/><SubTree ID="B" x="{k}"/></Sequence>'
    (finding,) = errors(in_two_files(outer, '<Read number="{x}"/>'), REGISTRY)
    assert (finding.code, finding.span.line) == ("key-of-two-types", 3)
    assert "(line 2)" in finding.message


def test_keys_of_subtrees_that_nobody_passes_on_are_their_own():
    outer = '<Sequence><Read count="{k}"/><SubTree ID="B"/></Sequence>'
    assert errors(in_two_files(outer, '<Read number="{k}"/>'), REGISTRY) == []


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
def test_a_constant_for_a_subtree_is_a_number_where_all_of_it_is_one(text, value):
    assert literal_value(text) == value
    assert type(literal_value(text)) is type(value)


def test_a_preview_needs_no_value_for_any_key():
    body = '<Sequence><Read number="{a}" thing="{b}"/><Fixed text="{@c}" numbers="{d}"/></Sequence>'
    assert preview_tree(bind_main(forest_of(document(body)), REGISTRY)).root.name == "Sequence"
