"""The slips that are made with the mission's tree, and what is said of them."""

from pathlib import Path

import pytest

from sar_compiler.checks import check
from sar_compiler.nodes.registry import default_registry
from tests.trees import forest_of

MISSION = Path("trees/search_and_rescue.xml").read_text("utf-8")


def changed(*changes):
    text = MISSION
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


def exchanged(one, other):
    assert one in MISSION
    assert other in MISSION
    return MISSION.replace(one, "\0").replace(other, one).replace("\0", other)


def line_of(text, part):
    return text[: text.index(part)].count("\n") + 1


SLIPS = {
    "no OneShot around the way home": (
        changed((' oneshot="ON_COMPLETION"', "")),
        ("repeated-effect", "<NavigateToBase/>"),
        "'NavigateToBase' would be sent a new goal in every tick",
        "wrap it in OneShot",
    ),
    "a patrol without memory": (
        changed(('name="Patrol" memory="true"', 'name="Patrol" memory="false"')),
        ("endless-restart", "<NavigateToZone/>"),
        "'NavigateToZone' is restarted in the next tick while 'DetectSurvivor' runs, and interrupts",
        "write memory=\"true\" in 'Patrol'",
    ),
    "a survivor who is named without memory": (
        changed(('name="SurvivorFound" memory="true"', 'name="SurvivorFound" memory="false"')),
        ("repeated-effect", "<BroadcastSurvivorTF "),
        "'BroadcastSurvivorTF' would publish a static frame with a new name",
        "write memory=\"true\" in 'SurvivorFound'",
    ),
    "a report before there is a name": (
        exchanged(
            '<BroadcastSurvivorTF detect_node="DetectSurvivor"/>',
            '<NotifyBase detect_node="DetectSurvivor"/>',
        ),
        ("wrong-order", "<NotifyBase "),
        "'NotifyBase' can only fail here: it needs the effect of 'BroadcastSurvivorTF' (line 22)",
        "move it after 'BroadcastSurvivorTF'",
    ),
    "the next zone before this one is searched": (
        changed(
            ("        <AdvanceZone/>\n", ""),
            ("        <DetectSurvivor/>\n", "        <AdvanceZone/>\n        <DetectSurvivor/>\n"),
        ),
        ("wrong-order", "<DetectSurvivor/>"),
        "'DetectSurvivor' needs the effect of 'NavigateToZone', but 'AdvanceZone' (line 16)",
        "move it before 'AdvanceZone'",
    ),
    "a log that comes first": (
        changed(
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
        changed(
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
        changed(
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


@pytest.mark.parametrize("name", SLIPS)
def test_a_slip_in_the_mission_is_one_finding_that_names_the_leaf_and_what_to_write(name):
    text, (code, part), words, hint = SLIPS[name]
    (finding,) = check(forest_of(text), default_registry())
    assert (finding.code, finding.span.line) == (code, line_of(text, part))
    assert words in finding.message
    assert finding.hint is not None
    assert hint in finding.hint


def test_both_flags_of_the_steps_gone_are_two_findings():
    text = changed(('memory="true"', 'memory="false"'))
    assert [f.code for f in check(forest_of(text), default_registry())] == [
        "endless-restart",
        "repeated-effect",
    ]


def test_a_number_that_only_the_mission_knows_keeps_nothing_from_being_checked():
    text = '<root BTCPP_format="4"><BehaviorTree ID="Main"><PostponeZone attempts="{@tries}"/></BehaviorTree></root>'
    assert check(forest_of(text), default_registry()) == []
