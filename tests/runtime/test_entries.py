"""Tests of nodes that read or write one entry of the blackboard, and of the types of entries."""

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
from tests.runtime.node_factories import own
from tests.runtime.stage import Stage

SkipUnlessUpdated = own("SkipUnlessUpdated")
WaitValueUpdate = own("WaitValueUpdate")
WasEntryUpdated = own("WasEntryUpdated")


class Colour(enum.Enum):
    RED = 1
    BLUE = 2


def set_blackboard(stage, value, key="k"):
    return SetBlackboard("set", value, Input(key), stage.scope, stage.enums)


def test_literal_is_written_as_string():
    stage = Stage()
    assert stage.tick(set_blackboard(stage, Input("7"))) == "S:"
    assert stage.entry("k").read() == "7"


def typed_stage(**entries):
    """Return a stage on which every entry is declared with its type, as by a port or a mission parameter."""
    stage = Stage(**entries)
    for key, value in entries.items():
        stage.entry(key).declare(type(value))
    return stage


def test_literal_is_converted_to_type_of_entry():
    stage = typed_stage(k=1)
    stage.tick(set_blackboard(stage, Input("7")))
    assert stage.entry("k").read() == 7


def test_untyped_entry_accepts_value_of_other_type():
    stage = Stage(k="x", source=1)
    stage.tick(set_blackboard(stage, stage.port("source")))
    assert stage.entry("k").read() == 1


def test_entry_created_by_literal_stays_string():
    stage = Stage(source=1)
    stage.tick(set_blackboard(stage, Input("7")))
    with pytest.raises(EntryTypeError, match="'set': k: 1 is not a string"):
        set_blackboard(stage, stage.port("source")).tick_once()


def test_key_that_is_no_string_raises_error():
    stage = Stage(which=2.5)
    with pytest.raises(EntryTypeError, match=r"'set': output_key: 2\.5 is not a key"):
        SetBlackboard("set", Input("7"), stage.port("which"), stage.scope, stage.enums).tick_once()


def test_referenced_but_unwritten_entry_accepts_literal():
    stage = Stage()
    stage.port("k")
    stage.tick(set_blackboard(stage, Input("7")))
    assert stage.entry("k").read() == "7"


def test_value_of_other_entry_is_copied_unchanged():
    pose = object()
    stage = Stage(source=pose)
    stage.tick(set_blackboard(stage, stage.port("source")))
    assert stage.entry("k").read() is pose


def test_key_can_come_from_blackboard():
    stage = Stage(which="other")
    SetBlackboard("set", Input("7"), stage.port("which"), stage.scope, stage.enums).tick_once()
    assert stage.entry("other").read() == "7"


def test_unsuitable_value_raises_error_with_node_and_entry():
    stage = typed_stage(k=1)
    with pytest.raises(EntryTypeError, match="'set': k: the string 'seven' is not a number"):
        set_blackboard(stage, Input("seven")).tick_once()
    assert stage.entry("k").read() == 1


def test_copying_declared_entry_fails_with_message_until_written():
    stage = Stage()
    stage.entry("source").declare()
    node = set_blackboard(stage, stage.port("source"))
    assert stage.tick(node) == "F:"
    assert node.feedback_message == "the key 'source' has no value yet"
    assert not stage.entry("k").exists
    stage.entry("source").write(1)
    assert stage.tick(node) == "S:"
    assert node.feedback_message == ""


def test_copying_undeclared_entry_raises_error():
    stage = Stage()
    with pytest.raises(PortError, match="the key 'source' has no value"):
        set_blackboard(stage, stage.port("source")).tick_once()


def unset(scope, key):
    UnsetBlackboard("unset", Input(key), scope).tick_once()


def test_unset_removes_entry_and_ignores_missing_entry():
    stage = Stage(k=1)
    unset(stage.scope, "k")
    unset(stage.scope, "k")
    assert not stage.entry("k").exists


def test_unset_in_subtree_removes_only_its_own_entries():
    stage = Stage(outer=1, same=1)
    inner = Scope(
        stage.scope.board, "sub", stage.scope, {"x": "outer"}, autoremap=True, own=frozenset({"mine"})
    )
    inner.resolve("mine").write(2)
    for key in ("x", "same", "mine"):
        unset(inner, key)
    assert stage.values == {"outer": 1, "same": 1}


def test_removed_entry_is_undeclared_and_untyped():
    stage = typed_stage(k=1)
    unset(stage.scope, "k")
    assert (stage.entry("k").is_declared, stage.entry("k").kind) == (False, None)


def test_unset_does_not_remove_root_key_and_reports_it():
    stage = Stage(k=1)
    node = UnsetBlackboard("unset", Input("@k"), Scope(stage.scope.board, "sub", stage.scope))
    assert stage.tick(node) == "S:"
    assert stage.values == {"k": 1}
    assert "'@k' is not removed" in node.feedback_message


def test_each_node_tracks_updates_separately():
    stage = Stage(k=1)
    first, second = (WasEntryUpdated(name, stage.port("k"), stage.scope) for name in ("first", "second"))
    assert [stage.tick(node) for node in (first, first, second)] == ["S:", "F:", "S:"]
    stage.entry("k").write(1)
    assert [stage.tick(node) for node in (first, second)] == ["S:", "S:"]


def test_unwritten_entry_is_not_updated():
    stage = Stage()
    assert stage.tick(WasEntryUpdated("w", stage.port("k"), stage.scope)) == "F:"


def test_entry_can_be_given_by_key():
    stage = Stage(k=1)
    assert stage.tick(WasEntryUpdated("w", Input("k"), stage.scope)) == "S:"


@pytest.mark.parametrize(("cls", "answer"), [(SkipUnlessUpdated, "K:"), (WaitValueUpdate, "R:")])
def test_child_is_not_ticked_without_update(cls, answer):
    stage = Stage(k=1)
    root = cls("u", stage.leaf("a", "R,S"), stage.port("k"), stage.scope)
    assert stage.ticks(root, 3) == ["R: a=R", "S: a=S", answer]
    assert root.feedback_message == "no update"
    stage.entry("k").write(2)
    assert stage.tick(root) == "S: a=S"


@pytest.mark.parametrize(("cls", "answer"), [(SkipUnlessUpdated, "K:"), (WaitValueUpdate, "R:")])
def test_halted_child_needs_another_update(cls, answer):
    stage = Stage(k=1)
    root = cls("u", stage.leaf("a", "R"), stage.port("k"), stage.scope)
    stage.tick(root)
    root.stop(Status.INVALID)
    assert stage.new_events() == "halt a"
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
def test_value_is_converted_to_type_of_current_value(current, value, stored):
    found = value_to_keep(current, value, {})
    assert found == stored
    assert type(found) is type(stored)


@pytest.mark.parametrize(
    ("current", "value"),
    [(1, 2.5), (1, "x"), ("x", 1), (True, 2.5), (Colour.RED, 3), ([1], 1), (1, [1]), ([1], "x")],
)
def test_value_unsuitable_for_type_of_current_value_is_rejected(current, value):
    with pytest.raises(RefusedValueError):
        value_to_keep(current, value, {})


@given(
    current=st.one_of(st.booleans(), st.integers(), st.floats(), st.text()),
    value=st.one_of(st.integers(), st.floats(), st.text(), st.none()),
)
def test_any_value_is_converted_to_type_of_entry_or_rejected(current, value):
    try:
        stored = value_to_keep(current, value, {})
    except RefusedValueError:
        return
    # For a script, a bool is an integer.
    assert type(stored) is type(current) or (isinstance(current, bool) and type(stored) is int)


@pytest.mark.parametrize(
    ("value", "seen"),
    [(True, 1.0), (3, 3), (2.5, 2.5), ("x", "x"), (Colour.BLUE, 2), ([1], None), (None, None)],
)
def test_script_reads_only_numbers_and_strings(value, seen):
    assert value_of(value) == seen


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [("5", str, "5"), ("5", int, 5), ("5", float, 5.0), ("TRUE", bool, True), ("0", bool, False)],
)
def test_string_is_parsed_as_type_of_entry(text, kind, value):
    assert read_as(text, kind) == value
    assert type(read_as(text, kind)) is kind


@pytest.mark.parametrize(("text", "kind"), [("true", int), ("2.5", int), ("x", float), ("yes", bool)])
def test_string_unsuitable_for_type_is_rejected(text, kind):
    with pytest.raises(RefusedValueError):
        read_as(text, kind)


VALUES = st.sampled_from([0, 1, 2.5, math.nan, True, "", "7", "x", None, [1], Colour.RED, Colour.BLUE])
ENTRIES = st.tuples(st.booleans(), VALUES, st.booleans(), st.sampled_from([None, bool, int, float, str]))


def copy_three_times(held, source, update):
    """Return the statuses, messages, errors and boards of three copies, between which the source changes."""
    stage = Stage()
    for key, (exists, value, is_declared, kind) in held.items():
        if is_declared:
            stage.entry(key).declare(kind)
        if exists:
            stage.entry(key).write(value)
    node = set_blackboard(stage, stage.port("source") if source is None else Input(source))
    results = []
    for value in (None, 2, "9"):
        try:
            results.append(update(node))
        except (EntryTypeError, PortError) as error:
            results.append(str(error))
        board = stage.scope.board
        results.append(
            (node.feedback_message, repr(board.values()), [*board.stamps.values()], [*board.kinds.values()])
        )
        if value is not None:
            stage.entry("source").write(value)
    return results


@given(st.fixed_dictionaries({"source": ENTRIES, "k": ENTRIES}), st.none() | VALUES)
def test_fast_path_of_set_blackboard_matches_general_path(held, source):
    assert copy_three_times(held, source, SetBlackboard.update) == copy_three_times(
        held, source, SetBlackboard._write_any
    )
