"""Launches one of the four trees, and ends with it."""

import sys
from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

HERE = Path(__file__).resolve().parent
TREES = ["inverter", "timeout", "retry", "success_is_running"]
SAR_RUN = ["-m", "sar_compiler.cli.run"]
OPTIONS = ["--nodes", "examples.decorators.leaves", "--until", "success", "--view", "text"]


def generate_launch_description() -> LaunchDescription:
    """Run a tree until it succeeds."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "tree",
                default_value="retry",
                choices=TREES,
                description="the tree to run",
            ),
            Node(
                executable=sys.executable,
                arguments=[*SAR_RUN, [str(HERE), "/", LaunchConfiguration("tree"), ".xml"], *OPTIONS],
                # The folder above examples/, from which the leaves are imported.
                cwd=str(HERE.parent.parent),
                output="screen",
                emulate_tty=True,
            ),
        ]
    )
