"""Two missions in one simulated world, each in its robot's namespace; ends when both missions have ended."""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.action import Action
from launch.actions import DeclareLaunchArgument, RegisterEventHandler, SetEnvironmentVariable, Shutdown
from launch.event_handlers import OnProcessExit
from launch.events.process import ProcessExited
from launch.substitutions import EnvironmentVariable, LaunchConfiguration
from launch_ros.actions import Node

HERE = Path(__file__).resolve().parent
RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
ROBOTS = {"robot1": "0,0.7,1.57", "robot2": "0,-0.7,-1.57"}
"""Where each robot starts: x, y (m), yaw (rad), frame `map`; the same as `initial_pose` in its file."""

# Launch passes on line by line what processes say, so nothing can be overwritten.
PASSED_ON = {"TERM": "dumb"}


def generate_launch_description() -> LaunchDescription:
    """Return the simulator, and for each robot the two servers and the mission."""
    missions = {robot: mission(robot) for robot in ROBOTS}
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "speed", default_value="5", description="simulated seconds per second, at most"
            ),
            # A simulation is of no interest to other machines.
            SetEnvironmentVariable(RANGE, EnvironmentVariable(RANGE, default_value="LOCALHOST")),
            simulator(),
            *(server(robot, kind) for robot in ROBOTS for kind in ("detect", "report")),
            *missions.values(),
            *ends_after(list(missions.values())),
        ]
    )


def simulator() -> Node:
    """Return the simulator of one world with both robots, which puts each into its namespace."""
    placed = [part for robot, start in ROBOTS.items() for part in ("--robot", f"{robot}:{start}")]
    return Node(
        package="sar_compiler",
        executable="sar-sim",
        arguments=["run", "--speed", LaunchConfiguration("speed"), *placed],
        output="screen",
        emulate_tty=True,
        additional_env=PASSED_ON,
        on_exit=Shutdown(reason="the simulator has ended"),
    )


def server(robot: str, kind: str) -> Node:
    """Return one of a robot's servers: `detect` or `report`."""
    return Node(
        package="sar_compiler",
        executable=f"sar-{kind}-survivor-server",
        namespace=robot,
        parameters=[{"use_sim_time": True}],
        remappings=[("/tf", "tf"), ("/tf_static", "tf_static")],
        output="screen",
        emulate_tty=True,
    )


def mission(robot: str) -> Node:
    """Return a robot's mission, with the parameters of its own file."""
    return Node(
        package="sar_compiler",
        executable="sar-run",
        arguments=["--until", "complete"],
        namespace=robot,
        parameters=[str(HERE / f"{robot}.yaml"), {"use_sim_time": True}],
        remappings=[("/tf", "tf"), ("/tf_static", "tf_static")],
        output="screen",
        emulate_tty=True,
        additional_env=PASSED_ON,
    )


def ends_after(missions: list[Node]) -> list[RegisterEventHandler]:
    """Return the actions that shut everything down once the last of *missions* has ended."""
    left = set(missions)

    def ended(event: ProcessExited, _: LaunchContext) -> Action | None:
        left.discard(event.action)
        return None if left else Shutdown(reason="both missions have ended")

    return [RegisterEventHandler(OnProcessExit(target_action=each, on_exit=ended)) for each in missions]
