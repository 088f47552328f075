"""Tests of well-formed but wrong keys, scripts and subtrees: each error has one finding, with its location."""

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.checks import check
from sar_compiler.leaves import Kind
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.runtime.blackboard import Scope
from sar_compiler.runtime.ports import InOut, Input, Output
from sar_compiler.tree.diagnostic import Severity
from sar_compiler.tree.xml import parse_xml
from tests.trees import document, forest_of


class Leaf(Behaviour):
    def update(self) -> Status:
        return Status.SUCCESS


class Say(Leaf):
    def __init__(self, name: str, text: Input[str]) -> None:
        super().__init__(name)
        self.text = text


class Find(Leaf):
    def __init__(self, name: str, at: Output[str]) -> None:
        super().__init__(name)
        self.at = at


class Count(Leaf):
    def __init__(self, name: str, times: InOut[int]) -> None:
        super().__init__(name)
        self.times = times


class Meddle(Leaf):
    def __init__(self, name: str, scope: Scope) -> None:
        super().__init__(name)
        self.scope = scope


STATUSES = frozenset({"SUCCESS", "FAILURE"})
LEAVES = [NodeSpec(cls.__name__, cls, Kind.ACTION, STATUSES) for cls in (Say, Find, Meddle)]
REGISTRY = Registry([*default_registry().specs(), *LEAVES, NodeSpec("CountUp", Count, Kind.ACTION, STATUSES)])


def findings_in(text):
    return [(f.code, f.span.line, f.span.column, f.suggestion) for f in check(forest_of(text), REGISTRY)]


ERRORS = {
    "a key that nobody writes": (
        '<Say text="{greeting}"/>',
        ("unwritten-key", 3, 12, None),
        "'greeting' is read here, but never written",
    ),
    "a misspelt key": (
        '<Sequence>\n<Find at="{place}"/>\n<Say text="{plaice}"/>\n</Sequence>',
        ("unwritten-key", 5, 12, "{place}"),
        "'plaice' is read here",
    ),
    "blanks that belong to a key": (
        '<Sequence>\n<Find at="{place}"/>\n<Say text="{ place }"/>\n</Sequence>',
        ("unwritten-key", 5, 12, "{place}"),
        "' place ' is read here",
    ),
    "a variable that nobody makes": (
        '<ScriptCondition code="ready &amp;&amp; true"/>',
        ("unwritten-key", 3, 24, None),
        "'ready' is read here",
    ),
    "a misspelt variable": (
        '<Sequence>\n<Script code="level := 1"/>\n<ScriptCondition code="1 &lt; lvel"/>\n</Sequence>',
        ("unwritten-key", 5, 31, "level"),
        "'lvel' is read here",
    ),
    "a variable that is changed before anything makes it": (
        '<Script code="count = 1"/>',
        ("unwritten-key", 3, 15, None),
        "'=' and similar operators need an existing variable",
    ),
    "a variable in a condition": (
        '<Success _skipIf="done"/>',
        ("unwritten-key", 3, 19, None),
        "_skipIf: 'done' is read here",
    ),
    "a key with braces where its name is wanted": (
        '<Sequence>\n<SetBlackboard value="1" output_key="{speed}"/>\n<Success/>\n</Sequence>',
        ("unwritten-key", 4, 38, None),
        "'speed' is read here",
    ),
    "a key that is read before it is written": (
        '<Sequence>\n<Say text="{place}"/>\n<Find at="{place}"/>\n</Sequence>',
        ("read-before-write", 4, 12, None),
        "'Find' (line 5) writes it, but is ticked later",
    ),
    "a key that is read before it is written, by a condition around both": (
        '<Sequence _skipIf="place &gt; 1">\n<Find at="{place}"/>\n<Success/>\n</Sequence>',
        ("read-before-write", 3, 20, None),
        "'Find' (line 4)",
    ),
    "a variable that is made of itself": (
        '<Sequence>\n<Script code="n := n + 1"/>\n<ScriptCondition code="n &gt; 1"/>\n</Sequence>',
        ("read-before-write", 4, 20, None),
        "'n' is read here before it is written",
    ),
    "a variable that its script makes behind what reads it": (
        '<Sequence>\n<Script code="b := n; n := 1"/>\n<ScriptCondition code="b == n"/>\n</Sequence>',
        ("read-before-write", 4, 20, None),
        "'n' is read here before it is written",
    ),
    "a key that is written twice": (
        '<Sequence>\n<Script code="a := 1"/>\n<Script code="a := 2"/>\n<ScriptCondition code="a == 2"/>\n</Sequence>',
        ("overwritten-key", 5, 15, None),
        "before any node can read the value from 'Script' (line 4)",
    ),
    "a key that two leaves write before the one who reads it": (
        '<Sequence>\n<Find name="Left" at="{place}"/>\n<Find name="Right" at="{place}"/>\n<Say text="{place}"/>\n</Sequence>',
        ("overwritten-key", 5, 24, None),
        "read the value from 'Left' (line 4)",
    ),
    "a key that two write side by side": (
        (
            '<Sequence>\n<ParallelAll>\n<Find at="{p}"/>\n<Find name="Other" at="{p}"/>\n</ParallelAll>\n<Say text="{p}"/>\n'
            "</Sequence>"
        ),
        ("shared-key", 6, 24, None),
        "in parallel in 'ParallelAll'",
    ),
    "a key that is written for nobody": (
        '<Sequence>\n<Script code="a := 1"/>\n<Success/>\n</Sequence>',
        ("unread-key", 4, 15, None),
        "'a' is written here, but never read",
    ),
    **{
        f"an assignment in {attribute}": (
            f'<Sequence>\n<Script code="a := 1"/>\n<Success {attribute}="a = 2"/>\n</Sequence>',
            ("assignment-as-condition", 5, 14 + len(attribute), "=="),
            "'=' assigns to 'a' in a condition",
        )
        for attribute in ("_failureIf", "_successIf", "_skipIf", "_while")
    },
    "an assignment to a variable that nobody makes, in a condition": (
        '<Precondition if="a = 1 &lt; 2; a = 2"><Success/></Precondition>',
        ("assignment-as-condition", 3, 35, "=="),
        "'=' assigns to 'a' in a condition",
    ),
    "an assignment in a ScriptCondition": (
        '<ScriptCondition code="a := 2"/>',
        ("assignment-as-condition", 3, 26, None),
        "':=' assigns to 'a' in a condition",
    ),
    "a key without its closing brace": (
        '<Say text="{greeting"/>',
        ("unclosed-key", 3, 12, "{greeting}"),
        "is written in braces",
    ),
    "a key without its opening brace": (
        '<Say text="greeting}"/>',
        ("unclosed-key", 3, 12, "{greeting}"),
        "'greeting}' is read as a string",
    ),
    "a number's key without its closing brace": (
        '<Delay delay_msec="{wait"><Say text="hi"/></Delay>',
        ("wrong-value", 3, 20, "{wait}"),
        "a key needs two braces",
    ),
}


@pytest.mark.parametrize("name", ERRORS)
def test_wrongly_used_key_has_one_finding(name):
    body, expected, words = ERRORS[name]
    (finding,) = check(forest_of(document(body)), REGISTRY)
    span = finding.span
    assert (finding.code, span.line, span.column, finding.suggestion) == expected
    assert words in finding.message
    assert finding.suggestion or finding.hint


def trees(main, *others):
    inner = "".join(f'\n<BehaviorTree ID="{name}">{body}</BehaviorTree>' for name, body in others)
    return f'<root BTCPP_format="4" main_tree_to_execute="Main">\n<BehaviorTree ID="Main">{main}</BehaviorTree>{inner}</root>'


def test_unused_tree_is_reported():
    assert findings_in(trees("<Success/>", ("B", "<Success/>"))) == [("unused-tree", 3, 19, None)]


def test_only_outermost_of_unused_trees_is_reported():
    text = trees("<Success/>", ("B", '<SubTree ID="C"/>'), ("C", "<Success/>"))
    assert findings_in(text) == [("unused-tree", 3, 19, None)]


def test_unused_argument_of_subtree_suggests_similar_key():
    text = trees(
        '<SubTree ID="B" at="hi" texxt="hi"/>',
        ("B", '<Sequence><Say text="{text}"/><Say text="{at}"/></Sequence>'),
    )
    assert findings_in(text) == [("unused-argument", 2, 49, "text")]


def test_key_not_passed_to_subtree_is_found_at_its_read():
    (finding,) = check(forest_of(trees('<SubTree ID="B"/>', ("B", '<Say text="{text}"/>'))), REGISTRY)
    assert (finding.code, finding.span.line, finding.span.column) == ("unwritten-key", 3, 33)
    assert finding.hint == 'pass it to the subtree, <SubTree ID="B" text="..."/>, or write it in a node'


def test_key_passed_to_subtree_is_followed_to_early_read():
    text = trees(
        '<Sequence>\n<SubTree ID="B" text="{place}"/>\n<Find at="{place}"/></Sequence>',
        ("B", '<Say text="{text}"/>'),
    )
    assert findings_in(text) == [("read-before-write", 5, 33, None)]


def test_key_passed_without_braces_is_warning_at_argument():
    body = '<Sequence>\n<Find at="{place}"/>\n<SubTree ID="B" text="place"/>\n<SubTree ID="B" text="Place"/></Sequence>'
    (finding,) = check(forest_of(trees(body, ("B", '<Say text="{text}"/>'))), REGISTRY)
    assert (finding.code, finding.span.line, finding.span.column) == ("key-as-text", 4, 23)
    assert (finding.suggestion, finding.severity) == ("{place}", Severity.WARNING)


@pytest.mark.parametrize("other", ['text="{place}"', 'text="@place"', 'text="A place"', 'text=""'])
def test_other_string_argument_of_subtree_is_no_finding(other):
    body = f'<Sequence><Find at="{{place}}"/><Say text="{{place}}"/><SubTree ID="B" {other}/></Sequence>'
    assert check(forest_of(trees(body, ("B", '<Say text="{text}"/>'))), REGISTRY) == []


@pytest.mark.parametrize("code", ["text == 'place'", "1 == ('place' != text)"])
def test_string_that_subtree_compares_with_its_key_is_no_finding(code):
    body = '<Sequence><Find at="{place}"/><Say text="{place}"/><SubTree ID="B" text="place"/></Sequence>'
    assert check(forest_of(trees(body, ("B", f'<ScriptCondition code="{code}"/>'))), REGISTRY) == []


def test_string_that_subtree_compares_with_another_key_is_reported():
    body = '<Sequence><Find at="{place}"/><SubTree ID="B" text="place"/></Sequence>'
    text = trees(body, ("B", "<ScriptCondition code=\"text == 'a' || @x == 'place'\"/>"))
    assert "key-as-text" in [code for code, *_ in findings_in(text)]


@pytest.mark.parametrize(
    ("code", "statement"),
    [("n := 1 minute", "minute"), ("n := 1 if n else 2", "if n else 2"), ("minute; n := 1", "minute")],
)
def test_word_that_is_separate_statement_has_one_finding(code, statement):
    (finding,) = check(
        forest_of(document(f'<Sequence><Script code="{code}"/><ScriptCondition code="n == 1"/></Sequence>')),
        REGISTRY,
    )
    assert finding.code == "idle-statement"
    assert f"'{statement}'" in finding.message


MISSPELT = '<Find at="{place}"/><Say text="{plaice}"/>'


def test_misspelt_key_is_found_beside_another_error():
    body = f"<Sequence>{MISSPELT}<Wiat/></Sequence>"
    assert sorted(code for code, *_ in findings_in(document(body))) == ["unknown-node", "unwritten-key"]


@pytest.mark.parametrize(
    "mistake",
    [
        '<Fnd at="{plaice}"/>',
        '<Find att="{plaice}"/>',
        '<SubTree ID="Elsewhere"/>',
        '<SubTre ID="Elsewhere"/>',
        '<Wiat><Find at="{plaice}"/></Wiat>',
    ],
)
def test_misspelt_key_is_not_reported_if_faulty_node_may_write_it(mistake):
    codes = [code for code, *_ in findings_in(document(f"<Sequence>{MISSPELT}{mistake}</Sequence>"))]
    assert codes
    assert "unwritten-key" not in codes


def test_unwritten_key_is_not_reported_if_faulty_script_may_write_it():
    body = '<Sequence>\n<Script code="a :="/>\n<ScriptCondition code="a"/></Sequence>'
    assert [code for code, *_ in findings_in(document(body))] == ["script-error"]


CORRECT = {
    "a variable that its script has made": (
        '<Sequence><Script code="n := 1; b := n + (c := n)"/><ScriptCondition code="b == c"/></Sequence>'
    ),
    "a parameter of the mission": '<Say text="{@greeting}"/>',
    "a parameter in a script": '<Success _skipIf="@battery &lt; 20"/>',
    "a parameter that an attribute takes as well": '<Sequence><Timeout duration="{wait}"><Sleep msec="9"/></Timeout><Say text="{wait}"/></Sequence>',
    "a variable that an attribute takes when the tree is made": (
        '<Sequence><Script code="wait := 5"/><Timeout duration="{wait}"><Sleep msec="9"/></Timeout></Sequence>'
    ),
    "a port that is both": '<CountUp times="{n}"/>',
    "a name of an enumeration": '<Sequence><Script code="s := 1"/><ScriptCondition code="s == RED"/></Sequence>',
    "a key that is asked for first": (
        '<Selector><CheckBlackboardVariableExists variable_name="place"/><Find at="{place}"/></Selector>'
    ),
    "a read that a guard keeps from coming first": (
        '<Selector><Sequence><WasEntryUpdated entry="{p}"/><Say text="{p}"/></Sequence><Find at="{p}"/></Selector>'
    ),
    "a phase that others look at while something runs": (
        '<Sequence><Script code="phase := 0"/><Parallel><Sequence><Sleep msec="9"/><Say text="{phase}"/></Sequence>'
        '<Sequence><Script code="phase := 1"/><Sleep msec="9"/><Script code="phase := 2"/></Sequence></Parallel></Sequence>'
    ),
    "a signal from one branch to the other": (
        '<Parallel><Script code="stop := 1"/><Sequence _while="stop == 0"><Script code="stop := 0"/><Success/></Sequence>'
        "</Parallel>"
    ),
    "a leaf that may write any key": '<Sequence><Meddle/><Say text="{greeting}"/></Sequence>',
    "a key in the middle of a text": '<Say text="hello {name}, good morning"/>',
    "what one branch or another writes": (
        '<Sequence><Fallback><Find at="{p}"/><Find at="{p}"/></Fallback><Say text="{p}"/></Sequence>'
    ),
    "an entry that a port has named": '<Sequence><Script code="p = 1"/><Say text="{p}"/></Sequence>',
}


@pytest.mark.parametrize("name", CORRECT)
def test_correctly_used_keys_have_no_findings(name):
    findings = [f.render() for f in check(forest_of(document(CORRECT[name])), REGISTRY)]
    assert findings == []


def test_script_in_key_may_write_any_key_but_is_too_late_for_btcpp():
    body = '<Sequence><SetBlackboard value="a:=1" output_key="s"/><Script code="{s}"/><ScriptCondition code="a"/></Sequence>'
    (finding,) = check(forest_of(document(body)), REGISTRY)
    assert (finding.code, finding.severity) == ("cpp-type-mismatch", Severity.WARNING)
    assert "needs the script in 's' before <SetBlackboard> writes it" in finding.message


def test_script_passed_to_subtree_has_no_findings():
    text = (
        '<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M"><SubTree ID="P" s="a:=1"/></BehaviorTree>'
        '<BehaviorTree ID="P"><Script code="{s}"/></BehaviorTree></root>'
    )
    assert check(forest_of(text), REGISTRY) == []


def test_unread_key_is_info():
    body = '<Sequence><Script code="a := 1"/><Success/></Sequence>'
    (finding,) = check(forest_of(document(body)), REGISTRY)
    assert finding.severity is Severity.INFO


def test_tree_may_read_input_ports_of_its_model():
    text = document('<Say text="{greeting}"/>').replace(
        "</root>",
        '<TreeNodesModel><SubTree ID="Main"><input_port name="greeting"/></SubTree></TreeNodesModel></root>',
    )
    assert findings_in(text) == []


def test_unread_key_written_by_subtree_is_found_in_subtree():
    text = trees('<SubTree ID="B" p="{place}"/>', ("B", '<Script code="p := 1"/>'))
    assert findings_in(text) == [("unread-key", 3, 36, None)]


def test_unused_argument_does_not_hide_unread_key():
    text = trees(
        '<Sequence><Script code="a := 1"/><SubTree ID="B" x="{@y}"/></Sequence>', ("B", "<Success/>")
    )
    assert [code for code, *_ in findings_in(text)] == ["unread-key", "unused-argument"]


@pytest.mark.parametrize("leaf", ['<UnsetBlackboard key="a"/>', '<UnsetBlackboardVariable key="a"/>'])
def test_node_that_unsets_key_neither_reads_nor_writes_it(leaf):
    body = f'<Sequence>\n<Script code="a := 1"/>\n{leaf}\n</Sequence>'
    assert findings_in(document(body)) == [("unread-key", 4, 15, None)]
    body = f'<Sequence>\n{leaf}\n<Say text="{{a}}"/>\n</Sequence>'
    assert findings_in(document(body)) == [("unwritten-key", 5, 12, None)]


@pytest.mark.parametrize(
    "node",
    [
        '<CheckBlackboardVariableExists variable_name="a"/>',
        '<WaitForBlackboardVariable variable_name="a"/>',
        '<CheckBlackboardVariableValue variable="a" operator="eq" value="1"/>',
        '<WaitForBlackboardVariableValue variable="a" operator="eq" value="1"/>',
        '<CheckBlackboardVariableValues checks="a eq 1;a eq 2" operator="or"/>',
        '<CompareBlackboardVariables var1_key="a" var2_key="{@b}" operator="eq"/>',
        '<CompareBlackboardVariables var1_key="{@b}" var2_key="a" operator="eq"/>',
        '<WasEntryUpdated entry="a"/>',
        '<WasEntryUpdated entry="{a}"/>',
        '<SkipUnlessUpdated entry="a"><Success/></SkipUnlessUpdated>',
        '<WaitValueUpdate entry="a"><Success/></WaitValueUpdate>',
        *(f'<Loop{of} queue="{{a}}"><Success/></Loop{of}>' for of in ("Bool", "Double", "Int", "String")),
    ],
)
def test_node_that_tolerates_missing_key_may_precede_its_write(node):
    value = "'1'" if "queue" in node else "1"
    assert findings_in(document(f'<Sequence>{node}<Script code="a := {value}"/></Sequence>')) == []


@pytest.mark.parametrize(
    "node",
    [
        '<SetBlackboard output_key="a" value="1"/>',
        '<SetBlackboardVariable variable_name="a" variable_value="1"/>',
        '<StatusToBlackboard variable_name="a"><Success/></StatusToBlackboard>',
        '<ForEach source_key="{@list}" target_key="a"><Success/></ForEach>',
    ],
)
def test_node_that_writes_key_without_reading_it_overwrites_value(node):
    text = document(f'<Sequence>\n{node}\n{node}\n<Say text="{{a}}"/></Sequence>')
    assert [(code, line) for code, line, *_ in findings_in(text)] == [("overwritten-key", 5)]


@pytest.mark.parametrize(
    ("read", "written", "suggestion"),
    [("{survivr}", "{survivor}", "{survivor}"), ("{survivors}", "{survivor}", None), ("{survivor}", "{survivors}", None),
     ("{survivor2}", "{survivor1}", None)],
)  # fmt: skip
def test_unwritten_key_in_unused_tree_is_reported_only_if_misspelt(read, written, suggestion):
    body = f'<Sequence><Find at="{written}"/><Say text="{read}"/></Sequence>'
    text = (
        document("<Success/>")
        .replace("<root ", '<root main_tree_to_execute="Main" ')
        .replace("</root>", f'<BehaviorTree ID="Other">\n{body}\n</BehaviorTree></root>')
    )
    said = [each.suggestion for each in check(forest_of(text), REGISTRY) if each.code == "unwritten-key"]
    assert said == ([suggestion] if suggestion else [])


PALETTE = parse_xml(
    '<root BTCPP_format="4"><TreeNodesModel><Action ID="Drive"><input_port name="gear"/></Action>'
    '<Action ID="Look"><output_port name="seen"/></Action></TreeNodesModel></root>',
    "palette.xml",
)
LATE = '<ScriptCondition code="speed > 1"/>\n<Script code="speed := 2"/>'


def findings_beside_palette(body):
    """Return the findings about keys in a sequence with nodes that a palette describes."""
    findings = check(forest_of(document(f"<Sequence>\n{body}\n</Sequence>")), REGISTRY, [PALETTE])
    return [(each.code, each.severity.value, each.span.line) for each in findings]


@pytest.mark.parametrize(
    ("body", "code"),
    [
        (LATE, "read-before-write"),
        ('<Script code="count += 1"/>', "unwritten-key"),
        ('<Say text="{a}"/>', "unwritten-key"),
    ],
)
def test_key_without_value_beside_described_leaf_has_lower_severity(body, code):
    assert findings_beside_palette(f"{body}\n<Success/>") == [(code, "warning", 4)]
    assert findings_beside_palette(f'{body}\n<Drive gear="{{gear}}"/>') == [(code, "info", 4)]


def test_finding_of_lower_severity_names_exception():
    body = f'<Sequence>{LATE}<Drive gear="{{speed}}"/></Sequence>'
    (finding,) = check(forest_of(document(body)), REGISTRY, [PALETTE])
    assert finding.message.endswith("writes it, but is ticked later, unless C++ code writes it")


def test_only_output_port_of_described_leaf_writes_key():
    assert findings_beside_palette('<Look seen="{a}"/>\n<Say text="{a}"/>') == []
    assert findings_beside_palette('<Drive gear="{a}"/>\n<Say text="{a}"/>') == [("unwritten-key", "info", 5)]


def test_key_read_only_by_described_leaves_is_no_finding():
    assert findings_beside_palette('<Drive gear="{a}"/>\n<Look seen="{b}"/>') == []


@pytest.mark.parametrize(
    ("body", "finding"),
    [
        ('<Drive gear="{a}"/>\n<Look seen="{a}"/>', ("read-before-write", "info", 4)),
        ('<Look seen="{a}"/>\n<Drive gear="{ a}"/>', ("unwritten-key", "warning", 5)),
        (
            '<Look seen="{goal_pose}"/>\n<Drive gear="{goal_poes}"/>\n<Drive gear="{goal_poes}"/>',
            ("unwritten-key", "info", 5),
        ),
        ('<Look seen="{s}"/>\n<Script code="RED += 1"/>', ("unwritten-key", "info", 5)),
        ('<Look seen="{s}"/>\n<ScriptCondition code="s == RED"/>', ("unwritten-key", "info", 5)),
    ],
)
def test_key_error_beside_described_leaves_is_always_reported(body, finding):
    assert findings_beside_palette(body) == [finding]


def test_possible_enumerator_is_reported_with_that_reason():
    body = '<Sequence><Look seen="{s}"/><ScriptCondition code="s == RED"/></Sequence>'
    (finding,) = check(forest_of(document(body)), REGISTRY, [PALETTE])
    assert (
        "unless it is an enumerator; to declare enumerators, use [language.enums] in sar.toml"
        in finding.message
    )


def test_inout_port_may_use_key_that_no_node_writes():
    model = (
        '<TreeNodesModel><Action ID="Edit"><inout_port name="pose" type="Pose"/></Action></TreeNodesModel>'
    )
    tree = '<BehaviorTree ID="Main"><Edit pose="{pose}"/></BehaviorTree>'
    text = f'<root BTCPP_format="4" main_tree_to_execute="Main">{tree}{model}</root>'
    assert check(forest_of(text), default_registry()) == []
