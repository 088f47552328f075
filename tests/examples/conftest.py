"""Fixtures for tests of the examples, shared with the tests of missions and nodes."""

from tests.e2e.conftest import start, witness
from tests.ros.conftest import make_ros, ros

__all__ = ["make_ros", "ros", "start", "witness"]
