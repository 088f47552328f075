"""Tests of ports: constants and entries, reading and writing."""

import pytest

from sar_compiler.runtime.blackboard import Board, Scope
from sar_compiler.runtime.ports import InOut, Input, Output, PortError


@pytest.fixture
def entry():
    return Scope(Board("Main")).resolve("x")


def test_input_may_be_constant():
    port = Input(3)
    assert (port.get(), port.get(4), port.entry) == (3, 3, None)


def test_input_reads_current_value_of_entry(entry):
    port = Input(entry)
    entry.write(1)
    assert port.get() == 1
    entry.write(2)
    assert port.get() == 2
    assert port.entry is entry


def test_input_uses_default_only_if_entry_is_unwritten(entry):
    port = Input(entry)
    assert port.get("default") == "default"
    entry.write(None)
    assert port.get("default") is None


def test_none_is_valid_default(entry):
    assert Input(entry).get(None) is None


def test_input_without_value_raises_error_with_port_and_key(entry):
    with pytest.raises(PortError, match=r"^speed: \{x\}: the key 'x' has no value yet$"):
        Input(entry, name="speed").get()


def test_unsuitable_value_raises_error_despite_default(entry):
    entry.write("fast")
    port = Input(entry, lambda value: float(str(value)), "speed")
    with pytest.raises(PortError, match=r"^speed: \{x\}: could not convert"):
        port.get(1.0)


def test_output_writes_its_entry_or_nothing(entry):
    port: Output[int] = Output(entry)
    port.set(5)
    nowhere: Output[int] = Output()
    nowhere.set(6)
    assert entry.read() == 5


@pytest.mark.parametrize(
    ("held", "given", "stored"), [(1.5, 2, 2.0), (1, 2.0, 2), (1, 2.5, 2.5), ("x", 2, 2), (1, True, 1)]
)
def test_written_number_keeps_type_of_previous_value_if_lossless(entry, held, given, stored):
    entry.declare(float)
    entry.write(held)
    port: Output[object] = Output(entry)
    port.set(given)
    assert entry.read() == stored
    assert type(entry.read()) is type(stored)


def test_output_sets_type_of_untyped_entry(entry):
    entry.declare()
    entry.write("x")
    port: Output[int] = Output(entry, int)
    port.set(5)
    assert (entry.read(), entry.kind) == (5, int)


def test_output_through_remapping_replaces_value_of_any_type():
    main = Scope(Board("Main"))
    main.resolve("x").declare(float)
    main.resolve("x").write(1.5)
    inner = Scope(main.board, "sub", main, {"y": "x"})
    port: Output[int] = Output(inner.resolve("y"), int)
    port.set(2)
    assert type(main.resolve("x").read()) is int


def test_inout_port_writes_entry_that_it_reads(entry):
    port = InOut(entry)
    port.set(1)
    port.set(port.get() + 1)
    assert (port.get(), entry.stamp) == (2, 2)


def test_inout_port_cannot_write_constant():
    with pytest.raises(PortError, match=r"count is a constant and cannot be written. Write a \{key\}"):
        InOut(1, name="count").set(2)
