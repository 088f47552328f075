"""Tests of the example `two_robots`: two missions in one world, observed by a third node."""

import itertools
import math
import os
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from action_msgs.msg import GoalStatusArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from tf2_msgs.msg import TFMessage

from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.occupancy import read_map
from sar_compiler.sim.planner import Planner
from sar_compiler.sim.world import find_world
from tests.e2e.observers import LATCHED, Watcher
from tests.processes import BIN, Command

FOLDER = Path("examples/two_robots")
ROBOTS = ("robot1", "robot2")
ZONES = {"robot1": ["zone_a", "zone_b"], "robot2": ["zone_d", "zone_c"]}
SURVIVORS = {"robot1": ("map", -2.5, 3.2), "robot2": ("map", 4.1, -2.5)}
SUCCEEDED = 4


def parameters(robot):
    return yaml.safe_load((FOLDER / f"{robot}.yaml").read_text())["/**"]["ros__parameters"]


def to_map_frame(start, places):
    """Convert positions from a robot's `odom` frame, whose origin is its start pose, to `map`."""
    cos, sin = math.cos(start["yaw"]), math.sin(start["yaw"])
    return [(start["x"] + cos * x - sin * y, start["y"] + sin * x + cos * y) for x, y in places]


class Bystander(Watcher):
    """A node outside the robots' namespaces that records messages of both robots and on global topics."""

    def __init__(self):
        super().__init__("bystander")
        self.frames = {}
        self.goals = {}
        self.places: dict[str, list[tuple[float, float]]] = {f"/{robot}/tf": [] for robot in ROBOTS}
        self.initial_poses: dict[str, set[tuple[float, float]]] = {robot: set() for robot in ROBOTS}
        for namespace in ("", *(f"/{robot}" for robot in ROBOTS)):
            self._hear(TFMessage, f"{namespace}/tf", self._record_frames, 10_000)
            self._hear(TFMessage, f"{namespace}/tf_static", self._record_frames, LATCHED)
            status = f"{namespace}/navigate_to_pose/_action/status"
            self._hear(GoalStatusArray, status, self._record_goals, LATCHED)
        for robot in ROBOTS:
            self._hear(PoseWithCovarianceStamped, f"/{robot}/initialpose", self._record_initial_pose, 10)
        self.watch()

    def _hear(self, kind, topic, take, qos):
        def took(message):
            with self._news:
                take(topic, message)
                self._news.tell()

        self.node.create_subscription(kind, topic, took, qos)

    def _record_frames(self, topic, message):
        for transform in message.transforms:
            at = transform.transform.translation
            frames = self.frames.setdefault(topic, {})
            frames[transform.child_frame_id] = (transform.header.frame_id, at.x, at.y)
            if transform.child_frame_id == "base_link":
                self.places[topic].append((at.x, at.y))

    def _record_goals(self, topic, message):
        for status in message.status_list:
            goals = self.goals.setdefault(topic.split("/")[1], {})
            goals[bytes(status.goal_info.goal_id.uuid)] = status.status

    def _record_initial_pose(self, topic, message):
        position = message.pose.pose.position
        self.initial_poses[topic.split("/")[1]].add((position.x, position.y))

    def wait_until(self, seen, what):
        """Wait until a condition on the received messages holds."""
        with self._news:
            self._news.wait_until(seen, lambda: f"{what} did not come: {self.frames}, {self.goals}")


class ScriptRun:
    """A run of the script from start to end, with its observer.

    Attributes:
        run: The script's process.
        status: Its exit status.
        bystander: The node that recorded messages meanwhile.
        global_publishers: The number of publishers on each global topic while both robots ran.
    """

    def __init__(self, run, bystander):
        self.run, self.bystander = run, bystander
        run.wait_for("Mission complete.")
        node = bystander.node
        self.global_publishers = {name: node.count_publishers(name) for name in ("/tf", "/tf_static")}
        self.status = run.end()
        for robot in ROBOTS:
            bystander.wait_until(
                # On a slow machine a goal can miss its time limit, and is then sent again.
                lambda robot=robot: list(bystander.goals.get(robot, {}).values()).count(SUCCEEDED) >= 3,
                f"the success of three goals of {robot}",
            )
            bystander.wait_until(
                lambda robot=robot: "survivor_1" in bystander.frames.get(f"/{robot}/tf_static", {}),
                f"the frame of the survivor that {robot} found",
            )

    def log_of(self, robot, node):
        """Return the log lines of one node, with their wall times."""
        return [(time, text) for time, name, text in self.run.stamped_log() if name == f"{robot}.{node}"]


# One run of some 10 s of CPU serves all tests. tests/sim/test_several_robots.py tests namespaces, positions and servers of several robots.
@pytest.fixture(scope="module")
def script_run():
    bystander = Bystander()
    run = Command(
        "/bin/bash", FOLDER / "two_robots.sh", 5, env={"PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"}
    )
    try:
        yield ScriptRun(run, bystander)
    finally:
        run.kill()
        bystander.close()


@pytest.mark.costly
@pytest.mark.ros
def test_script_succeeds_after_both_missions_complete(script_run):
    assert script_run.status == 0, script_run.run.output
    assert script_run.run.output.count("Summary: the mission is complete.") == 2


@pytest.mark.costly
@pytest.mark.ros
def test_both_missions_run_at_the_same_time(script_run):
    drives = [script_run.log_of(robot, "search_and_rescue") for robot in ROBOTS]
    starts = [next(time for time, text in log if text.startswith("Navigating to ")) for log in drives]
    ends = [next(time for time, text in log if text == "Mission complete.") for log in drives]
    assert max(starts) < min(ends)


@pytest.mark.costly
@pytest.mark.ros
@pytest.mark.parametrize("robot", ROBOTS)
def test_each_mission_visits_zones_of_its_parameters(script_run, robot):
    assert parameters(robot)["zone_order"] == ZONES[robot]
    log = [text for _, text in script_run.log_of(robot, "search_and_rescue")]
    reached = [text for text in log if text.startswith("Reached ")]
    assert reached == [*(f"Reached {zone}." for zone in ZONES[robot]), "Reached base station."]


@pytest.mark.costly
@pytest.mark.ros
@pytest.mark.parametrize("robot", ROBOTS)
def test_each_robot_stays_in_its_half_and_reaches_its_zones(script_run, robot):
    own = parameters(robot)
    places = to_map_frame(own["initial_pose"], script_run.bystander.places[f"/{robot}/tf"])
    for zone in ZONES[robot]:
        target = own["zones"][zone]
        assert min(math.dist(place, (target["x"], target["y"])) for place in places) < 0.3
    side = math.copysign(1.0, own["initial_pose"]["y"])
    assert all(y * side > 0.0 for _, y in places)


@pytest.mark.costly
@pytest.mark.ros
@pytest.mark.parametrize("robot", ROBOTS)
def test_each_localisation_receives_initial_pose_of_its_robot(script_run, robot):
    start = parameters(robot)["initial_pose"]
    assert script_run.bystander.initial_poses[robot] == {(start["x"], start["y"])}
    assert "The initial pose" not in script_run.run.output, "a robot does not stand where it is told"


@pytest.mark.costly
@pytest.mark.ros
@pytest.mark.parametrize("robot", ROBOTS)
def test_each_server_is_called_only_by_its_robot(script_run, robot):
    asked = [text for _, text in script_run.log_of(robot, "detect_survivor_server") if "request for" in text]
    # A request is repeated if a slow machine responds after the time limit.
    assert list(dict.fromkeys(text.split(":")[0] for text in asked)) == [
        f"Detection request for {zone}" for zone in ZONES[robot]
    ]
    _, x, y = SURVIVORS[robot]
    reports = [text for _, text in script_run.log_of(robot, "report_survivor_server") if "received" in text]
    assert set(reports) == {f"Report received: survivor_1 at ({x:.2f}, {y:.2f}). Acknowledged."}


@pytest.mark.costly
@pytest.mark.ros
@pytest.mark.parametrize("robot", ROBOTS)
def test_survivor_frame_belongs_only_to_its_robot(script_run, robot):
    assert script_run.bystander.frames[f"/{robot}/tf_static"] == {"survivor_1": SURVIVORS[robot]}


@pytest.mark.costly
@pytest.mark.ros
def test_global_topics_have_no_publishers(script_run):
    assert script_run.global_publishers == {"/tf": 0, "/tf_static": 0}
    topics = {f"/{robot}/{name}" for robot in ROBOTS for name in ("tf", "tf_static")}
    assert set(script_run.bystander.frames) == topics
    assert set(script_run.bystander.goals) == set(ROBOTS)


def path_of(robot, planner):
    """Return all points of a robot's planned path, from its base through its zones and back; shape (n, 2)."""
    own = parameters(robot)
    places = [own["base_station"], *(own["zones"][zone] for zone in own["zone_order"]), own["base_station"]]
    poses = [Pose2D(**place) for place in places]
    return np.concatenate([planner.plan(*legs).points for legs in itertools.pairwise(poses)])


def test_planned_paths_of_robots_stay_apart():
    world = find_world("disaster_zone")
    assert world.map_path is not None
    planner = Planner(read_map(world.map_path), world.robot_radius)
    north, south = (path_of(robot, planner) for robot in ROBOTS)
    apart = np.hypot(*(north[:, None] - south[None, :]).transpose(2, 0, 1)).min()
    # In metres. The robots touch at two radii, and a turning robot leaves its path by less than one.
    assert apart > 4 * world.robot_radius


@pytest.mark.parametrize("file", ["two_robots.sh", "two_robots.launch.py"])
@pytest.mark.parametrize("robot", ROBOTS)
def test_robot_starts_at_initial_pose_of_its_parameters(file, robot):
    text = (FOLDER / file).read_text(encoding="utf-8")
    [start] = re.findall(rf'{robot}(?:": ")?:?(-?[\d.]+,[-\d.]+,[-\d.]+)', text)
    pose = parameters(robot)["initial_pose"]
    assert [float(number) for number in start.split(",")] == [pose["x"], pose["y"], pose["yaw"]]
    assert parameters(robot)["base_station"] == pose
