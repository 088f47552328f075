"""ROS while a command has it up."""

import warnings
from contextlib import contextmanager

import pytest

from sar_compiler.ros.middleware import ros_up

pytestmark = pytest.mark.ros

UNHEARD = "failed to send response (timeout): client will not receive response, at service.c:400"


@contextmanager
def heard():
    """Hear every warning, whatever the tests' own settings are."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        yield said


def test_an_answer_that_a_client_does_not_hear_is_nothing_to_warn_of():
    with heard() as said, ros_up([]):
        warnings.warn(UNHEARD, RuntimeWarning, stacklevel=1)
    assert said == []


def test_other_warnings_are_shown():
    with heard() as said, ros_up([]):
        warnings.warn("failed to take a request", RuntimeWarning, stacklevel=1)
    assert [str(each.message) for each in said] == ["failed to take a request"]


def test_warnings_are_as_before_once_ros_is_down():
    with heard() as said:
        with ros_up([]):
            pass
        warnings.warn(UNHEARD, RuntimeWarning, stacklevel=1)
    assert len(said) == 1
