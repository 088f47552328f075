"""Tests of the expectations of a scenario, and of the messages if they fail."""

import pytest

from tests.analysis.simulate.stage import missed

RUN = """
until: "zones_left == 0 && at == 'base'"
leaves:
  NavigateToZone: {outcome: arrived, after: 1s}
  DetectSurvivor: [nothing, found, nothing]
  NavigateToBase: {outcome: arrived, after: 2s}
expect:
  """
EXPECTATION_LINE = RUN.count("\n") + 1


def test_scenario_without_expectations_expects_an_end():
    assert missed("ticks: 2\nleaves: {NavigateToZone: RUNNING}") == [
        ("ends", "the run has not ended by tick 2 (0.5 s): the root has not succeeded or failed yet", 0)
    ]
    assert missed("ticks: 2\nuntil: \"at == 'base'\"") == [
        ("ends", "the run has not ended by tick 2 (0.5 s): until 'at == 'base'' is not true yet", 0)
    ]


@pytest.mark.parametrize(
    "expected",
    [
        "root: SUCCESS",
        "within: 9s",
        "within: 14 ticks",
        "facts: {zones_left: 0, at: base, found_by_DetectSurvivor: false}",
        "order: [DetectSurvivor nothing, DetectSurvivor found, DetectSurvivor SUCCESS, NavigateToBase starts]",
        "never: [NavigateToBase halted, NavigateToZone aborted]",
        "count: {NavigateToZone arrived: 3, NavigateToZone aborted: 0, DetectSurvivor SUCCESS: 3}",
        "count: {NavigateToZone driving: at least 3, DetectSurvivor found: at most 1}",
        "ends: true",
    ],
)
def test_met_expectation_holds(expected):
    assert missed(RUN + expected) == []


@pytest.mark.parametrize(
    ("expected", "word", "message"),
    [
        (
            "root: FAILURE",
            "root",
            "the status of the root is SUCCESS in the last tick, but FAILURE was expected",
        ),
        ("within: 5s", "within", "the run ends with tick 14 (6.5 s), but was expected to end by 5 s"),
        (
            "within: 13 ticks",
            "within",
            "the run ends with tick 14 (6.5 s), but was expected to end by tick 13",
        ),
        ("within: 1 tick", "within", "the run ends with tick 14 (6.5 s), but was expected to end by tick 1"),
        (
            "facts: {at: zone}",
            "facts",
            "the fact 'at' is 'base' at the end of the run, but 'zone' was expected",
        ),
        (
            "order: [DetectSurvivor found, DetectSurvivor found]",
            "order",
            "'DetectSurvivor found' does not happen after 'DetectSurvivor found'",
        ),
        ("order: NavigateToZone halted", "order", "'NavigateToZone halted' does not happen"),
        ("never: DetectSurvivor found", "never", "'DetectSurvivor found' happens in tick 6 (2.5 s)"),
        (
            "count: {NavigateToZone arrived: 2}",
            "count",
            "'NavigateToZone arrived' happens 3 times, expected 2",
        ),
        (
            "count: {DetectSurvivor found: at least 2}",
            "count",
            "'DetectSurvivor found' happens once, expected at least 2",
        ),
        (
            "count: {NavigateToZone aborted: 1}",
            "count",
            "'NavigateToZone aborted' never happens, expected 1",
        ),
        (
            "count: {NavigateToZone arrived: at most 2}",
            "count",
            "'NavigateToZone arrived' happens 3 times, expected at most 2",
        ),
        (
            "ends: false",
            "ends",
            "the run ends with tick 14 (6.5 s): until 'zones_left == 0 && at == 'base'' is true",
        ),
    ],
)
def test_failed_expectation_is_reported_with_its_line(expected, word, message):
    assert missed(RUN + expected) == [(word, message, EXPECTATION_LINE)]


def test_each_expectation_has_its_own_line():
    text = (
        f"{RUN}never:\n    - NavigateToZone aborted\n    - DetectSurvivor nothing\n    - DetectSurvivor found"
    )
    assert [line for _, _, line in missed(text)] == [EXPECTATION_LINE + 2, EXPECTATION_LINE + 3]


def test_run_without_end_can_be_expected():
    assert missed("ticks: 5\nleaves: {NavigateToZone: RUNNING}\nexpect: {ends: false, root: RUNNING}") == []
