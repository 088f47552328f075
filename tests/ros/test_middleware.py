"""ROS while a command has it up."""

import warnings

import pytest

from sar_compiler.ros.middleware import ros_up

pytestmark = pytest.mark.ros

UNHEARD = "failed to send response (timeout): client will not receive response, at service.c:400"


def test_an_answer_that_a_client_does_not_hear_is_nothing_to_warn_of():
    with warnings.catch_warnings(record=True) as said, ros_up([]):
        warnings.warn(UNHEARD, RuntimeWarning, stacklevel=1)
    assert said == []


def test_other_warnings_are_shown():
    with warnings.catch_warnings(record=True) as said, ros_up([]):
        warnings.warn("failed to take a request", RuntimeWarning, stacklevel=1)
    assert [str(each.message) for each in said] == ["failed to take a request"]


def test_warnings_are_as_before_once_ros_is_down():
    with warnings.catch_warnings(record=True) as said:
        with ros_up([]):
            pass
        warnings.warn(UNHEARD, RuntimeWarning, stacklevel=1)
    assert len(said) == 1
