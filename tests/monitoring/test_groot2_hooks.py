"""Breakpoints and substitutions, which hold a tree and not its node."""

import json
from contextlib import ExitStack, closing

import pytest

import sar_compiler
from sar_compiler import Groot2Publisher, TreeRunner
from sar_compiler.leaves import Clock
from sar_compiler.testing import ManualClock
from tests.monitoring.groot2_client import Client, request
from tests.monitoring.test_groot2 import FAILURE, IDLE, RUNNING, SUCCESS, WAS, Queue, main
from tests.processes import free_port
from tests.ros.conftest import make_ros, ros
from tests.trees import write
from tests.waiting import SILENCE_SEC

pytestmark = pytest.mark.ros

__all__ = ["make_ros", "ros"]

BEFORE, AFTER = 0, 1
TWO = '<Sequence><Queue name="one" answers="S"/><Queue name="two" answers="S"/></Sequence>'


@pytest.fixture
def stage(ros, tmp_path):
    """Show a tree that may be held; return what ticks it, a client, and what was told."""
    with ExitStack() as stack:

        def show(body, **options):
            path = tmp_path / "tree.xml"
            write(path, *main(body), main="Main")
            tree = sar_compiler.load(path, nodes=[Queue]).compile(context={Clock: ManualClock()})
            port = free_port()
            told: list[str] = []
            # A machine that stalls is not somebody who has gone.
            options = {"patience_sec": SILENCE_SEC, **options}
            publisher = Groot2Publisher(tree, port, hooks=True, tell=told.append, **options)
            stack.enter_context(closing(publisher))
            runner = TreeRunner(tree)
            publisher.watch(runner)
            runner.setup(node=ros.node())
            stack.callback(runner.shutdown)
            return runner, stack.enter_context(closing(Client(port))), told

        yield show


def hook(uid, position=BEFORE, mode=0, status="SKIPPED", *, once=False):
    return json.dumps(
        {
            "enabled": True,
            "uid": uid,
            "mode": mode,
            "once": once,
            "desired_status": status,
            "position": position,
        }
    ).encode()


def unlock(uid, status="SKIPPED", position=BEFORE, *, remove=False):
    asked = {"uid": uid, "position": position, "desired_status": status, "remove_when_done": remove}
    return json.dumps(asked).encode()


def test_a_breakpoint_holds_the_tick_at_its_node_and_tells_so(stage):
    runner, client, told = stage(TWO)
    assert client.ask("I", hook(3)) == []
    runner.tick()
    assert client.heard() == ("N", "3")
    assert client.statuses() == {1: RUNNING, 2: SUCCESS, 3: IDLE}
    assert runner.count == 0
    runner.tick()
    assert (runner.count, client.statuses()[2]) == (0, SUCCESS)
    assert told == ["Groot2 holds the tree before 'two': it is not ticked until it goes on"]
    assert client.ask("U", unlock(3)) == []
    runner.tick()
    assert runner.count == 1
    assert client.statuses() == dict.fromkeys((1, 2, 3), WAS + SUCCESS)
    assert told[1:] == ["the tree is ticked again"]


def test_while_the_tree_is_held_its_node_goes_on_and_unlocking_wakes_the_tree(stage, ros):
    runner, client, _ = stage(TWO)
    client.ask("I", hook(2))
    beats = []
    runner.node.create_timer(0.001, lambda: beats.append(runner.count))
    runner.tick_tock(period_ms=1e7)
    runner.wake()
    ros.spin_until(client.hears, "the breakpoint")
    held = len(beats)
    ros.spin_until(lambda: len(beats) > held + 5, "the node's timer")
    assert set(beats) == {0}
    client.ask("U", unlock(2, remove=True))
    ros.spin_until(lambda: runner.count == 1, "the end of the tick")
    assert client.ask("D") == [b"[]"]


@pytest.mark.parametrize(("status", "outcome"), [("SUCCESS", SUCCESS), ("FAILURE", FAILURE)])
def test_another_outcome_is_put_in_the_place_of_a_node_that_is_not_ticked(status, outcome, stage):
    runner, client, told = stage('<Sequence><Queue name="one" answers="R"/></Sequence>')
    client.ask("I", hook(2, mode=1, status=status))
    runner.tick()
    assert client.heard() == ("N", "2")
    assert client.statuses() == {1: WAS + outcome, 2: WAS + outcome}
    assert told == [f"Groot2 overrides the outcome of 'one' with {status}"]
    runner.tick()
    assert client.heard() == ("N", "2")


def test_what_is_put_in_a_place_in_every_tick_is_said_once_for_each_outcome(stage):
    runner, client, told = stage(TWO)
    for status in ("SUCCESS", "FAILURE"):
        client.ask("I", hook(2, mode=1, status=status))
        runner.tick()
        runner.tick()
    assert told == [
        f"Groot2 overrides the outcome of 'one' with {status}" for status in ("SUCCESS", "FAILURE")
    ]


def test_a_node_that_runs_is_stopped_before_another_outcome_takes_its_place(stage):
    runner, client, _ = stage('<Sequence><Queue name="one" answers="R"/><Queue answers="R"/></Sequence>')
    (queue, _) = runner.root.children
    stopped = []
    queue.terminate = lambda status: stopped.append(status.value)
    runner.tick()
    client.ask("I", hook(2, mode=1, status="SUCCESS", once=True))
    runner.tick()
    assert (stopped, client.statuses()) == (["INVALID"], {1: RUNNING, 2: SUCCESS, 3: RUNNING})
    assert client.ask("D") == [b"[]"]


def test_an_outcome_is_replaced_after_the_tick(stage):
    runner, client, _ = stage(TWO)
    client.ask("I", hook(2, AFTER, mode=1, status="FAILURE"))
    runner.tick()
    assert client.statuses() == {1: WAS + FAILURE, 2: WAS + FAILURE, 3: IDLE}


def test_a_breakpoint_can_be_left_with_an_outcome(stage):
    runner, client, _ = stage(TWO)
    client.ask("I", hook(2))
    runner.tick()
    client.ask("U", unlock(2, "FAILURE", remove=True))
    runner.tick()
    assert client.statuses() == {1: WAS + FAILURE, 2: WAS + FAILURE, 3: IDLE}


@pytest.mark.parametrize("word", ["IDLE", "RUNNING", "CONTINUE", ""])
def test_a_breakpoint_is_left_without_an_outcome_by_every_other_word(word, stage):
    runner, client, _ = stage(TWO)
    client.ask("I", hook(2))
    runner.tick()
    client.ask("U", unlock(2, word))
    runner.tick()
    assert client.statuses()[1] == WAS + SUCCESS


@pytest.mark.parametrize("leave", ["remove", "remove all", "disable", "replace"])
def test_who_waits_at_a_breakpoint_that_is_taken_away_goes_on(leave, stage):
    runner, client, _ = stage(TWO)
    client.ask("I", b"[%b]" % hook(2))
    runner.tick()
    asked = {
        "remove": ("R", json.dumps({"uid": 2, "position": BEFORE}).encode()),
        "remove all": ("A",),
        "disable": ("X",),
        "replace": ("I", hook(2, mode=1)),
    }[leave]
    client.ask(*asked)
    runner.tick()
    assert (runner.count, client.statuses()[1]) == (1, WAS + SUCCESS)


def test_a_breakpoint_of_somebody_who_is_gone_holds_nobody(stage, ros):
    runner, client, told = stage(TWO, patience_sec=1.0)
    runner.tick_tock(period_ms=1e7)
    client.ask("I", hook(2))
    runner.wake()
    ros.spin_until(lambda: client.ask("D") and told, "the breakpoint")
    assert told[0].startswith("Groot2 holds the tree before 'one'")
    ros.spin_until(lambda: runner.count == 1, "the end of the tick")
    (listed,) = json.loads(client.ask("D")[0])
    assert listed["enabled"]


def test_a_tree_that_is_held_can_be_stopped(stage):
    runner, client, _ = stage('<Sequence><Queue answers="R"/><Queue answers="S"/></Sequence>')
    runner.tick()
    client.ask("I", hook(2))
    runner.tick()
    runner.shutdown()
    assert [node.status.value for node in runner.root.iterate()] == ["INVALID"] * 3


def test_hooks_are_listed_as_they_were_set(stage):
    _, client, _ = stage(TWO)
    hooks = [hook(2), hook(2, AFTER, 1, "SUCCESS", once=True), hook(99)]
    client.ask("I", b"[%b]" % b",".join(hooks))
    assert json.loads(client.ask("D")[0]) == [json.loads(each) for each in hooks[:2]]


@pytest.mark.parametrize(
    ("kind", "payload", "words"),
    [
        ("I", b"{", "not JSON"),
        ("I", b"[[[1", "not JSON"),
        ("I", b"7", "a hook is an object with 'uid', a whole number"),
        ("I", b'{"uid": "2"}', "a hook is an object with 'uid', a whole number"),
        ("I", b'{"uid": true}', "a hook is an object with 'uid', a whole number"),
        ("I", b'{"uid": 2, "position": 7}', "position: 7 is none of 0, 1"),
        ("I", hook(2, status="DONE"), "desired_status: 'DONE' is none of RUNNING, SUCCESS"),
        ("R", b'{"uid": 2, "position": 0}', "Node ID not found"),
        ("U", unlock(2), "Node ID not found"),
    ],
)
def test_a_malformed_hook_is_refused(kind, payload, words, stage):
    _, client, _ = stage(TWO)
    assert words in client.refused(request(kind), payload)
    assert client.ask("D") == [b"[]"]
