"""Launches the same camera twice, with different node names."""

import sys
from pathlib import Path

from launch import LaunchDescription
from launch_ros.actions import Node

CAMERA = Path(__file__).resolve().parent.parent / "cameras" / "camera.py"


def generate_launch_description() -> LaunchDescription:
    """Start the nodes front_camera and rear_camera."""
    return LaunchDescription(
        [
            Node(
                executable=sys.executable,
                arguments=[str(CAMERA)],
                name=name,
                output="screen",
                emulate_tty=True,
            )
            for name in ("front_camera", "rear_camera")
        ]
    )
