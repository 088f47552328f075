"""Playing a tick with every combination of choices."""

import itertools

import pytest

from sar_compiler.analysis.state_search.choices import Choices
from sar_compiler.errors import UnsteadyError


def played(tick):
    """Return the result of a tick, for every combination."""
    choices = Choices()
    choices.begin()
    found = []
    while True:
        found.append(tick(choices))
        if choices.advance() < 0:
            return found


def test_every_combination_is_played_once():
    found = played(lambda choices: tuple(choices.pick(count) for count in (2, 3, 2)))
    assert found == list(itertools.product(range(2), range(3), range(2)))


def test_a_tick_without_a_choice_is_played_once():
    assert played(lambda choices: choices.pick(1)) == [0]


def test_a_choice_that_only_comes_after_another_one_is_made_only_then():
    found = played(lambda choices: (1, choices.pick(2)) if choices.pick(2) else (0,))
    assert found == [(0,), (1, 0), (1, 1)]


def test_one_combination_can_be_played_again():
    choices = Choices()
    choices.begin()
    choices.pick(3)
    choices.advance()
    assert (choices.pick(3), choices.pick(2), choices.path) == (1, 0, (1, 0))


def test_a_tick_that_does_not_ask_the_same_again_is_refused():
    choices = Choices()
    choices.begin()
    choices.pick(2)
    choices.advance()
    with pytest.raises(UnsteadyError, match="behaves differently in equal states"):
        choices.pick(3)
