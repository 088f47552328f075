"""Tests of a blackboard whose contents are numbered, so that states can be stored, compared and restored."""

from collections import deque

import pytest

from sar_compiler.analysis.numbered_board import NumberedBoard
from sar_compiler.runtime.blackboard import Board, Scope
from sar_compiler.runtime.frozen import FrozenValueError
from sar_compiler.runtime.kernel.entry_cells import EntryCells


@pytest.fixture
def cells():
    return EntryCells()


@pytest.fixture
def board(cells):
    board = Board("numbers")
    NumberedBoard.from_board(board, cells)
    return board


@pytest.fixture
def scope(board):
    return Scope(board)


def contents_of(cells):
    """Return the numbers of the contents of all entries."""
    cells.update_contents()
    return [number for number in cells.now if number]


def test_existing_entries_are_kept(cells):
    board = Board("numbers")
    scope = Scope(board)
    scope.resolve("a").write([1, 2])
    scope.resolve("b").declare(int)
    NumberedBoard.from_board(board, cells)
    assert (scope.resolve("a").read(), scope.resolve("b").kind) == ([1, 2], int)
    assert [name.removeprefix(board.prefix) for name in board.names()] == ["/a"]


def test_entries_are_restored_with_values_and_types(board, cells, scope):
    scope.resolve("a").declare(int)
    scope.resolve("a").write(1)
    scope.resolve("b").declare(str)
    before = cells.now[:]
    scope.resolve("a").write("changed")
    scope.resolve("b").write("written")
    scope.resolve("c").write("new")
    cells.restore(before)
    assert scope.resolve("a").read() == 1
    assert (scope.resolve("a").kind, scope.resolve("b").kind) == (int, str)
    assert not scope.resolve("b").exists
    assert not scope.resolve("c").exists
    assert not scope.resolve("c").is_declared
    assert [name.removeprefix(board.prefix) for name in board.names()] == ["/a"]


def test_removed_entry_is_restored(cells, scope):
    scope.resolve("a").write(1)
    before = cells.now[:]
    scope.resolve("a").remove()
    with pytest.raises(KeyError):
        scope.resolve("a").read()
    cells.restore(before)
    assert scope.resolve("a").read() == 1


def test_equal_contents_have_equal_numbers(cells, scope):
    scope.resolve("a").write(1)
    scope.resolve("b").write(2)
    before = contents_of(cells)
    scope.resolve("a").remove()
    scope.resolve("a").write(0)
    scope.resolve("a").write(1)
    assert contents_of(cells) == before


@pytest.mark.parametrize(("one", "other"), [(1, 1.0), (1, True), ("1", 1)])
def test_values_of_different_types_are_different_contents(cells, scope, one, other):
    scope.resolve("a").write(one)
    before = contents_of(cells)
    scope.resolve("a").write(other)
    assert contents_of(cells) != before
    assert scope.resolve("a").read() is other


def test_declared_type_is_part_of_contents(cells, scope):
    before = contents_of(cells)
    scope.resolve("a").declare()
    assert contents_of(cells) != before


def test_first_specific_type_is_kept(scope):
    entry = scope.resolve("a")
    entry.declare()
    entry.board.set_kind(entry.name, int)
    entry.board.set_kind(entry.name, str)
    entry.declare(float)
    assert entry.kind is int


def test_list_changed_in_place_is_different_content(cells, scope):
    scope.resolve("a").write(deque([1, 2]))
    before, now = contents_of(cells), cells.now[:]
    scope.resolve("a").read().popleft()
    assert scope.resolve("a").read() == deque([2])
    assert contents_of(cells) != before
    cells.restore(now)
    assert scope.resolve("a").read() == deque([1, 2])


def test_list_that_is_only_read_is_same_content(cells, scope):
    scope.resolve("a").write([1, 2])
    before = contents_of(cells)
    assert scope.resolve("a").read() == [1, 2]
    assert contents_of(cells) == before


def test_write_count_matters_only_if_entry_is_watched(board, cells, scope):
    entry = scope.resolve("a")
    entry.write(1)
    before = contents_of(cells)
    entry.write(1)
    assert contents_of(cells) == before
    board.watch_entry(entry.name)
    entry.write(1)
    assert (entry.stamp, contents_of(cells) == before) == (2, False)
    board.restamp(entry.name, 1)
    assert contents_of(cells) == before


def test_unfreezable_value_is_rejected_with_entry_name(scope):
    with pytest.raises(FrozenValueError, match="the entry 'image' holds a value of type bytearray"):
        scope.resolve("image").write(bytearray(b"x"))


def test_boards_with_shared_cells_have_separate_entries(board, cells, scope):
    other = Board("numbers")
    Scope(other).resolve("a").write("theirs")
    NumberedBoard.from_board(other, cells)
    scope.resolve("a").write("ours")
    assert (scope.resolve("a").read(), Scope(other).resolve("a").read()) == ("ours", "theirs")
    assert len(list(board.names())) == len(list(other.names())) == 1


class Counting:
    """Adds up two entries, and counts its calls."""

    def __init__(self, scope):
        self._entries = [scope.resolve(name) for name in ("a", "b", "sum")]
        self.calls = 0

    def memo(self, board):
        return board.memo(self._entries)

    def run(self):
        self.calls += 1
        one, other, total = self._entries
        total.write(one.read() + other.read())
        return self.calls


def test_memoized_code_runs_once_and_repeats_its_changes(board, cells, scope):
    scope.resolve("a").write(1)
    scope.resolve("b").write(2)
    before = cells.now[:]
    code = Counting(scope)
    memo = code.memo(board)
    assert memo.call(code.run) == 1
    cells.restore(before)
    assert (memo.call(code.run), scope.resolve("sum").read(), code.calls) == (1, 3, 1)
    scope.resolve("a").write(5)
    assert (memo.call(code.run), scope.resolve("sum").read()) == (2, 7)


def test_exception_is_not_memoized(board, cells, scope):
    code = Counting(scope)
    memo = code.memo(board)
    for _ in range(2):
        with pytest.raises(KeyError):
            memo.call(code.run)
    assert code.calls == 2


def test_code_with_one_entry_runs_once_for_each_of_many_values(board, cells, scope):
    entry, ran = scope.resolve("a"), []

    def count_on():
        ran.append(entry.read())
        entry.write(-ran[-1])
        return len(ran)

    memo = board.memo([entry])
    for _ in range(2):
        for number in range(1, 1500):
            entry.write(number)
            assert (memo.call(count_on), entry.read()) == (number, -number)
    assert ran == list(range(1, 1500))
