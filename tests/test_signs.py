"""Tests of colours and signs."""

import pytest

from sar_compiler.journal.display import Level
from sar_compiler.style import LEVELS, colour_of, literal, rgb, sign_of, style


def test_each_level_has_a_style():
    assert len(LEVELS) == len(Level)


@pytest.mark.parametrize(
    ("level", "is_found", "colour", "sign"),
    [
        (Level.TO_COME, False, "quiet", ""),
        (Level.IN_HAND, False, "running", "▶"),
        (Level.DONE, False, "success", "✓"),
        (Level.GIVEN_UP, False, "failure", "✗"),
        (Level.TO_COME, True, "warning", "!"),
        (Level.IN_HAND, True, "warning", "!"),
        (Level.DONE, True, "warning", "✓"),
        (Level.GIVEN_UP, True, "quiet", "✗"),
    ],
)
def test_colour_and_sign_depend_on_level_and_detection(level, is_found, colour, sign):
    assert (colour_of(level, is_found=is_found), sign_of(level, is_found=is_found)) == (colour, sign)


def test_rgb_returns_components_from_0_to_1():
    assert rgb("stop") == pytest.approx((168 / 255, 50 / 255, 0.0))
    assert rgb("ground", dark=True) == pytest.approx((20 / 255, 23 / 255, 27 / 255))


def test_only_dark_screens_have_dark_colours():
    light, dark = style().split("@media screen and (prefers-color-scheme:dark)")
    assert "--ground:#ffffff" in light
    assert "--ground:#14171b" in dark


def test_literal_replaces_colour_names_in_pictures():
    light, _, dark = literal("a{fill:var(--text)}\nb{stroke:0}\n").partition("@media")
    assert light == "a{fill:#16191d}\nb{stroke:0}\n"
    assert "a{fill:#e8eaed}" in dark
    assert "b{" not in dark
