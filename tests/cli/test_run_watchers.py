"""Who watches a run of `sar-run` cannot end it."""

from contextlib import ExitStack
from types import SimpleNamespace
from typing import Any

from sar_compiler.cli.run_watchers import RunWatchers


class FailingView:
    """A view that cannot draw."""

    def __init__(self) -> None:
        self.drawn = 0
        self.closed = False

    def begin(self, earlier: object) -> None:
        pass

    def take(self, entry: object) -> None:
        pass

    def refresh(self, now: float) -> None:
        self.drawn += 1
        raise ValueError(now)

    def close(self) -> None:
        self.closed = True
        raise ValueError


def test_a_view_that_fails_is_closed_and_told_of_and_not_drawn_again() -> None:
    said: list[str] = []
    logger = SimpleNamespace(error=said.append)
    node: Any = SimpleNamespace(get_logger=lambda: logger)
    journal: Any = SimpleNamespace(earlier=list, listen=lambda _: None)
    options: Any = SimpleNamespace(report=[], record=None, publish=False)
    view: Any = FailingView()
    watchers = RunWatchers(options, node, journal, ExitStack(), view, None)
    watchers.refresh(1.0)
    watchers.refresh(2.0)
    watchers.leave_terminal()
    assert (view.drawn, view.closed) == (1, True)
    assert said == ["The view has failed, and shows no more: ValueError(1.0)."]
