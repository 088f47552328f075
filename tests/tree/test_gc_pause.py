"""Tests of pausing the garbage collector while a large structure is built."""

import gc
import weakref

import pytest

from sar_compiler.gc_pause import LARGE, gc_paused
from sar_compiler.tree.diagnostic import TreeError


class Node:
    """An object that can be part of a reference cycle."""

    def __init__(self):
        self.other = None


@pytest.fixture(autouse=True)
def _restore_collector():
    yield
    gc.unfreeze()
    gc.enable()


def is_old(thing):
    return any(each is thing for each in gc.get_objects(generation=2))


def test_collector_pauses_within_block():
    with gc_paused():
        assert not gc.isenabled()
    assert gc.isenabled()


def test_collector_resumes_after_error():
    with pytest.raises(TreeError), gc_paused(LARGE):
        raise TreeError([])
    assert gc.isenabled()


def test_disabled_collector_stays_disabled():
    gc.disable()
    with gc_paused(LARGE):
        grown = Node()
    assert not gc.isenabled()
    assert not is_old(grown)


def test_objects_built_from_large_text_are_old_at_once():
    with gc_paused(LARGE):
        grown = Node()
    assert is_old(grown)


def test_objects_built_from_small_text_stay_young():
    gc.collect()
    with gc_paused(LARGE - 1):
        grown = Node()
    assert not is_old(grown)


def test_existing_garbage_is_collected_before_pause():
    gc.collect()
    first, second = Node(), Node()
    first.other, second.other = second, first
    seen = weakref.ref(first)
    del first, second
    with gc_paused(LARGE):
        assert seen() is None


def test_objects_frozen_by_other_code_stay_frozen():
    gc.freeze()
    frozen = gc.get_freeze_count()
    with gc_paused(LARGE):
        grown = Node()
    assert 0 < gc.get_freeze_count() <= frozen
    assert not is_old(grown)
