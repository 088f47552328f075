"""Tests of the flat form of a tree, and of the nodes that it rejects."""

from collections.abc import Hashable, Iterable

import pytest
from py_trees import composites, decorators
from py_trees.behaviour import Behaviour
from py_trees.behaviours import Failure, Running, StatusQueue, Success
from py_trees.common import OneShotPolicy, ParallelPolicy, Status
from py_trees.display import unicode_tree

from sar_compiler.runtime.clock import ManualClock
from sar_compiler.runtime.kernel.cells import FAILURE, INVALID, RUNNING, SKIPPED, SUCCESS
from sar_compiler.runtime.kernel.table import NotFlatError, flatten, known_node
from sar_compiler.runtime.kernel.times import ClockTimes, Times
from sar_compiler.runtime.kernel.tree_nodes import NodeBuilder, Ticker, TreeNode
from sar_compiler.runtime.ports import Input
from sar_compiler.runtime.stock import AsyncSequence
from tests.kernels import python_only
from tests.runtime.kernel.flat import put_to_rest, stop, tick
from tests.runtime.node_factories import own
from tests.runtime.stage import Stage

Delay, OwnTimeout = own("Delay"), own("Timeout")


def times_of_clock(clock: ManualClock) -> Times:
    return ClockTimes(lambda _: clock)


TIMES = times_of_clock(ManualClock())


class TestShape:
    def test_nodes_are_in_pre_order_and_know_their_children(self):
        inner = composites.Selector("inner", memory=False, children=[Success("a"), Success("b")])
        flat = flatten(composites.Sequence("root", memory=True, children=[inner, Success("c")]))
        assert [node.behaviour.name for node in flat.nodes] == ["root", "inner", "a", "b", "c"]
        assert [[child.index for child in node.children] for node in flat.nodes] == [
            [1, 4],
            [2, 3],
            [],
            [],
            [],
        ]

    def test_cell_at_index_of_node_holds_its_status(self):
        flat = flatten(
            composites.Sequence("root", memory=True, children=[Success("a"), Running("b"), Failure("c")])
        )
        ticker = flat.ticker(TIMES)
        assert list(ticker.cells[:4]) == [INVALID] * 4
        assert tick(flat, ticker) == RUNNING
        assert list(ticker.cells[:4]) == [RUNNING, SUCCESS, RUNNING, INVALID]

    def test_tree_with_900_nested_decorators_can_be_flattened(self):
        root: Behaviour = Success("leaf")
        for number in range(900):
            root = decorators.Inverter(f"inverter {number}", root)
        flat = flatten(root)
        assert tick(flat, flat.ticker(TIMES)) == SUCCESS


class CustomControl(composites.Composite):
    def tick(self):
        yield from self.children[0].tick()


class SequenceSubclass(composites.Sequence):
    """A subclass, whose methods could do anything."""


class CustomDecorator(decorators.Decorator):
    def update(self):
        return self.decorated.status


class CustomLeaf(Behaviour):
    def update(self):
        return Status.SUCCESS


class TestUnknownClasses:
    @pytest.mark.parametrize(
        "node",
        [
            CustomControl("mine", [Success("a")]),
            CustomControl("mine", []),
            SequenceSubclass("mine", memory=True, children=[Success("a")]),
            CustomDecorator("mine", Success("a")),
        ],
    )
    def test_unknown_control_or_decorator_is_rejected_with_name_and_class(self, node):
        with pytest.raises(
            NotFlatError,
            match=f"'mine' is a .*{type(node).__name__}.*Replace it by registered controls and decorators",
        ) as caught:
            flatten(composites.Sequence("root", memory=True, children=[node]))
        assert caught.value.behaviour is node

    def test_leaf_with_child_is_rejected(self):
        leaf = CustomLeaf("mine")
        leaf.children.append(Success("a"))
        with pytest.raises(NotFlatError, match="mine"):
            flatten(leaf)


class LeafWithOwnTick(Behaviour):
    """A leaf that overrides `tick` and `stop`."""

    def __init__(self, name, *answers):
        super().__init__(name)
        self.outcomes = list(answers)
        self.stops = []

    def tick(self):
        self.status = self.outcomes.pop(0)
        yield self

    def update(self):
        raise AssertionError

    def stop(self, new_status):
        self.stops.append((self.status, new_status))
        super().stop(new_status)


class ConstantLeaf(Behaviour):
    def __init__(self, name, answer):
        super().__init__(name)
        self.answer = answer
        self.ends = []

    def update(self):
        return self.answer

    def terminate(self, new_status):
        self.ends.append(new_status)


class RaisingLeaf(Behaviour):
    def update(self):
        message = "out of battery"
        raise RuntimeError(message)


class TestLeaves:
    def test_overridden_tick_and_stop_of_leaf_are_called(self):
        leaf = LeafWithOwnTick("leaf", Status.SUCCESS, Status.RUNNING)
        flat = flatten(leaf)
        ticker = flat.ticker(TIMES)
        assert [tick(flat, ticker), tick(flat, ticker)] == [SUCCESS, RUNNING]
        stop(flat, ticker)
        assert leaf.stops == [(Status.RUNNING, Status.INVALID)]
        assert ticker.cells[0] == INVALID

    @pytest.mark.parametrize("answer", [Status.INVALID, None, "SUCCESS"])
    def test_invalid_return_value_resets_leaf_as_in_py_trees(self, answer):
        leaf = ConstantLeaf("leaf", answer)
        flat = flatten(leaf)
        ticker = flat.ticker(TIMES)
        assert tick(flat, ticker) == SKIPPED
        assert (ticker.cells[0], leaf.status, leaf.ends) == (INVALID, Status.INVALID, [Status.INVALID])

    def test_exception_in_leaf_propagates_and_running_sibling_keeps_running(self):
        flat = flatten(
            composites.Parallel(
                "both",
                children=[Running("a"), RaisingLeaf("b")],
                policy=ParallelPolicy.SuccessOnAll(synchronise=False),
            )
        )
        ticker = flat.ticker(TIMES)
        with pytest.raises(RuntimeError, match="out of battery"):
            tick(flat, ticker)
        assert list(ticker.cells[:3]) == [INVALID, RUNNING, INVALID]

    def test_return_value_that_is_no_status_is_logged(self, monkeypatch):
        leaf = ConstantLeaf("leaf", "SUCCESS")
        said: list[str] = []
        monkeypatch.setattr(leaf.logger, "error", said.append)
        flat = flatten(leaf)
        tick(flat, flat.ticker(TIMES))
        assert said == ["A behaviour returned an invalid status, setting to INVALID [SUCCESS][leaf]"]

    def test_returned_invalid_status_is_not_logged(self, monkeypatch):
        leaf = ConstantLeaf("leaf", Status.INVALID)
        said: list[str] = []
        monkeypatch.setattr(leaf.logger, "error", said.append)
        flat = flatten(leaf)
        tick(flat, flat.ticker(TIMES))
        assert said == []

    @python_only
    def test_flatten_accepts_custom_node_builder(self):
        ticked: list[str] = []

        class RecordingNode(TreeNode):
            def tick(self, ticker: Ticker) -> int:
                ticked.append(self.behaviour.name)
                ticker.cells[self.status_cell] = SUCCESS
                return SUCCESS

        def node_of(part: NodeBuilder) -> TreeNode:
            return RecordingNode(part) if isinstance(part.behaviour, Running) else known_node(part)

        root = composites.Sequence("root", memory=True, children=[Running("a"), Running("b")])
        flat = flatten(root, node_of)
        assert tick(flat, flat.ticker(TIMES)) == SUCCESS
        assert ticked == ["a", "b"]


class TestState:
    def test_two_tickers_of_one_tree_are_independent(self):
        flat = flatten(composites.Sequence("root", memory=True, children=[Success("a"), Running("b")]))
        one, other = flat.ticker(TIMES), flat.ticker(TIMES)
        tick(flat, one)
        assert (one.cells[0], other.cells[0]) == (RUNNING, INVALID)

    def test_oneshot_keeps_final_status_after_stop(self):
        child = StatusQueue("child", [Status.FAILURE, Status.SUCCESS], None)
        flat = flatten(decorators.OneShot("once", child, OneShotPolicy.ON_COMPLETION))
        ticker = flat.ticker(TIMES)
        tick(flat, ticker)
        stop(flat, ticker)
        assert [tick(flat, ticker), tick(flat, ticker)] == [FAILURE, FAILURE]

    def test_oneshot_completed_before_flattening_stays_completed(self, monkeypatch):
        root = decorators.OneShot("once", Success("child"), OneShotPolicy.ON_COMPLETION)
        root.tick_once()
        monkeypatch.setattr(root.decorated, "update", RaisingLeaf("never").update)
        flat = flatten(root)
        assert tick(flat, flat.ticker(TIMES)) == SUCCESS

    def test_count_decorator_exposes_its_counters(self):
        count = decorators.Count(
            "count", StatusQueue("child", [Status.RUNNING, Status.SUCCESS], Status.RUNNING)
        )
        flat = flatten(count)
        ticker = flat.ticker(TIMES)
        for _ in range(3):
            tick(flat, ticker)
        stop(flat, ticker)
        assert (count.total_tick_count, count.running_count, count.success_count) == (3, 2, 1)
        assert (count.failure_count, count.interrupt_count) == (0, 1)

    def test_single_node_can_be_stopped_or_reset_by_index(self):
        ended = ConstantLeaf("leaf", Status.RUNNING)
        flat = flatten(composites.Sequence("root", memory=True, children=[Success("a"), ended]))
        ticker = flat.ticker(TIMES)
        tick(flat, ticker)
        stop(flat, ticker, 2)
        put_to_rest(flat, ticker, 1)
        assert (list(ticker.cells[:3]), ended.ends) == ([RUNNING, INVALID, INVALID], [Status.INVALID])

    def test_guard_condition_returning_neither_bool_nor_status_raises(self):
        flat = flatten(decorators.EternalGuard("guard", Success("child"), lambda: 1))
        with pytest.raises(RuntimeError, match="'guard': the condition"):
            tick(flat, flat.ticker(TIMES))

    @pytest.mark.parametrize(("answer", "outcome"), [(Status.FAILURE, FAILURE), (Status.RUNNING, SUCCESS)])
    def test_guard_condition_may_return_status(self, answer, outcome):
        flat = flatten(decorators.EternalGuard("guard", Success("child"), lambda: answer))
        assert tick(flat, flat.ticker(TIMES)) == outcome


class TestViews:
    def test_flat_tree_is_drawn_like_py_trees_tree(self):
        drawings = []
        for form in ("py_trees", "flat"):
            clock = ManualClock()
            child = AsyncSequence("pausing", [Success("a"), Delay("d", Running("b"), Input(1500), clock)])
            root = composites.Selector(
                "root", memory=False, children=[Failure("x"), OwnTimeout("t", child, Input(4000), clock)]
            )
            flat = flatten(root)
            ticker = flat.ticker(times_of_clock(clock))
            for _ in range(3):
                if form == "flat":
                    tick(flat, ticker)
                else:
                    root.tick_once()
                clock.advance(1.0)
            if form == "flat":
                for node in flat.nodes:
                    node.write_status(ticker.cells)
            drawings.append(unicode_tree(root, show_status=True))
        assert drawings[0] == drawings[1]
        assert "remaining: 2.0s" in drawings[0]

    def test_pausing_node_wakes_runner(self):
        stage = Stage()
        root = stage.ready(AsyncSequence("pausing", [Success("a"), Success("b")]))
        flat = flatten(root)
        assert tick(flat, flat.ticker(TIMES)) == RUNNING
        assert stage.woken == 1


class ScriptedTimes(Times):
    """Timers that expire as scripted, and record their starts."""

    def __init__(self, answers: Iterable[bool] = ()) -> None:
        self.outcomes = list(answers)
        self.started: list[tuple[int, float]] = []

    def start(self, index: int, seconds: float) -> Hashable:
        self.started.append((index, seconds))
        return len(self.started)

    def is_up(self, index: int, token: Hashable) -> bool:
        assert (index, token) == (self.started[-1][0], len(self.started))
        return self.outcomes.pop(0)

    def remaining_sec(self, index: int, token: Hashable) -> float:
        return 0.0


class TestTimers:
    @python_only
    def test_times_of_ticker_decide_when_timeout_expires(self):
        flat = flatten(OwnTimeout("t", Running("child"), Input(700), ManualClock()))
        times = ScriptedTimes([False, True])
        ticker = flat.ticker(times)
        assert [tick(flat, ticker) for _ in range(3)] == [RUNNING, RUNNING, FAILURE]
        assert times.started == [(0, 0.7)]

    @python_only
    def test_expired_timer_is_not_queried_again(self):
        flat = flatten(Delay("d", Running("child"), Input(100), ManualClock()))
        times = ScriptedTimes([False, True])
        ticker = flat.ticker(times)
        assert [tick(flat, ticker) for _ in range(5)] == [RUNNING] * 5

    @python_only
    def test_timeout_without_limit_starts_no_timer(self):
        flat = flatten(OwnTimeout("t", Running("child"), Input(0), ManualClock()))
        times = ScriptedTimes()
        ticker = flat.ticker(times)
        assert [tick(flat, ticker) for _ in range(3)] == [RUNNING] * 3
        assert times.started == []

    def test_clock_jumping_back_is_treated_as_stopped(self):
        clock = ManualClock(100.0)
        times = times_of_clock(clock)
        token = times.start(0, 2.0)
        clock.advance(1.0)
        assert times.remaining_sec(0, token) == 1.0
        clock.advance(-50.0)
        assert times.remaining_sec(0, token) == 1.0
        assert not times.is_up(0, token)
        clock.advance(1.0)
        assert times.is_up(0, token)
        assert times.remaining_sec(0, token) == 0.0
