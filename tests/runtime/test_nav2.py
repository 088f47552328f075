"""The controls and decorators of Nav2, sentence by sentence as its sources have them."""

import pytest
from py_trees import composites
from py_trees.common import Status

from sar_compiler.runtime.clock import ManualClock
from sar_compiler.runtime.kernel.nav2_controls import Nav2ControlError
from sar_compiler.runtime.ports import InOut, Input
from tests.runtime.own import asking, of_nav2
from tests.runtime.stage import Stage

RecoveryNode = of_nav2("RecoveryNode")
PipelineSequence = of_nav2("PipelineSequence")
WrappingRoundRobin = of_nav2("RoundRobin")
RoundRobin = of_nav2("RoundRobin", "main")
NonblockingSequence = of_nav2("NonblockingSequence", "main")
PersistentSequence = of_nav2("PersistentSequence", "main")
RateController = of_nav2("RateController")
SingleTrigger = of_nav2("SingleTrigger")
WhenDue = asking("SpeedController")
WhenDriven = asking("DistanceController")
WhenPathIsLonger = asking("PathLongerOnApproach")
PausedOnRequest = asking("PauseResumeController")


def recovery(stage, retries=1, **children):
    return RecoveryNode("r", stage.leaves(**children), Input(retries))


class TestRecoveryNode:
    def test_it_succeeds_with_its_first_child_and_never_ticks_the_second_one(self):
        stage = Stage()
        assert stage.ticks(recovery(stage, a="R,S", b="S"), 2) == ["R: a=R", "S: a=S"]

    def test_after_a_failure_it_recovers_and_tries_again_in_the_same_tick(self):
        stage = Stage()
        assert stage.tick(recovery(stage, a="F,S", b="S")) == "S: a=F b=S a=S"

    def test_it_fails_when_its_first_child_has_failed_once_more_than_there_are_retries(self):
        stage = Stage()
        assert stage.tick(recovery(stage, 2, a="F", b="S")) == "F: a=F b=S a=F b=S a=F"

    def test_without_retries_it_does_not_recover(self):
        stage = Stage()
        assert stage.tick(recovery(stage, 0, a="F", b="S")) == "F: a=F"

    def test_less_than_no_retries_count_as_one(self):
        stage = Stage()
        assert stage.tick(recovery(stage, -1, a="F", b="S")) == "F: a=F b=S a=F"

    def test_it_fails_with_the_recovery_and_begins_with_its_first_child_the_next_time(self):
        stage = Stage()
        assert stage.ticks(recovery(stage, a="F", b="R,F"), 3) == ["R: a=F b=R", "F: b=F", "F: a=F b=F"]

    def test_while_the_recovery_runs_the_first_child_is_not_ticked(self):
        stage = Stage()
        assert stage.ticks(recovery(stage, a="F,S", b="R,S"), 2) == ["R: a=F b=R", "S: b=S a=S"]

    def test_it_is_skipped_with_its_first_child(self):
        stage = Stage()
        assert stage.tick(recovery(stage, a="K", b="S")) == "K: a=K"

    def test_a_recovery_that_is_skipped_makes_it_fail_and_the_retries_so_far_still_count(self):
        stage = Stage()
        root = recovery(stage, 2, a="F", b="S,K,S")
        assert stage.ticks(root, 2) == ["F: a=F b=S a=F b=K", "F: a=F b=S a=F"]

    def test_a_halt_forgets_the_retries(self):
        stage = Stage()
        root = recovery(stage, 1, a="F,R,F,R", b="S")
        assert stage.tick(root) == "R: a=F b=S a=R"
        root.stop(Status.INVALID)
        assert stage.told() == "halt a"
        assert stage.tick(root) == "R: a=F b=S a=R"


class TestPipelineSequence:
    def test_it_goes_on_to_the_next_child_only_after_a_success(self):
        stage = Stage()
        root = PipelineSequence("p", stage.leaves(a="R,S", b="S"))
        assert stage.ticks(root, 2) == ["R: a=R", "S: a=S b=S"]

    def test_it_ticks_the_children_before_the_one_that_runs_again_in_each_tick(self):
        stage = Stage()
        root = PipelineSequence("p", stage.leaves(a="S", b="R"))
        assert stage.ticks(root, 2) == ["R: a=S b=R", "R: a=S b=R"]

    def test_children_before_the_furthest_one_may_run_beside_it(self):
        stage = Stage()
        root = PipelineSequence("p", stage.leaves(a="S,R,S", b="R,R,S"))
        assert stage.ticks(root, 3) == ["R: a=S b=R", "R: a=R b=R", "S: a=S b=S"]

    def test_its_end_halts_the_children_that_still_run(self):
        stage = Stage()
        root = PipelineSequence("p", stage.leaves(a="S,R", b="R,S"))
        assert stage.ticks(root, 2) == ["R: a=S b=R", "S: a=R b=S halt a"]

    def test_it_fails_with_any_child(self):
        stage = Stage()
        root = PipelineSequence("p", stage.leaves(a="S,F", b="R"))
        assert stage.ticks(root, 2) == ["R: a=S b=R", "F: a=F halt b"]

    def test_it_passes_over_what_is_skipped_and_is_skipped_if_all_children_are(self):
        stage = Stage()
        root = PipelineSequence("p", stage.leaves(a="K", b="K,S"))
        assert stage.ticks(root, 2) == ["K: a=K b=K", "S: a=K b=S"]

    def test_after_a_halt_the_first_child_has_to_succeed_again_before_the_second_one(self):
        stage = Stage()
        root = PipelineSequence("p", stage.leaves(a="S,R", b="R"))
        stage.tick(root)
        root.stop(Status.INVALID)
        stage.told()
        assert stage.tick(root) == "R: a=R"


class TestRoundRobin:
    def test_the_next_start_begins_behind_the_child_that_has_succeeded(self):
        stage = Stage()
        root = WrappingRoundRobin("r", stage.leaves(a="S", b="S"))
        assert stage.ticks(root, 3) == ["S: a=S", "S: b=S", "S: a=S"]

    @pytest.mark.parametrize("memory", [True, False])
    def test_whose_turn_it_is_outlasts_its_end_below_a_sequence_of_py_trees(self, memory):
        stage = Stage()
        robin = WrappingRoundRobin("r", stage.leaves(a="S", b="S"))
        root = composites.Sequence("s", memory, [composites.Selector("f", memory, [robin]), stage.leaf("c")])
        assert stage.ticks(root, 3) == ["S: a=S c=S", "S: b=S c=S", "S: a=S c=S"]

    def test_whose_turn_it_is_outlasts_that_its_status_is_set_back(self):
        stage = Stage()
        root = WrappingRoundRobin("r", stage.leaves(a="S", b="R"))
        assert stage.tick(root) == "S: a=S"
        root.status = Status.INVALID
        assert stage.tick(root) == "R: b=R"

    def test_it_fails_when_all_children_have_failed_one_after_another(self):
        stage = Stage()
        root = WrappingRoundRobin("r", stage.leaves(a="S,F", b="F,R,F"))
        assert stage.ticks(root, 3) == ["S: a=S", "F: b=F a=F", "R: a=F b=R"]

    def test_it_is_skipped_if_all_children_are(self):
        stage = Stage()
        root = WrappingRoundRobin("r", stage.leaves(a="K", b="K"))
        assert stage.tick(root) == "K: a=K b=K"

    def test_a_halt_makes_it_begin_with_the_first_child(self):
        stage = Stage()
        root = WrappingRoundRobin("r", stage.leaves(a="F,S", b="R"))
        stage.tick(root)
        root.stop(Status.INVALID)
        stage.told()
        assert stage.tick(root) == "S: a=S"

    def test_without_a_wrap_the_success_of_the_last_child_is_a_failure(self):
        stage = Stage()
        root = RoundRobin("r", stage.leaves(a="F,S", b="S"))
        assert stage.ticks(root, 3) == ["F: a=F b=S", "S: a=S", "F: b=S"]

    def test_with_a_wrap_that_success_is_one(self):
        stage = Stage()
        root = RoundRobin("r", stage.leaves(a="F", b="S"), Input(source=True))
        assert stage.tick(root) == "S: a=F b=S"


class TestNonblockingSequence:
    def test_it_ticks_all_children_also_those_that_have_succeeded_until_all_do_in_one_tick(self):
        stage = Stage()
        root = NonblockingSequence("n", stage.leaves(a="R,S,S", b="S,R,S"))
        assert stage.ticks(root, 3) == ["R: a=R b=S", "R: a=S b=R", "S: a=S b=S"]

    def test_a_failure_halts_the_others_and_ticks_none_behind(self):
        stage = Stage()
        root = NonblockingSequence("n", stage.leaves(a="R", b="F", c="S"))
        assert stage.tick(root) == "F: a=R b=F halt a"

    def test_a_child_that_is_skipped_is_an_error(self):
        stage = Stage()
        root = NonblockingSequence("n", stage.leaves(a="K"))
        with pytest.raises(
            Nav2ControlError, match="'a' was skipped, but 'n' does not accept skipped children"
        ):
            root.tick_once()


class TestPersistentSequence:
    def persistent(self, stage, **children):
        return PersistentSequence("p", stage.leaves(**children), InOut(stage.entry("place")))

    def test_its_place_is_on_the_blackboard_and_outlasts_a_halt(self):
        stage = Stage(place=0)
        root = self.persistent(stage, a="S", b="R,S")
        assert stage.tick(root) == "R: a=S b=R"
        assert stage.entry("place").read() == 1
        root.stop(Status.INVALID)
        stage.told()
        assert stage.tick(root) == "S: b=S"
        assert stage.entry("place").read() == 0

    def test_a_failure_begins_again_with_the_first_child(self):
        stage = Stage(place=1)
        assert stage.tick(self.persistent(stage, a="S", b="F")) == "F: b=F"
        assert stage.entry("place").read() == 0

    def test_a_child_that_is_skipped_counts_as_a_success(self):
        stage = Stage(place=0)
        assert stage.tick(self.persistent(stage, a="K", b="K")) == "S: a=K b=K"

    def test_a_place_before_the_first_child_is_an_error(self):
        root = self.persistent(Stage(place=-1), a="S")
        with pytest.raises(Nav2ControlError, match="'p' cannot begin with child -1"):
            root.tick_once()


class TestRateController:
    def rated(self, stage, clock, answers, hz=2.0):
        return RateController("rate", stage.leaf("a", answers), clock, Input(hz))

    def in_pipeline(self, stage, clock, answers, hz=2.0):
        """Under a node that ticks it again without a reset."""
        return PipelineSequence("p", [self.rated(stage, clock, answers, hz), stage.leaf("b", "R")])

    def test_its_child_is_ticked_at_the_start_and_again_when_the_period_is_over(self):
        stage, clock = Stage(), ManualClock()
        root = self.in_pipeline(stage, clock, "S")
        told = []
        for _ in range(4):
            told.append(stage.tick(root))
            clock.advance(0.25)
        assert told == ["R: a=S b=R", "R: b=R", "R: a=S b=R", "R: b=R"]

    def test_a_child_that_runs_is_ticked_in_every_tick(self):
        stage = Stage()
        assert stage.ticks(self.rated(stage, ManualClock(), "R,R,S"), 3) == ["R: a=R", "R: a=R", "S: a=S"]

    def test_a_rate_of_zero_ticks_it_once(self):
        stage, clock = Stage(), ManualClock()
        root = self.in_pipeline(stage, clock, "S", hz=0.0)
        stage.tick(root)
        clock.advance(1e6)
        assert stage.tick(root) == "R: b=R"

    def test_after_a_reset_it_ticks_its_child_at_once(self):
        stage = Stage()
        root = self.rated(stage, ManualClock(), "S")
        assert stage.ticks(root, 2) == ["S: a=S", "S: a=S"]


class TestSingleTrigger:
    def test_its_child_ends_once_and_then_it_fails(self):
        stage = Stage()
        root = NonblockingSequence("n", [SingleTrigger("t", stage.leaf("a", "R,S,S")), stage.leaf("b", "R")])
        assert stage.ticks(root, 3) == ["R: a=R b=R", "R: a=S b=R", "F: halt b"]

    def test_after_a_reset_its_child_may_end_again(self):
        stage = Stage()
        root = SingleTrigger("t", stage.leaf("a", "F"))
        assert stage.ticks(root, 2) == ["F: a=F", "F: a=F"]


def beside(stage, cls, world, child, other="R"):
    """Put a decorator that asks the world where it is ticked again without a reset."""
    decorator = cls("d", stage.leaf("a", child), stage.leaf("world", world))
    return PipelineSequence("p", [decorator, stage.leaf("b", other)])


class TestWhatAsksTheWorld:
    def test_what_is_due_now_and_then_asks_only_where_that_decides(self):
        stage = Stage()
        root = beside(stage, WhenDue, "R,S", "S,R,S")
        assert stage.ticks(root, 4) == [
            "R: a=S b=R",
            "R: world=R b=R",
            "R: world=S a=R b=R",
            "R: a=S b=R",
        ]

    def test_what_waits_for_a_distance_asks_in_every_tick_and_fails_without_a_pose(self):
        stage = Stage()
        root = beside(stage, WhenDriven, "R,R,S,F", "S")
        assert stage.ticks(root, 4) == [
            "R: world=R a=S b=R",
            "R: world=R b=R",
            "R: world=S a=S b=R",
            "F: world=F halt b",
        ]

    def test_a_path_cannot_be_longer_than_none(self):
        stage = Stage()
        root = WhenPathIsLonger("d", stage.leaf("a", "R"), stage.leaf("world", "F,S"))
        assert stage.ticks(root, 3) == ["S:", "S: world=F", "R: world=S a=R"]

    def test_a_path_that_is_no_longer_longer_leaves_its_child_running(self):
        stage = Stage()
        root = WhenPathIsLonger("d", stage.leaf("a", "R"), stage.leaf("world", "S,F,S"))
        assert stage.ticks(root, 4) == ["S:", "R: world=S a=R", "S: world=F", "R: world=S a=R"]

    def test_a_pause_halts_the_work_and_a_resumption_begins_it_anew(self):
        stage = Stage()
        children = stage.leaves(work="R", pause="R", on_pause="S", on_resume="S")
        root = PausedOnRequest("p", children, stage.leaf("world", "S,F,S,R,S,S"))
        assert stage.ticks(root, 5) == [
            "R: world=S work=R",
            "R: world=F halt work on_pause=S",
            "R: world=S pause=R",
            "R: world=R halt pause on_resume=S",
            "R: world=S work=R",
        ]

    def test_without_children_for_the_changes_a_pause_takes_a_tick_for_nothing(self):
        stage = Stage()
        root = PausedOnRequest("p", stage.leaves(work="R,S"), stage.leaf("world", "F,S,R,S"))
        assert stage.ticks(root, 4) == ["R: world=F", "R: world=S", "R: world=R", "R: world=S work=R"]

    def test_a_request_to_resume_is_not_heard_while_nothing_is_paused(self):
        stage = Stage()
        root = PausedOnRequest("p", stage.leaves(work="S"), stage.leaf("world", "R"))
        assert stage.tick(root) == "S: world=R work=S"
