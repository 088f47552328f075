"""Tests of resuming a mission that was killed at any time: no survivor is lost, and none is named or reported twice."""

import random
import signal
from typing import Any

import pytest

from tests.faults.crashing_mission import ONCE, SURVIVORS, Mortal, kinds
from tests.faults.self_killing_runs import KILLER, TIMED_KILLER
from tests.faults.worlds import ACKNOWLEDGED, arguments, end, hold, is_over, world

__all__ = ["world"]

pytestmark = pytest.mark.ros

TREES = ("search_and_rescue", "search_and_rescue_resilient")


@pytest.fixture
def crashing_mission(ros, tmp_path):
    """Return a function that makes missions that can be killed."""
    made: list[Mortal] = []

    def make(tree):
        made.append(Mortal(ros, tmp_path / f"{len(made)}.journal", tree))
        return made[-1]

    yield make
    for each in made:
        each.close()


SOME_FACTS, ALL_FACTS = 5, 1


@pytest.mark.parametrize(
    ("tree", "step", "refused"),
    [
        *((tree, SOME_FACTS, 0) for tree in TREES),
        *(pytest.param(tree, ALL_FACTS, 0, marks=pytest.mark.slow) for tree in TREES),
        pytest.param(TREES[1], ALL_FACTS, 4, marks=pytest.mark.slow),
    ],
)
def test_mission_killed_at_any_event_ends_like_undisturbed_one(crashing_mission, tree, step, refused):
    undisturbed = crashing_mission(tree)
    undisturbed.refuse(refused)
    assert undisturbed.live()
    expected, facts = undisturbed.outcome(), undisturbed.facts
    assert facts > 10
    for dies_at in range(step, facts + 1, step):
        for written in (False, True):
            mission = crashing_mission(tree)
            mission.refuse(refused)
            assert not mission.live(dies_at, written=written)
            assert mission.live()
            moment = f"killed {'after' if written else 'before'} fact {dies_at}"
            assert mission.outcome() == expected, moment
            found = kinds(mission.place)
            assert {key: count for key, count in found.items() if count > 1 and key[0] in ONCE} == {}, moment
            assert all(goal.final for goal in mission.nav.goals), moment


@pytest.mark.parametrize("tree", TREES)
def test_repeatedly_killed_mission_reaches_its_end(crashing_mission, tree):
    undisturbed = crashing_mission(tree)
    undisturbed.live()
    mission = crashing_mission(tree)
    lives = 1
    # Each life records two more events than it needs to return to the earlier state.
    while not mission.live(4, written=True):
        lives += 1
        assert lives < 40
    assert mission.outcome() == undisturbed.outcome()


@pytest.mark.parametrize("tree", TREES)
def test_mission_killed_with_full_disk_ends_like_undisturbed_one(crashing_mission, tree):
    undisturbed = crashing_mission(tree)
    undisturbed.live()
    mission = crashing_mission(tree)
    mission.full_from = 3  # zone_a is being searched
    assert not mission.live(undisturbed.facts - 3)
    mission.full_from = None
    assert mission.live()
    assert mission.outcome() == undisturbed.outcome()
    assert {key: count for key, count in kinds(mission.place).items() if count > 1 and key[0] in ONCE} == {}


def test_reported_survivor_name_is_not_reused_after_lost_events(crashing_mission, monkeypatch):
    from sar_compiler.journal import spill_file

    monkeypatch.setattr(spill_file, "_SLOT_BYTES", 330)
    mission = crashing_mission("search_and_rescue")
    mission.full_from = 3
    assert not mission.live(9)
    assert kinds(mission.place)["facts_lost", None] == 1
    (before,) = {each.survivor_id for each in mission.report.requests}
    assert before == "survivor_1"
    mission.full_from = None
    assert mission.live()
    assert {name for name, *_ in mission.told()} == {"survivor_1", "survivor_2", "survivor_3"}
    assert [survivor.survivor_id for survivor in mission.record.survivors] == ["survivor_2", "survivor_3"]


def test_orphaned_goal_is_canceled_before_next_goal_is_sent(crashing_mission):
    mission = crashing_mission("search_and_rescue")
    mission.nav.script = []
    runner = mission.begin()
    mission.stage.until(lambda: runner.tick() or mission.nav.goals, "the first goal")
    mission.die()
    mission.nav.script = ["succeed"]
    mission.begin()
    assert [goal.final for goal in mission.nav.goals] == ["canceled"]
    mission.die()
    assert mission.live()
    assert mission.nav.goals[0].final == "canceled"


def test_uncanceled_orphaned_goal_is_awaited(crashing_mission):
    mission = crashing_mission("search_and_rescue")
    mission.nav.script, mission.nav.heed_cancel = [], False
    runner = mission.begin()
    mission.stage.until(lambda: runner.tick() or mission.nav.goals, "the first goal")
    mission.die()

    from sar_compiler.journal.journal_opening import open_journal
    from sar_compiler.ros.orphaned_goals import OrphanedGoals

    journal = open_journal(mission.place, resume=True)
    left = OrphanedGoals(mission.stage.node, journal)
    mission.stage.until(lambda: left.poll() and mission.nav.cancels > 1, "the second request to cancel")
    assert "has not ended yet. The robot may be moving" in str(left.poll())
    mission.nav.order("abort")
    mission.stage.until(lambda: left.poll() is None, "the end of the goal")
    journal.close()


def test_stored_reports_are_delivered_by_next_run(crashing_mission):
    mission = crashing_mission("search_and_rescue_resilient")
    acknowledge = mission.report.answer
    mission.report.answer = lambda _, response: setattr(response, "acknowledged", False)
    # Three attempts to report the survivor of zone_a are events 5 to 7; then the report is stored.
    assert not mission.live(8, written=True)
    assert kinds(mission.place)["report_kept", "survivor_1"] == 1
    mission.report.answer = acknowledge
    assert mission.live()
    assert [survivor.acknowledged for survivor in mission.outcome()[1]] == [True, True]
    found = kinds(mission.place)
    assert found["report_acknowledged", "survivor_1"] == found["report_acknowledged", "survivor_2"] == 1
    assert {each.survivor_id for each in mission.report.requests} == {"survivor_1", "survivor_2"}


def test_survivor_frames_are_published_again(crashing_mission):
    mission = crashing_mission("search_and_rescue")
    # zone_a with its survivor is visited: the name, the report and the visit are events 4 to 7.
    assert not mission.live(8)
    assert kinds(mission.place)["zone_visited", "zone_a"] == 1
    listener = mission.stage.static_frames(mission.stage.host().node)
    mission.begin()
    mission.stage.until(lambda: "survivor_1" in listener.frames, "the frame of the survivor")
    assert listener.position("survivor_1") == (*SURVIVORS["zone_a"], 0.0)
    mission.die()


SIMULATED = ("--sim", "--speed", 20)
TWO_ZONES = ("--ros-args", "-p", "zone_order:=[zone_a, zone_b]")


def run_killed_mission(start, dies_at, written, *arguments):
    """Run a mission that is killed at an event."""
    run = start("python", "-c", KILLER, dies_at, written, *arguments)
    assert run.end() == -signal.SIGKILL, run.output
    return run


@pytest.mark.costly
@pytest.mark.parametrize("tree", TREES)
def test_simulated_mission_killed_between_name_and_report_is_resumed(start, tmp_path, tree):
    place = tmp_path / "mission.journal"
    dead = run_killed_mission(start, 5, "before", tree, *SIMULATED, "--journal", place, *TWO_ZONES)
    assert "Survivor detected at zone_a!" in dead.output
    refused = start("sar-run", tree, *SIMULATED, "--journal", place, *TWO_ZONES)
    assert refused.end() == 2
    assert f"the mission in the journal {place} is not over" in refused.output
    run = start("sar-run", tree, *SIMULATED, "--journal", place, "--resume", *TWO_ZONES)
    assert run.end() == 0, run.output
    assert "The mission in " in run.output
    assert "zone_a was searched in an earlier run." in run.output
    assert "Detection request for zone_a" not in run.output
    assert "Navigating to zone_a" not in run.output
    assert ACKNOWLEDGED in run.output
    assert run.output.count("Report received: survivor_1 at (-2.50, 3.20)") == 1
    again = start("sar-run", tree, *SIMULATED, "--journal", place, "--resume", *TWO_ZONES)
    assert again.end() == 2
    assert "is over (Mission complete.). Omit --resume" in again.output


@pytest.mark.costly
def test_mission_killed_while_driving_leaves_no_goal_and_sends_no_pose(world, start, witness, tmp_path):
    from geometry_msgs.msg import PoseWithCovarianceStamped

    place, watching, base = tmp_path / "mission.journal", witness(), world.base()
    poses: list[Any] = []
    watching.node.create_subscription(PoseWithCovarianceStamped, "initialpose", poses.append, 10)
    dead = start("sar-run", *arguments(place, TREES[0])).wait_for("Navigating to zone_b...")
    watching.wait_until_moving()
    dead.send(signal.SIGKILL)
    dead.end()
    told = len(poses)
    run = start("sar-run", *arguments(place, TREES[0], "--resume"))
    end(run)
    hold(watching, base, place)
    assert len(poses) == told
    # The subscription works: a pose that the test publishes is received.
    publisher = watching.node.create_publisher(PoseWithCovarianceStamped, "initialpose", 10)

    def is_heard():
        publisher.publish(PoseWithCovarianceStamped())
        return len(poses) > told

    watching.wait_until(is_heard, "a pose of the test's own")
    assert "Navigating to zone_a..." not in run.log


@pytest.mark.slow
@pytest.mark.parametrize("tree", TREES)
@pytest.mark.parametrize("written", ["before", "written"])
@pytest.mark.parametrize("dies_at", range(1, 14))
def test_mission_killed_at_any_event_is_resumed(world, start, witness, tmp_path, tree, written, dies_at):
    place, base = tmp_path / "mission.journal", world.base()
    run_killed_mission(start, dies_at, written, *arguments(place, tree))
    end(start("sar-run", *arguments(place, tree, "--resume")))
    hold(witness(), base, place)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(50))
def test_mission_killed_at_random_times_is_resumed(world, start, witness, tmp_path, seed):
    chance = random.Random(seed)  # noqa: S311 - as many as there are seeds
    place, base, tree = tmp_path / "mission.journal", world.base(), chance.choice(TREES)
    for life in range(4):
        more = ("--resume",) if life else ()
        run = start("python", "-c", TIMED_KILLER, chance.uniform(0.0, 3.0), *arguments(place, tree, *more))
        if run.end() != -signal.SIGKILL or is_over(
            place
        ):  # the mission may be over before the process has ended
            break
    else:
        end(start("sar-run", *arguments(place, tree, "--resume")))
    hold(witness(), base, place)
