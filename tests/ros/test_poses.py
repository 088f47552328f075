"""Tests of rotations about z as quaternions."""

import math
from types import SimpleNamespace

import pytest

from sar_compiler.ros.poses import turn_by, yaw_of


def quaternion(x=0.0, y=0.0, z=0.0, w=1.0):
    return SimpleNamespace(x=x, y=y, z=z, w=w)


@pytest.mark.parametrize("yaw", [0.0, 1.0, -3.1, 3.1])
def test_yaw_is_read_as_written(yaw):
    turn = quaternion()
    turn_by(turn, yaw)
    assert yaw_of(turn) == pytest.approx(yaw)


def test_opposite_quaternions_have_same_yaw():
    assert yaw_of(quaternion(z=-math.sin(0.5), w=-math.cos(0.5))) == pytest.approx(1.0)


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("axis", ["x", "y", "z", "w"])
def test_non_finite_quaternion_has_no_yaw(axis, number):
    assert math.isnan(yaw_of(quaternion(**{axis: number})))


@pytest.mark.parametrize("axis", ["x", "y", "z", "w"])
def test_huge_component_gives_finite_yaw(axis):
    assert math.isfinite(yaw_of(quaternion(**{axis: 1e300})))


def test_rounded_quaternion_has_intended_yaw():
    assert yaw_of(quaternion(z=0.7, w=0.7)) == pytest.approx(math.pi / 2)
