"""Tests that `sar-run --approved` starts a tree only as it was approved."""

import pytest

from tests.trees import document, write

pytestmark = pytest.mark.ros


@pytest.fixture
def tree(tmp_path):
    path = tmp_path / "tree.xml"
    other = '<BehaviorTree ID="Other"><AlwaysSuccess/></BehaviorTree>'
    write(path, '<BehaviorTree ID="Main"><AlwaysSuccess/></BehaviorTree>', other, main="Main")
    return path


@pytest.fixture
def state(tmp_path):
    return {"XDG_STATE_HOME": str(tmp_path / "state")}


def test_tree_runs_only_as_approved(start, tree, state, tmp_path):
    def run_approved(*options):
        run = start("sar-run", tree, "--approved", *options, env=state)
        return run.end(), run.output

    status, said = run_approved()
    assert (status, "is not approved, but --approved requires an approval" in said) == (2, True)
    assert start("sar-compile", "approve", tree, "--by", "Ada", env=state).end() == 0
    assert run_approved()[0] == 0
    status, said = run_approved("--tree", "Other")
    assert (status, f"the tree 'Other' of {tree} is not approved (approved: Main)" in said) == (2, True)
    status, said = run_approved("--ros-args", "-p", "tick_rate_hz:=9.0", "-p", "words:=[a, b]")
    assert (status, "tick_rate_hz is 9.0, but was not given" in said) == (2, True)
    (tmp_path / "q.yaml").write_text(
        "/**: {ros__parameters: {tick_rate_hz: 9.0, words: [a, b]}}\n", encoding="utf-8"
    )
    params = ("--params", tmp_path / "q.yaml")
    assert start("sar-compile", "approve", tree, *params, env=state).end() == 0
    assert run_approved(*params)[0] == 0
    assert run_approved("--ros-args", "-p", "tick_rate_hz:=9.0", "-p", "words:=[a, b]")[0] == 0
    (tmp_path / "p.yaml").write_text("properties: {nobody sleeps: {never: Sleep}}\n", encoding="utf-8")
    status, said = run_approved(*params, "--properties", tmp_path / "p.yaml")
    assert (status, "p.yaml is not the approved properties file" in said) == (2, True)
    tree.write_text(document("<AlwaysFailure/>"), encoding="utf-8")
    status, said = run_approved()
    assert (status, "tree.xml has changed. Review the tree, then run: sar-compile approve" in said) == (
        2,
        True,
    )
