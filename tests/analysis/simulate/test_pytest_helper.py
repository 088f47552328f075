"""Tests of the pytest helper, as users write them for their own trees."""

import pytest

from sar_compiler.testing import RENEW, assert_scenario_holds, simulate
from sar_compiler.tree.diagnostic import TreeError

TREE = "trees/search_and_rescue.xml"
HOME = "zones_left == 0 && at == 'base'"


def test_zone_not_reached_at_once_is_retried():
    home = {"outcome": "arrived", "after": "5s"}
    run = simulate(TREE, NavigateToZone=["aborted", "arrived"], NavigateToBase=home, scenario={"until": HOME})
    run.run_to_end()
    run.expect(order=["NavigateToZone aborted", "NavigateToZone arrived"], count={"AdvanceZone advanced": 3})


def test_refused_report_is_lost():
    run = simulate(
        TREE, NotifyBase="refused", scenario={"facts": {"zones_left": 1}, "until": HOME}
    ).run_to_end()
    run.expect(order=["NotifyBase refused", "LogNoDetection logged", "AdvanceZone advanced"])


def test_leaves_with_any_name_can_be_scripted():
    run = simulate(
        TREE, leaves={"ZonesRemaining?": "some left", "HandleDetection/NotifyBase": "refused"}
    ).tick(2)
    assert (run.root, run.facts["zones_left"]) == ("SUCCESS", 1)
    assert "NotifyBase           refused (FAILURE)" in run.trace
    assert len(run.run.ticks) == 2


def test_run_without_end_fails_test():
    run = simulate(TREE, NavigateToZone="RUNNING", scenario={"ticks": 5})
    with pytest.raises(
        AssertionError, match=r"(?s)ends: the run has not ended by tick 5 .*\n\ntick 1, 0 s: root RUNNING"
    ):
        run.run_to_end()


def test_run_with_error_fails_test():
    run = simulate(TREE, DetectSurvivor="no zone")
    with pytest.raises(
        AssertionError, match="run: an error occurred in tick 1: 'DetectSurvivor' cannot return"
    ):
        run.run_to_end()


def test_failed_expectation_fails_test_with_trace():
    run = simulate(TREE).run_to_end()
    with pytest.raises(
        AssertionError,
        match=r"(?s)^root: the status of the root is SUCCESS.*FAILURE was expected\n\ntick 1, ",
    ):
        run.expect(root="FAILURE")


def test_unfinished_run_fails_only_if_end_is_expected():
    run = simulate(TREE, NavigateToZone="RUNNING").tick()
    run.expect(root="RUNNING")
    with pytest.raises(AssertionError, match="ends: the run has not ended"):
        run.expect(ends=True)


def test_typo_is_explained_as_in_scenario():
    with pytest.raises(TreeError, match="did you mean 'aborted'"):
        simulate(TREE, NavigateToZone="abroted")
    with pytest.raises(TreeError, match="did you mean 'order'"):
        simulate(TREE).run_to_end().expect(ordr=["NavigateToZone arrived"])


def test_trace_can_be_compared_with_golden_file(tmp_path, monkeypatch):
    golden = tmp_path / "trace.txt"
    monkeypatch.setenv(RENEW, "1")
    simulate(TREE).run_to_end().expect(trace=str(golden))
    monkeypatch.delenv(RENEW)
    simulate(TREE).run_to_end().expect(trace=str(golden))
    with pytest.raises(AssertionError, match=r"(?s)trace: .*aborted"):
        simulate(TREE, NavigateToZone="aborted").run_to_end().expect(trace=str(golden))


def test_scenario_that_holds_passes():
    assert_scenario_holds(TREE, "examples/scenarios/nominal.yaml")


def test_scenario_that_does_not_hold_fails_test(tmp_path):
    path = tmp_path / "wrong.yaml"
    path.write_text("expect:\n  root: FAILURE\n", encoding="utf-8")
    with pytest.raises(AssertionError, match=r"wrong.yaml:2: root: the status of the root is SUCCESS"):
        assert_scenario_holds(TREE, path)
