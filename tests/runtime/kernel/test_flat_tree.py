"""What the flat form of a tree offers, and what it refuses."""

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
from tests.runtime.own import own
from tests.runtime.stage import Stage

Delay, OwnTimeout = own("Delay"), own("Timeout")


def timed_by(clock: ManualClock) -> Times:
    return ClockTimes(lambda _: clock)


TIMES = timed_by(ManualClock())


class TestShape:
    def test_nodes_are_in_pre_order_and_know_their_family(self):
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

    def test_the_cell_of_a_nodes_number_holds_its_status(self):
        flat = flatten(
            composites.Sequence("root", memory=True, children=[Success("a"), Running("b"), Failure("c")])
        )
        ticker = flat.ticker(TIMES)
        assert list(ticker.cells[:4]) == [INVALID] * 4
        assert tick(flat, ticker) == RUNNING
        assert list(ticker.cells[:4]) == [RUNNING, SUCCESS, RUNNING, INVALID]

    def test_a_tree_as_deep_as_py_trees_can_tick_has_a_flat_form(self):
        root: Behaviour = Success("leaf")
        for number in range(900):
            root = decorators.Inverter(f"inverter {number}", root)
        flat = flatten(root)
        assert tick(flat, flat.ticker(TIMES)) == SUCCESS


class Halves(composites.Composite):
    def tick(self):
        yield from self.children[0].tick()


class PoliteSequence(composites.Sequence):
    """It may do anything in its own methods."""


class Loud(decorators.Decorator):
    def update(self):
        return self.decorated.status


class Adopting(Behaviour):
    def update(self):
        return Status.SUCCESS


class TestUnknownClasses:
    @pytest.mark.parametrize(
        "node",
        [
            Halves("mine", [Success("a")]),
            Halves("mine", []),
            PoliteSequence("mine", memory=True, children=[Success("a")]),
            Loud("mine", Success("a")),
        ],
    )
    def test_a_control_or_decorator_that_is_not_the_librarys_is_refused_by_name_and_class(self, node):
        with pytest.raises(
            NotFlatError,
            match=f"'mine' is a .*{type(node).__name__}.*Replace it by registered controls and decorators",
        ) as caught:
            flatten(composites.Sequence("root", memory=True, children=[node]))
        assert caught.value.behaviour is node

    def test_a_leaf_that_has_taken_a_child_is_refused(self):
        leaf = Adopting("mine")
        leaf.children.append(Success("a"))
        with pytest.raises(NotFlatError, match="mine"):
            flatten(leaf)


class Ticking(Behaviour):
    """A leaf that counts its ticks by a method that others leave alone."""

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


class Answering(Behaviour):
    def __init__(self, name, answer):
        super().__init__(name)
        self.answer = answer
        self.ends = []

    def update(self):
        return self.answer

    def terminate(self, new_status):
        self.ends.append(new_status)


class Broken(Behaviour):
    def update(self):
        message = "out of battery"
        raise RuntimeError(message)


class TestLeaves:
    def test_a_leaf_with_a_tick_and_a_stop_of_its_own_is_ticked_and_stopped_by_them(self):
        leaf = Ticking("leaf", Status.SUCCESS, Status.RUNNING)
        flat = flatten(leaf)
        ticker = flat.ticker(TIMES)
        assert [tick(flat, ticker), tick(flat, ticker)] == [SUCCESS, RUNNING]
        stop(flat, ticker)
        assert leaf.stops == [(Status.RUNNING, Status.INVALID)]
        assert ticker.cells[0] == INVALID

    @pytest.mark.parametrize("answer", [Status.INVALID, None, "SUCCESS"])
    def test_an_answer_that_is_no_end_counts_as_a_reset_as_for_py_trees(self, answer):
        leaf = Answering("leaf", answer)
        flat = flatten(leaf)
        ticker = flat.ticker(TIMES)
        assert tick(flat, ticker) == SKIPPED
        assert (ticker.cells[0], leaf.status, leaf.ends) == (INVALID, Status.INVALID, [Status.INVALID])

    def test_what_a_leaf_raises_comes_out_and_what_ran_goes_on_running(self):
        flat = flatten(
            composites.Parallel(
                "both",
                children=[Running("a"), Broken("b")],
                policy=ParallelPolicy.SuccessOnAll(synchronise=False),
            )
        )
        ticker = flat.ticker(TIMES)
        with pytest.raises(RuntimeError, match="out of battery"):
            tick(flat, ticker)
        assert list(ticker.cells[:3]) == [INVALID, RUNNING, INVALID]

    def test_an_answer_that_is_no_status_is_logged(self, monkeypatch):
        leaf = Answering("leaf", "SUCCESS")
        said: list[str] = []
        monkeypatch.setattr(leaf.logger, "error", said.append)
        flat = flatten(leaf)
        tick(flat, flat.ticker(TIMES))
        assert said == ["A behaviour returned an invalid status, setting to INVALID [SUCCESS][leaf]"]

    def test_a_leaf_that_resets_itself_logs_nothing(self, monkeypatch):
        leaf = Answering("leaf", Status.INVALID)
        said: list[str] = []
        monkeypatch.setattr(leaf.logger, "error", said.append)
        flat = flatten(leaf)
        tick(flat, flat.ticker(TIMES))
        assert said == []

    @python_only
    def test_whoever_flattens_a_tree_may_build_some_of_its_nodes_otherwise(self):
        ticked: list[str] = []

        class Telling(TreeNode):
            def tick(self, ticker: Ticker) -> int:
                ticked.append(self.behaviour.name)
                ticker.cells[self.status_cell] = SUCCESS
                return SUCCESS

        def node_of(part: NodeBuilder) -> TreeNode:
            return Telling(part) if isinstance(part.behaviour, Running) else known_node(part)

        root = composites.Sequence("root", memory=True, children=[Running("a"), Running("b")])
        flat = flatten(root, node_of)
        assert tick(flat, flat.ticker(TIMES)) == SUCCESS
        assert ticked == ["a", "b"]


class TestState:
    def test_two_states_of_one_tree_do_not_know_of_each_other(self):
        flat = flatten(composites.Sequence("root", memory=True, children=[Success("a"), Running("b")]))
        one, other = flat.ticker(TIMES), flat.ticker(TIMES)
        tick(flat, one)
        assert (one.cells[0], other.cells[0]) == (RUNNING, INVALID)

    def test_how_a_oneshot_has_ended_is_never_forgotten(self):
        child = StatusQueue("child", [Status.FAILURE, Status.SUCCESS], None)
        flat = flatten(decorators.OneShot("once", child, OneShotPolicy.ON_COMPLETION))
        ticker = flat.ticker(TIMES)
        tick(flat, ticker)
        stop(flat, ticker)
        assert [tick(flat, ticker), tick(flat, ticker)] == [FAILURE, FAILURE]

    def test_a_oneshot_that_has_ended_before_has_ended_in_flat_form(self, monkeypatch):
        root = decorators.OneShot("once", Success("child"), OneShotPolicy.ON_COMPLETION)
        root.tick_once()
        monkeypatch.setattr(root.decorated, "update", Broken("never").update)
        flat = flatten(root)
        assert tick(flat, flat.ticker(TIMES)) == SUCCESS

    def test_what_a_count_counts_can_be_read_from_it(self):
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

    def test_one_node_can_be_stopped_or_forgotten_by_its_number(self):
        ended = Answering("leaf", Status.RUNNING)
        flat = flatten(composites.Sequence("root", memory=True, children=[Success("a"), ended]))
        ticker = flat.ticker(TIMES)
        tick(flat, ticker)
        stop(flat, ticker, 2)
        put_to_rest(flat, ticker, 1)
        assert (list(ticker.cells[:3]), ended.ends) == ([RUNNING, INVALID, INVALID], [Status.INVALID])

    def test_a_guard_that_answers_with_neither_a_bool_nor_a_status_raises_as_in_py_trees(self):
        flat = flatten(decorators.EternalGuard("guard", Success("child"), lambda: 1))
        with pytest.raises(RuntimeError, match="'guard': the condition"):
            tick(flat, flat.ticker(TIMES))

    @pytest.mark.parametrize(("answer", "outcome"), [(Status.FAILURE, FAILURE), (Status.RUNNING, SUCCESS)])
    def test_a_guard_may_answer_with_a_status(self, answer, outcome):
        flat = flatten(decorators.EternalGuard("guard", Success("child"), lambda: answer))
        assert tick(flat, flat.ticker(TIMES)) == outcome


class TestViews:
    def test_the_drawing_is_that_of_the_tree_of_py_trees(self):
        drawings = []
        for form in ("py_trees", "flat"):
            clock = ManualClock()
            child = AsyncSequence("pausing", [Success("a"), Delay("d", Running("b"), Input(1500), clock)])
            root = composites.Selector(
                "root", memory=False, children=[Failure("x"), OwnTimeout("t", child, Input(4000), clock)]
            )
            flat = flatten(root)
            ticker = flat.ticker(timed_by(clock))
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

    def test_the_runner_is_woken_by_a_node_that_pauses(self):
        stage = Stage()
        root = stage.ready(AsyncSequence("pausing", [Success("a"), Success("b")]))
        flat = flatten(root)
        assert tick(flat, flat.ticker(TIMES)) == RUNNING
        assert stage.woken == 1


class Asked(Times):
    """Timers that are up as they are told, and note what they are asked."""

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
    def test_whoever_ticks_decides_when_a_timer_is_up(self):
        flat = flatten(OwnTimeout("t", Running("child"), Input(700), ManualClock()))
        times = Asked([False, True])
        ticker = flat.ticker(times)
        assert [tick(flat, ticker) for _ in range(3)] == [RUNNING, RUNNING, FAILURE]
        assert times.started == [(0, 0.7)]

    @python_only
    def test_a_timer_that_was_up_is_not_asked_again(self):
        flat = flatten(Delay("d", Running("child"), Input(100), ManualClock()))
        times = Asked([False, True])
        ticker = flat.ticker(times)
        assert [tick(flat, ticker) for _ in range(5)] == [RUNNING] * 5

    @python_only
    def test_a_timeout_without_a_limit_starts_no_timer(self):
        flat = flatten(OwnTimeout("t", Running("child"), Input(0), ManualClock()))
        times = Asked()
        ticker = flat.ticker(times)
        assert [tick(flat, ticker) for _ in range(3)] == [RUNNING] * 3
        assert times.started == []

    def test_a_clock_that_goes_back_counts_as_one_that_stands_still(self):
        clock = ManualClock(100.0)
        times = timed_by(clock)
        token = times.start(0, 2.0)
        clock.advance(1.0)
        assert times.remaining_sec(0, token) == 1.0
        clock.advance(-50.0)
        assert times.remaining_sec(0, token) == 1.0
        assert not times.is_up(0, token)
        clock.advance(1.0)
        assert times.is_up(0, token)
        assert times.remaining_sec(0, token) == 0.0
