"""Launches a camera and a processor, and remaps their different topic names to a third name."""

import sys
from pathlib import Path

from launch import LaunchDescription
from launch_ros.actions import Node

CAMERAS = Path(__file__).resolve().parent.parent / "cameras"


def generate_launch_description() -> LaunchDescription:
    """Start both on /sensors/front/image."""
    return LaunchDescription(
        [
            Node(
                executable=sys.executable,
                arguments=[str(CAMERAS / "camera.py")],
                remappings=[("image_raw", "/sensors/front/image")],
                output="screen",
                emulate_tty=True,
            ),
            Node(
                executable=sys.executable,
                arguments=[str(CAMERAS / "image_processor.py")],
                remappings=[("camera/image", "/sensors/front/image")],
                output="screen",
                emulate_tty=True,
            ),
        ]
    )
