"""Properties of users, in YAML: what they say of small trees, and what is said of slips in them."""

import pytest

from sar_compiler.analysis.verify import verify
from sar_compiler.analysis.verify.properties import parse_property_file
from sar_compiler.compiler import bind_main
from sar_compiler.tree.diagnostic import TreeError
from tests.analysis.verify.stage import (
    BROKEN,
    PROVED,
    REGISTRY,
    TAGS,
    outcome,
    simulated_tree,
    told,
    verdict,
    verified,
)
from tests.trees import forest_of

TWO = "<Sequence><A/><B/></Sequence>"
ANY = "<Fallback><A/><B/></Fallback>"


def answer(body, prop, more=""):
    return verdict(verified(body, f"properties:\n  p: {prop}\n{more}"), "p")


@pytest.mark.parametrize(
    ("body", "prop", "expected"),
    [
        (TWO, "{never: B starts}", BROKEN),
        (TWO, "{before: B starts, comes: A SUCCESS}", PROVED),
        (ANY, "{before: B starts, comes: A SUCCESS}", BROKEN),
        (ANY, "{before: B starts, comes: [A SUCCESS, A FAILURE]}", PROVED),
        (TWO, "{before: B SUCCESS, comes: B starts, since: A starts}", PROVED),
        (TWO, "{after: A SUCCESS, eventually: B starts, before: A starts}", PROVED),
        (ANY, "{after: A starts, eventually: B starts, before: A starts}", BROKEN),
        (TWO, "{after: A SUCCESS, eventually: [B SUCCESS, B FAILURE]}", PROVED),
        (TWO, "{after: A SUCCESS, eventually: B SUCCESS}", BROKEN),
        (TWO, "{at_most_once: B starts, per: A starts}", PROVED),
        (TWO, "{at_most_once: A starts}", BROKEN),
        ("<ReactiveFallback><P/><A/></ReactiveFallback>", "{never: A halted}", BROKEN),
        ("<Fallback><P/><A/></Fallback>", "{never: A halted}", PROVED),
        (TWO, "{at_end: root == 'SUCCESS'}", BROKEN),
        (TWO, "{at_end: root == 'SUCCESS' || root == 'FAILURE'}", PROVED),
    ],
)
def test_a_property_holds_in_every_run_or_a_run_is_told_in_which_it_does_not(body, prop, expected):
    found = answer(body, prop)
    assert (found.outcome, found.trace is None) == (expected, expected is PROVED)


def test_the_run_that_is_told_has_as_few_ticks_as_can_be():
    found = answer("<Sequence><A/><B/><C/></Sequence>", "{at_most_once: C starts}")
    assert told(found.trace) == ["A:SUCCESS B:SUCCESS C:FAILURE", "A:SUCCESS B:SUCCESS C:RUNNING"]


def test_a_condition_says_while_what_an_event_counts():
    facts = "facts: {ready: false}\noutcomes: {A: [{status: SUCCESS, then: ready = true}, FAILURE]}"
    assert answer(TWO, '{never: B starts, while: "!ready"}', facts).outcome is PROVED
    assert answer(ANY, '{never: B starts, while: "!ready"}', facts).outcome is BROKEN


@pytest.mark.parametrize("status", ["SUCCESS", "FAILURE", "RUNNING"])
def test_a_leaf_that_does_not_say_how_it_can_end_may_be_assumed_to_end_in_any_way(status):
    always = verified("<U/>", f"outcomes: {{U: [{status}]}}\nproperties: {{p: {{never: U {status}}}}}")
    assert outcome(always, "p") is BROKEN


def test_a_condition_is_looked_at_before_the_answer_changes_anything():
    facts = "facts: {ready: false}\noutcomes: {A: [{status: SUCCESS, then: ready = true}]}"
    once = '<A oneshot="ON_COMPLETION"/>'
    assert answer(once, "{never: A SUCCESS, while: ready}", facts).outcome is PROVED


def test_an_event_under_a_condition_may_bound_its_own_property():
    alternating = "{before: A starts, comes: B starts, since: A starts, while: n > 0}"
    tree = '<Sequence><Script code="n := 0" oneshot="ON_COMPLETION"/><A/>{}<Script code="n = 1"/></Sequence>'
    answers = "outcomes: {A: [SUCCESS], B: [SUCCESS]}"
    assert answer(tree.format("<B/>"), alternating, answers).outcome is PROVED
    assert answer(tree.format('<B _skipIf="n == 0"/>'), alternating, answers).outcome is BROKEN


def test_a_condition_reads_keys_of_the_tree():
    tree = '<Sequence><Script code="n := 1"/><A/><Script code="n := 2"/><B/></Sequence>'
    assert answer(tree, "{never: B starts, while: n == 1}").outcome is PROVED
    assert answer(tree, "{never: B starts, while: n == 2}").outcome is BROKEN


def test_what_must_come_one_day_must_come_before_the_end():
    found = answer(
        '<Sequence oneshot="ON_COMPLETION"><A/><B/></Sequence>', "{after: A SUCCESS, eventually: B SUCCESS}"
    )
    assert told(found.trace) == ["A:SUCCESS B:FAILURE"]


def test_what_must_come_one_day_and_is_put_off_for_ever_is_told_as_a_round():
    tree = "<KeepRunningUntilFailure><Sequence><P/><ForceSuccess><B/></ForceSuccess></Sequence></KeepRunningUntilFailure>"
    found = answer(
        tree, "{after: P SUCCESS, eventually: B SUCCESS}", "outcomes: {P: [SUCCESS], B: [SUCCESS, FAILURE]}"
    )
    assert (found.outcome, found.trace.loop) == (BROKEN, 1)
    assert told(found.trace)[-1] == "P:SUCCESS B:FAILURE"


def test_whether_an_end_idles_is_asked_once_all_its_ticks_are_known():
    assert answer('<A oneshot="ON_COMPLETION"/>', "{at_end: idle}").outcome is PROVED
    assert answer("<A/>", "{at_end: idle}").outcome is BROKEN
    assert answer("<A/>", "{at_end: '!idle'}").outcome is PROVED
    assert answer('<A oneshot="ON_COMPLETION"/>', "{at_end: '!idle'}").outcome is BROKEN


def test_a_condition_reads_a_key_that_the_main_tree_only_passes_on():
    main = '<BehaviorTree ID="Main"><SubTree ID="Inner" n="{shared}"/></BehaviorTree>'
    inner = '<BehaviorTree ID="Inner"><Script code="n := 1"/></BehaviorTree>'
    binding = bind_main(
        forest_of(f'<root BTCPP_format="4" main_tree_to_execute="Main">{main}{inner}</root>'), REGISTRY
    )
    file = parse_property_file("properties: {p: {at_end: shared == 1}}")
    assert outcome(verify(simulated_tree(binding, file), file, TAGS, 100), "p") is PROVED


def test_there_may_be_more_properties_than_a_word_has_bits():
    lines = [f"  p{number}: {{after: A SUCCESS, eventually: B starts}}" for number in range(70)]
    found = verified(TWO, "\n".join(["properties:", *lines]))
    assert {outcome(found, f"p{number}") for number in range(70)} == {PROVED}


def test_an_end_can_be_something_else_than_the_end_of_the_root():
    two_done = (
        "facts: {done: 0}\noutcomes: {A: [{status: SUCCESS, when: done < 2, then: done += 1}, FAILURE]}"
    )
    properties = f"{two_done}\nproperties: {{p: {{at_end: done == 2}}}}\nend: "
    assert outcome(verified("<A/>", f"{properties} done == 2"), "p") is PROVED
    assert outcome(verified("<A/>", f"{properties} root == 'FAILURE'"), "p") is BROKEN


def test_an_idle_tree_is_one_that_every_tick_leaves_as_it_is():
    tree = '<A oneshot="ON_COMPLETION"/>'
    assert verified(tree, "end: idle").is_proved
    assert not verified("<A/>", "end: idle").is_proved


def test_a_leaf_is_named_by_its_name_its_tag_or_its_path():
    tree = '<Sequence name="S"><A name="first"/><Sequence name="T"><A name="second"/></Sequence></Sequence>'
    assert answer(tree, "{before: second starts, comes: first SUCCESS}").outcome is PROVED
    assert answer(tree, "{never: A starts}").outcome is BROKEN
    assert answer(tree, "{before: T/second starts, comes: S/first SUCCESS}").outcome is PROVED


def test_an_event_of_a_leaf_that_the_tree_does_not_have_is_passed_over():
    assert answer(TWO, "{before: B starts, comes: [AdvanceZone SUCCESS, A SUCCESS]}").outcome is PROVED


def test_a_property_of_nothing_but_leaves_that_the_tree_does_not_have_is_left_out():
    verification = verified(TWO, "properties: {p: {never: NotifyBase starts}, q: {never: A halted}}")
    assert [(left.name, left.missing) for left in verification.left_out] == [("p", ("NotifyBase",))]
    assert outcome(verification, "q") is PROVED


@pytest.mark.parametrize(
    ("properties", "place", "code", "advice"),
    [
        ("propertys: {}", "1:1", "unknown-key", "did you mean 'properties'?"),
        ("properties:\n  p: {nevr: A starts}", "2:7", "unknown-key", "did you mean 'never'?"),
        (
            "properties:\n  p: {}",
            "2:3",
            "missing-key",
            "'p' needs one of after, never, at_most_once, before, at_end",
        ),
        (
            "properties:\n  p: {while: true}",
            "2:3",
            "missing-key",
            "'p' needs one of after, never, at_most_once, before, at_end",
        ),
        ("properties:\n  p: {before: A starts}", "2:3", "missing-key", "'before' needs 'comes'"),
        ("properties:\n  p: {never: A starts, since: B starts}", "2:24", "conflicting-keys", "has while"),
        ("properties:\n  p: {never: A strats}", "2:16", "unknown-outcome", "did you mean 'starts'?"),
        ("properties:\n  p: {never: E starts}", "2:14", "unknown-leaf", "known: A, B"),
        ("properties:\n  p: {never: A}", "2:14", "wrong-value", "write A SUCCESS"),
        (
            "properties:\n  p: {never: [[A]]}",
            "2:15",
            "wrong-shape",
            "an item of 'never' must be an event, but is a list",
        ),
        (
            "properties:\n  p: {never: A starts, while: n == 1}",
            "2:31",
            "unknown-fact",
            "neither a fact nor a key",
        ),
        (
            "properties:\n  p: {never: A starts, while: root == 'SUCCESS'}",
            "2:31",
            "wrong-condition",
            "use this condition only in 'end' or 'at_end'",
        ),
        ("properties:\n  p: {at_end: root = 'SUCCESS'}", "2:15", "wrong-condition", "write == to compare"),
        ("properties:\n  p: {at_end: root == }", "2:20", "script-error", "a value is missing"),
        ("end: rot == 'SUCCESS'", "1:6", "unknown-fact", "did you mean 'root'?"),
        (
            "properties:\n  p: {never: A starts}\n  p: {never: B starts}",
            "3:3",
            "duplicate-key",
            "given twice",
        ),
        ("facts: {zone: 1}", "1:9", "unknown-fact", "no leaf of this tree declares"),
        ("properties: [a]", "1:13", "wrong-shape", "'properties' must be a mapping, but is a list"),
        ("", "1:1", "empty-file", "write a property, for example: properties:"),
    ],
)
def test_a_slip_is_a_finding_with_its_place_and_what_to_write(properties, place, code, advice):
    with pytest.raises(TreeError) as caught:
        verified(TWO, properties)
    text = str(caught.value)
    assert text.startswith(f"props.yaml:{place}: error[{code}]"), text
    assert advice in text


def test_all_slips_of_a_file_are_found_at_once():
    with pytest.raises(TreeError) as caught:
        verified(TWO, "end: x == 1\nproperties:\n  p: {never: E starts}\n  q: {never: A strats}")
    assert [finding.span.line for finding in caught.value.findings] == [1, 3, 4]


def test_slips_that_only_the_tree_shows_are_found_with_those_that_anybody_sees():
    text = "ende: 1\nfacts: {zone: 1}\nproperties:\n  p: {never: E starts}\n  q: {nevr: A starts}"
    with pytest.raises(TreeError) as caught:
        verified(TWO, text)
    codes = [(finding.code, finding.span.line) for finding in caught.value.findings]
    assert codes == [("unknown-key", 1), ("unknown-fact", 2), ("unknown-leaf", 4), ("unknown-key", 5)]


def test_a_tree_without_an_end_is_not_asked_whether_it_comes_to_one():
    found = verified("<A/>", "properties: {p: {never: A starts}}\nend: none")
    assert [each.question for each in found.verdicts] == [
        "no tick raises an error",
        "every leaf can run",
        "p",
    ]


def test_nothing_can_hold_at_an_end_that_there_is_not():
    with pytest.raises(TreeError) as caught:
        verified("<A/>", "properties: {p: {at_end: idle}}\nend: none")
    (finding,) = caught.value.findings
    assert (finding.code, finding.message) == (
        "conflicting-keys",
        "the property 'p' must hold at the end of a run, but 'end: none' declares that runs have no end",
    )


def test_a_condition_may_ask_for_a_key_whose_name_is_given_to_a_node():
    tree = '<Sequence><SetBlackboard value="low" output_key="battery"/><A/></Sequence>'
    assert answer(tree, "{never: A starts, while: battery == 'high'}").outcome is PROVED
