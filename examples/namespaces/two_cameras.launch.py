"""Launches the same camera twice, each in a separate namespace."""

import sys
from pathlib import Path

from launch import LaunchDescription
from launch_ros.actions import Node

CAMERA = Path(__file__).resolve().parent.parent / "cameras" / "camera.py"


def generate_launch_description() -> LaunchDescription:
    """Start a camera under /front and one under /rear."""
    return LaunchDescription(
        [
            Node(
                executable=sys.executable,
                arguments=[str(CAMERA)],
                namespace=namespace,
                output="screen",
                emulate_tty=True,
            )
            for namespace in ("front", "rear")
        ]
    )
