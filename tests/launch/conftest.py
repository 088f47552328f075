"""A ROS context for each test that needs one."""

from collections.abc import Iterator

import pytest

from tests.ros.conftest import Ros


@pytest.fixture
def ros() -> Iterator[Ros]:
    stage = Ros()
    yield stage
    stage.close()
