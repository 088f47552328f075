"""Tests of the controls and decorators of Nav2, which must behave as in its sources."""

import pytest
from py_trees import composites
from py_trees.common import Status

from sar_compiler.runtime.clock import ManualClock
from sar_compiler.runtime.kernel.nav2_controls import Nav2ControlError
from sar_compiler.runtime.ports import InOut, Input
from tests.runtime.node_factories import asking, of_nav2
from tests.runtime.stage import Stage

RecoveryNode = of_nav2("RecoveryNode")
PipelineSequence = of_nav2("PipelineSequence")
WrappingRoundRobin = of_nav2("RoundRobin")
RoundRobin = of_nav2("RoundRobin", "main")
NonblockingSequence = of_nav2("NonblockingSequence", "main")
PersistentSequence = of_nav2("PersistentSequence", "main")
RateController = of_nav2("RateController")
SingleTrigger = of_nav2("SingleTrigger")
SpeedController = asking("SpeedController")
DistanceController = asking("DistanceController")
PathLongerOnApproach = asking("PathLongerOnApproach")
PauseResumeController = asking("PauseResumeController")


def recovery_node(stage, retries=1, **children):
    return RecoveryNode("r", stage.leaves(**children), Input(retries))


class TestRecoveryNode:
    def test_success_of_first_child_succeeds_without_recovery(self):
        stage = Stage()
        assert stage.ticks(recovery_node(stage, a="R,S", b="S"), 2) == ["R: a=R", "S: a=S"]

    def test_failure_triggers_recovery_and_retry_in_same_tick(self):
        stage = Stage()
        assert stage.tick(recovery_node(stage, a="F,S", b="S")) == "S: a=F b=S a=S"

    def test_node_fails_when_first_attempt_and_all_retries_have_failed(self):
        stage = Stage()
        assert stage.tick(recovery_node(stage, 2, a="F", b="S")) == "F: a=F b=S a=F b=S a=F"

    def test_zero_retries_mean_no_recovery(self):
        stage = Stage()
        assert stage.tick(recovery_node(stage, 0, a="F", b="S")) == "F: a=F"

    def test_negative_number_of_retries_is_treated_as_one(self):
        stage = Stage()
        assert stage.tick(recovery_node(stage, -1, a="F", b="S")) == "F: a=F b=S a=F"

    def test_failed_recovery_fails_node_and_next_start_ticks_first_child(self):
        stage = Stage()
        assert stage.ticks(recovery_node(stage, a="F", b="R,F"), 3) == ["R: a=F b=R", "F: b=F", "F: a=F b=F"]

    def test_first_child_is_not_ticked_while_recovery_runs(self):
        stage = Stage()
        assert stage.ticks(recovery_node(stage, a="F,S", b="R,S"), 2) == ["R: a=F b=R", "S: b=S a=S"]

    def test_skipped_first_child_skips_node(self):
        stage = Stage()
        assert stage.tick(recovery_node(stage, a="K", b="S")) == "K: a=K"

    def test_skipped_recovery_fails_node_and_keeps_retry_count(self):
        stage = Stage()
        root = recovery_node(stage, 2, a="F", b="S,K,S")
        assert stage.ticks(root, 2) == ["F: a=F b=S a=F b=K", "F: a=F b=S a=F"]

    def test_halt_resets_retry_count(self):
        stage = Stage()
        root = recovery_node(stage, 1, a="F,R,F,R", b="S")
        assert stage.tick(root) == "R: a=F b=S a=R"
        root.stop(Status.INVALID)
        assert stage.new_events() == "halt a"
        assert stage.tick(root) == "R: a=F b=S a=R"


class TestPipelineSequence:
    def test_next_child_is_ticked_only_after_success(self):
        stage = Stage()
        root = PipelineSequence("p", stage.leaves(a="R,S", b="S"))
        assert stage.ticks(root, 2) == ["R: a=R", "S: a=S b=S"]

    def test_children_before_running_one_are_ticked_again_in_every_tick(self):
        stage = Stage()
        root = PipelineSequence("p", stage.leaves(a="S", b="R"))
        assert stage.ticks(root, 2) == ["R: a=S b=R", "R: a=S b=R"]

    def test_earlier_children_may_run_together_with_furthest_one(self):
        stage = Stage()
        root = PipelineSequence("p", stage.leaves(a="S,R,S", b="R,R,S"))
        assert stage.ticks(root, 3) == ["R: a=S b=R", "R: a=R b=R", "S: a=S b=S"]

    def test_success_halts_children_that_still_run(self):
        stage = Stage()
        root = PipelineSequence("p", stage.leaves(a="S,R", b="R,S"))
        assert stage.ticks(root, 2) == ["R: a=S b=R", "S: a=R b=S halt a"]

    def test_failure_of_any_child_fails_sequence(self):
        stage = Stage()
        root = PipelineSequence("p", stage.leaves(a="S,F", b="R"))
        assert stage.ticks(root, 2) == ["R: a=S b=R", "F: a=F halt b"]

    def test_skipped_children_are_ignored_unless_all_are_skipped(self):
        stage = Stage()
        root = PipelineSequence("p", stage.leaves(a="K", b="K,S"))
        assert stage.ticks(root, 2) == ["K: a=K b=K", "S: a=K b=S"]

    def test_halted_sequence_requires_first_child_to_succeed_again(self):
        stage = Stage()
        root = PipelineSequence("p", stage.leaves(a="S,R", b="R"))
        stage.tick(root)
        root.stop(Status.INVALID)
        stage.new_events()
        assert stage.tick(root) == "R: a=R"


class TestRoundRobin:
    def test_next_start_begins_after_succeeded_child(self):
        stage = Stage()
        root = WrappingRoundRobin("r", stage.leaves(a="S", b="S"))
        assert stage.ticks(root, 3) == ["S: a=S", "S: b=S", "S: a=S"]

    @pytest.mark.parametrize("memory", [True, False])
    def test_current_child_is_kept_below_py_trees_sequence(self, memory):
        stage = Stage()
        robin = WrappingRoundRobin("r", stage.leaves(a="S", b="S"))
        root = composites.Sequence("s", memory, [composites.Selector("f", memory, [robin]), stage.leaf("c")])
        assert stage.ticks(root, 3) == ["S: a=S c=S", "S: b=S c=S", "S: a=S c=S"]

    def test_current_child_is_kept_when_status_is_reset(self):
        stage = Stage()
        root = WrappingRoundRobin("r", stage.leaves(a="S", b="R"))
        assert stage.tick(root) == "S: a=S"
        root.status = Status.INVALID
        assert stage.tick(root) == "R: b=R"

    def test_node_fails_when_all_children_have_failed_in_turn(self):
        stage = Stage()
        root = WrappingRoundRobin("r", stage.leaves(a="S,F", b="F,R,F"))
        assert stage.ticks(root, 3) == ["S: a=S", "F: b=F a=F", "R: a=F b=R"]

    def test_node_is_skipped_if_all_children_are_skipped(self):
        stage = Stage()
        root = WrappingRoundRobin("r", stage.leaves(a="K", b="K"))
        assert stage.tick(root) == "K: a=K b=K"

    def test_halted_node_starts_with_first_child(self):
        stage = Stage()
        root = WrappingRoundRobin("r", stage.leaves(a="F,S", b="R"))
        stage.tick(root)
        root.stop(Status.INVALID)
        stage.new_events()
        assert stage.tick(root) == "S: a=S"

    def test_success_of_last_child_fails_without_wrap_around(self):
        stage = Stage()
        root = RoundRobin("r", stage.leaves(a="F,S", b="S"))
        assert stage.ticks(root, 3) == ["F: a=F b=S", "S: a=S", "F: b=S"]

    def test_success_of_last_child_succeeds_with_wrap_around(self):
        stage = Stage()
        root = RoundRobin("r", stage.leaves(a="F", b="S"), Input(source=True))
        assert stage.tick(root) == "S: a=F b=S"


class TestNonblockingSequence:
    def test_all_children_are_ticked_until_all_succeed_in_one_tick(self):
        stage = Stage()
        root = NonblockingSequence("n", stage.leaves(a="R,S,S", b="S,R,S"))
        assert stage.ticks(root, 3) == ["R: a=R b=S", "R: a=S b=R", "S: a=S b=S"]

    def test_failure_halts_running_children_and_ticks_no_later_child(self):
        stage = Stage()
        root = NonblockingSequence("n", stage.leaves(a="R", b="F", c="S"))
        assert stage.tick(root) == "F: a=R b=F halt a"

    def test_skipped_child_raises_error(self):
        stage = Stage()
        root = NonblockingSequence("n", stage.leaves(a="K"))
        with pytest.raises(
            Nav2ControlError, match="'a' was skipped, but 'n' does not accept skipped children"
        ):
            root.tick_once()


class TestPersistentSequence:
    def make_sequence(self, stage, **children):
        return PersistentSequence("p", stage.leaves(**children), InOut(stage.entry("place")))

    def test_child_index_is_on_blackboard_and_survives_halt(self):
        stage = Stage(place=0)
        root = self.make_sequence(stage, a="S", b="R,S")
        assert stage.tick(root) == "R: a=S b=R"
        assert stage.entry("place").read() == 1
        root.stop(Status.INVALID)
        stage.new_events()
        assert stage.tick(root) == "S: b=S"
        assert stage.entry("place").read() == 0

    def test_failure_resets_child_index(self):
        stage = Stage(place=1)
        assert stage.tick(self.make_sequence(stage, a="S", b="F")) == "F: b=F"
        assert stage.entry("place").read() == 0

    def test_skipped_child_counts_as_success(self):
        stage = Stage(place=0)
        assert stage.tick(self.make_sequence(stage, a="K", b="K")) == "S: a=K b=K"

    def test_negative_child_index_raises_error(self):
        root = self.make_sequence(Stage(place=-1), a="S")
        with pytest.raises(Nav2ControlError, match="'p' cannot begin with child -1"):
            root.tick_once()


class TestRateController:
    def make_controller(self, stage, clock, answers, hz=2.0):
        return RateController("rate", stage.leaf("a", answers), clock, Input(hz))

    def make_pipeline(self, stage, clock, answers, hz=2.0):
        """Return the controller below a node that ticks it again without a reset."""
        return PipelineSequence("p", [self.make_controller(stage, clock, answers, hz), stage.leaf("b", "R")])

    def test_child_is_ticked_at_start_and_after_each_period(self):
        stage, clock = Stage(), ManualClock()
        root = self.make_pipeline(stage, clock, "S")
        results = []
        for _ in range(4):
            results.append(stage.tick(root))
            clock.advance(0.25)
        assert results == ["R: a=S b=R", "R: b=R", "R: a=S b=R", "R: b=R"]

    def test_running_child_is_ticked_in_every_tick(self):
        stage = Stage()
        assert stage.ticks(self.make_controller(stage, ManualClock(), "R,R,S"), 3) == [
            "R: a=R",
            "R: a=R",
            "S: a=S",
        ]

    def test_rate_of_zero_ticks_child_once(self):
        stage, clock = Stage(), ManualClock()
        root = self.make_pipeline(stage, clock, "S", hz=0.0)
        stage.tick(root)
        clock.advance(1e6)
        assert stage.tick(root) == "R: b=R"

    def test_child_is_ticked_immediately_after_reset(self):
        stage = Stage()
        root = self.make_controller(stage, ManualClock(), "S")
        assert stage.ticks(root, 2) == ["S: a=S", "S: a=S"]


class TestSingleTrigger:
    def test_trigger_fails_after_child_has_ended_once(self):
        stage = Stage()
        root = NonblockingSequence("n", [SingleTrigger("t", stage.leaf("a", "R,S,S")), stage.leaf("b", "R")])
        assert stage.ticks(root, 3) == ["R: a=R b=R", "R: a=S b=R", "F: halt b"]

    def test_child_may_end_again_after_reset(self):
        stage = Stage()
        root = SingleTrigger("t", stage.leaf("a", "F"))
        assert stage.ticks(root, 2) == ["F: a=F", "F: a=F"]


def pipeline_with_decorator(stage, cls, world, child, other="R"):
    """Return a decorator with a query leaf, below a node that ticks it again without a reset."""
    decorator = cls("d", stage.leaf("a", child), stage.leaf("world", world))
    return PipelineSequence("p", [decorator, stage.leaf("b", other)])


class TestDecoratorsThatQueryTheRobot:
    def test_speed_controller_makes_no_query_at_start_or_while_child_runs(self):
        stage = Stage()
        root = pipeline_with_decorator(stage, SpeedController, "R,S", "S,R,S")
        assert stage.ticks(root, 4) == [
            "R: a=S b=R",
            "R: world=R b=R",
            "R: world=S a=R b=R",
            "R: a=S b=R",
        ]

    def test_distance_controller_queries_every_tick_and_fails_without_pose(self):
        stage = Stage()
        root = pipeline_with_decorator(stage, DistanceController, "R,R,S,F", "S")
        assert stage.ticks(root, 4) == [
            "R: world=R a=S b=R",
            "R: world=R b=R",
            "R: world=S a=S b=R",
            "F: world=F halt b",
        ]

    def test_path_longer_on_approach_makes_no_query_in_first_tick(self):
        stage = Stage()
        root = PathLongerOnApproach("d", stage.leaf("a", "R"), stage.leaf("world", "F,S"))
        assert stage.ticks(root, 3) == ["S:", "S: world=F", "R: world=S a=R"]

    def test_path_longer_on_approach_does_not_halt_child_when_path_is_shorter(self):
        stage = Stage()
        root = PathLongerOnApproach("d", stage.leaf("a", "R"), stage.leaf("world", "S,F,S"))
        assert stage.ticks(root, 4) == ["S:", "R: world=S a=R", "S: world=F", "R: world=S a=R"]

    def test_pause_halts_child_and_resume_restarts_it(self):
        stage = Stage()
        children = stage.leaves(work="R", pause="R", on_pause="S", on_resume="S")
        root = PauseResumeController("p", children, stage.leaf("world", "S,F,S,R,S,S"))
        assert stage.ticks(root, 5) == [
            "R: world=S work=R",
            "R: world=F halt work on_pause=S",
            "R: world=S pause=R",
            "R: world=R halt pause on_resume=S",
            "R: world=S work=R",
        ]

    def test_pause_and_resume_take_one_tick_each_without_event_children(self):
        stage = Stage()
        root = PauseResumeController("p", stage.leaves(work="R,S"), stage.leaf("world", "F,S,R,S"))
        assert stage.ticks(root, 4) == ["R: world=F", "R: world=S", "R: world=R", "R: world=S work=R"]

    def test_resume_request_is_ignored_unless_paused(self):
        stage = Stage()
        root = PauseResumeController("p", stage.leaves(work="S"), stage.leaf("world", "R"))
        assert stage.tick(root) == "S: world=R work=S"
