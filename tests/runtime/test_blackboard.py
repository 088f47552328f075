"""Tests of the blackboard: its entries, and the resolution of keys in scopes."""

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


def inner_scope(around, name="a", remapping=None, **more):
    path = f"{around.path}/{name}" if around.path else name
    return Scope(around.board, path, around, remapping, **more)


def test_entry_exists_once_written(main):
    entry = main.resolve("x")
    assert not entry.exists
    entry.write(None)
    assert entry.exists
    assert entry.read() is None


def test_reading_unwritten_entry_raises_error_with_key(main):
    with pytest.raises(MissingEntryError, match=r"^the key '@speed' has no value yet$") as caught:
        main.resolve("@speed").read()
    assert caught.value.key == "@speed"


def test_every_write_increments_stamp_even_of_same_value(main):
    entry = main.resolve("x")
    assert entry.stamp == 0
    entry.write(1)
    entry.write(1)
    assert entry.stamp == 2


def test_removed_entry_does_not_exist_and_has_stamp_zero(main):
    entry = main.resolve("x")
    entry.write(1)
    entry.remove()
    entry.remove()
    assert (entry.exists, entry.stamp) == (False, 0)


def test_entries_are_stored_on_py_trees_blackboard(main):
    main.resolve("x").write(1)
    assert Blackboard.storage[f"{main.board.prefix}/x"] == 1


def test_boards_with_same_name_share_no_entries():
    first, second = Scope(Board("Main")), Scope(Board("Main"))
    first.resolve("x").write(1)
    assert not second.resolve("x").exists


def test_garbage_collected_board_removes_its_entries():
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
def test_key_in_subtree_belongs_to_its_own_or_outer_scope(main, remapping, more, key, depth, name):
    scope = inner_scope(main, remapping=remapping, **more)
    assert scope.owner(key) == ((main, scope)[depth], name)


def test_remapping_to_root_key_bypasses_intermediate_scopes(main):
    innermost = inner_scope(inner_scope(main), "b", {"x": "@y"})
    assert innermost.owner("x") == (main, "y")
    assert innermost.root is main


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (lambda main: main.resolve("a/x"), lambda main: inner_scope(main).resolve("x")),
        (
            lambda main: inner_scope(main).resolve("b/x"),
            lambda main: inner_scope(inner_scope(main), "b").resolve("x"),
        ),
    ],
)
def test_slash_in_key_does_not_address_subtree(main, one, other):
    assert one(main).name != other(main).name
