"""Transforms in a row and backwards; what a node hears of them, `test_leaves_by_attributes` tests."""

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


def same(one: Transform, other: Transform) -> bool:
    """Return whether two transforms are the same; both signs of a quaternion are one turn."""
    flipped = Transform(*other[:3], *(-each for each in other[3:]))
    return any(one == pytest.approx(each, abs=1e-6) for each in (other, flipped))


@given(transforms())
def test_a_transform_and_its_inverse_lead_back(transform: Transform) -> None:
    assert same(transform.inverse.compose(transform), Transform())
    assert same(transform.compose(transform.inverse), Transform())


@given(transforms(), transforms(), transforms())
def test_transforms_in_a_row_may_be_put_together_from_either_end(
    a: Transform, b: Transform, c: Transform
) -> None:
    assert same(a.compose(b).compose(c), a.compose(b.compose(c)))


@pytest.mark.parametrize(
    ("axis", "turned"), [((1, 0, 0), (1, -3, 2)), ((0, 1, 0), (3, 2, -1)), ((0, 0, 1), (-2, 1, 3))]
)
def test_a_quarter_turn_is_by_the_right_hand(axis: tuple[int, ...], turned: tuple[int, ...]) -> None:
    half = math.sqrt(0.5)
    qx, qy, qz = (half * each for each in axis)
    quarter = Transform(10, 20, 30, qx, qy, qz, half)
    x, y, z = turned
    assert quarter.compose(Transform(1, 2, 3))[:3] == pytest.approx((10 + x, 20 + y, 30 + z))
    assert quarter.yaw == pytest.approx(math.pi / 2 if axis[2] else 0.0)
