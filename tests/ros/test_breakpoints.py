"""Tests of breakpoints: the tree waits within a tick while its node continues."""

import pytest

import sar_compiler
from sar_compiler import TreeRunner
from sar_compiler.leaves import Clock
from sar_compiler.runtime.breakpoints import Breakpoints
from sar_compiler.testing import ManualClock
from tests.groot2.test_groot2 import Queue, main
from tests.ros.conftest import make_ros, ros
from tests.trees import write
from tests.waiting import SILENCE_SEC

pytestmark = pytest.mark.ros

__all__ = ["make_ros", "ros"]


@pytest.fixture
def run(ros, tmp_path):
    """Return the runner of a sequence of two leaves, its breakpoints, and their log."""
    path = tmp_path / "tree.xml"
    write(
        path,
        *main('<Sequence><Queue name="one" answers="RS"/><Queue name="two" answers="S"/></Sequence>'),
        main="Main",
    )
    runner = TreeRunner(sar_compiler.load(path, nodes=[Queue]).compile(context={Clock: ManualClock()}))
    runner.setup(node=ros.node())
    log: list[str] = []
    breakpoints = Breakpoints(log.append, SILENCE_SEC)
    breakpoints.wake = runner.wake
    runner.use_breakpoints(breakpoints)
    yield runner, breakpoints, log
    runner.shutdown()


def test_node_continues_while_tree_is_paused_and_resume_wakes_tree(run, ros):
    runner, breakpoints, log = run
    one = runner.root.children[0]
    breakpoints.add(one)
    counts = []
    runner.node.create_timer(0.001, lambda: counts.append(runner.count))
    runner.tick_tock(period_ms=1e7)
    runner.wake()
    ros.spin_until(lambda: breakpoints.held_at is one, "the breakpoint")
    held = len(counts)
    ros.spin_until(lambda: len(counts) > held + 5, "the node's timer")
    assert set(counts) == {0}
    breakpoints.resume()
    ros.spin_until(lambda: runner.count == 1, "the end of the tick")
    assert log == [
        "A breakpoint pauses the tree before 'one' until you continue it",
        "The tree is ticked again",
    ]


def test_breakpoint_pauses_every_tick_that_reaches_its_node(run):
    runner, breakpoints, _ = run
    breakpoints.add(runner.root.children[0])
    for count in (1, 2):
        runner.tick()
        assert runner.count == count - 1
        breakpoints.resume()
        runner.tick()
        assert runner.count == count


def test_abandoned_breakpoint_releases_tree_until_next_keep_alive(run, ros):
    runner, breakpoints, _ = run
    breakpoints.add(runner.root.children[0])
    runner.tick_tock(period_ms=1e7)
    runner.wake()
    ros.spin_until(lambda: breakpoints.held_at is not None, "the breakpoint")
    breakpoints._patience_sec = -1.0
    breakpoints.release_if_abandoned()
    ros.spin_until(lambda: runner.count == 1, "the end of the tick")
    breakpoints._patience_sec = SILENCE_SEC
    breakpoints.keep_alive()
    runner.wake()
    ros.spin_until(lambda: breakpoints.held_at is not None, "the breakpoint, again")


def test_paused_tree_can_be_stopped(run):
    runner, breakpoints, _ = run
    runner.tick()
    breakpoints.add(runner.root.children[0])
    runner.tick()
    runner.shutdown()
    assert [node.status.value for node in runner.root.iterate()] == ["INVALID"] * 3
