"""Nodes that work with one entry of the blackboard."""

import enum
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from py_trees.common import Status

from sar_compiler.runtime.blackboard import Scope
from sar_compiler.runtime.entry_types import read_as, value_of, value_to_keep
from sar_compiler.runtime.language_nodes import EntryTypeError, SetBlackboard, UnsetBlackboard
from sar_compiler.runtime.ports import Input, PortError
from sar_compiler.runtime.variables import RefusedValueError
from tests.runtime.own import own
from tests.runtime.stage import Stage

SkipUnlessUpdated = own("SkipUnlessUpdated")
WaitValueUpdate = own("WaitValueUpdate")
WasEntryUpdated = own("WasEntryUpdated")


class Colour(enum.Enum):
    RED = 1
    BLUE = 2


def setting(stage, value, key="k"):
    return SetBlackboard("set", value, Input(key), stage.scope, stage.enums)


def test_a_literal_is_written_as_text():
    stage = Stage()
    assert stage.tick(setting(stage, Input("7"))) == "S:"
    assert stage.entry("k").read() == "7"


def typed(**entries):
    """Make a stage on which every entry has been given its type, as a port or the mission gives it."""
    stage = Stage(**entries)
    for key, value in entries.items():
        stage.entry(key).declare(type(value))
    return stage


def test_a_literal_becomes_what_the_entry_already_is():
    stage = typed(k=1)
    stage.tick(setting(stage, Input("7")))
    assert stage.entry("k").read() == 7


def test_an_entry_without_a_type_of_its_own_takes_another_one():
    stage = Stage(k="x", source=1)
    stage.tick(setting(stage, stage.port("source")))
    assert stage.entry("k").read() == 1


def test_an_entry_that_a_literal_has_made_stays_a_text():
    stage = Stage(source=1)
    stage.tick(setting(stage, Input("7")))
    with pytest.raises(EntryTypeError, match="'set': k: 1 is not a string"):
        setting(stage, stage.port("source")).tick_once()


def test_a_key_that_is_no_text_is_an_error():
    stage = Stage(which=2.5)
    with pytest.raises(EntryTypeError, match=r"'set': output_key: 2\.5 is not a key"):
        SetBlackboard("set", Input("7"), stage.port("which"), stage.scope, stage.enums).tick_once()


def test_an_entry_that_was_named_but_never_written_takes_a_literal():
    stage = Stage()
    stage.port("k")
    stage.tick(setting(stage, Input("7")))
    assert stage.entry("k").read() == "7"


def test_another_entrys_value_is_copied_with_its_type():
    pose = object()
    stage = Stage(source=pose)
    stage.tick(setting(stage, stage.port("source")))
    assert stage.entry("k").read() is pose


def test_the_key_itself_can_come_from_the_blackboard():
    stage = Stage(which="other")
    SetBlackboard("set", Input("7"), stage.port("which"), stage.scope, stage.enums).tick_once()
    assert stage.entry("other").read() == "7"


def test_a_value_that_the_entry_cannot_take_is_an_error_that_names_node_and_entry():
    stage = typed(k=1)
    with pytest.raises(EntryTypeError, match="'set': k: the string 'seven' is not a number"):
        setting(stage, Input("seven")).tick_once()
    assert stage.entry("k").read() == 1


def test_copying_an_entry_that_is_named_and_empty_fails_and_says_so_until_it_succeeds():
    stage = Stage()
    stage.entry("source").declare()
    node = setting(stage, stage.port("source"))
    assert stage.tick(node) == "F:"
    assert node.feedback_message == "the key 'source' has no value yet"
    assert not stage.entry("k").exists
    stage.entry("source").write(1)
    assert stage.tick(node) == "S:"
    assert node.feedback_message == ""


def test_copying_what_nobody_has_named_is_an_error():
    stage = Stage()
    with pytest.raises(PortError, match="the key 'source' has no value"):
        setting(stage, stage.port("source")).tick_once()


def unset(scope, key):
    UnsetBlackboard("unset", Input(key), scope).tick_once()


def test_an_entry_is_removed_and_removing_nothing_is_no_mistake():
    stage = Stage(k=1)
    unset(stage.scope, "k")
    unset(stage.scope, "k")
    assert not stage.entry("k").exists


def test_a_subtree_removes_its_own_entries_only():
    stage = Stage(outer=1, same=1)
    inner = Scope(
        stage.scope.board, "sub", stage.scope, {"x": "outer"}, autoremap=True, own=frozenset({"mine"})
    )
    inner.resolve("mine").write(2)
    for key in ("x", "same", "mine"):
        unset(inner, key)
    assert stage.values == {"outer": 1, "same": 1}


def test_an_entry_that_is_removed_has_no_name_and_no_type_any_more():
    stage = typed(k=1)
    unset(stage.scope, "k")
    assert (stage.entry("k").is_declared, stage.entry("k").kind) == (False, None)


def test_a_key_of_the_root_is_not_removed_and_the_node_says_so():
    stage = Stage(k=1)
    node = UnsetBlackboard("unset", Input("@k"), Scope(stage.scope.board, "sub", stage.scope))
    assert stage.tick(node) == "S:"
    assert stage.values == {"k": 1}
    assert "'@k' is not removed" in node.feedback_message


def test_each_node_notices_updates_for_itself():
    stage = Stage(k=1)
    first, second = (WasEntryUpdated(name, stage.port("k"), stage.scope) for name in ("first", "second"))
    assert [stage.tick(node) for node in (first, first, second)] == ["S:", "F:", "S:"]
    stage.entry("k").write(1)
    assert [stage.tick(node) for node in (first, second)] == ["S:", "S:"]


def test_an_entry_that_nobody_wrote_is_not_updated():
    stage = Stage()
    assert stage.tick(WasEntryUpdated("w", stage.port("k"), stage.scope)) == "F:"


def test_an_entry_can_be_given_by_its_key():
    stage = Stage(k=1)
    assert stage.tick(WasEntryUpdated("w", Input("k"), stage.scope)) == "S:"


@pytest.mark.parametrize(("cls", "answer"), [(SkipUnlessUpdated, "K:"), (WaitValueUpdate, "R:")])
def test_without_an_update_the_child_is_not_ticked(cls, answer):
    stage = Stage(k=1)
    root = cls("u", stage.leaf("a", "R,S"), stage.port("k"), stage.scope)
    assert stage.ticks(root, 3) == ["R: a=R", "S: a=S", answer]
    assert root.feedback_message == "no update"
    stage.entry("k").write(2)
    assert stage.tick(root) == "S: a=S"


@pytest.mark.parametrize(("cls", "answer"), [(SkipUnlessUpdated, "K:"), (WaitValueUpdate, "R:")])
def test_after_a_halt_the_child_needs_another_update(cls, answer):
    stage = Stage(k=1)
    root = cls("u", stage.leaf("a", "R"), stage.port("k"), stage.scope)
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.told() == "halt a"
    assert stage.tick(root) == answer


@pytest.mark.parametrize(
    ("current", "value", "stored"),
    [
        (None, "x", "x"),
        (1, 2.0, 2),
        (1, "2", 2),
        (1, True, 1),
        (1.0, 2, 2.0),
        (True, 0.0, False),
        (True, False, False),
        (True, 2.0, 2),
        (False, -1, -1),
        ("x", "y", "y"),
        (Colour.RED, 2, Colour.BLUE),
        (Colour.RED, Colour.BLUE, Colour.BLUE),
        (1, Colour.BLUE, 2),
        ([1], [2], [2]),
    ],
)
def test_an_entry_keeps_its_type(current, value, stored):
    found = value_to_keep(current, value, {})
    assert found == stored
    assert type(found) is type(stored)


@pytest.mark.parametrize(
    ("current", "value"),
    [(1, 2.5), (1, "x"), ("x", 1), (True, 2.5), (Colour.RED, 3), ([1], 1), (1, [1]), ([1], "x")],
)
def test_an_entry_refuses_what_it_cannot_be(current, value):
    with pytest.raises(RefusedValueError):
        value_to_keep(current, value, {})


@given(
    current=st.one_of(st.booleans(), st.integers(), st.floats(), st.text()),
    value=st.one_of(st.integers(), st.floats(), st.text(), st.none()),
)
def test_whatever_an_entry_is_given_it_keeps_its_type_or_refuses(current, value):
    try:
        stored = value_to_keep(current, value, {})
    except RefusedValueError:
        return
    # A truth value is an integer to a script.
    assert type(stored) is type(current) or (isinstance(current, bool) and type(stored) is int)


@pytest.mark.parametrize(
    ("value", "seen"),
    [(True, 1.0), (3, 3), (2.5, 2.5), ("x", "x"), (Colour.BLUE, 2), ([1], None), (None, None)],
)
def test_a_script_sees_numbers_and_texts(value, seen):
    assert value_of(value) == seen


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [("5", str, "5"), ("5", int, 5), ("5", float, 5.0), ("TRUE", bool, True), ("0", bool, False)],
)
def test_an_entry_with_a_type_reads_a_text_as_one_of_it(text, kind, value):
    assert read_as(text, kind) == value
    assert type(read_as(text, kind)) is kind


@pytest.mark.parametrize(("text", "kind"), [("true", int), ("2.5", int), ("x", float), ("yes", bool)])
def test_a_text_that_is_none_of_the_type_is_refused(text, kind):
    with pytest.raises(RefusedValueError):
        read_as(text, kind)


VALUES = st.sampled_from([0, 1, 2.5, math.nan, True, "", "7", "x", None, [1], Colour.RED, Colour.BLUE])
ENTRIES = st.tuples(st.booleans(), VALUES, st.booleans(), st.sampled_from([None, bool, int, float, str]))


def copied(held, source, update):
    """Return what comes of copying three times, while the source changes: statuses, messages, errors, boards."""
    stage = Stage()
    for key, (exists, value, is_declared, kind) in held.items():
        if is_declared:
            stage.entry(key).declare(kind)
        if exists:
            stage.entry(key).write(value)
    node = setting(stage, stage.port("source") if source is None else Input(source))
    told = []
    for value in (None, 2, "9"):
        try:
            told.append(update(node))
        except (EntryTypeError, PortError) as error:
            told.append(str(error))
        board = stage.scope.board
        told.append(
            (node.feedback_message, repr(board.values()), [*board.stamps.values()], [*board.kinds.values()])
        )
        if value is not None:
            stage.entry("source").write(value)
    return told


@given(st.fixed_dictionaries({"source": ENTRIES, "k": ENTRIES}), st.none() | VALUES)
def test_an_entry_that_takes_the_value_as_it_is_is_written_as_any_other(held, source):
    assert copied(held, source, SetBlackboard.update) == copied(held, source, SetBlackboard._write_any)
