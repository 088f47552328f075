"""Tests of property monitoring: a failing monitor ends no mission."""

from types import SimpleNamespace
from typing import Any

import pytest

from sar_compiler import load
from sar_compiler.analysis.tree_analysis import stage_of
from sar_compiler.missions.mission import MissionRun

pytestmark = pytest.mark.ros


class FailingWatch:
    """A watch that fails at the first status."""

    def __init__(self) -> None:
        self.alarms: list[Any] = []
        self.taken: list[str] = []
        self.broken = {"one"}
        self.file = None
        self.properties = SimpleNamespace(names=("one", "two"), left_out=())

    def on_before_event(self, _number: int) -> None:
        self.taken.append("looks")

    def on_start(self, _number: int) -> None:
        self.taken.append("starts")

    def on_status(self, *_what: object) -> None:
        self.taken.append("returns")
        raise LookupError("no such thing")

    def conclude(self, **_: object) -> None:
        self.taken.append("conclude")


def test_failing_watch_is_not_called_again_and_verdicts_remain(
    ros: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from sar_compiler.execution.run_watch import PropertyWatch

    tree, watch = stage_of(load("search_and_rescue")).play().simulated.compiled, FailingWatch()
    engine: Any = SimpleNamespace(add_post_tick_handler=lambda _: None)
    run: Any = SimpleNamespace(
        node=ros.node("mission"),
        options=SimpleNamespace(properties=True, tree_id=None),
        loaded=None,
        approval=None,
        mission=MissionRun(),
        values={},
    )
    monkeypatch.setattr("sar_compiler.execution.run_watch.watch_tree", lambda *_, **__: watch)
    extension = PropertyWatch(run)
    extension.on_compiled(tree, engine)
    tree.root.tick_once()
    tree.root.tick_once()
    assert watch.taken.count("returns") == 1
    assert watch.taken[-1] == "returns"
    extension.on_last_tick(is_over=True)
    assert extension.verdicts() == {"one": "broken", "two": "unknown"}
    assert extension.summary_text() == "Monitored 2 properties: 1 violated (one), 1 unknown (two)."
