"""Tests of the tools on the engineer's page: breakpoints, blackboard, other outcomes, report."""

from typing import Any

import pytest

from sar_compiler.analysis.assumptions import StartValues
from sar_compiler.analysis.tree_analysis import stage_of
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.loaded_tree import load
from sar_compiler.nodes.registry import default_registry
from sar_compiler.runtime.breakpoints import tick_with_breakpoints
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.testing import compile_for_test
from sar_compiler.web.page_tools import LiveTools, ToolError, journal_tools
from tests.trees import document
from tests.views.recorded_runs import ScriptedPolicy, run_and_record, simulated

BODY = '<Sequence name="all"><Script name="write" code="goal := 3"/><AlwaysSuccess name="end"/></Sequence>'


class Engine:
    """Ticks a tree with breakpoints."""

    def __init__(self, root):
        self._live = LiveTree(root)
        self._breakpoints: Any = None
        self.woken = 0

    def use_breakpoints(self, breakpoints):
        self._breakpoints = breakpoints

    def wake(self):
        self.woken += 1

    def tick(self):
        """Return a tick as an iterator that yields when it is paused."""
        return tick_with_breakpoints(self._live, self._breakpoints, [])


@pytest.fixture
def run(tmp_path):
    """Return the tools of a run, its engine, and the messages of its breakpoints."""
    path = tmp_path / "tree.xml"
    path.write_text(document(BODY), encoding="utf-8")
    tree = compile_for_test(path)
    said = []
    tools = LiveTools(lambda *each: said.append(each))
    engine: Any = Engine(tree.root)
    tools.begin(tree, engine)
    return tools, engine, said


def ask(tools, tool, **values):
    return tools.tools[tool].ask(values)


def test_breakpoint_pauses_tree_before_its_node_until_resumed(run):
    tools, engine, said = run
    assert ask(tools, "breakpoints", node=2, is_set=True) == {"nodes": [2], "held": None}
    tick = engine.tick()
    next(tick)
    assert ask(tools, "breakpoints") == {"nodes": [2], "held": 2}
    assert (
        said[-1][1]
        == "The tree is paused at a breakpoint before 'end'. If the robot is driving, it drives on."
    )
    assert ask(tools, "breakpoints", goes_on=True) == {"nodes": [2], "held": None}
    assert [*tick] == []
    assert said[-1][1] == ""
    assert engine.woken == 1


def test_removing_breakpoint_lets_tick_finish(run):
    tools, engine, _ = run
    ask(tools, "breakpoints", node=1, is_set=True)
    tick = engine.tick()
    next(tick)
    assert ask(tools, "breakpoints", node=1, is_set=False) == {"nodes": [], "held": 1}
    assert [*tick] == []


def test_paused_tree_is_released_when_page_is_abandoned(run):
    tools, engine, _ = run
    ask(tools, "breakpoints", node=1, is_set=True)
    tick = engine.tick()
    next(tick)
    tools.release_abandoned()
    assert engine.woken == 0
    tools._breakpoints._patience_sec = -1.0
    tools.release_abandoned()
    assert engine.woken == 1
    assert [*tick] == []


@pytest.mark.parametrize("node", [3, -1, "1", None])
def test_breakpoint_at_unknown_node_is_rejected(run, node):
    with pytest.raises(ToolError, match="no node"):
        ask(run[0], "breakpoints", node=node, is_set=True)


def test_engine_without_breakpoints_is_reported(run):
    tools, _, _ = run
    tools._use_breakpoints = None
    with pytest.raises(ToolError, match=r"this engine cannot pause a tree within a tick\. Omit --engine"):
        ask(tools, "breakpoints", node=1, is_set=True)


def test_blackboard_has_entries_by_scope(run):
    tools, engine, _ = run
    engine.use_breakpoints(tools._breakpoints)
    assert [*engine.tick()] == []
    assert ask(tools, "entries") == [
        {"scope": "", "entries": [{"key": "goal", "value": "3", "type": "int", "writes": 1}]}
    ]


def test_only_entries_tool_is_free(run):
    tools, _, _ = run
    assert {name: tool.is_free for name, tool in tools.tools.items()} == {
        "entries": True,
        "breakpoints": False,
        "otherwise": False,
    }


def test_tools_require_a_tree():
    tools = LiveTools(lambda *_: None)
    for tool in ("entries", "breakpoints"):
        with pytest.raises(ToolError, match="not built yet"):
            ask(tools, tool)


def test_journal_tool_shows_consequence_of_other_outcome(tmp_path):
    path, place = tmp_path / "tree.xml", tmp_path / "a.journal"
    path.write_text(
        document('<Sequence name="all"><ZonesRemaining/><NavigateToBase/></Sequence>'), encoding="utf-8"
    )
    journal = open_journal(place)
    tree = simulated(path, default_registry())
    run_and_record(
        tree, ScriptedPolicy(NavigateToBase=["aborted"]), journal, tree_file=str(path), tree_id="Main"
    )
    journal.close()
    tool = journal_tools([place])["otherwise"]
    found: Any = tool.ask({"robot": 0, "run": 1, "node": 2, "tick": 1})
    assert {"instead": {"status": "SUCCESS", "label": "arrived"}, "then": [], "root": "SUCCESS"} in found


def test_consequence_is_available_for_run_paused_longer_than_assumed(tmp_path):
    path, place = tmp_path / "tree.xml", tmp_path / "a.journal"
    held = "<ReactiveFallback><NotHeld/><Running/></ReactiveFallback>"
    path.write_text(
        document(f"<ReactiveSequence>{held}<NavigateToBase/></ReactiveSequence>"), encoding="utf-8"
    )
    journal = open_journal(place)
    start = StartValues(facts={"orders_left": 9})
    tree = stage_of(load(path), params=start).play().simulated
    said = ScriptedPolicy(NotHeld=["held"] * 5, NavigateToBase=["aborted"])
    run_and_record(tree, said, journal, tree_file=str(path), tree_id="Main")
    journal.close()
    tool = journal_tools([place])["otherwise"]
    released: Any = tool.ask({"robot": 0, "run": 1, "node": 2, "tick": 5})
    assert "free" in {each["instead"]["label"] for each in released}
    found: Any = tool.ask({"robot": 0, "run": 1, "node": 4, "tick": 6})
    assert {"instead": {"status": "SUCCESS", "label": "arrived"}, "then": [], "root": "SUCCESS"} in found


def journal_of_one_leaf(folder):
    """Run a tree of one leaf; return the path of its journal."""
    place = folder / "a.journal"
    path = folder / "tree.xml"
    path.write_text(document("<ZonesRemaining/>"), encoding="utf-8")
    journal = open_journal(place)
    run_and_record(
        simulated(path, default_registry()), ScriptedPolicy(), journal, tree_file=str(path), tree_id="Main"
    )
    journal.close()
    return place


def test_journal_tool_provides_report(tmp_path):
    place = journal_of_one_leaf(tmp_path)
    report = journal_tools([place])["report"]
    assert "<h2>What to do next</h2>" in str(report.ask({"robot": 0}))
    with pytest.raises(ToolError, match="this page has no such robot"):
        report.ask({"robot": 1})
    place.unlink()
    with pytest.raises(JournalError):
        report.ask({"robot": 0})


@pytest.mark.parametrize("wrong", [{"robot": 1}, {"robot": -1}, {"run": 2}, {"node": 3}])
def test_request_for_unknown_item_of_journal_is_rejected(tmp_path, wrong):
    place = journal_of_one_leaf(tmp_path)
    with pytest.raises(ToolError, match="no such"):
        journal_tools([place])["otherwise"].ask({"robot": 0, "run": 1, "node": 0, "tick": 1, **wrong})
