"""Tests of composed and inverse transforms; `test_leaves_by_attributes` tests how a node receives them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.ros.frames import Transform

SMALL = st.floats(-100, 100)


@st.composite
def transforms(draw: st.DrawFn) -> Transform:
    turn = [draw(st.floats(-1, 1)) for _ in range(4)]
    length = math.hypot(*turn)
    parts = [0.0, 0.0, 0.0, 1.0] if length < 0.1 else [each / length for each in turn]
    return Transform(draw(SMALL), draw(SMALL), draw(SMALL), *parts)


def is_equivalent(one: Transform, other: Transform) -> bool:
    """Return whether two transforms are equal; both signs of a quaternion are one rotation."""
    flipped = Transform(*other[:3], *(-each for each in other[3:]))
    return any(one == pytest.approx(each, abs=1e-6) for each in (other, flipped))


@given(transforms())
def test_transform_composed_with_inverse_is_identity(transform: Transform) -> None:
    assert is_equivalent(transform.inverse.compose(transform), Transform())
    assert is_equivalent(transform.compose(transform.inverse), Transform())


@given(transforms(), transforms(), transforms())
def test_composition_is_associative(a: Transform, b: Transform, c: Transform) -> None:
    assert is_equivalent(a.compose(b).compose(c), a.compose(b.compose(c)))


@pytest.mark.parametrize(
    ("axis", "turned"), [((1, 0, 0), (1, -3, 2)), ((0, 1, 0), (3, 2, -1)), ((0, 0, 1), (-2, 1, 3))]
)
def test_quarter_turn_follows_right_hand_rule(axis: tuple[int, ...], turned: tuple[int, ...]) -> None:
    half = math.sqrt(0.5)
    qx, qy, qz = (half * each for each in axis)
    quarter = Transform(10, 20, 30, qx, qy, qz, half)
    x, y, z = turned
    assert quarter.compose(Transform(1, 2, 3))[:3] == pytest.approx((10 + x, 20 + y, 30 + z))
    assert quarter.yaw == pytest.approx(math.pi / 2 if axis[2] else 0.0)
