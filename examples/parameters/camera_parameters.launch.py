"""Launches a camera with a parameter file. Launch arguments override values of the file."""

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
                # With name and namespace, the dictionary below applies to this node only. Otherwise it would apply to all nodes (/**),
                # and a section of the file for this node would take precedence.
                namespace="front",
                name="camera_node",
                parameters=[
                    LaunchConfiguration("params_file"),
                    # Without the type, rate_hz:=5 would be an integer.
                    {"rate_hz": ParameterValue(LaunchConfiguration("rate_hz"), value_type=float)},
                ],
                output="screen",
                emulate_tty=True,
            ),
        ]
    )
