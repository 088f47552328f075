"""Tests of the loops over queues."""

from collections import deque

import pytest
from hypothesis import given
from hypothesis import strategies as st
from py_trees.behaviours import Success
from py_trees.common import Status

from sar_compiler.runtime.outcomes import ReturnedStatus
from sar_compiler.runtime.ports import Input, Output, PortError
from sar_compiler.runtime.queues import QueueError
from tests.runtime.node_factories import own
from tests.runtime.stage import Stage

LoopBool = own("LoopBool")
LoopDouble = own("LoopDouble")
LoopInt = own("LoopInt")
LoopString = own("LoopString")


def loop(stage, queue, cls=LoopInt, outcomes="S", if_empty=ReturnedStatus.SUCCESS):
    return cls("l", stage.leaf("a", outcomes), queue, Output(stage.entry("n")), Input(if_empty))


def items_of(stage, root):
    """Tick until the loop ends, and return the item for each tick of the child."""
    items = []
    while stage.tick(root).startswith("R: a"):
        items.append(stage.entry("n").read())
    return items


@pytest.mark.parametrize(
    ("cls", "text", "items"),
    [
        (LoopInt, "1;-2;3", [1, -2, 3]),
        (LoopInt, "7;", [7]),
        (LoopInt, "", []),
        (LoopDouble, "1;2.5;1e3", [1.0, 2.5, 1000.0]),
        (LoopBool, "true;0;TRUE;False", [True, False, True, False]),
        (LoopString, "red; green;", ["red", " green"]),
    ],
)
def test_literal_queue_yields_items_of_loop_type(cls, text, items):
    stage = Stage()
    found = items_of(stage, loop(stage, Input(text), cls))
    assert found == items
    assert [type(item) for item in found] == [type(item) for item in items]


@pytest.mark.parametrize(
    ("cls", "text"),
    [
        (LoopInt, "1;2.5"),
        (LoopDouble, "x"),
        (LoopBool, "2"),
        (LoopInt, "1;;2"),
        (LoopInt, "1; 2"),
        (LoopInt, ";"),
    ],
)
def test_unsuitable_item_of_literal_queue_is_rejected_before_first_child_tick(cls, text):
    stage = Stage()
    with pytest.raises(QueueError, match=r"'l': queue: '.*' is not "):
        loop(stage, Input(text), cls).tick_once()
    assert stage.new_events() == ""


def test_literal_queue_restarts_with_every_activation():
    stage = Stage()
    root = loop(stage, Input("1;2"))
    assert items_of(stage, root) == [1, 2]
    assert items_of(stage, root) == [1, 2]


def test_list_on_blackboard_is_not_changed():
    stage = Stage(q=[1, 2])
    root = loop(stage, stage.port("q"))
    assert items_of(stage, root) == [1, 2]
    assert stage.entry("q").read() == [1, 2]


def test_deque_on_blackboard_is_consumed_and_may_grow_meanwhile():
    queue = deque([1, 2])
    stage = Stage(q=queue)
    root = loop(stage, stage.port("q"))
    stage.tick(root)
    queue.append(3)
    assert items_of(stage, root) == [2, 3]
    assert not queue


def test_string_on_blackboard_is_parsed_as_queue():
    stage = Stage(q="1;2")
    assert items_of(stage, loop(stage, stage.port("q"))) == [1, 2]


def test_value_that_is_no_queue_raises_error_with_remedy():
    stage = Stage(q=7)
    with pytest.raises(QueueError, match=r"queue: a value of type int is not a queue\. Write a list"):
        loop(stage, stage.port("q")).tick_once()


def test_unwritten_queue_raises_error():
    stage = Stage()
    with pytest.raises(PortError, match="the key 'q' has no value"):
        loop(stage, stage.port("q")).tick_once()


def test_unsuitable_item_of_list_raises_error():
    stage = Stage(q=[1, object()])
    with pytest.raises(QueueError, match="is not an integer"):
        loop(stage, stage.port("q")).tick_once()


@pytest.mark.parametrize(
    ("if_empty", "answer"),
    [
        (ReturnedStatus.SUCCESS, "S:"),
        (ReturnedStatus.FAILURE, "F:"),
        (ReturnedStatus.SKIPPED, "K:"),
        (ReturnedStatus.RUNNING, "R:"),
    ],
)
def test_empty_queue_returns_configured_outcome(if_empty, answer):
    stage = Stage()
    root = loop(stage, Input(""), if_empty=if_empty)
    assert stage.tick(root) == answer
    assert root.feedback_message == "no item left"


def test_failure_ends_loop_and_running_child_keeps_its_item():
    stage = Stage()
    root = loop(stage, Input("1;2"), outcomes="R,S,F")
    assert stage.ticks(root, 2) == ["R: a=R", "R: a=S"]
    assert stage.entry("n").read() == 1
    assert root.feedback_message == "item 1, 1 left"
    assert stage.tick(root) == "F: a=F"
    assert stage.entry("n").read() == 2


def test_halted_loop_starts_with_first_item():
    stage = Stage()
    root = loop(stage, Input("1;2"), outcomes="S,R,S")
    stage.ticks(root, 2)
    root.stop(Status.INVALID)
    assert stage.new_events() == "halt a"
    stage.tick(root)
    assert stage.entry("n").read() == 1


def test_loop_without_output_port_repeats_child_for_each_item():
    root = LoopInt("l", Success("a"), Input("1;2"))
    stage = Stage()
    assert stage.ticks(root, 3) == ["R:", "R:", "S:"]


@given(items=st.lists(st.integers(-(2**63), 2**63 - 1), max_size=8))
def test_every_item_is_yielded_once_in_order(items):
    stage = Stage()
    root = loop(stage, Input(";".join(map(str, items))))
    assert items_of(stage, root) == items
