"""Tests of warnings while a command has ROS up."""

import warnings
from contextlib import contextmanager

import pytest

from sar_compiler.ros.middleware import ros_up

pytestmark = pytest.mark.ros

UNDELIVERED_RESPONSE = "failed to send response (timeout): client will not receive response, at service.c:400"


@contextmanager
def record_warnings():
    """Record every warning, regardless of the warning filters of the tests."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        yield said


def test_warning_of_undelivered_response_is_suppressed():
    with record_warnings() as said, ros_up([]):
        warnings.warn(UNDELIVERED_RESPONSE, RuntimeWarning, stacklevel=1)
    assert said == []


def test_other_warnings_are_shown():
    with record_warnings() as said, ros_up([]):
        warnings.warn("failed to take a request", RuntimeWarning, stacklevel=1)
    assert [str(each.message) for each in said] == ["failed to take a request"]


def test_warning_filters_are_restored_after_ros_is_down():
    with record_warnings() as said:
        with ros_up([]):
            pass
        warnings.warn(UNDELIVERED_RESPONSE, RuntimeWarning, stacklevel=1)
    assert len(said) == 1
