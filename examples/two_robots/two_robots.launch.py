"""Launches two missions in one simulated world, each in the namespace of its robot. Ends after both missions have ended."""

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
"""The initial pose of each robot: x, y (m) and yaw (rad) in the frame `map`, the same as `initial_pose` in its file."""

# launch forwards the output line by line, so the processes must not redraw lines.
ENVIRONMENT = {"TERM": "dumb"}


def generate_launch_description() -> LaunchDescription:
    """Return the simulator, and for each robot the two servers and the mission."""
    missions = {robot: mission(robot) for robot in ROBOTS}
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "speed", default_value="5", description="maximum number of simulated seconds per second"
            ),
            # Other machines do not need the simulation.
            SetEnvironmentVariable(RANGE, EnvironmentVariable(RANGE, default_value="LOCALHOST")),
            simulator(),
            *(server(robot, kind) for robot in ROBOTS for kind in ("detect", "report")),
            *missions.values(),
            *shutdown_after(list(missions.values())),
        ]
    )


def simulator() -> Node:
    """Return the simulator of a world with both robots, each in its namespace."""
    placed = [part for robot, start in ROBOTS.items() for part in ("--robot", f"{robot}:{start}")]
    return Node(
        package="sar_compiler",
        executable="sar-sim",
        arguments=["run", "--speed", LaunchConfiguration("speed"), *placed],
        output="screen",
        emulate_tty=True,
        additional_env=ENVIRONMENT,
        on_exit=Shutdown(reason="the simulator has ended"),
    )


def server(robot: str, kind: str) -> Node:
    """Return a server of a robot. *kind* is `detect` or `report`."""
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
    """Return the mission of a robot, with its parameter file."""
    return Node(
        package="sar_compiler",
        executable="sar-run",
        arguments=["--until", "complete"],
        namespace=robot,
        parameters=[str(HERE / f"{robot}.yaml"), {"use_sim_time": True}],
        remappings=[("/tf", "tf"), ("/tf_static", "tf_static")],
        output="screen",
        emulate_tty=True,
        additional_env=ENVIRONMENT,
    )


def shutdown_after(missions: list[Node]) -> list[RegisterEventHandler]:
    """Return the actions that stop all processes after the last of *missions* has ended."""
    running = set(missions)

    def on_exit(event: ProcessExited, _: LaunchContext) -> Action | None:
        running.discard(event.action)
        return None if running else Shutdown(reason="both missions have ended")

    return [RegisterEventHandler(OnProcessExit(target_action=each, on_exit=on_exit)) for each in missions]
