"""Who watches a run of `sar-run` cannot end it."""

from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from py_trees.behaviours import Running
from py_trees.common import Status

from sar_compiler.cli.run_watchers import RunWatchers
from sar_compiler.journal.journal import Journal


class FailingView:
    """A view that cannot draw."""

    def __init__(self, done: list[str]) -> None:
        self.drawn = 0
        self._done = done

    def begin(self, earlier: object) -> None:
        pass

    def take(self, entry: object) -> None:
        pass

    def refresh(self, now: float) -> None:
        self.drawn += 1
        raise ValueError(now)

    def close(self) -> None:
        self._done.append("closed")
        raise ValueError


class Stage:
    """Watchers of a run, and what has happened and was logged.

    Args:
        view: Whether there is a view, which cannot draw.
        options: What is asked for on the command line.
    """

    def __init__(self, *, view: bool = False, **options: object) -> None:
        self.done: list[str] = []
        self.said: list[str] = []
        logger = SimpleNamespace(error=self.said.append)
        node: Any = SimpleNamespace(get_logger=lambda: logger)
        asked: Any = SimpleNamespace(**{"report": [], "record": None, "publish": False, **options})
        self.node = node
        self.journal: Any = Journal()
        self.view: Any = FailingView(self.done) if view else None
        make: Any = RunWatchers
        self.watchers = make(asked, node, self.journal, ExitStack(), self.view, None)

    def fail(self, *_: object) -> None:
        """Fail at what is asked for."""
        self.done.append("failed")
        raise ValueError


def test_a_view_that_fails_is_closed_and_told_of_and_not_drawn_again() -> None:
    stage = Stage(view=True)
    stage.watchers.refresh(1.0)
    stage.watchers.refresh(2.0)
    stage.watchers.leave_terminal()
    assert (stage.view.drawn, stage.done) == (1, ["closed"])
    assert stage.said == ["The view has failed, and shows no more: ValueError(1.0)."]


def test_a_view_that_cannot_be_closed_is_told_of() -> None:
    stage = Stage(view=True)
    stage.watchers.leave_terminal()
    assert stage.said == ["The view could not be closed: ValueError()."]


def test_one_whose_end_fails_keeps_no_other_from_its_end() -> None:
    stage = Stage()
    stage.watchers._recording = SimpleNamespace(end=stage.fail)
    stage.watchers._publisher = SimpleNamespace(end=lambda: stage.done.append("published"))
    stage.watchers._report = SimpleNamespace(write=stage.fail)
    stage.watchers.end()
    assert stage.done == ["failed", "published", "failed"]
    assert stage.said == [
        "One who watches the mission could not say how it has ended: ValueError().",
        "The report could not be written: ValueError().",
    ]


def test_a_recording_that_fails_takes_nothing_from_who_publishes(monkeypatch: pytest.MonkeyPatch) -> None:
    recording = SimpleNamespace()
    monkeypatch.setattr(RunWatchers, "_opened", lambda *_: recording)
    recording.take = Stage().fail
    stage = Stage(record=Path("run.mcap"), publish=True)
    assert stage.journal.is_wanted
    stage.watchers._publisher = SimpleNamespace(take=lambda entry: stage.done.append(entry.kind))
    stage.journal.note("zone_visited")
    stage.journal.note("base_reached")
    assert stage.done == ["zone_visited", "base_reached"]


@pytest.mark.ros
def test_goals_are_cancelled_before_the_view_is_closed_when_a_run_ends_at_once(
    capsys: pytest.CaptureFixture[str],
) -> None:
    from sar_compiler.cli.run_mission import ADRIFT, _TreeRun
    from sar_compiler.ros.leaves.goals_under_way import goals_under_way

    stage = Stage(view=True)
    goals_under_way(stage.node).sending(SimpleNamespace(uuid=[1] * 16), "/drive/_action/cancel_goal")
    leaf: Any = Running("drive")
    leaf.status = Status.RUNNING
    leaf.terminate = lambda _: stage.done.append("cancelled")
    run: Any = SimpleNamespace(node=stage.node, watchers=stage.watchers)
    tree: Any = SimpleNamespace(root=leaf)
    assert _TreeRun._leave_at_once(run, tree) == ADRIFT
    assert stage.done == ["cancelled", "closed"]
    assert "what is under way was told to stop" in capsys.readouterr().err
