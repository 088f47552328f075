"""Messages of `ros2 doctor`, by their published interface."""

import sys


def doctor_error(msg: str) -> None:
    sys.stderr.write(f"ERROR: {msg}\n")


def doctor_warn(msg: str) -> None:
    sys.stderr.write(f"WARNING: {msg}\n")
