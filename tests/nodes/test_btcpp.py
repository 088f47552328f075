"""Tests of the conversion of trees for BehaviorTree.CPP 4 and Groot2."""

import sys
from datetime import timedelta
from pathlib import Path

import py_trees
import pytest
from hypothesis import given
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.checks.btcpp_conversion import convert_to_btcpp
from sar_compiler.compiler import bind_main, compile_tree, preview_tree
from sar_compiler.compiler.outline import outline
from sar_compiler.leaves import Input, Kind, Seconds, register
from sar_compiler.nodes.btcpp.to_btcpp import to_btcpp
from sar_compiler.nodes.models.palette import is_built_in
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.runtime.clock import Clock, ManualClock
from sar_compiler.tree.diagnostic import Severity, TreeError
from sar_compiler.tree.discovery import read_tree_file
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.model import MODEL_TAG, SUBTREE_TAG
from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.xml_writer import write_xml
from sar_compiler.tree.yaml import parse_yaml
from sar_compiler.tree.yaml_writer import write_yaml
from tests.nodes import leaves
from tests.trees import document, errors, forest_of

TICKED: list[tuple[str, Status]] = []
STATUSES = {"S": Status.SUCCESS, "F": Status.FAILURE, "R": Status.RUNNING}


@register("Answer", kind=Kind.ACTION)
class Answer(Behaviour):
    """Returns the given statuses, repeatedly."""

    def __init__(self, name: str, statuses: str) -> None:
        super().__init__(name)
        self._statuses = statuses
        self._count = 0

    def update(self) -> Status:
        status = STATUSES[self._statuses[self._count % len(self._statuses)]]
        self._count += 1
        TICKED.append((self.name, status))
        return status


class Wait(Behaviour):
    """Has an integer attribute."""

    def __init__(self, name: str, amount: int) -> None:
        super().__init__(name)
        self.amount = amount

    def update(self) -> Status:
        return Status.SUCCESS


@register("Waits", kind=Kind.ACTION, outcomes={Status.SUCCESS})
class Waits(Behaviour):
    """Has a duration as a port and as an attribute."""

    def __init__(self, name: str, patience: Input[Seconds], limit: timedelta) -> None:
        super().__init__(name)
        self.patience, self.limit = patience, limit


REGISTRY = Registry(default_registry().specs())
BUILT_IN = {tag for tag, specs in REGISTRY.by_tag().items() if is_built_in(specs)} | {"SubTree"}
REGISTRY.add_module(leaves)
REGISTRY.add_module(sys.modules[__name__])

BITS = Registry([*REGISTRY.specs(), NodeSpec("Wait", Wait, Kind.ACTION)])


def convert_body(body, registry=REGISTRY):
    """Convert a tree; return its lines without the elements around it, and the notes."""
    tree_file, notes = to_btcpp(parse_xml(document(body), "a.xml"), registry)
    lines = [line.strip() for line in write_xml(tree_file).splitlines()]
    inside = lines[lines.index('<BehaviorTree ID="Main">') + 1 : lines.index("</BehaviorTree>")]
    return "".join(inside), notes


LEAF = '<Answer statuses="S"/>'


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (f'<Sequence memory="false">{LEAF}</Sequence>', f"<ReactiveSequence>{LEAF}</ReactiveSequence>"),
        (f'<Sequence memory="true">{LEAF}</Sequence>', f"<Sequence>{LEAF}</Sequence>"),
        (f'<Selector name="A">{LEAF}</Selector>', f'<Fallback name="A">{LEAF}</Fallback>'),
        (f'<Fallback memory="0">{LEAF}</Fallback>', f"<ReactiveFallback>{LEAF}</ReactiveFallback>"),
        (
            f'<ReactiveFallback memory="false">{LEAF}</ReactiveFallback>',
            f"<ReactiveFallback>{LEAF}</ReactiveFallback>",
        ),
        ("<Success/>", "<AlwaysSuccess/>"),
        ("<Failure/>", "<AlwaysFailure/>"),
        (
            '<Running name="Wait"/>',
            '<KeepRunningUntilFailure name="Wait"><AlwaysSuccess/></KeepRunningUntilFailure>',
        ),
        (f"<FailureIsSuccess>{LEAF}</FailureIsSuccess>", f"<ForceSuccess>{LEAF}</ForceSuccess>"),
        (f"<SuccessIsFailure>{LEAF}</SuccessIsFailure>", f"<ForceFailure>{LEAF}</ForceFailure>"),
        (
            f"<SuccessIsRunning>{LEAF}</SuccessIsRunning>",
            f"<KeepRunningUntilFailure>{LEAF}</KeepRunningUntilFailure>",
        ),
        (f'<Timeout duration="2.5">{LEAF}</Timeout>', f'<Timeout msec="2500">{LEAF}</Timeout>'),
        (f'<Timeout duration="0">{LEAF}</Timeout>', f'<Timeout msec="1">{LEAF}</Timeout>'),
        ('<Timer duration="1.5"/>', '<Sleep msec="1500"/>'),
        ("<Timer/>", '<Sleep msec="5000"/>'),
        (f'<Timeout duration="2min">{LEAF}</Timeout>', f'<Timeout msec="120000">{LEAF}</Timeout>'),
        ('<Sleep msec="1.5s"/>', '<Sleep msec="1500"/>'),
        ('<Action ID="Sleep" msec="1.5s"/>', '<Action ID="Sleep" msec="1500"/>'),
        (f'<Delay delay_msec="{{pause}}">{LEAF}</Delay>', f'<Delay delay_msec="{{pause}}">{LEAF}</Delay>'),
        ('<Waits patience="250ms" limit="2min"/>', '<Waits patience="0.25" limit="120"/>'),
        (f'<OneShot policy="ON_COMPLETION">{LEAF}</OneShot>', f'<RunOnce then_skip="false">{LEAF}</RunOnce>'),
        (
            '<Answer statuses="S" name="A" oneshot="ON_COMPLETION"/>',
            '<RunOnce name="AOneShot" then_skip="false"><Answer statuses="S" name="A"/></RunOnce>',
        ),
        (
            '<SubTree ID="Main" x="{y}" oneshot="ON_COMPLETION"/>',
            '<RunOnce name="MainOneShot" then_skip="false"><SubTree ID="Main" x="{y}"/></RunOnce>',
        ),
        (
            f'<Control ID="Selector" memory="false">{LEAF}</Control>',
            f'<Control ID="ReactiveFallback">{LEAF}</Control>',
        ),
        ('<Action name="A" ID="Success"/>', '<Action ID="AlwaysSuccess" name="A"/>'),
        ('<Success _skipIf="a &lt; 1"/>', '<AlwaysSuccess _skipIf="a &lt; 1"/>'),
    ],
)
def test_node_is_converted_to_equivalent_node(before, after):
    assert convert_body(before) == (after, [])


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ('<Retry num_failures="3">', '<RetryUntilSuccessful num_attempts="3">', "waits for the next tick"),
        ('<Retry num_failures="0">', '<RetryUntilSuccessful num_attempts="1">', "waits for the next tick"),
        (
            '<Retry num_failures="{@n}">',
            '<RetryUntilSuccessful num_attempts="{@n}">',
            "waits for the next tick",
        ),
        ('<Repeat num_success="3">', '<Repeat num_cycles="3">', "waits for the next tick"),
        ('<Repeat num_success="0">', '<Repeat num_cycles="-1">', "waits for the next tick"),
        (
            '<Parallel policy="SuccessOnAll">',
            '<Parallel success_count="-1" failure_count="1">',
            "ticks all children before it decides",
        ),
        (
            '<Parallel policy="SuccessOnOne" synchronise="false">',
            '<Parallel success_count="1" failure_count="1">',
            "ticks all children before it decides",
        ),
    ],
)
def test_slightly_different_counterpart_is_reported(before, after, words):
    tag = before[1:].split()[0]
    text, (note,) = convert_body(f"{before}{LEAF}</{tag}>")
    assert text.startswith(f"{after}{LEAF}")
    assert (note.code, note.severity, note.span.line) == ("differs", Severity.INFO, 3)
    assert words in note.message


@pytest.mark.parametrize(
    ("body", "part", "hint"),
    [
        (f"<RunningIsFailure>{LEAF}</RunningIsFailure>", "<RunningIsFailure>", "in C++"),
        (f"<FailureIsRunning>{LEAF}</FailureIsRunning>", "<FailureIsRunning>", "Inverter"),
        (
            f'<OneShot policy="ON_SUCCESSFUL_COMPLETION">{LEAF}</OneShot>',
            '<OneShot policy="ON_SUCCESSFUL_COMPLETION">',
            "in C++",
        ),
        (
            '<Success name="A" oneshot="ON_SUCCESSFUL_COMPLETION"/>',
            '<OneShot name="AOneShot" policy="ON_SUCCESSFUL_COMPLETION"><AlwaysSuccess name="A"/>',
            "in C++",
        ),
        (f'<Timeout duration="{{@t}}">{LEAF}</Timeout>', '<Timeout duration="{@t}">', "msec"),
        (f'<Sequence memory="{{@m}}">{LEAF}</Sequence>', '<Sequence memory="{@m}">', "write the value"),
        (
            '<Parallel policy="SuccessOnSelected" selected="A"><Answer name="A" statuses="S"/></Parallel>',
            '<Parallel policy="SuccessOnSelected" selected="A">',
            "success_count",
        ),
        (
            f'<Parallel policy="SuccessOnAll" synchronise="false">{LEAF}</Parallel>',
            '<Parallel policy="SuccessOnAll" synchronise="false">',
            "success_count",
        ),
    ],
)
def test_node_without_counterpart_is_kept_with_warning(body, part, hint):
    text, (note,) = convert_body(body)
    assert text.startswith(part)
    assert (note.code, note.severity, note.span.line) == ("no-counterpart", Severity.WARNING, 3)
    assert hint in note.hint


FAR = """<TreeNodesModel><Action ID="Far"><input_port name="a" type="int"/><input_port name="b" type="int64_t"/>
<input_port name="c" type="std::vector&lt;unsigned int>"/></Action></TreeNodesModel>"""


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ('<Far a="2147483647" b="2147483648" c="0;4294967295"/>', None),
        ('<Far a="{k}" c="{k}"/>', None),
        ('<Far a="2147483648"/>', "a: 2147483648 does not fit into BehaviorTree.CPP's int"),
        ('<Far a="-2147483649"/>', "a: -2147483649 does not"),
        ('<Far c="1;-1"/>', "c: -1 does not fit into BehaviorTree.CPP's unsigned int"),
        (f'<Repeat num_cycles="2147483648">{LEAF}</Repeat>', "num_cycles: 2147483648 does not"),
        (f'<Timeout duration="4294967.296">{LEAF}</Timeout>', "msec: 4294967296 does not"),
        (f'<LoopInt queue="1;2147483648" value="{{k}}">{LEAF}</LoopInt>', "queue: 2147483648 does not"),
        ('<Wait amount="2147483648"/>', "amount: 2147483648 does not"),
    ],
)
def test_integer_too_large_for_cpp_type_is_reported(body, told):
    file = parse_xml(f'<root BTCPP_format="4"><BehaviorTree ID="M">{body}</BehaviorTree>{FAR}</root>')
    found = [note for note in to_btcpp(file, BITS)[1] if "does not fit" in note.message]
    assert [(note.code, note.severity) for note in found] == [("no-counterpart", Severity.WARNING)] * bool(
        told
    )
    assert told is None or found[0].message.startswith(told)


def test_duration_with_unit_passed_to_subtree_is_reported():
    text = """<root BTCPP_format="4" main_tree_to_execute="A"><BehaviorTree ID="A"><Sequence>
<SubTree ID="B" pause="2min" note="2min"/>
<SubTree ID="B" pause="2000" note="text"/></Sequence></BehaviorTree>
<BehaviorTree ID="B"><Sequence><Sleep msec="{pause}"/><Script code="x := note"/></Sequence></BehaviorTree></root>"""
    _, notes = to_btcpp(parse_xml(text, "a.xml"), REGISTRY)
    assert [(note.code, note.span.line, note.hint) for note in notes] == [
        ("no-counterpart", 2, "write 120000 instead of 2min")
    ]


@pytest.mark.parametrize(
    ("body", "suggestion"),
    [
        (f'<Sequence memory="flase">{LEAF}</Sequence>', "false"),
        (f'<ReactiveSequence memory="flase">{LEAF}</ReactiveSequence>', "false"),
        (f'<Timeout duration="5 s">{LEAF}</Timeout>', "5s"),
        ('<Timer duration="5 s"/>', "5s"),
        (f'<Retry num_failures="2e0">{LEAF}</Retry>', "2"),
        (f'<OneShot policy="ON_COMPLETIO">{LEAF}</OneShot>', "ON_COMPLETION"),
        (
            '<Parallel policy="SuccessOnAll" synchronise="flase"><Answer statuses="S"/></Parallel>',
            "false",
        ),
        ('<Answer statuses="S" oneshot="ON_COMPLETIO"/>', "ON_COMPLETION"),
    ],
)
def test_invalid_value_is_kept_with_error(body, suggestion):
    text, notes = convert_body(body)
    assert text == body
    assert (notes[-1].code, notes[-1].severity) == ("wrong-value", Severity.ERROR)
    assert notes[-1].suggestion == suggestion


@pytest.mark.parametrize(
    "body",
    [
        f"<Retry>{LEAF}</Retry>",
        f'<Parallel failure_count="1">{LEAF}</Parallel>',
        f'<Repeat num_cycles="2">{LEAF}</Repeat>',
        f'<Timeout msec="2">{LEAF}</Timeout>',
        f"<OneShot>{LEAF}</OneShot>",
        "<Action/>",
    ],
)
def test_node_in_behaviortree_cpp_form_or_without_required_attributes_is_kept(body):
    assert convert_body(body)[0] == body


def test_unknown_attribute_is_removed_and_reported():
    text, (note,) = convert_body('<Answer statuses="S" colour="red" _description="an answer"/>')
    assert text == '<Answer statuses="S" _description="an answer"/>'
    assert (note.code, note.span.column) == ("left-out", 22)


def test_reference_is_kept_and_explained_in_first_note():
    body = '<Sequence><Say message="a"/><Listen name="A" to="Say"/><Listen name="B" to="Say"/></Sequence>'
    text, notes = convert_body(body)
    assert text.count('to="Say"') == 2
    assert [(note.code, note.severity) for note in notes] == [
        ("reference", Severity.INFO),
        ("reference", Severity.INFO),
    ]
    assert ["<Say>" in note.message for note in notes] == [True, False]


def test_implicit_reference_is_reported_at_node():
    (note,) = convert_body("<Listen/>")[1]
    assert (note.code, note.span.line, note.span.column) == ("reference", 3, 1)


def test_node_name_invalid_in_behaviortree_cpp_is_reported():
    (note,) = convert_body("<my.Node/>")[1]
    assert (note.code, note.severity) == ("no-counterpart", Severity.WARNING)
    assert note.hint == "register the node under a name without '.'"


def test_decorator_named_like_node_kind_is_written_in_explicit_form():
    text, _ = convert_body(f'<Condition status="SUCCESS">{LEAF}</Condition>')
    assert text == f'<Decorator ID="Condition" status="SUCCESS">{LEAF}</Decorator>'
    assert errors(Forest.from_file(parse_xml(document(text))), REGISTRY) == []


def test_explicit_form_becomes_compact_inside_reactive_sequence():
    text, (note,) = convert_body('<Sequence memory="false"><Action ID="Answer" statuses="S"/></Sequence>')
    assert text == f"<ReactiveSequence>{LEAF}</ReactiveSequence>"
    assert (note.code, note.severity) == ("differs", Severity.INFO)


def models_of(text, registry=REGISTRY):
    root = to_btcpp(parse_xml(text), registry)[0].root
    (section,) = [child for child in root.children if child.tag == MODEL_TAG]
    return {
        model.attributes["ID"]: (
            model.tag,
            [port.attributes["name"] for port in model.children if port.attributes],
        )
        for model in section.children
    }


def test_py_trees_node_survives_round_trip():
    body = "<Sequence><OneShot policy='ON_SUCCESSFUL_COMPLETION'><ZonesRemaining/></OneShot><Count><Success/></Count></Sequence>"
    text = write_xml(to_btcpp(parse_xml(document(body)), REGISTRY)[0])
    assert text.count('<Metadata library="py_trees"/>') == 2
    assert not any(node.spec.is_only_described for node in bind_main(forest_of(text), REGISTRY).all_nodes())


def test_model_describes_every_node_missing_in_behaviortree_cpp():
    body = '<Sequence><Answer statuses="S"/><Success oneshot="ON_SUCCESSFUL_COMPLETION"/></Sequence>'
    assert models_of(document(body)) == {
        "Answer": ("Action", ["statuses"]),
        "OneShot": ("Decorator", ["policy"]),
    }


def test_unknown_node_is_described_by_its_use():
    body = '<Many><One x="1"><None_ y="2"/></One><None_ name="A" z="3"/></Many>'
    assert models_of(document(body)) == {
        "Many": ("Control", []),
        "One": ("Decorator", ["x"]),
        "None_": ("Action", ["y", "z"]),
    }


def test_models_of_file_are_kept():
    own = '<TreeNodesModel><Condition ID="Mine"><output_port name="p"/></Condition></TreeNodesModel></root>'
    body = '<Sequence><Mine q="1"/><Answer statuses="S"/></Sequence>'
    assert models_of(document(body).replace("</root>", own)) == {
        "Mine": ("Condition", ["p"]),
        "Answer": ("Action", ["statuses"]),
    }


def test_model_is_copied_from_palette():
    palette = parse_xml(
        '<root><TreeNodesModel><Condition ID="Mine"><input_port name="p">Text.</input_port></Condition></TreeNodesModel></root>'
    )
    text = write_xml(to_btcpp(parse_xml(document("<Mine/>")), REGISTRY, [palette])[0])
    assert '<input_port name="p">Text.</input_port>' in text


def test_tree_without_id_gets_id_if_models_are_added():
    text = write_xml(to_btcpp(parse_xml(f"<root><BehaviorTree>{LEAF}</BehaviorTree></root>"), REGISTRY)[0])
    assert '<root BTCPP_format="4">' in text
    assert '<BehaviorTree ID="BehaviorTree_1">' in text


@pytest.mark.parametrize(
    ("tree_id", "words"),
    [
        ("My tree", "rejects the ID 'My tree'"),
        ("Root", "rejects the ID 'Root'"),
        ("Inverter", "the ID 'Inverter', because a node has the same ID"),
        ("Mine", "the ID 'Mine', because a node has the same ID"),
    ],
)
def test_tree_id_invalid_in_behaviortree_cpp_is_reported(tree_id, words):
    tree_file = parse_xml(document("<Mine/>", main=tree_id))
    (note,) = to_btcpp(tree_file, REGISTRY)[1]
    assert note.severity is Severity.WARNING
    assert words in note.message


def test_included_file_is_reported_as_not_converted():
    (note,) = to_btcpp(parse_xml('<root><include path="a.xml"/></root>'), REGISTRY)[1]
    assert (note.code, note.severity) == ("not-converted", Severity.INFO)


def test_comments_keep_their_positions():
    text, _ = convert_body(
        "<!-- a -->\n<Selector>\n<!-- b -->\n<Running/> <!-- c -->\n<!-- d -->\n</Selector>"
    )
    assert text == (
        "<!-- a --><Fallback><!-- b --><KeepRunningUntilFailure>  <!-- c -->"
        "<AlwaysSuccess/></KeepRunningUntilFailure><!-- d --></Fallback>"
    )


def test_yaml_tree_is_converted_like_xml_tree():
    tree = document('<Selector memory="false"><Answer statuses="S" oneshot="ON_COMPLETION"/></Selector>')
    in_yaml = parse_yaml(write_yaml(parse_xml(tree)))
    assert (
        convert_to_btcpp(Forest.from_file(in_yaml), REGISTRY).text
        == convert_to_btcpp(Forest.from_file(parse_xml(tree)), REGISTRY).text
    )


def test_file_with_stray_text_is_not_converted():
    with pytest.raises(TreeError, match="stray-text"):
        convert_to_btcpp(forest_of(document("<Success/> oops")), REGISTRY)


SHIPPED = "trees/search_and_rescue.xml"


def comparable_outline(node):
    """Return an outline without the differences that the conversion makes on purpose."""
    cls = (
        node["class"]
        .rsplit(".", maxsplit=1)[-1]
        .replace("RunOnceNode", "OneShot")
        .replace("Selector", "Fallback")
    )
    attributes = {k: v for k, v in node["attributes"].items() if k != "then_skip"}
    memory = node.get("memory")
    return cls, node["name"], memory, attributes, [comparable_outline(child) for child in node["children"]]


def shipped_outline(tree_file):
    forest = Forest.from_file(tree_file)
    assert errors(forest, REGISTRY) == []
    return comparable_outline(outline(preview_tree(bind_main(forest, REGISTRY))))


def test_shipped_mission_survives_round_trip():
    tree_file = read_tree_file(SHIPPED)
    result = convert_to_btcpp(Forest.from_file(tree_file), REGISTRY)
    assert {note.severity for note in result.losses} == {Severity.INFO}
    assert shipped_outline(parse_xml(result.text)) == shipped_outline(tree_file)
    assert convert_to_btcpp(forest_of(result.text), REGISTRY).text == result.text


@pytest.mark.parametrize("path", [SHIPPED, *sorted(map(str, Path("examples").rglob("*.xml")))])
def test_converted_shipped_trees_contain_only_built_in_or_described_nodes(path):
    root = to_btcpp(read_tree_file(path), REGISTRY)[0].root
    described = {
        model.attributes["ID"]
        for section in root.children
        if section.tag == MODEL_TAG
        for model in section.children
    }
    nodes = [
        node
        for tree in root.children
        if tree.tag != MODEL_TAG
        for child in tree.children
        for node in child.iterate()
    ]
    assert {node.tag for node in nodes} <= BUILT_IN | described | {SUBTREE_TAG}
    assert not {"memory", "oneshot"} & {name for node in nodes for name in node.attributes}


# Nodes whose counterpart does exactly the same in every tick.
WRAPPERS = [
    "Inverter",
    "FailureIsSuccess",
    "SuccessIsFailure",
    "SuccessIsRunning",
    'OneShot policy="ON_COMPLETION"',
]
CONTROLS = [
    f'{tag} memory="{memory}"' for tag in ("Sequence", "Selector", "Fallback") for memory in ("true", "false")
]
ONCE = st.sampled_from(["", "", ' oneshot="ON_COMPLETION"', ' oneshot="ON_SUCCESSFUL_COMPLETION"'])


def element(start, content):
    return f"<{start}>{content}</{start.split()[0]}>"


BODIES = st.recursive(
    st.builds('<Answer statuses="{}"{}/>'.format, st.text("SFR", min_size=1, max_size=3), ONCE)
    | st.sampled_from(["<Success/>", "<Failure/>", "<Running/>"]),
    lambda inner: (
        st.builds(element, st.sampled_from(WRAPPERS), inner)
        | st.builds(element, st.sampled_from(CONTROLS), st.lists(inner, min_size=1, max_size=3).map("".join))
    ),
    max_leaves=8,
)


def with_named_leaves(body):
    """Give every stub leaf a unique name."""
    first, *rest = body.split("<Answer ")
    return first + "".join(f'<Answer name="a{number}" {part}' for number, part in enumerate(rest))


def run(tree_file):
    """Tick a tree several times, and return the statuses of its root and its leaves."""
    forest = Forest.from_file(tree_file)
    assert errors(forest, REGISTRY) == []
    tree = compile_tree(bind_main(forest, REGISTRY), {Clock: ManualClock()}, {})
    trace = []
    for _ in range(6):
        TICKED.clear()
        tree.root.tick_once()
        trace.append((tree.root.status, TICKED[:]))
    tree.root.stop(py_trees.common.Status.INVALID)
    return trace


@given(BODIES.map(with_named_leaves))
def test_converted_tree_behaves_like_original(body):
    tree_file = parse_xml(document(body))
    assert run(parse_xml(convert_to_btcpp(Forest.from_file(tree_file), REGISTRY).text)) == run(tree_file)


def test_built_in_nodes_are_those_of_behaviortree_cpp():
    assert {
        *(
            "AlwaysFailure",
            "AlwaysSuccess",
            "AsyncFallback",
            "AsyncSequence",
            "Delay",
            "Fallback",
            "ForceFailure",
        ),
        *(
            "ForceSuccess",
            "IfThenElse",
            "Inverter",
            "KeepRunningUntilFailure",
            "LoopBool",
            "LoopDouble",
            "LoopInt",
        ),
        *(
            "LoopString",
            "Parallel",
            "ParallelAll",
            "Precondition",
            "ReactiveFallback",
            "ReactiveSequence",
            "Repeat",
        ),
        *("RetryUntilSuccessful", "RunOnce", "Script", "ScriptCondition", "Sequence", "SequenceWithMemory"),
        *(
            "SetBlackboard",
            "SkipUnlessUpdated",
            "Sleep",
            "SubTree",
            "Switch2",
            "Switch3",
            "Switch4",
            "Switch5",
        ),
        *(
            "Switch6",
            "Timeout",
            "TryCatch",
            "UnsetBlackboard",
            "WaitValueUpdate",
            "WasEntryUpdated",
            "WhileDoElse",
        ),
    } == BUILT_IN


def test_every_spec_states_whether_behaviortree_cpp_has_its_tag():
    specs = list(default_registry())
    assert [
        spec.tag for spec in specs if spec.semantics.counterpart.built_in is not (spec.tag in BUILT_IN)
    ] == []


def test_node_named_like_kind_stays_in_explicit_form_with_warning():
    model = '<TreeNodesModel><Action ID="Action"/></TreeNodesModel>'
    text = document('<ReactiveSequence><Action ID="Action"/></ReactiveSequence>').replace(
        "</root>", f"{model}</root>"
    )
    tree_file, notes = to_btcpp(parse_xml(text), default_registry())
    [node] = tree_file.trees[0].children[0].children
    assert (node.tag, node.attributes) == ("Action", {"ID": "Action"})
    assert [(note.code, note.hint) for note in notes] == [("no-counterpart", "wrap it in a Sequence")]
