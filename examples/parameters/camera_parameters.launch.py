"""A camera with a parameter file, and with arguments of the launch that override it."""

import sys
from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

HERE = Path(__file__).resolve().parent
CAMERA = HERE.parent / "cameras" / "camera.py"


def generate_launch_description() -> LaunchDescription:
    """Start the camera under /front."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "params_file",
                default_value=str(HERE / "camera_params.yaml"),
                description="a ROS 2 parameter file",
            ),
            DeclareLaunchArgument("rate_hz", default_value="4.0", description="pictures per second"),
            Node(
                executable=sys.executable,
                arguments=[str(CAMERA)],
                # With both, the dictionary below is written for this very node. Without, it would be written
                # for all (/**), and a section of the file with the node's name would win over it.
                namespace="front",
                name="camera_node",
                parameters=[
                    LaunchConfiguration("params_file"),
                    # The type is said, so that rate_hz:=5 is not taken for a whole number.
                    {"rate_hz": ParameterValue(LaunchConfiguration("rate_hz"), value_type=float)},
                ],
                output="screen",
                emulate_tty=True,
            ),
        ]
    )
