"""A board whose contents are numbers: taken, compared, and gone back to."""

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


def taken(cells):
    """Return what all entries hold."""
    cells.update_contents()
    return [number for number in cells.now if number]


def test_what_was_on_the_board_stays_there(cells):
    board = Board("numbers")
    scope = Scope(board)
    scope.resolve("a").write([1, 2])
    scope.resolve("b").declare(int)
    NumberedBoard.from_board(board, cells)
    assert (scope.resolve("a").read(), scope.resolve("b").kind) == ([1, 2], int)
    assert [name.removeprefix(board.prefix) for name in board.names()] == ["/a"]


def test_entries_come_back_with_their_values_and_types(board, cells, scope):
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


def test_a_removed_entry_comes_back(cells, scope):
    scope.resolve("a").write(1)
    before = cells.now[:]
    scope.resolve("a").remove()
    with pytest.raises(KeyError):
        scope.resolve("a").read()
    cells.restore(before)
    assert scope.resolve("a").read() == 1


def test_equal_contents_have_equal_numbers_however_they_came_to_be(cells, scope):
    scope.resolve("a").write(1)
    scope.resolve("b").write(2)
    before = taken(cells)
    scope.resolve("a").remove()
    scope.resolve("a").write(0)
    scope.resolve("a").write(1)
    assert taken(cells) == before


@pytest.mark.parametrize(("one", "other"), [(1, 1.0), (1, True), ("1", 1)])
def test_values_of_different_types_are_different_contents(cells, scope, one, other):
    scope.resolve("a").write(one)
    before = taken(cells)
    scope.resolve("a").write(other)
    assert taken(cells) != before
    assert scope.resolve("a").read() is other


def test_a_type_is_a_content(cells, scope):
    before = taken(cells)
    scope.resolve("a").declare()
    assert taken(cells) != before


def test_the_first_type_counts_and_one_of_any_can_be_settled(scope):
    entry = scope.resolve("a")
    entry.declare()
    entry.board.set_kind(entry.name, int)
    entry.board.set_kind(entry.name, str)
    entry.declare(float)
    assert entry.kind is int


def test_a_list_that_is_changed_in_place_is_another_content(cells, scope):
    scope.resolve("a").write(deque([1, 2]))
    before, now = taken(cells), cells.now[:]
    scope.resolve("a").read().popleft()
    assert scope.resolve("a").read() == deque([2])
    assert taken(cells) != before
    cells.restore(now)
    assert scope.resolve("a").read() == deque([1, 2])


def test_a_list_that_is_only_read_is_the_same_content(cells, scope):
    scope.resolve("a").write([1, 2])
    before = taken(cells)
    assert scope.resolve("a").read() == [1, 2]
    assert taken(cells) == before


def test_how_often_an_entry_was_written_counts_only_if_it_is_watched(board, cells, scope):
    entry = scope.resolve("a")
    entry.write(1)
    before = taken(cells)
    entry.write(1)
    assert taken(cells) == before
    board.watch_entry(entry.name)
    entry.write(1)
    assert (entry.stamp, taken(cells) == before) == (2, False)
    board.restamp(entry.name, 1)
    assert taken(cells) == before


def test_a_value_that_cannot_be_kept_is_refused_with_the_name_of_its_entry(scope):
    with pytest.raises(FrozenValueError, match="the entry 'image' holds a value of type bytearray"):
        scope.resolve("image").write(bytearray(b"x"))


def test_boards_share_cells_without_touching_each_others_entries(board, cells, scope):
    other = Board("numbers")
    Scope(other).resolve("a").write("theirs")
    NumberedBoard.from_board(other, cells)
    scope.resolve("a").write("ours")
    assert (scope.resolve("a").read(), Scope(other).resolve("a").read()) == ("ours", "theirs")
    assert len(list(board.names())) == len(list(other.names())) == 1


class Counting:
    """Adds up two entries, and counts how often it does."""

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


def test_code_runs_once_for_the_same_contents_and_changes_the_same_again(board, cells, scope):
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


def test_what_code_raises_is_not_remembered(board, cells, scope):
    code = Counting(scope)
    memo = code.memo(board)
    for _ in range(2):
        with pytest.raises(KeyError):
            memo.call(code.run)
    assert code.calls == 2


def test_code_that_uses_one_entry_runs_once_for_each_of_its_contents_however_many(board, cells, scope):
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
