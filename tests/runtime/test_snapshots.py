"""Taking a blackboard's state, and going back to it."""

from collections import deque

import pytest

from sar_compiler.runtime.blackboard import Board, Scope
from sar_compiler.runtime.frozen import FrozenValueError


@pytest.fixture
def board():
    return Board("snapshots")


@pytest.fixture
def scope(board):
    return Scope(board)


def test_entries_come_back_with_their_values_and_types(board, scope):
    scope.resolve("a").declare(int)
    scope.resolve("a").write(1)
    scope.resolve("b").declare(str)
    before = board.snapshot()
    scope.resolve("a").write("changed")
    scope.resolve("b").write("written")
    scope.resolve("c").write("new")
    board.restore(before)
    assert scope.resolve("a").read() == 1
    assert (scope.resolve("a").kind, scope.resolve("b").kind) == (int, str)
    assert not scope.resolve("b").exists
    assert not scope.resolve("c").exists
    assert not scope.resolve("c").declared
    assert [name.removeprefix(board.prefix) for name in board.names()] == ["/a"]


def test_a_removed_entry_comes_back(board, scope):
    scope.resolve("a").write(1)
    before = board.snapshot()
    scope.resolve("a").remove()
    board.restore(before)
    assert scope.resolve("a").read() == 1


def test_equal_boards_have_equal_snapshots_however_they_came_to_it(board, scope):
    scope.resolve("a").write(1)
    scope.resolve("b").write(2)
    before = board.snapshot()
    scope.resolve("a").remove()
    scope.resolve("a").write(0)
    scope.resolve("a").write(1)
    again = board.snapshot()
    assert (before, hash(before)) == (again, hash(again))


@pytest.mark.parametrize(("one", "other"), [(1, 1.0), (1, True), ("1", 1)])
def test_values_of_different_types_make_different_states(board, scope, one, other):
    scope.resolve("a").write(one)
    before = board.snapshot()
    scope.resolve("a").write(other)
    assert board.snapshot() != before


def test_a_type_makes_a_different_state(board, scope):
    before = board.snapshot()
    scope.resolve("a").declare()
    assert board.snapshot() != before


def test_nothing_is_done_again_as_long_as_nothing_is_written(board, scope):
    scope.resolve("a").write(1)
    taken = board.snapshot()
    assert board.snapshot() is taken
    board.restore(taken)
    assert board.snapshot() is taken


def test_a_list_that_is_changed_in_place_is_a_different_state(board, scope):
    scope.resolve("a").write(deque([1, 2]))
    before = board.snapshot()
    scope.resolve("a").read().popleft()
    assert board.snapshot() != before
    board.restore(before)
    assert scope.resolve("a").read() == deque([1, 2])


def test_how_often_an_entry_was_written_counts_only_if_it_is_watched(board, scope):
    entry = scope.resolve("a")
    entry.write(1)
    before = board.snapshot()
    entry.write(1)
    assert board.snapshot() == before
    board.watch(entry.name)
    watched = board.snapshot()
    entry.write(1)
    assert board.snapshot() != watched
    board.restore(watched)
    assert entry.stamp == 2


def test_a_value_that_cannot_be_kept_is_refused_with_the_name_of_its_entry(board, scope):
    scope.resolve("image").write(bytearray(b"x"))
    with pytest.raises(FrozenValueError, match="the entry 'image' holds a value of type bytearray"):
        board.snapshot()


def test_boards_do_not_touch_each_others_entries(board, scope):
    other = Scope(Board("snapshots"))
    other.resolve("a").write("theirs")
    empty = board.snapshot()
    scope.resolve("a").write("ours")
    board.restore(empty)
    assert other.resolve("a").read() == "theirs"
