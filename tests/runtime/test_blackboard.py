"""Entries, and which one a key means."""

import gc

import pytest
from py_trees.blackboard import Blackboard

from sar_compiler.runtime.blackboard import Board, MissingEntryError, Scope


@pytest.fixture
def board():
    return Board("Main")


@pytest.fixture
def main(board):
    return Scope(board)


def inner(around, name="a", remapping=None, **more):
    path = f"{around.path}/{name}" if around.path else name
    return Scope(around.board, path, around, remapping, **more)


def test_an_entry_is_there_once_it_is_written(main):
    entry = main.resolve("x")
    assert not entry.exists
    entry.write(None)
    assert entry.exists
    assert entry.read() is None


def test_what_was_never_written_cannot_be_read_and_the_error_names_the_key(main):
    with pytest.raises(MissingEntryError, match=r"^the key '@speed' has no value yet$") as caught:
        main.resolve("@speed").read()
    assert caught.value.key == "@speed"


def test_every_write_counts_even_of_the_same_value(main):
    entry = main.resolve("x")
    assert entry.stamp == 0
    entry.write(1)
    entry.write(1)
    assert entry.stamp == 2


def test_an_entry_that_is_removed_was_never_written(main):
    entry = main.resolve("x")
    entry.write(1)
    entry.remove()
    entry.remove()
    assert (entry.exists, entry.stamp) == (False, 0)


def test_entries_lie_on_the_blackboard_of_py_trees(main):
    main.resolve("x").write(1)
    assert Blackboard.storage[f"{main.board.prefix}/x"] == 1


def test_two_boards_of_one_name_share_nothing():
    first, second = Scope(Board("Main")), Scope(Board("Main"))
    first.resolve("x").write(1)
    assert not second.resolve("x").exists


def test_a_board_forgets_its_entries_when_nobody_has_it_any_more():
    scope = Scope(Board("Gone"))
    entry = scope.resolve("x")
    entry.write(1)
    name = entry.name
    assert name in Blackboard.storage
    del scope, entry
    gc.collect()
    assert name not in Blackboard.storage


@pytest.mark.parametrize(
    ("remapping", "more", "key", "depth", "name"),
    [
        ({}, {}, "x", 1, "x"),
        ({"x": "y"}, {}, "x", 0, "y"),
        ({"x": "y"}, {}, "y", 1, "y"),
        ({}, {"autoremap": True}, "x", 0, "x"),
        ({}, {"autoremap": True}, "_x", 1, "_x"),
        ({"_x": "y"}, {"autoremap": True}, "_x", 0, "y"),
        ({}, {"autoremap": True, "own": frozenset("x")}, "x", 1, "x"),
        ({}, {}, "@x", 0, "x"),
        ({"x": "@y"}, {}, "x", 0, "y"),
    ],
)
def test_a_key_of_a_subtree_belongs_to_it_or_to_the_tree_around(main, remapping, more, key, depth, name):
    scope = inner(main, remapping=remapping, **more)
    assert scope.owner(key) == ((main, scope)[depth], name)


def test_a_root_key_that_is_passed_on_goes_past_every_tree_between(main):
    innermost = inner(inner(main), "b", {"x": "@y"})
    assert innermost.owner("x") == (main, "y")
    assert innermost.root is main


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (lambda main: main.resolve("a/x"), lambda main: inner(main).resolve("x")),
        (lambda main: inner(main).resolve("b/x"), lambda main: inner(inner(main), "b").resolve("x")),
    ],
)
def test_a_stroke_in_a_key_leads_into_no_subtree(main, one, other):
    assert one(main).name != other(main).name
