"""What objects of a user's classes remember is taken as one value, and put back as it was."""

import collections
import random
import threading
from collections import deque
from dataclasses import dataclass, field
from datetime import timedelta

import pytest
from py_trees.behaviours import Success

from sar_compiler.runtime.object_memory import ObjectMemory, UnkeepableError


@dataclass
class Reading:
    """A class of a user's."""

    value: float = 0.0
    others: list[int] = field(default_factory=list)


class Slotted:
    """A class without a dictionary."""

    __slots__ = ("count",)

    def __init__(self, count: int) -> None:
        self.count = count

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Slotted) and other.count == self.count

    __hash__ = None  # type: ignore[assignment]


def remembering(**attributes):
    """Return a behaviour with some attributes, and its memory."""
    behaviour = Success("Here")
    vars(behaviour).update(attributes)
    return behaviour, ObjectMemory([behaviour], [behaviour])


@pytest.mark.parametrize(
    ("value", "change"),
    [
        (1, None),
        (float("inf"), None),
        ([1, [2]], lambda held: held[1].append(3)),
        ({"a": {1}}, lambda held: held["a"].clear()),
        (deque([1, 2], maxlen=2), lambda held: held.append(3)),
        (collections.Counter("ab"), lambda held: held.update("c")),
        (collections.defaultdict(list, a=[1]), lambda held: held["b"].append(2)),
        (Reading(1.5, [1]), lambda held: held.others.append(2)),
        (Slotted(1), lambda held: setattr(held, "count", 2)),
        ((timedelta(seconds=1), Reading()), lambda held: setattr(held[1], "value", 2.0)),
    ],
)
def test_a_value_is_put_back_as_it_was(value, change):
    behaviour, memory = remembering(held=value)
    before, shown = memory.taken(), repr(value)
    assert hash(before) == hash(memory.taken())
    assert before == memory.taken()
    if change is not None:
        change(behaviour.held)
        assert memory.taken() != before
    behaviour.held, behaviour.more = None, 1
    memory.put_back(before)
    assert (type(behaviour.held), hasattr(behaviour, "more")) == (type(value), False)
    assert memory.taken() == before
    if not isinstance(value, Slotted):
        assert repr(behaviour.held) == shown


def test_what_is_put_back_is_not_what_is_changed_afterwards():
    behaviour, memory = remembering(held=[1])
    before = memory.taken()
    for _ in range(2):
        memory.put_back(before)
        assert behaviour.held == [1]
        behaviour.held.append(2)


def test_one_object_in_two_places_is_one_again():
    shared = [1]
    behaviour, memory = remembering(first=shared, second={"it": shared}, third=[1])
    before = memory.taken()
    memory.put_back(before)
    assert behaviour.first is behaviour.second["it"]
    assert behaviour.first is not behaviour.third
    behaviour.first = [1]
    assert memory.taken() != before


def test_a_generator_of_random_numbers_goes_on_from_where_it_was():
    behaviour, memory = remembering(chance=random.Random(1))  # noqa: S311 - the same in every run
    before, numbers = memory.taken(), []
    for _ in range(2):
        memory.put_back(before)
        numbers.append(behaviour.chance.random())
    assert numbers[0] == numbers[1]


def counting():
    yield 1


@pytest.mark.parametrize(("value", "kind"), [(counting(), "generator"), (threading.Lock(), "lock")])
def test_what_can_neither_be_copied_nor_compared_is_named(value, kind):
    _, memory = remembering(held=[value])
    with pytest.raises(UnkeepableError, match=f"whose attribute 'held' is a list.*{kind}"):
        memory.taken()
