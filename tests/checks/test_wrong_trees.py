"""Tests of well-formed but wrong trees: each error has one finding, with its location."""

import html
from dataclasses import replace

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Sequence

from sar_compiler.checks import check
from sar_compiler.leaves import Kind, register
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.semantics import Semantics
from sar_compiler.nodes.spec import MARK, NodeSpec, Use
from sar_compiler.tree.diagnostic import Severity
from sar_compiler.tree.xml import parse_xml
from tests.trees import document, forest_of


def leaf(tag, outcomes, kind=Kind.ACTION, effects="", uses=()):
    """Return the specification of a leaf, of which only the declaration matters."""

    def init(self, name: str) -> None:
        Behaviour.__init__(self, name)

    cls = type(tag, (Behaviour,), {"__init__": init, "update": lambda _: Status.SUCCESS})
    return NodeSpec(tag, cls, kind, frozenset(outcomes), effects, uses)


WORKING = {"SUCCESS", "FAILURE", "RUNNING"}
LEAVES = [
    leaf("Ready", {"SUCCESS", "FAILURE"}, Kind.CONDITION),
    leaf("Beep", {"SUCCESS"}, effects="publishes a tone"),
    leaf("Drive", WORKING, effects="drives the robot", uses=(Use.action("go"),)),
    leaf("Look", WORKING, effects="searches the room"),
    leaf("Wait", {"SUCCESS", "RUNNING"}),
    leaf("Unknown", ()),
]
REGISTRY = Registry([*default_registry().specs(), *LEAVES])


def findings_of(text):
    return check(forest_of(text), REGISTRY)


def findings_in(text):
    return [(f.code, f.span.line, f.span.column) for f in findings_of(text)]


# Each: the text of the tree (its first line is line 3), then code, line, column and a part of the message.
ERRORS = {
    # repeated effects, repeated interruptions
    "an action before one that takes time, without memory": (
        '<Sequence name="S" memory="false">\n<Ready/>\n<Beep/>\n<Drive/>\n</Sequence>',
        ("repeated-effect", 5, 1, "'Beep' would publish a tone in every tick while 'Drive' runs"),
    ),
    "the same in a ReactiveSequence": (
        "<ReactiveSequence>\n<Beep/>\n<Wait/>\n</ReactiveSequence>",
        ("repeated-effect", 4, 1, "'ReactiveSequence' re-evaluates every child in each tick"),
    ),
    "two actions that take time, without memory": (
        '<Sequence memory="false">\n<Ready/>\n<Look/>\n<Drive/>\n</Sequence>',
        ("endless-restart", 5, 1, "interrupts 'Drive' before that ends"),
    ),
    "an action that is tried again before another one can end": (
        "<ReactiveFallback>\n<Look/>\n<Drive/>\n</ReactiveFallback>",
        ("endless-restart", 4, 1, "after it has failed, and interrupts 'Drive'"),
    ),
    "work that is done and started again": (
        '<Selector name="S" memory="false">\n<Sequence><Ready/><Look/></Sequence>\n<Drive/>\n</Selector>',
        ("repeated-effect", 5, 1, "'Drive' would be sent a new goal in every tick"),
    ),
    "steps that are lost when they are interrupted": (
        (
            '<Selector memory="false">\n<Sequence><Ready/><Wait/></Sequence>\n'
            '<Sequence name="Steps">\n<Look/><Drive/></Sequence>\n</Selector>'
        ),
        ("lost-progress", 5, 1, "'Steps' starts over with 'Look'"),
    ),
    # unreachable nodes, endless nodes
    "a child behind one that cannot fail": (
        "<Selector>\n<Ready/>\n<Beep/>\n<Drive/>\n</Selector>",
        ("unreachable-node", 6, 1, "'Drive' is never ticked: the previous child 'Beep' never fails"),
    ),
    "a child behind one that cannot succeed": (
        "<Sequence>\n<SuccessIsFailure><Ready/></SuccessIsFailure>\n<Drive/>\n</Sequence>",
        ("unreachable-node", 5, 1, "the previous child 'SuccessIsFailure' never succeeds"),
    ),
    "a child behind a selector that cannot fail": (
        "<Selector>\n<Selector><Ready/><Beep/></Selector>\n<Drive/>\n</Selector>",
        ("unreachable-node", 5, 1, "the previous child 'Selector' never fails"),
    ),
    "a child behind a placeholder that runs for ever": (
        "<Sequence>\n<Running/>\n<Drive/>\n</Sequence>",
        ("unreachable-node", 5, 1, "the previous child 'Running' never succeeds"),
    ),
    "a branch for a condition that cannot be false": (
        "<IfThenElse>\n<Beep/>\n<Drive/>\n<Look/>\n</IfThenElse>",
        ("unreachable-node", 6, 1, "'Beep' never fails"),
    ),
    "a catch where nothing can fail": (
        "<TryCatch>\n<Beep/>\n<Look/>\n</TryCatch>",
        ("unreachable-node", 5, 1, "'Beep' never fails"),
    ),
    "no rounds at all": (
        '<Repeat num_cycles="0">\n<Drive/>\n</Repeat>',
        ("unreachable-node", 4, 1, "'Repeat' ticks it 0 times"),
    ),
    "rounds without an end": (
        '<Sequence>\n<Repeat num_cycles="-1"><Beep/></Repeat>\n<Drive/>\n</Sequence>',
        ("never-ends", 4, 1, "'Repeat' never ends: 'Beep' never fails"),
    ),
    "py_trees' rounds without an end": (
        '<Sequence>\n<Repeat num_success="0"><Beep/></Repeat>\n<Drive/>\n</Sequence>',
        ("never-ends", 4, 1, "'Beep' never fails"),
    ),
    "attempts without an end at the very top": (
        '<RetryUntilSuccessful num_attempts="-1">\n<Failure/>\n</RetryUntilSuccessful>',
        ("never-ends", 3, 1, "'Failure' never succeeds"),
    ),
    "a constant that is taken for running": (
        "<SuccessIsRunning>\n<Beep/>\n</SuccessIsRunning>",
        ("never-ends", 3, 1, "'SuccessIsRunning' never ends"),
    ),
    "waiting for a status that never comes": (
        '<Condition status="FAILURE">\n<Beep/>\n</Condition>',
        ("never-ends", 3, 1, "'Beep' never fails"),
    ),
    "waiting in the middle for what never comes": (
        '<Sequence>\n<Condition status="FAILURE"><Beep/></Condition>\n<Drive/>\n</Sequence>',
        ("never-ends", 4, 1, "'Beep' never fails"),
    ),
    # no effect, or an unintended effect
    "trying again what cannot fail": (
        '<Retry num_failures="3">\n<Beep/>\n</Retry>',
        ("without-effect", 3, 1, "'Retry' has no effect: 'Beep' never fails"),
    ),
    "a time limit for what ends at once": (
        '<Timeout duration="5">\n<Ready/>\n</Timeout>',
        ("without-effect", 3, 1, "'Ready' always ends in its first tick"),
    ),
    "a time limit of none": (
        '<Timeout msec="0">\n<Drive/>\n</Timeout>',
        ("without-effect", 3, 1, 'msec="0" is no limit'),
    ),
    "a time limit longer than the one around it": (
        (
            '<Timeout name="Outer" duration="5">\n<Sequence>\n<Look/>\n<Timeout msec="8000"><Drive/></Timeout>\n'
            "</Sequence>\n</Timeout>"
        ),
        ("without-effect", 6, 1, "its limit of 8 s never expires before the limit of 5 s of 'Outer'"),
    ),
    "a time limit of a tick": (
        '<Timeout duration="0.2">\n<Drive/>\n</Timeout>',
        ("short-timeout", 3, 1, "little more than one tick"),
    ),
    "running taken for failure": (
        "<RunningIsFailure>\n<Drive/>\n</RunningIsFailure>",
        ("interrupted-action", 3, 1, "'Drive' is interrupted in every tick in which it runs"),
    ),
    "running taken for success": (
        "<RunningIsSuccess>\n<Drive/>\n</RunningIsSuccess>",
        ("interrupted-action", 3, 1, "'RunningIsSuccess' ends"),
    ),
    "trying again what is done only once": (
        '<RetryUntilSuccessful num_attempts="3">\n<Drive oneshot="ON_COMPLETION"/>\n</RetryUntilSuccessful>',
        ("without-effect", 3, 1, "'Drive' runs only once"),
    ),
    "repeating what is done only once": (
        '<Repeat num_success="3">\n<OneShot policy="ON_SUCCESSFUL_COMPLETION"><Drive/></OneShot>\n</Repeat>',
        ("without-effect", 3, 1, "'OneShot' runs only once"),
    ),
    # needless nodes
    "a control of one": (
        "<Sequence>\n<Drive/>\n</Sequence>",
        ("needless-node", 3, 1, "its only child is 'Drive'"),
    ),
    "a parallel of one": (
        "<ParallelAll>\n<Drive/>\n</ParallelAll>",
        ("needless-node", 3, 1, "its only child is 'Drive'"),
    ),
    "a single attempt": (
        '<Retry num_failures="1">\n<Drive/>\n</Retry>',
        ("needless-node", 3, 1, "is also executed once without this decorator"),
    ),
    "a single round": (
        '<Repeat num_cycles="1">\n<Drive/>\n</Repeat>',
        ("needless-node", 3, 1, "is also executed once without this decorator"),
    ),
    "an inverter of an inverter": (
        "<Inverter>\n<Inverter>\n<Ready/>\n</Inverter>\n</Inverter>",
        ("needless-node", 3, 1, "reverses the effect of 'Inverter'"),
    ),
    # parallel branches and names
    "a race of two that work": (
        '<Parallel policy="SuccessOnOne">\n<Drive/>\n<Look/>\n</Parallel>',
        ("cancelled-branch", 3, 19, "'Look' is interrupted when 'Drive' succeeds"),
    ),
    "children that must succeed in the same tick": (
        '<Parallel policy="SuccessOnAll" synchronise="false">\n<Wait/>\n<Look/>\n</Parallel>',
        ("out-of-step", 3, 46, "'Wait' is restarted whenever it has succeeded"),
    ),
    "two that drive the robot at the same time": (
        "<ParallelAll>\n<Drive/>\n<Sequence><Ready/><Drive/></Sequence>\n</ParallelAll>",
        ("shared-action", 5, 19, "'Drive' sends goals to 'go' at the same time as 'Drive'"),
    ),
    "two nodes beside each other with one name": (
        '<Sequence>\n<Look name="Work"/>\n<Drive name="Work"/>\n</Sequence>',
        ("same-name", 5, 14, "also the name of its sibling in line 4"),
    ),
    "a name that reads as a path": (
        '<Sequence>\n<Look name="left/right"/>\n<Drive/>\n</Sequence>',
        ("separator-in-name", 4, 13, "separates the names of a path"),
    ),
    "a name that reads as an attribute of a key": (
        '<Sequence>\n<Look/>\n<Drive name="v1.2"/>\n</Sequence>',
        ("separator-in-name", 5, 14, "separates a key from its attributes"),
    ),
}


@pytest.mark.parametrize("name", ERRORS)
def test_tree_with_unintended_behaviour_has_one_finding(name):
    body, (code, line, column, words) = ERRORS[name]
    (finding,) = check(forest_of(document(body)), REGISTRY)
    assert (finding.code, finding.span.line, finding.span.column) == (code, line, column)
    assert words in finding.message
    assert finding.suggestion or finding.hint
    assert finding.severity is not Severity.ERROR


def test_error_in_one_node_does_not_hide_finding_of_another():
    body = '<Sequence memory="false">\n<Beep/>\n<Drive colour="red"/>\n<Look/>\n</Sequence>'
    assert findings_in(document(body)) == [("repeated-effect", 4, 1), ("unknown-attribute", 5, 8)]


def test_faulty_node_has_no_derived_findings():
    assert [code for code, *_ in findings_in(document('<Retry num_failures="three">\n<Beep/></Retry>'))] == [
        "wrong-value"
    ]


TREES = (
    '<BehaviorTree ID="Main"><Sequence name="S" memory="false">\n<SubTree ID="Greet"/>\n<Drive/></Sequence></BehaviorTree>'
    '<BehaviorTree ID="Greet"><Sequence>\n<Ready/>\n<Beep/></Sequence></BehaviorTree>'
)


def test_repeated_effect_in_subtree_is_found_at_subtree():
    (finding,) = check(
        forest_of(f'<root BTCPP_format="4" main_tree_to_execute="Main">{TREES}</root>'), REGISTRY
    )
    assert (finding.code, finding.span.line) == ("repeated-effect", 2)
    assert finding.message.startswith("'Beep' in the tree 'Greet' would publish a tone")


def test_error_in_tree_used_twice_is_one_finding():
    text = (
        '<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main"><Sequence>\n<SubTree ID="B"/><SubTree ID="B"/></Sequence>'
        '</BehaviorTree>\n<BehaviorTree ID="B"><Retry num_failures="3"><Beep/></Retry></BehaviorTree></root>'
    )
    assert findings_in(text) == [("without-effect", 3, 22)]


def test_repeated_effect_at_root_is_found_in_subtree():
    text = (
        '<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main"><SubTree ID="B"/></BehaviorTree>\n'
        '<BehaviorTree ID="B"><Selector memory="false">\n<Sequence><Ready/><Look/></Sequence>\n<Drive/></Selector>'
        "</BehaviorTree></root>"
    )
    assert findings_in(text) == [("repeated-effect", 4, 1)]


@pytest.mark.parametrize(
    "leaf",
    [
        '<Sleep msec="900"/>',
        '<Timer duration="3"/>',
        '<TickCounter duration="3" completion_status="SUCCESS"/>',
    ],
)
def test_wait_before_long_action_in_reactive_sequence_is_endless_restart(leaf):
    body = f"<ReactiveSequence>\n{leaf}\n<Drive/>\n</ReactiveSequence>"
    assert findings_in(document(body)) == [("endless-restart", 4, 1)]


@pytest.mark.parametrize("loop", ["KeepRunningUntilFailure", 'Repeat num_cycles="-1"'])
def test_endless_repetition_at_root_is_no_finding(loop):
    assert findings_in(document(f"<{loop}>\n<Beep/>\n</{loop.partition(' ')[0]}>")) == []


def test_sequence_with_memory_loses_no_progress():
    steps = "<Look/><Drive/>"
    body = '<Selector memory="false">\n<Sequence><Ready/><Wait/></Sequence>\n<{0}>{1}</{0}>\n</Selector>'
    assert findings_in(document(body.format("Sequence", steps))) == [("lost-progress", 5, 1)]
    assert findings_in(document(body.format("SequenceWithMemory", steps))) == []


def test_nested_single_attempts_are_two_findings():
    body = '<Retry num_failures="1">\n<Repeat num_cycles="1">\n<Drive/></Repeat></Retry>'
    findings = check(forest_of(document(body)), REGISTRY)
    assert [finding.span.line for finding in findings] == [3, 4]
    assert all("is also executed once without this decorator" in finding.message for finding in findings)


def test_child_of_try_catch_after_one_that_never_succeeds_is_unreachable():
    body = "<TryCatch>\n<Ready/>\n<ForceFailure><Ready/></ForceFailure>\n<Drive/>\n<Look/>\n</TryCatch>"
    (finding,) = check(forest_of(document(body)), REGISTRY)
    assert (finding.code, finding.span.line) == ("unreachable-node", 6)
    assert "'ForceFailure' never succeeds" in finding.message


def test_child_of_try_catch_after_skipped_one_is_reachable():
    body = '<TryCatch>\n<Precondition if="false" else="SKIPPED"><Ready/></Precondition>\n<Drive/>\n<Look/>\n</TryCatch>'
    assert [code for code, *_ in findings_in(document(body))] == ["constant-condition"]


def test_custom_control_with_sequence_semantics_is_checked_as_sequence():
    @register("Steps", kind=Kind.CONTROL, semantics=Semantics.sequence(reactive=True))
    class Steps(Sequence):
        """Ticks its children one after the other.

        Args:
            name: The node's name.
            children: The children.
        """

        def __init__(self, name: str, children: list[Behaviour]) -> None:
            super().__init__(name, memory=False, children=children)

    registry = Registry([*REGISTRY.specs(), getattr(Steps, MARK)])
    body = '<Steps name="S">\n<Ready/>\n<Fallback><Failure/><Failure name="other"/></Fallback>\n<Look/>\n</Steps>'
    findings = check(forest_of(document(body)), registry)
    assert [(f.code, f.span.line) for f in findings] == [("unreachable-node", 6)]
    reactive = check(forest_of(document("<Steps>\n<Beep/>\n<Wait/>\n</Steps>")), registry)
    assert [(f.code, f.hint) for f in reactive] == [
        ("repeated-effect", "use a node that resumes at the running child")
    ]


def test_node_after_delay_of_zero_is_reachable():
    body = (
        "<Fallback>\n<RunningIsFailure><Delay delay_msec='0'><AlwaysSuccess/></Delay></RunningIsFailure>\n"
        "<AlwaysSuccess name='after'/>\n</Fallback>"
    )
    assert findings_in(document(body)) == []


def test_missing_child_is_only_finding_of_control_and_its_decorator():
    text = document("<Inverter>\n<WhileDoElse>\n<Ready/>\n</WhileDoElse>\n</Inverter>")
    assert findings_in(text) == [("missing-child", 4, 1)]


def test_tree_with_id_of_node_in_named_palette_is_warning():
    forest = forest_of(document("<NavigateToBase/>", main="Foo"))
    palette = parse_xml("<root><TreeNodesModel><Action ID='Foo'/></TreeNodesModel></root>", "palette.xml")
    assert check(forest, REGISTRY) == check(forest, REGISTRY, [replace(palette, is_named=False)]) == []
    [finding] = check(forest, REGISTRY, [palette])
    assert (finding.code, finding.severity) == ("wrong-tree-id", Severity.WARNING)
    assert (finding.span.line, finding.span.column) == (2, 19)


CONSTANT = {
    "a condition that no value makes false": ("_skipIf", "x != 1 || x != 2", Severity.WARNING),
    "a condition that no value makes true": ("_while", "x &lt; 1 &amp;&amp; x &gt; 2", Severity.WARNING),
    "a condition without variables": ("_failureIf", "1 == 1", Severity.INFO),
}


@pytest.mark.parametrize("case", CONSTANT)
def test_constant_condition_is_reported_with_consequence(case):
    attribute, condition, severity = CONSTANT[case]
    body = f'<Sequence>\n<Script code="x := 1"/>\n<Drive name="A" {attribute}="{condition}"/>\n</Sequence>'
    (finding,) = [each for each in findings_of(document(body)) if each.code == "constant-condition"]
    assert finding.severity is severity
    assert finding.message.endswith("so 'A' is never ticked")


CLAUSES = {
    "(x != 1 || x != 2) && y == 1": "x != 1 || x != 2",
    "y == 1 || x == 1 && x == 2": "x == 1 && x == 2",
    "y == 1 && !(x < 1 && x > 2 || y == 2)": "x < 1 && x > 2",
    "y == 1 && x == 1": None,
    "true && y == 1": None,
    "(x == 1 || y == 1) && (x == 2 || y == 2)": None,
}


@pytest.mark.parametrize("condition", CLAUSES)
def test_constant_part_of_condition_is_reported_at_its_location(condition):
    text = html.escape(condition, quote=False)
    body = f'<Sequence>\n<Script code="x := 1; y := 1"/>\n<Drive _skipIf="{text}"/>\n</Sequence>'
    told = [each for each in findings_of(document(body)) if each.code == "constant-condition"]
    places = [each.source.text[slice(*each.source.offsets(each.span))] for each in told]
    assert [html.unescape(each) for each in places] == [each for each in [CLAUSES[condition]] if each]
    assert all("never ticked" not in each.message for each in told)


@pytest.mark.parametrize("condition", ["x &lt; 1 &amp;&amp; x &gt; 2", "false"])
def test_child_after_condition_that_is_never_true_is_unreachable(condition):
    body = f'<Sequence>\n<ScriptCondition code="{condition}"/>\n<Drive/>\n</Sequence>'
    assert ("unreachable-node", 5, 1) in findings_in(document(body))


WAITS = {
    "a longer sleep": '<Sleep msec="10000"/>',
    "a longer delay": '<Delay delay_msec="9000"><Drive/></Delay>',
    "a longer timer of py_trees": '<Timer duration="7.5"/>',
    "a sleep in a selector": '<Fallback><Drive/><Sleep msec="5000"/></Fallback>',
    "two sleeps in a row": '<Sequence><Sleep msec="3000"/><Sleep msec="3000"/></Sequence>',
    "a sleep in a subtree": '<SubTree ID="Waits"/>',
}
SHORT_WAITS = {
    "a shorter sleep": '<Sleep msec="4000"/>',
    "a sleep of a time in a key": '<Sequence><Script code="t := 9000"/><Sleep msec="{t}"/></Sequence>',
    "one of two sleeps": '<Fallback><Sleep msec="3000"/><Sleep msec="3000"/></Fallback>',
    "sleeps side by side": '<Parallel><Sleep msec="3000"/><Sleep msec="3000"/></Parallel>',
    "a second sleep after one that may be skipped": '<Sequence><Sleep msec="3000" _skipIf="x"/><Sleep msec="3000"/></Sequence>',
    "a sequence that keeps its place": '<SequenceWithMemory><Sleep msec="3000"/><Sleep msec="3000"/></SequenceWithMemory>',
}
_WAITS_TREE = '<BehaviorTree ID="Waits"><Sequence><Drive/><Sleep msec="20000"/></Sequence></BehaviorTree>'


def findings_in_timeout(body):
    text = document(f'<Timeout msec="5000">{body}</Timeout>').replace("</root>", f"{_WAITS_TREE}</root>")
    return [each for each in findings_of(text) if each.code == "short-timeout"]


@pytest.mark.parametrize("case", WAITS)
def test_timeout_shorter_than_wait_is_warning(case):
    (finding,) = findings_in_timeout(WAITS[case])
    assert finding.severity is Severity.WARNING


@pytest.mark.parametrize("case", SHORT_WAITS)
def test_timeout_that_some_run_keeps_is_no_warning(case):
    assert findings_in_timeout(SHORT_WAITS[case]) == []
