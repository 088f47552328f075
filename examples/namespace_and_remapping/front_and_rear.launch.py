"""Launches two pairs of a camera and a processor. Namespaces separate the pairs, and remappings connect the nodes of a pair."""

import sys
from pathlib import Path

from launch import LaunchDescription
from launch_ros.actions import Node

CAMERAS = Path(__file__).resolve().parent.parent / "cameras"


def pair(namespace: str) -> list[Node]:
    """Return a camera and its processor in a namespace."""
    return [
        Node(
            executable=sys.executable,
            arguments=[str(CAMERAS / "camera.py")],
            namespace=namespace,
            name="camera",
            parameters=[{"scene": f"what is at the {namespace}"}],
            # Both names are relative, so ROS adds the namespace to them.
            remappings=[("image_raw", "camera/image")],
            output="screen",
            emulate_tty=True,
        ),
        Node(
            executable=sys.executable,
            arguments=[str(CAMERAS / "image_processor.py")],
            namespace=namespace,
            output="screen",
            emulate_tty=True,
        ),
    ]


def generate_launch_description() -> LaunchDescription:
    """Start a pair under /front and one under /rear."""
    return LaunchDescription([*pair("front"), *pair("rear")])
