"""Fixtures for tests of mission leaves: a stage with a node, scripted servers and the log lines of the leaves."""

from collections.abc import Callable, Iterator
from importlib import import_module
from typing import TYPE_CHECKING, Any

import pytest

from tests.ros.conftest import make_ros, ros, said

if TYPE_CHECKING:
    from tests.missions.mission_stage import Stage

__all__ = ["make_ros", "ros", "said"]


def _stage(*contexts: Any) -> "Stage":
    # Imported late: this file is also loaded on machines without ROS.
    stage: Stage = import_module("mission_stage").Stage(*contexts)
    return stage


@pytest.fixture(scope="session")
def ros_context() -> Iterator[Any]:
    """One ROS context for all tests, apart from rclpy's default one."""
    rclpy = pytest.importorskip("rclpy")
    context = rclpy.context.Context()
    rclpy.init(context=context)
    yield context
    context.try_shutdown()


@pytest.fixture
def make_stage(ros_context: Any) -> Iterator[Callable[[], "Stage"]]:
    """Return a function that makes stages, each in its own namespace."""
    stages: list[Stage] = []

    def make() -> "Stage":
        stages.append(_stage(ros_context))
        return stages[-1]

    yield make
    for stage in stages:
        stage.close()


@pytest.fixture
def stage(make_stage: Callable[[], "Stage"]) -> "Stage":
    """One stage."""
    return make_stage()


@pytest.fixture
def mortal_stage(ros_context: Any) -> Iterator["Stage"]:
    """A stage whose mission has its own ROS context, so that a test can shut it down."""
    import rclpy

    context = rclpy.context.Context()
    rclpy.init(context=context)
    stage = _stage(context, ros_context)
    yield stage
    stage.close()
