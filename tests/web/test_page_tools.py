"""What engineers can ask of a run on its page, beside what they are told."""

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
from tests.views.flown import Said, flown, simulated

BODY = '<Sequence name="all"><Script name="write" code="goal := 3"/><AlwaysSuccess name="end"/></Sequence>'


class Engine:
    """What ticks a tree, and can be held."""

    def __init__(self, root):
        self._live = LiveTree(root)
        self._breakpoints: Any = None
        self.woken = 0

    def use_breakpoints(self, breakpoints):
        self._breakpoints = breakpoints

    def wake(self):
        self.woken += 1

    def tick(self):
        """Return a tick, which yields where it is held."""
        return tick_with_breakpoints(self._live, self._breakpoints, [])


@pytest.fixture
def run(tmp_path):
    """Return the tools of a run with what ticks its tree, and what breakpoints have said."""
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


def test_a_breakpoint_holds_the_tree_before_its_node_until_somebody_goes_on(run):
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


def test_a_breakpoint_that_is_taken_away_holds_nothing(run):
    tools, engine, _ = run
    ask(tools, "breakpoints", node=1, is_set=True)
    tick = engine.tick()
    next(tick)
    assert ask(tools, "breakpoints", node=1, is_set=False) == {"nodes": [], "held": 1}
    assert [*tick] == []


def test_nobody_is_held_once_nobody_looks(run):
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
def test_what_is_no_node_is_not_held(run, node):
    with pytest.raises(ToolError, match="no node"):
        ask(run[0], "breakpoints", node=node, is_set=True)


def test_an_engine_that_cannot_hold_a_tree_is_named(run):
    tools, _, _ = run
    tools._use_breakpoints = None
    with pytest.raises(ToolError, match=r"this engine cannot pause a tree within a tick\. Omit --engine"):
        ask(tools, "breakpoints", node=1, is_set=True)


def test_the_blackboard_has_each_scope_with_its_entries(run):
    tools, engine, _ = run
    engine.use_breakpoints(tools._breakpoints)
    assert [*engine.tick()] == []
    assert ask(tools, "entries") == [
        {"scope": "", "entries": [{"key": "goal", "value": "3", "type": "int", "writes": 1}]}
    ]


def test_who_may_only_look_takes_no_time_from_a_run(run):
    tools, _, _ = run
    assert {name: tool.is_free for name, tool in tools.tools.items()} == {
        "entries": True,
        "breakpoints": False,
        "otherwise": False,
    }


def test_before_there_is_a_tree_nothing_can_be_asked():
    tools = LiveTools(lambda *_: None)
    for tool in ("entries", "breakpoints"):
        with pytest.raises(ToolError, match="not built yet"):
            ask(tools, tool)


def test_a_journal_is_asked_what_another_answer_would_have_led_to(tmp_path):
    path, place = tmp_path / "tree.xml", tmp_path / "a.journal"
    path.write_text(
        document('<Sequence name="all"><ZonesRemaining/><NavigateToBase/></Sequence>'), encoding="utf-8"
    )
    journal = open_journal(place)
    tree = simulated(path, default_registry())
    flown(tree, Said(NavigateToBase=["aborted"]), journal, tree_file=str(path), tree_id="Main")
    journal.close()
    tool = journal_tools([place])["otherwise"]
    found: Any = tool.ask({"robot": 0, "run": 1, "node": 2, "tick": 1})
    assert {"instead": {"status": "SUCCESS", "label": "arrived"}, "then": [], "root": "SUCCESS"} in found


def test_of_a_run_that_was_held_longer_than_proofs_assume_it_can_be_asked_as_well(tmp_path):
    path, place = tmp_path / "tree.xml", tmp_path / "a.journal"
    held = "<ReactiveFallback><NotHeld/><Running/></ReactiveFallback>"
    path.write_text(
        document(f"<ReactiveSequence>{held}<NavigateToBase/></ReactiveSequence>"), encoding="utf-8"
    )
    journal = open_journal(place)
    start = StartValues(facts={"orders_left": 9})
    tree = stage_of(load(path), params=start).play().simulated
    said = Said(NotHeld=["held"] * 5, NavigateToBase=["aborted"])
    flown(tree, said, journal, tree_file=str(path), tree_id="Main")
    journal.close()
    tool = journal_tools([place])["otherwise"]
    released: Any = tool.ask({"robot": 0, "run": 1, "node": 2, "tick": 5})
    assert "free" in {each["instead"]["label"] for each in released}
    found: Any = tool.ask({"robot": 0, "run": 1, "node": 4, "tick": 6})
    assert {"instead": {"status": "SUCCESS", "label": "arrived"}, "then": [], "root": "SUCCESS"} in found


def journal_of_one_leaf(folder):
    """Fly a tree of one leaf; return the file of its journal."""
    place = folder / "a.journal"
    path = folder / "tree.xml"
    path.write_text(document("<ZonesRemaining/>"), encoding="utf-8")
    journal = open_journal(place)
    flown(simulated(path, default_registry()), Said(), journal, tree_file=str(path), tree_id="Main")
    journal.close()
    return place


def test_a_journal_has_a_report_on_its_page(tmp_path):
    place = journal_of_one_leaf(tmp_path)
    report = journal_tools([place])["report"]
    assert "<h2>What to do next</h2>" in str(report.ask({"robot": 0}))
    with pytest.raises(ToolError, match="this page has no such robot"):
        report.ask({"robot": 1})
    place.unlink()
    with pytest.raises(JournalError):
        report.ask({"robot": 0})


@pytest.mark.parametrize("wrong", [{"robot": 1}, {"robot": -1}, {"run": 2}, {"node": 3}])
def test_what_is_not_in_a_journal_cannot_be_asked(tmp_path, wrong):
    place = journal_of_one_leaf(tmp_path)
    with pytest.raises(ToolError, match="no such"):
        journal_tools([place])["otherwise"].ask({"robot": 0, "run": 1, "node": 0, "tick": 1, **wrong})
