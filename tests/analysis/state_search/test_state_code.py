"""Tests of encoding states as bytes, and of numbering them."""

from hypothesis import given
from hypothesis import strategies as st
from librt.vecs import vec
from mypy_extensions import i32

from sar_compiler.analysis.state_search.numbering import Numbering
from sar_compiler.analysis.state_search.state_code import StateCode
from sar_compiler.runtime.kernel.cells import FAILURE, INVALID, RUNNING, SUCCESS

FIRST_CELLS = [INVALID] * 3 + [0, 7]
FIRST_VALUES = [(), "x"]
STATES = st.tuples(
    st.tuples(st.integers(0, 4), st.integers(0, 2**200)),
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


def without_trailing_zeros(entries):
    """Return entry numbers without trailing missing entries."""
    while entries and not entries[-1]:
        entries = entries[:-1]
    return entries


@given(STATES)
def test_state_survives_encoding(state):
    head, cells, values, entries = state
    states = code()
    written = states.write(*head, numbers(cells), values, numbers(entries))
    read_values, read_entries = [9] * len(values), numbers([0] * len(entries))
    assert list(states.read(written, read_values, read_entries)) == cells
    assert (read_values, list(read_entries), states.head(written)) == (values, entries, head)


@given(st.lists(STATES, max_size=6))
def test_encodings_are_equal_only_for_equal_states(states):
    coding = code()
    written = [
        coding.write(*head, numbers(cells), values, numbers(entries))
        for head, cells, values, entries in states
    ]
    same = [(head, cells, values, without_trailing_zeros(entries)) for head, cells, values, entries in states]
    for index, one in enumerate(same):
        assert [other == one for other in same] == [other == written[index] for other in written]


def test_outcome_of_forgotten_node_is_not_encoded():
    states = code([True, False, True])
    ended, running = [SUCCESS, FAILURE, INVALID, 0, 7], [INVALID, FAILURE, RUNNING, 0, 7]

    def read(cells):
        written = states.write(0, 0, numbers(cells), FIRST_VALUES, numbers([]))
        return list(states.read(written, [0, 0], numbers([])))

    assert read(ended) == [INVALID, FAILURE, INVALID, 0, 7]
    assert read(running) == running


def test_middle_contains_outcomes_of_shown_forgotten_nodes():
    states = code([True, True, True])

    def middle(cells, shown):
        return states.write_middle(3, 0, 0, shown, numbers(cells), FIRST_VALUES, numbers([]))

    one, other = [SUCCESS, SUCCESS, INVALID, 0, 7], [SUCCESS, FAILURE, INVALID, 0, 7]
    assert middle(one, [1]) != middle(other, [1])
    assert middle(one, [0, 2]) == middle(other, [0, 2])
    assert middle(one, []) == middle(other, [])


def test_middle_depends_on_node_and_property_state():
    states = code()
    middles = {
        states.write_middle(node, watched, broken, [], numbers(FIRST_CELLS), FIRST_VALUES, numbers([]))
        for node in (0, 200)
        for watched in (0, 1, 2**70)
        for broken in (0, 1)
    }
    assert len(middles) == 12


def test_one_change_takes_one_byte():
    changed = [RUNNING, FAILURE, SUCCESS, 13, 7]
    assert len(code().write(0, 0, numbers(changed), FIRST_VALUES, numbers([0, 14]))) == 2 + 5


def test_initial_state_takes_two_bytes():
    assert len(code().write(0, 0, numbers(FIRST_CELLS), FIRST_VALUES, numbers([0, 0]))) == 2


@given(st.lists(st.binary(max_size=2), max_size=3000))
def test_states_are_numbered_in_order_of_addition(keys):
    numbering = Numbering()
    expected: dict[bytes, int] = {}
    for key in keys:
        assert numbering.find(key) == expected.get(key, -1)
        if key not in expected:
            expected[key] = len(expected)
            assert numbering.add(key) == expected[key]
    assert list(numbering.states) == list(expected)


def test_ten_thousand_states_are_found():
    numbering = Numbering()
    for number in range(10_000):
        numbering.add(f"state {number}".encode())
    assert all(numbering.find(f"state {number}".encode()) == number for number in range(10_000))
    assert numbering.find(b"state 10000") == -1
