"""Tests of running a mission from Python."""

import pytest

from sar_compiler import TreeError
from sar_compiler.execution import RunOptions, run_mission
from tests.trees import document

pytestmark = pytest.mark.ros


def test_properties_are_monitored_if_options_request_it(tmp_path):
    options = RunOptions(
        "search_and_rescue",
        sim="disaster_zone",
        stepped=True,
        speed=1000.0,
        properties=True,
        journal=tmp_path / "mission.journal",
    )
    outcome = run_mission(options)
    assert (outcome.status, outcome.reason, outcome.messages) == (0, "", ())
    assert outcome.verdicts
    assert set(outcome.verdicts.values()) == {"kept"}
    assert len(outcome.head) == 64


def test_tree_with_errors_is_rejected_before_start(tmp_path):
    tree = tmp_path / "tree.xml"
    tree.write_text(document("<NavigateToBse/>"), encoding="utf-8")
    with pytest.raises(TreeError, match="NavigateToBse"):
        run_mission(RunOptions(str(tree), sim="disaster_zone", no_journal=True))
