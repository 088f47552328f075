"""The garbage collector while something large grows."""

import gc
import weakref

import pytest

from sar_compiler.gc_pause import LARGE, gc_paused
from sar_compiler.tree.diagnostic import TreeError


class Node:
    """Something that can be part of a cycle."""

    def __init__(self):
        self.other = None


@pytest.fixture(autouse=True)
def _as_it_was():
    yield
    gc.unfreeze()
    gc.enable()


def is_old(thing):
    return any(each is thing for each in gc.get_objects(generation=2))


def test_the_collector_pauses_while_something_grows():
    with gc_paused():
        assert not gc.isenabled()
    assert gc.isenabled()


def test_the_collector_goes_on_after_an_error():
    with pytest.raises(TreeError), gc_paused(LARGE):
        raise TreeError([])
    assert gc.isenabled()


def test_a_collector_that_was_off_stays_off():
    gc.disable()
    with gc_paused(LARGE):
        grown = Node()
    assert not gc.isenabled()
    assert not is_old(grown)


def test_what_grows_from_a_large_text_counts_as_old_at_once():
    with gc_paused(LARGE):
        grown = Node()
    assert is_old(grown)


def test_what_grows_from_a_small_text_grows_old_as_anything_does():
    gc.collect()
    with gc_paused(LARGE - 1):
        grown = Node()
    assert not is_old(grown)


def test_garbage_from_before_does_not_grow_old():
    gc.collect()
    first, second = Node(), Node()
    first.other, second.other = second, first
    seen = weakref.ref(first)
    del first, second
    with gc_paused(LARGE):
        assert seen() is None


def test_what_somebody_else_has_frozen_stays_so():
    gc.freeze()
    frozen = gc.get_freeze_count()
    with gc_paused(LARGE):
        grown = Node()
    assert 0 < gc.get_freeze_count() <= frozen
    assert not is_old(grown)
