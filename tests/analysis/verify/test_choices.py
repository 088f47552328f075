"""Tests of playing a tick with every combination of choices."""

import itertools

import pytest

from sar_compiler.analysis.state_search.choices import Choices
from sar_compiler.errors import UnsteadyError


def play_all(tick):
    """Return the result of a tick, for every combination."""
    choices = Choices()
    choices.begin()
    found = []
    while True:
        found.append(tick(choices))
        if choices.advance() < 0:
            return found


def test_every_combination_is_played_once():
    found = play_all(lambda choices: tuple(choices.pick(count) for count in (2, 3, 2)))
    assert found == list(itertools.product(range(2), range(3), range(2)))


def test_tick_without_choice_is_played_once():
    assert play_all(lambda choices: choices.pick(1)) == [0]


def test_dependent_choice_is_made_only_after_its_condition():
    found = play_all(lambda choices: (1, choices.pick(2)) if choices.pick(2) else (0,))
    assert found == [(0,), (1, 0), (1, 1)]


def test_combination_can_be_played_again():
    choices = Choices()
    choices.begin()
    choices.pick(3)
    choices.advance()
    assert (choices.pick(3), choices.pick(2), choices.path) == (1, 0, (1, 0))


def test_tick_with_different_choices_when_repeated_is_rejected():
    choices = Choices()
    choices.begin()
    choices.pick(2)
    choices.advance()
    with pytest.raises(UnsteadyError, match="behaves differently in equal states"):
        choices.pick(3)
