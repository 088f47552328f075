"""Launches the drive to a goal. Each value of params.yaml is an argument. The launch ends at the goal."""

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
    "goal_x": "x of the goal in the frame of the odometry, metres",
    "goal_y": "y of the goal in the frame of the odometry, metres",
    "tolerance": "tolerance: metres for the goal, radians for the heading of the recovery",
    "k_rho": "gain of the speed: m/s per metre of distance",
    "k_alpha": "gain of the rotation: rad/s per radian of bearing",
    "timeout_duration": "time limit of the drive, after which the recovery starts, seconds",
    "goal_yaw": "target heading of the recovery, radians",
    "k_yaw": "gain of the recovery: rad/s per radian",
    "tick_rate_hz": "tick rate of the tree, hertz",
}

TREE, LEAVES = str(HERE / "drive_to_goal.xml"), "examples.drive_to_goal.leaves"
SAR_RUN = ["-m", "sar_compiler.cli.run", TREE, "--nodes", LEAVES, "--until", "failure", "--view", "text"]
# The folder above examples/, from which the leaves are imported.
ROOT = str(HERE.parent.parent)


def generate_launch_description() -> LaunchDescription:
    """Drive a robot, or a simulated one in the empty world with sim:=true."""
    sim, use_sim_time = LaunchConfiguration("sim"), LaunchConfiguration("use_sim_time")
    # Without the type, goal_x:=5 would be an integer.
    values = {name: ParameterValue(LaunchConfiguration(name), value_type=float) for name in VALUES}
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=str(DEFAULTS[name]), description=description)
                for name, description in VALUES.items()
            ),
            DeclareLaunchArgument("sim", default_value="false", description="whether to simulate the robot"),
            DeclareLaunchArgument(
                "use_sim_time",
                default_value="false",
                description="whether the nodes use the time on /clock",
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
