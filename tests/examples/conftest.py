"""The examples are tried with the same means as the missions and the nodes."""

from tests.e2e.conftest import start, witness
from tests.ros.conftest import make_ros, ros

__all__ = ["make_ros", "ros", "start", "witness"]
