"""A robot without a mission: the simulated world, Nav2's nodes as processes that a test can kill, and an observer."""

import math
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import yaml
from action_msgs.msg import GoalStatus, GoalStatusArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from lifecycle_msgs.srv import ChangeState
from nav2_msgs.action import NavigateToPose
from nav_msgs.msg import Odometry
from rclpy.action import ActionClient
from sensor_msgs.msg import BatteryState

from tests.e2e.observers import LATCHED, Watcher
from tests.nav2.parameter_files import NAV2_PARAMS, ROOT
from tests.nav2.prefix import MANAGER, SERVERS, environment, executable
from tests.processes import Command

LOCALISATION = ["map_server", "amcl"]
NAVIGATION = [name for name in SERVERS if name not in LOCALISATION]
LOCALISATION_MANAGER, NAVIGATION_MANAGER = "lifecycle_manager_localization", "lifecycle_manager_navigation"
_MANAGERS = {LOCALISATION_MANAGER: LOCALISATION, NAVIGATION_MANAGER: NAVIGATION}

# The actual rate in controller_server's warning about a late control loop, Hz.
_RATE = re.compile(r"Control loop missed its desired rate of [\d.]+ Hz. Current loop rate is ([\d.]+|inf) Hz")

# A slower robot counts as standing, m/s and rad/s.
STANDS_V, STANDS_W = 0.02, 0.05
# The robot must stand this long after the end of a goal or of the process, seconds.
GRACE_SEC = 1.0
# The number of attempts to start Nav2, and the time limit of each, seconds.
_BRING_UPS, _BRING_UP_SEC = 3, 40.0
# How long its processes may take to end after Ctrl-C, as in `ros2 launch`, seconds.
_END_SEC = 10.0
# A robot nearer than this to its start is at home, metres.
_HOME = 0.5
_ENDED = (GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED)


@contextmanager
def busy_processes(count):
    """Run a number of processes that keep the computer busy."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for each in busy:
            each.kill()
            each.wait()


class Robot(Watcher):
    """The movement and the goals of a robot since the beginning, with the machine's times."""

    def __init__(self):
        super().__init__("witness_of_nav2")
        self.speeds = []  # (time, m/s, rad/s)
        self.goals = {}  # for each goal: (time, status) of each change
        self.place = self.pose = None
        self._action = ActionClient(self.node, NavigateToPose, "navigate_to_pose")
        self.node.create_subscription(Odometry, "odometry/filtered", self._on_odometry, 100)
        self.node.create_subscription(PoseWithCovarianceStamped, "amcl_pose", self._on_pose, LATCHED)
        for action in ("navigate_to_pose", "navigate_through_poses"):
            self.node.create_subscription(
                GoalStatusArray, f"{action}/_action/status", self._on_statuses, LATCHED
            )
        self._initial_pose = self.node.create_publisher(PoseWithCovarianceStamped, "initialpose", 1)
        self._battery = self.node.create_publisher(BatteryState, "battery_state", 10)
        self._changes = {
            name: self.node.create_client(ChangeState, f"{name}/change_state") for name in SERVERS
        }
        self.watch()

    def _on_odometry(self, message, info):
        twist, position = message.twist.twist, message.pose.pose.position
        with self._news:
            when = info["source_timestamp"] / 1e9
            self.speeds.append((when, abs(twist.linear.x), abs(twist.angular.z)))
            self.place = (position.x, position.y)
            self._news.tell()

    def _on_pose(self, message):
        with self._news:
            self.pose = (message.pose.pose.position.x, message.pose.pose.position.y)
            self._news.tell()

    def _on_statuses(self, message, info):
        with self._news:
            for each in message.status_list:
                changes = self.goals.setdefault(bytes(each.goal_info.goal_id.uuid), [])
                if not changes or changes[-1][1] != each.status:
                    changes.append((info["source_timestamp"] / 1e9, each.status))
            self._news.tell()

    def comes_within(self, sec, wanted):
        """Wait until a condition holds, but not longer than a time; return whether it holds."""
        deadline = time.time() + sec
        self.wait_until(lambda: wanted() or time.time() > deadline, "the time")
        return wanted()

    def let_pass(self, sec):
        """Wait for a time in which something must not happen."""
        self.comes_within(sec, lambda: False)

    def wait_until_moving(self, run=None):
        """Wait for movement; show the output of a run that ends before."""
        is_over = (lambda: run.is_over) if run is not None else (lambda: False)
        self.wait_until(lambda: (self.speeds and self.speeds[-1][1] > 0.1) or is_over(), "movement")
        assert not is_over(), run.output

    def wait_until_active(self):
        """Wait for an active goal."""
        self.wait_until(lambda: any(not self._is_over(each) for each in self.goals.values()), "a goal")

    def ends_since(self, began):
        """Return the final statuses of the goals that have ended since a time."""
        with self._news:
            return [
                each[-1][1] for each in self.goals.values() if self._is_over(each) and each[-1][0] >= began
            ]

    def first(self, statuses, since):
        """Return the first time after *since* at which a goal had one of some statuses; None if none had."""
        with self._news:
            times = [
                at
                for each in self.goals.values()
                for at, status in each
                if at >= since and status in statuses
            ]
        return min(times, default=None)

    @staticmethod
    def _is_over(changes):
        return changes[-1][1] in _ENDED

    def still_after(self, when):
        """Observe for three seconds; return how long after a time the robot still moved, seconds."""
        self.let_pass(3.0)
        with self._news:
            moving = [at for at, v, w in self.speeds if when < at and (v > STANDS_V or w > STANDS_W)]
        return max(moving) - when if moving else 0.0

    def drives_without_goal(self, since):
        """Return the longest time after the end of a goal at which the robot moved while no goal was active, seconds."""
        with self._news:
            spans = [
                (each[0][0], each[-1][0] if self._is_over(each) else math.inf) for each in self.goals.values()
            ]
            moving = [at for at, v, w in self.speeds if at >= since and (v > STANDS_V or w > STANDS_W)]
        late = []
        for at in moving:
            if not any(begin <= at <= end for begin, end in spans):
                ended = max((end for _, end in spans if end < at), default=since)
                late.append(at - ended)
        return max(late, default=0.0)

    def drive_home(self):
        """Send the robot to its start; return whether it arrived."""
        goal = self.send(0.0, 0.0)
        result = self._in_its_thread(goal.get_result_async, "the robot's coming home")
        return result.status == GoalStatus.STATUS_SUCCEEDED

    def send(self, x, y):
        """Send a goal as another client; return the accepted goal."""
        self.wait_until(self._action.server_is_ready, "the server of navigate_to_pose")
        goal = NavigateToPose.Goal()
        goal.pose.header.frame_id, goal.pose.pose.orientation.w = "map", 1.0
        goal.pose.pose.position.x, goal.pose.pose.position.y = x, y
        sent = self._in_its_thread(lambda: self._action.send_goal_async(goal), "the answer to the goal")
        assert sent.accepted, "the goal is rejected"
        return sent

    def _in_its_thread(self, ask, what):
        """Send a request in the thread that spins, and return the response.

        rclpy registers a request only after it is sent: in another thread the response can arrive before, and is lost.
        """
        asked = self._executor.create_task(ask)
        self.wait_until(lambda: asked.done() and asked.result().done(), what)
        return asked.result().result()

    def tell_pose(self, x, y):
        """Publish the initial pose, as RViz does."""
        message = PoseWithCovarianceStamped()
        message.header.frame_id, message.pose.pose.orientation.w = "map", 1.0
        message.pose.pose.position.x, message.pose.pose.position.y = x, y
        message.pose.covariance[0] = message.pose.covariance[7] = message.pose.covariance[35] = 0.05
        self.wait_until(self._initial_pose.get_subscription_count, "a localisation")
        self._initial_pose.publish(message)

    def change_state(self, name, transition):
        """Change the lifecycle state of a node of Nav2, as the lifecycle manager does; return whether it succeeded."""
        client = self._changes[name]
        self.wait_until(client.service_is_ready, f"{name}/change_state")
        request = ChangeState.Request()
        request.transition.id = transition
        return self._in_its_thread(lambda: client.call_async(request), f"the change of {name}").success

    def say_battery(self, left):
        """Publish the battery's charge, from 0 to 1, in addition to the simulator, which publishes it once a second."""
        self._battery.publish(BatteryState(percentage=left, present=True))

    def is_home(self):
        """Return whether the robot is localised, and at its start."""
        with self._news:
            return (
                self.place is not None
                and self.pose is not None
                and max(math.hypot(*self.place), math.hypot(*self.pose)) < _HOME
            )


class Nav2:
    """The world, the robot, the servers for survivors, and Nav2.

    Args:
        prefix: The installation prefix of Nav2.
        folder: The folder for logs and files.

    Attributes:
        parameters: The parameter file of Nav2's nodes; None for the shipped one. Takes effect at the next start.
    """

    def __init__(self, prefix, folder):
        self._prefix, self._folder = prefix, folder
        self._environment = environment(prefix)
        self.parameters = None
        self._processes, self._commands, self._read = {}, [], {}
        self.start()

    def start(self):
        """Start everything, with the robot at its start and not localised.

        If a busy machine loses a response to one of the managers, this manager waits forever. Then everything is restarted.
        """
        for _ in range(_BRING_UPS):
            self._launch()
            if self.robot.comes_within(_BRING_UP_SEC, self._is_up):
                return
            self.stop()
        message = f"Nav2 does not come up:\n{self.log(LOCALISATION_MANAGER)}{self.log(NAVIGATION_MANAGER)}"
        raise AssertionError(message)

    def _is_up(self):
        """Return whether the localisation is active, and the planner waits for the robot's pose."""
        return "Managed nodes are active" in self.news(
            LOCALISATION_MANAGER
        ) and "Activating planner_server" in self.news(NAVIGATION_MANAGER)

    def _launch(self):
        self.is_whole = True
        self.forget_logs()
        simulated = ["--ros-args", "-p", "use_sim_time:=true"]
        self.simulator = Command("sar-sim", "run", self._world(), "--speed", "1")
        self.simulator.wait_for("runs")
        params = ["--params-file", ROOT / "config" / "mission_params.yaml"]
        self._commands = [
            self.simulator,
            Command("sar-detect-survivor-server", *simulated, *params),
            Command("sar-report-survivor-server", *simulated),
        ]
        for name in [*SERVERS, *_MANAGERS]:
            self.run(name)
        self.robot = Robot()

    def _world(self):
        """Write the world without its map, so that the simulator does not start its stand-in for Nav2."""
        world = yaml.safe_load((ROOT / "worlds" / "disaster_zone.yaml").read_text(encoding="utf-8"))
        del world["map"]
        path = self._folder / "disaster_zone.yaml"
        path.write_text(yaml.safe_dump(world), encoding="utf-8")
        return path

    def _map(self, name):
        return (
            ["-p", f"yaml_filename:={ROOT / 'maps' / 'disaster_zone.yaml'}"] if name == "map_server" else []
        )

    def run(self, name):
        """Start one of its processes, or restart a killed one."""
        if name in SERVERS:
            self._start(
                name, SERVERS[name], name, "--params-file", self.parameters or NAV2_PARAMS, *self._map(name)
            )
        else:
            listed = f"node_names:=[{', '.join(_MANAGERS[name])}]"
            self._start(name, *MANAGER, "-r", f"__node:={name}", "-p", "autostart:=true", "-p", listed)

    def _start(self, name, package, program, *arguments):
        log = (self._folder / f"{name}.log").open("a")
        words = [
            executable(self._prefix, package, program),
            "--ros-args",
            "-p",
            "use_sim_time:=true",
            *arguments,
        ]
        self._processes[name] = subprocess.Popen(
            [str(word) for word in words],
            env=self._environment,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )

    def kill(self, *names):
        """Kill processes; return the machine's time of that."""
        self.is_whole = False
        self.forget_logs()
        for name in names:
            self._processes[name].kill()
            self._processes[name].wait()
        return time.time()

    def end(self, *names):
        """End processes by Ctrl-C, as a launch file does, and kill those that remain; return the machine's time of that."""
        for name in names:
            self._processes[name].send_signal(signal.SIGINT)
        self.robot.comes_within(
            _END_SEC, lambda: all(self._processes[name].poll() is not None for name in names)
        )
        return self.kill(*names)

    def log(self, name):
        """Return the log of a node."""
        return (self._folder / f"{name}.log").read_text(encoding="utf-8", errors="replace")

    def news(self, name):
        """Return the log of a node since the start, or since a process was last killed."""
        return self.log(name)[self._read.get(name, 0) :]

    def forget_logs(self):
        """Mark all present log lines as old."""
        self._read = {each: len(self.log(each)) for each in self._processes}

    def missed_rates(self):
        """Return how often the controller has missed its rate in the new log lines."""
        return len(_RATE.findall(self.news("controller_server")))

    def control_rate(self):
        """Return a text on how often the controller has missed its rate in the new log lines, and the lowest rate."""
        rates = [float(each) for each in _RATE.findall(self.news("controller_server"))]
        return (
            f"control loop late {len(rates)} times, {min(rates):.1f} Hz at worst"
            if rates
            else "control loop in time"
        )

    def be_home(self):
        """Ensure that everything runs with the robot at its start: drive it there, or restart everything."""
        runs = self.is_whole and all(each.poll() is None for each in self._processes.values())
        if runs and not self.robot.goals and self.robot.pose is None:
            return
        if not (runs and (self.robot.is_home() or self.robot.drive_home())):
            self.stop()
            self.start()

    def stop(self):
        """End everything, whatever its state."""
        self.robot.close()
        self.simulator.send(signal.SIGCONT)
        for process in self._processes.values():
            process.kill()
            process.wait()
        for command in self._commands:
            command.kill()
