"""Drive to a goal, with every value of params.yaml as an argument; the launch ends at the goal."""

import sys
from pathlib import Path

import yaml
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition, UnlessCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

HERE = Path(__file__).resolve().parent
DEFAULTS = yaml.safe_load((HERE / "params.yaml").read_text(encoding="utf-8"))["/**"]["ros__parameters"]

VALUES = {
    "goal_x": "the goal, metres, in the frame of the odometry",
    "goal_y": "the goal, metres, in the frame of the odometry",
    "tolerance": "how near is near enough: metres for the goal, radians for the recovery's heading",
    "k_rho": "speed per metre of distance, 1/s",
    "k_alpha": "turning per radian of bearing, 1/s",
    "timeout_duration": "how long driving may take before the recovery has its turn, seconds",
    "goal_yaw": "the heading that the recovery turns to, radians",
    "k_yaw": "turning per radian of the recovery, 1/s",
    "tick_rate_hz": "how often the tree is ticked, 1/s",
}

TREE, LEAVES = str(HERE / "drive_to_goal.xml"), "examples.drive_to_goal.leaves"
SAR_RUN = ["-m", "sar_compiler.cli.run", TREE, "--nodes", LEAVES, "--until", "failure", "--view", "text"]
# The folder above examples/, from which the leaves are imported.
ROOT = str(HERE.parent.parent)


def generate_launch_description() -> LaunchDescription:
    """Drive a robot, or with sim:=true one in the simulated empty world."""
    sim, use_sim_time = LaunchConfiguration("sim"), LaunchConfiguration("use_sim_time")
    # The type is said, so that goal_x:=5 is not taken for a whole number.
    values = {name: ParameterValue(LaunchConfiguration(name), value_type=float) for name in VALUES}
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=str(DEFAULTS[name]), description=description)
                for name, description in VALUES.items()
            ),
            DeclareLaunchArgument("sim", default_value="false", description="simulate a robot"),
            DeclareLaunchArgument(
                "use_sim_time",
                default_value="false",
                description="whether a simulator of yours gives the time",
            ),
            Node(
                executable=sys.executable,
                arguments=[*SAR_RUN, "--sim", "empty"],
                condition=IfCondition(sim),
                parameters=[values],
                cwd=ROOT,
                output="screen",
                emulate_tty=True,
            ),
            Node(
                executable=sys.executable,
                arguments=SAR_RUN,
                condition=UnlessCondition(sim),
                parameters=[values, {"use_sim_time": ParameterValue(use_sim_time, value_type=bool)}],
                cwd=ROOT,
                output="screen",
                emulate_tty=True,
            ),
        ]
    )
