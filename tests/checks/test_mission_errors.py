"""Tests of the findings about typical errors in the mission's tree."""

from pathlib import Path

import pytest

from sar_compiler.checks import check
from sar_compiler.nodes.registry import default_registry
from tests.trees import forest_of

MISSION = Path("trees/search_and_rescue.xml").read_text("utf-8")


def replace_in_mission(*changes):
    text = MISSION
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


def swap_in_mission(one, other):
    assert one in MISSION
    assert other in MISSION
    return MISSION.replace(one, "\0").replace(other, one).replace("\0", other)


def line_of(text, part):
    return text[: text.index(part)].count("\n") + 1


ERRORS = {
    "no OneShot around the way home": (
        replace_in_mission((' oneshot="ON_COMPLETION"', "")),
        ("repeated-effect", "<NavigateToBase/>"),
        "'NavigateToBase' would be sent a new goal in every tick",
        "wrap it in OneShot",
    ),
    "a patrol without memory": (
        replace_in_mission(('name="Patrol" memory="true"', 'name="Patrol" memory="false"')),
        ("endless-restart", "<NavigateToZone/>"),
        "'NavigateToZone' is restarted in the next tick while 'DetectSurvivor' runs, and interrupts",
        "write memory=\"true\" in 'Patrol'",
    ),
    "a survivor who is named without memory": (
        replace_in_mission(('name="SurvivorFound" memory="true"', 'name="SurvivorFound" memory="false"')),
        ("repeated-effect", "<BroadcastSurvivorTF "),
        "'BroadcastSurvivorTF' would publish a static frame with a new name",
        "write memory=\"true\" in 'SurvivorFound'",
    ),
    "a report before there is a name": (
        swap_in_mission(
            '<BroadcastSurvivorTF detect_node="DetectSurvivor"/>',
            '<NotifyBase detect_node="DetectSurvivor"/>',
        ),
        ("wrong-order", "<NotifyBase "),
        "'NotifyBase' can only fail here: it needs the effect of 'BroadcastSurvivorTF' (line 22)",
        "move it after 'BroadcastSurvivorTF'",
    ),
    "the next zone before this one is searched": (
        replace_in_mission(
            ("        <AdvanceZone/>\n", ""),
            ("        <DetectSurvivor/>\n", "        <AdvanceZone/>\n        <DetectSurvivor/>\n"),
        ),
        ("wrong-order", "<DetectSurvivor/>"),
        "'DetectSurvivor' needs the effect of 'NavigateToZone', but 'AdvanceZone' (line 16)",
        "move it before 'AdvanceZone'",
    ),
    "a log that comes first": (
        replace_in_mission(
            ("          <LogNoDetection/>\n", ""),
            (
                '        <Selector name="HandleDetection" memory="false">\n',
                '        <Selector name="HandleDetection" memory="false">\n          <LogNoDetection/>\n',
            ),
        ),
        ("unreachable-node", '<Sequence name="SurvivorFound"'),
        "'SurvivorFound' is never ticked: the previous child 'LogNoDetection' never fails",
        "move it",
    ),
    "the way home before the patrol": (
        replace_in_mission(
            ('      <NavigateToBase oneshot="ON_COMPLETION"/>\n', ""),
            (
                '      <Sequence name="Patrol" memory="true">\n',
                '      <NavigateToBase/>\n      <Sequence name="Patrol" memory="true">\n',
            ),
        ),
        ("endless-restart", "<NavigateToBase/>"),
        "'NavigateToBase' is restarted in the next tick after it has failed, and interrupts 'Patrol'",
        "write memory=\"true\" in 'MissionOrReturnToBase'",
    ),
    "a time limit for what asks": (
        replace_in_mission(
            (
                '<IsSurvivorDetected name="IsSurvivorDetected?" detect_node="DetectSurvivor"/>',
                '<Timeout duration="5"><IsSurvivorDetected name="IsSurvivorDetected?" detect_node="DetectSurvivor"/></Timeout>',
            )
        ),
        ("without-effect", "<Timeout "),
        "'IsSurvivorDetected?' always ends in its first tick",
        "delete <Timeout>",
    ),
}


@pytest.mark.parametrize("name", ERRORS)
def test_error_in_mission_is_one_finding_with_leaf_and_hint(name):
    text, (code, part), words, hint = ERRORS[name]
    (finding,) = check(forest_of(text), default_registry())
    assert (finding.code, finding.span.line) == (code, line_of(text, part))
    assert words in finding.message
    assert finding.hint is not None
    assert hint in finding.hint


def test_both_sequences_without_memory_are_two_findings():
    text = replace_in_mission(('memory="true"', 'memory="false"'))
    assert [f.code for f in check(forest_of(text), default_registry())] == [
        "endless-restart",
        "repeated-effect",
    ]


def test_number_from_mission_parameter_has_no_findings():
    text = '<root BTCPP_format="4"><BehaviorTree ID="Main"><PostponeZone attempts="{@tries}"/></BehaviorTree></root>'
    assert check(forest_of(text), default_registry()) == []
