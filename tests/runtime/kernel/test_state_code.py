"""States as bytes, and their numbers."""

from hypothesis import given
from hypothesis import strategies as st
from librt.vecs import vec
from mypy_extensions import i32

from sar_compiler.runtime.kernel.cells import FAILURE, INVALID, RUNNING, SUCCESS
from sar_compiler.runtime.kernel.numbering import Numbering
from sar_compiler.runtime.kernel.state_code import StateCode

FIRST_CELLS = [INVALID] * 3 + [0, 7]
FIRST_VALUES = [(), "x"]
STATES = st.tuples(
    st.tuples(st.integers(0, 4), st.integers(0, 2**200)).map(list),
    st.tuples(
        *(st.sampled_from([INVALID, RUNNING, SUCCESS, FAILURE]) for _ in range(3)),
        st.integers(-1, 300),
        st.integers(-1, 100_000),
    ).map(list),
    st.tuples(st.sampled_from([(), (1,)]), st.sampled_from(["x", "y", None])).map(list),
    st.lists(st.integers(0, 200), max_size=200),
)


def numbers(items):
    return vec[i32](items)


def code(forgotten=()):
    return StateCode(numbers(FIRST_CELLS), FIRST_VALUES, list(forgotten))


def without_end(entries):
    """Return numbers of entries without those at the end that are not there."""
    while entries and not entries[-1]:
        entries = entries[:-1]
    return entries


@given(STATES)
def test_a_state_is_read_as_it_was_written(state):
    head, cells, values, entries = state
    states = code()
    written = states.write(head, numbers(cells), values, numbers(entries))
    read_cells, read_values = numbers([9] * len(cells)), [9] * len(values)
    assert list(states.read(written, read_cells, read_values)) == without_end(entries)
    assert (list(read_cells), read_values, states.head(written)) == (cells, values, head)


@given(st.lists(STATES, max_size=6))
def test_two_states_are_written_alike_only_if_they_are_the_same(states):
    coding = code()
    written = [
        coding.write(head, numbers(cells), values, numbers(entries))
        for head, cells, values, entries in states
    ]
    same = [(head, cells, values, without_end(entries)) for head, cells, values, entries in states]
    for index, one in enumerate(same):
        assert [other == one for other in same] == [other == written[index] for other in written]


def test_how_a_forgotten_node_has_ended_is_not_written():
    states = code([True, False, True])
    ended, running = [SUCCESS, FAILURE, INVALID, 0, 7], [INVALID, FAILURE, RUNNING, 0, 7]
    read = numbers([0] * 5)
    states.read(states.write([0, 0], numbers(ended), FIRST_VALUES, numbers([])), read, [0, 0])
    assert list(read) == [INVALID, FAILURE, INVALID, 0, 7]
    states.read(states.write([0, 0], numbers(running), FIRST_VALUES, numbers([])), read, [0, 0])
    assert list(read) == running


def test_a_tree_as_it_was_at_first_takes_two_bytes():
    assert len(code().write([0, 0], numbers(FIRST_CELLS), FIRST_VALUES, numbers([0, 0]))) == 2


@given(st.lists(st.binary(max_size=2), max_size=3000))
def test_states_are_numbered_in_the_order_in_which_they_are_added(keys):
    numbering = Numbering()
    expected: dict[bytes, int] = {}
    for key in keys:
        assert numbering.find(key) == expected.get(key, -1)
        if key not in expected:
            expected[key] = len(expected)
            assert numbering.add(key) == expected[key]
    assert list(numbering.states) == list(expected)


def test_ten_thousand_states_are_found_again():
    numbering = Numbering()
    for number in range(10_000):
        numbering.add(f"state {number}".encode())
    assert all(numbering.find(f"state {number}".encode()) == number for number in range(10_000))
    assert numbering.find(b"state 10000") == -1
