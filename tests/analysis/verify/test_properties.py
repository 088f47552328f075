"""Tests of users' properties in YAML: verdicts about small trees, and findings about errors in them."""

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


def verdict_on(body, prop, more=""):
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
def test_property_is_proved_or_has_counterexample(body, prop, expected):
    found = verdict_on(body, prop)
    assert (found.outcome, found.trace is None) == (expected, expected is PROVED)


def test_counterexample_has_fewest_ticks():
    found = verdict_on("<Sequence><A/><B/><C/></Sequence>", "{at_most_once: C starts}")
    assert told(found.trace) == ["A:SUCCESS B:SUCCESS C:FAILURE", "A:SUCCESS B:SUCCESS C:RUNNING"]


def test_while_condition_restricts_event():
    facts = "facts: {ready: false}\noutcomes: {A: [{status: SUCCESS, then: ready = true}, FAILURE]}"
    assert verdict_on(TWO, '{never: B starts, while: "!ready"}', facts).outcome is PROVED
    assert verdict_on(ANY, '{never: B starts, while: "!ready"}', facts).outcome is BROKEN


@pytest.mark.parametrize("status", ["SUCCESS", "FAILURE", "RUNNING"])
def test_leaf_without_declared_outcomes_can_be_assumed_to_return_any_status(status):
    always = verified("<U/>", f"outcomes: {{U: [{status}]}}\nproperties: {{p: {{never: U {status}}}}}")
    assert outcome(always, "p") is BROKEN


def test_condition_is_evaluated_before_effects_of_outcome():
    facts = "facts: {ready: false}\noutcomes: {A: [{status: SUCCESS, then: ready = true}]}"
    once = '<A oneshot="ON_COMPLETION"/>'
    assert verdict_on(once, "{never: A SUCCESS, while: ready}", facts).outcome is PROVED


def test_event_with_condition_can_limit_its_own_property():
    alternating = "{before: A starts, comes: B starts, since: A starts, while: n > 0}"
    tree = '<Sequence><Script code="n := 0" oneshot="ON_COMPLETION"/><A/>{}<Script code="n = 1"/></Sequence>'
    answers = "outcomes: {A: [SUCCESS], B: [SUCCESS]}"
    assert verdict_on(tree.format("<B/>"), alternating, answers).outcome is PROVED
    assert verdict_on(tree.format('<B _skipIf="n == 0"/>'), alternating, answers).outcome is BROKEN


def test_condition_can_read_keys_of_tree():
    tree = '<Sequence><Script code="n := 1"/><A/><Script code="n := 2"/><B/></Sequence>'
    assert verdict_on(tree, "{never: B starts, while: n == 1}").outcome is PROVED
    assert verdict_on(tree, "{never: B starts, while: n == 2}").outcome is BROKEN


def test_eventual_event_must_occur_before_end():
    found = verdict_on(
        '<Sequence oneshot="ON_COMPLETION"><A/><B/></Sequence>', "{after: A SUCCESS, eventually: B SUCCESS}"
    )
    assert told(found.trace) == ["A:SUCCESS B:FAILURE"]


def test_eventual_event_delayed_forever_is_reported_as_loop():
    tree = "<KeepRunningUntilFailure><Sequence><P/><ForceSuccess><B/></ForceSuccess></Sequence></KeepRunningUntilFailure>"
    found = verdict_on(
        tree, "{after: P SUCCESS, eventually: B SUCCESS}", "outcomes: {P: [SUCCESS], B: [SUCCESS, FAILURE]}"
    )
    assert (found.outcome, found.trace.loop) == (BROKEN, 1)
    assert told(found.trace)[-1] == "P:SUCCESS B:FAILURE"


def test_idle_end_is_evaluated_after_all_ticks_are_known():
    assert verdict_on('<A oneshot="ON_COMPLETION"/>', "{at_end: idle}").outcome is PROVED
    assert verdict_on("<A/>", "{at_end: idle}").outcome is BROKEN
    assert verdict_on("<A/>", "{at_end: '!idle'}").outcome is PROVED
    assert verdict_on('<A oneshot="ON_COMPLETION"/>', "{at_end: '!idle'}").outcome is BROKEN


def test_condition_can_read_remapped_key_of_main_tree():
    main = '<BehaviorTree ID="Main"><SubTree ID="Inner" n="{shared}"/></BehaviorTree>'
    inner = '<BehaviorTree ID="Inner"><Script code="n := 1"/></BehaviorTree>'
    binding = bind_main(
        forest_of(f'<root BTCPP_format="4" main_tree_to_execute="Main">{main}{inner}</root>'), REGISTRY
    )
    file = parse_property_file("properties: {p: {at_end: shared == 1}}")
    assert outcome(verify(simulated_tree(binding, file), file, TAGS, 100), "p") is PROVED


def test_more_than_64_properties_are_supported():
    lines = [f"  p{number}: {{after: A SUCCESS, eventually: B starts}}" for number in range(70)]
    found = verified(TWO, "\n".join(["properties:", *lines]))
    assert {outcome(found, f"p{number}") for number in range(70)} == {PROVED}


def test_end_can_be_defined_by_condition():
    two_done = (
        "facts: {done: 0}\noutcomes: {A: [{status: SUCCESS, when: done < 2, then: done += 1}, FAILURE]}"
    )
    properties = f"{two_done}\nproperties: {{p: {{at_end: done == 2}}}}\nend: "
    assert outcome(verified("<A/>", f"{properties} done == 2"), "p") is PROVED
    assert outcome(verified("<A/>", f"{properties} root == 'FAILURE'"), "p") is BROKEN


def test_idle_tree_is_unchanged_by_every_tick():
    tree = '<A oneshot="ON_COMPLETION"/>'
    assert verified(tree, "end: idle").is_proved
    assert not verified("<A/>", "end: idle").is_proved


def test_leaf_is_matched_by_name_tag_or_path():
    tree = '<Sequence name="S"><A name="first"/><Sequence name="T"><A name="second"/></Sequence></Sequence>'
    assert verdict_on(tree, "{before: second starts, comes: first SUCCESS}").outcome is PROVED
    assert verdict_on(tree, "{never: A starts}").outcome is BROKEN
    assert verdict_on(tree, "{before: T/second starts, comes: S/first SUCCESS}").outcome is PROVED


def test_event_of_missing_leaf_is_ignored():
    assert verdict_on(TWO, "{before: B starts, comes: [AdvanceZone SUCCESS, A SUCCESS]}").outcome is PROVED


def test_property_with_only_missing_leaves_is_omitted():
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
def test_error_in_properties_is_reported_with_location_and_advice(properties, place, code, advice):
    with pytest.raises(TreeError) as caught:
        verified(TWO, properties)
    text = str(caught.value)
    assert text.startswith(f"props.yaml:{place}: error[{code}]"), text
    assert advice in text


def test_all_errors_of_file_are_reported():
    with pytest.raises(TreeError) as caught:
        verified(TWO, "end: x == 1\nproperties:\n  p: {never: E starts}\n  q: {never: A strats}")
    assert [finding.span.line for finding in caught.value.findings] == [1, 3, 4]


def test_errors_with_and_without_knowledge_of_tree_are_reported_together():
    text = "ende: 1\nfacts: {zone: 1}\nproperties:\n  p: {never: E starts}\n  q: {nevr: A starts}"
    with pytest.raises(TreeError) as caught:
        verified(TWO, text)
    codes = [(finding.code, finding.span.line) for finding in caught.value.findings]
    assert codes == [("unknown-key", 1), ("unknown-fact", 2), ("unknown-leaf", 4), ("unknown-key", 5)]


def test_tree_without_end_is_not_asked_for_end():
    found = verified("<A/>", "properties: {p: {never: A starts}}\nend: none")
    assert [each.question for each in found.verdicts] == [
        "no tick raises an error",
        "every leaf can run",
        "p",
    ]


def test_at_end_property_conflicts_with_end_none():
    with pytest.raises(TreeError) as caught:
        verified("<A/>", "properties: {p: {at_end: idle}}\nend: none")
    (finding,) = caught.value.findings
    assert (finding.code, finding.message) == (
        "conflicting-keys",
        "the property 'p' must hold at the end of a run, but 'end: none' declares that runs have no end",
    )


def test_condition_can_read_key_named_by_attribute():
    tree = '<Sequence><SetBlackboard value="low" output_key="battery"/><A/></Sequence>'
    assert verdict_on(tree, "{never: A starts, while: battery == 'high'}").outcome is PROVED
