"""Tests of the evaluation of scripts: values, assignments and errors."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.runtime.evaluation import EvaluationError, Program
from sar_compiler.runtime.operators import LONGEST_TEXT, as_condition
from sar_compiler.runtime.script import parse
from sar_compiler.runtime.tokens import ScriptError
from sar_compiler.runtime.variables import LARGEST_EXACT, RefusedValueError, UnknownVariableError, fit

ENUMS = {"RED": 1, "BLUE": 3}


class DictVariables:
    """Variables in a dictionary. Each keeps the type of its first value."""

    def __init__(self, **values):
        self.values = values

    def read(self, name):
        if name not in self.values:
            raise UnknownVariableError(name)
        return self.values[name]

    def create(self, name, value):
        if name in self.values:
            return self.assign(name, value)
        self.values[name] = value
        return value

    def assign(self, name, value):
        self.values[name] = fit(value, type(self.read(name)), ENUMS)
        return self.values[name]


def value_of(text, **variables):
    return Program(parse(text), ENUMS).run(DictVariables(**variables))


def variables_after(text, **variables):
    """Return the variables after a script."""
    store = DictVariables(**variables)
    Program(parse(text), ENUMS).run(store)
    return store.values


def error_of(text, **variables):
    with pytest.raises(EvaluationError) as caught:
        value_of(text, **variables)
    return caught.value


def outcome(program, **variables):
    """Return the value of a program or its error."""
    try:
        return program.run(DictVariables(**variables)), None
    except EvaluationError as error:
        return None, error


def marked_text(text, error):
    return text[error.start : error.end]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("7", 7),
        ("-7", -7.0),
        ("1 + 2", 3.0),
        ("7 - 2 - 1", 4.0),
        ("2 * 3 / 4", 1.5),
        ("2 + 3 * 4 - 1", 13.0),
        ("'a' + 'b' + 'c'", "abc"),
        ("'a' .. 'b'", "ab"),
        ("'n' .. 5 .. '!'", "n5!"),
        ("1.5 .. 'm'", "1.500000m"),
        ("'n' .. (2 + 3)", "n5.000000"),
        ("6 & 3", 2.0),
        ("6 | 3 & 5", 7.0),
        ("6 ^ 3", 5.0),
        ("2.0 | 1", 3.0),
        ("~0", -1.0),
        ("~2.9", -3.0),
        ("~-2.9", 1.0),
        ("!0", 1.0),
        ("!0.5", 0.0),
        ("!!true", 1.0),
        ("true && 0", 0.0),
        ("0 || 0.5", 1.0),
        ("false || true && true", 1.0),
        ("true ? 'yes' : nope", "yes"),
        ("0 ? nope : 'no'", "no"),
        ("'2' ? 1 : 0", 1),
        ("RED + BLUE", 4.0),
        ("1; 2; 'last'", "last"),
    ],
)
def test_expression_has_same_value_as_in_behaviortree_cpp(text, value):
    assert value_of(text) == value
    assert type(value_of(text)) is type(value)


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("0.1 + 0.2 == 0.3", True),
        ("1.0 == 1.0000001", True),
        ("1.0 == 1.000001", False),
        ("1.0 != 1.0000001", False),
        ("1 < 1.0000001", True),
        ("'10' < '9'", True),
        ("'10' < 9", False),
        ("9 < '10'", True),
        ("'a' < 'aa' < 'b'", True),
        ("'3' == 3", True),
        ("'-2.5e1' == -25", True),
        ("'true' == 1", True),
        ("0 == 'false'", True),
        ("'RED' == 1", True),
        ("'RED' == RED", True),
        ("'RED' == 'RED'", True),
        ("1 < 2 < 3", True),
        ("1 < 2 > 3", False),
        ("3 > 2 > 1", True),
        ("(3 > 2) > 1", False),
        ("5 == 5 != 3", True),
        ("2 > 3 == nope", False),
    ],
)
def test_comparison_yields_one_or_zero(text, holds):
    assert value_of(text) == float(holds)
    assert isinstance(value_of(text), float)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 / 0", math.inf),
        ("-1 / 0", -math.inf),
        ("1 / -0.0", -math.inf),
        ("1 / (1 / 0)", 0.0),
        ("1e308 * 10", math.inf),
    ],
)
def test_division_by_zero_and_overflow_yield_infinity(text, value):
    assert value_of(text) == value


def test_nan_equals_nothing_and_every_order_comparison_with_it_holds():
    assert math.isnan(value_of("0 / 0"))
    assert value_of("(0 / 0) == (0 / 0)") == 0.0
    assert value_of("(0 / 0) != 1") == 1.0
    assert value_of("(0 / 0) < 1 < (0 / 0)") == 1.0


@pytest.mark.parametrize("text", ["false && nope", "true || nope", "nope && false"])
def test_both_operands_of_logical_operator_are_always_evaluated(text):
    error = error_of(text)
    assert error.message == "there is no variable 'nope'"
    assert marked_text(text, error) == "nope"


def test_number_literals_keep_their_type_and_results_are_floats():
    store = variables_after("i:=42; r:=3.5; s:='txt'; b:=true; h:=0xFF; e:=1e3; n:=-1; c:=RED")
    assert store == {"i": 42, "r": 3.5, "s": "txt", "b": 1.0, "h": 255, "e": 1000.0, "n": -1.0, "c": 1.0}
    whole = {name for name, value in store.items() if isinstance(value, int)}
    assert whole == {"i", "h"}


@pytest.mark.parametrize(
    ("text", "before", "after"),
    [
        ("x += 1", 1, 2),
        ("x += 0.5", 1.0, 1.5),
        ("x -= 3", 1, -2),
        ("x *= 3", 2, 6),
        ("x /= 4", 2.0, 0.5),
        ("x /= 2", 4, 2),
        ("x += 'b'", "a", "ab"),
        ("x := 2.0", 1, 2),
        ("x = '5'", 1, 5),
        ("x = '5'", 1.0, 5.0),
        ("x = 'RED'", 5, 1),
        ("x = 'true'", 0, 1),
        ("x = y := 7", 1.5, 7.0),
        ("x += (x = 5)", 1, 10),
    ],
)
def test_assigned_variable_keeps_its_type(text, before, after):
    value = variables_after(text, x=before)["x"]
    assert value == after
    assert type(value) is type(before)


def test_value_of_assignment_is_stored_value():
    assert type(value_of("x = 2.0", x=1)) is int
    assert value_of("y := x = '7'", x=1.5) == 7.0


def test_root_variable_differs_from_local_variable():
    assert variables_after("@g := 1; g := 2") == {"@g": 1, "g": 2}


def test_enumerator_hides_variable_of_same_name():
    assert value_of("RED := 5; RED") == 1.0


@pytest.mark.parametrize("text", ["nope = 3", "nope += 3"])
def test_only_colon_equals_creates_variable(text):
    error = error_of(text)
    assert (error.message, error.hint) == ("there is no variable 'nope'", "to create it, write nope := ...")
    assert marked_text(text, error) == "nope"


@pytest.mark.parametrize(
    ("text", "mark", "said"),
    [
        ("1 + count + label * 2", "label * 2", "the string 'abc' is not a number"),
        ("1 + count + label", "1 + count + label", "the string 'abc' is not a number"),
        ("0 + (label + 1) + 2", "label + 1", "'..' joins a string and a number"),
        ("1 + (label) + 2", "1 + (label)", "the string 'abc' is not a number"),
        ("-label", "-label", "the string 'abc' is not a number"),
        ("label - label", "label - label", "the string 'abc' is not a number"),
        ("label && true", "label && true", "the string 'abc' is not a number"),
        ("count && true", "count && true", "3 is neither true (1) nor false (0)"),
        ("true || -1.5", "true || -1.5", "-1.5 is neither true (1) nor false (0)"),
        ("count .. 1", "count .. 1", "neither 3 nor 1 is a string"),
        ("label == 1", "label == 1", "the string 'abc' is not a number"),
        ("1 < 2 < label < 3", "1 < 2 < label", "the string 'abc' is not a number"),
        ("'12abc' == 12", "'12abc' == 12", "the string '12abc' is not a number"),
        ("'' == 0", "'' == 0", "the string '' is not a number"),
        ("'1e999' > 0", "'1e999' > 0", "the string '1e999' is not a number"),
        ("label ? 1 : 2", "label", "the string 'abc' is not a number"),
        ("1.5 & 1", "1.5 & 1", "1.5 is not an integer"),
        ("1 | 1e300", "1 | 1e300", "1e+300 is too large"),
        ("~(1 / 0)", "~(1 / 0)", "inf is not an integer"),
        ("label += 1", "label += 1", "the string 'abc' is not a number"),
        ("label *= 'a'", "label *= 'a'", "the string 'abc' is not a number"),
        ("count /= 4", "count /= 4", "this value cannot be assigned to 'count': 0.75 is not an integer"),
        ("count = 'many'", "count = 'many'", "the string 'many' is not a number"),
        ("count := 1 / 0", "count := 1 / 0", "inf is not an integer"),
        ("label = 7", "label = 7", "this value cannot be assigned to 'label': 7 is not a string"),
        ("9007199254740993 + 0", "9007199254740993 + 0", "too large for an exact calculation"),
        ("pose = 1", "pose = 1", "1 is not of type list"),
        ("pose + 1", "pose + 1", "a value of type list is not a number"),
        ("pose .. 'm'", "pose .. 'm'", "a value of type list is neither a string nor a number"),
        ("huge == 1", "huge == 1", "an integer of 20001 bits is too large"),
    ],
)
def test_unsuitable_value_is_marked_and_explained(text, mark, said):
    error = error_of(text, count=3, label="abc", pose=[], huge=1 << 20_000)
    assert marked_text(text, error) == mark
    assert said in f"{error.message}; {error.hint}"


@pytest.mark.parametrize("text", ["a = a + a", "a += a", "a = a .. a", "a = a .. 1.5"])
def test_length_of_created_string_is_limited(text):
    error = error_of(text, a="x" * LONGEST_TEXT)
    assert f"but the limit is {LONGEST_TEXT:,}" in error.message


def test_existing_string_may_exceed_length_limit():
    assert value_of("a == a ? a : ''", a="x" * 100_000) == "x" * 100_000


def test_any_value_can_be_assigned_from_another_variable():
    pose = object()
    assert variables_after("b := a", a=pose)["b"] is pose


def test_assignments_before_error_are_kept():
    store = DictVariables()
    with pytest.raises(EvaluationError):
        Program(parse("a := 1; b := nope; c := 2")).run(store)
    assert store.values == {"a": 1}


def test_empty_script_changes_nothing():
    store = DictVariables(a=1)
    assert Program(parse("", allow_empty=True)).run(store) == 0.0
    assert store.values == {"a": 1}


def test_program_can_run_repeatedly():
    program, store = Program(parse("n += 1")), DictVariables(n=0)
    assert [program.run(store) for _ in range(3)] == [1, 2, 3]


@pytest.mark.parametrize(
    ("value", "holds"),
    [(1, True), (0, False), (1.0, True), (-0.0, False), (True, True), (0.5, True), (2.5, True)],
)
def test_zero_one_and_positive_floats_are_truth_values(value, holds):
    assert as_condition(value) is holds


@pytest.mark.parametrize("value", [2, -1, -0.5, "1", "true", []])
def test_other_values_are_no_truth_values(value):
    with pytest.raises(RefusedValueError, match="neither true"):
        as_condition(value)


def test_condition_script_returns_bool():
    assert Program(parse("x > 3")).holds(DictVariables(x=4)) is True
    assert Program(parse("x > 3")).holds(DictVariables(x=3)) is False


def test_assignment_as_condition_raises_error_suggesting_comparison():
    text = "y := 1; x = 2"
    with pytest.raises(EvaluationError, match="'x = 2' is not a condition: 2 is neither") as caught:
        Program(parse(text)).holds(DictVariables(x=0))
    assert marked_text(text, caught.value) == "x = 2"
    assert caught.value.hint is not None
    assert "==" in caught.value.hint


@pytest.mark.parametrize(
    ("value", "kind", "fitted"),
    [
        (2.0, int, 2),
        (-(2.0**63), int, -(2**63)),
        ("12", int, 12),
        ("9007199254740993", int, 9007199254740993),
        ("2.0", int, 2),
        ("BLUE", int, 3),
        ("false", int, 0),
        (3, float, 3.0),
        (LARGEST_EXACT, float, float(LARGEST_EXACT)),
        ("-.5e1", float, -5.0),
        ("inf", float, math.inf),
        ("a", str, "a"),
        (1.0, bool, True),
        ("false", bool, False),
        (True, int, 1),
        (True, float, 1.0),
        ([7], list, [7]),
    ],
)
def test_suitable_value_is_converted_to_type(value, kind, fitted):
    result = fit(value, kind, ENUMS)
    assert result == fitted
    assert type(result) is type(fitted)


@pytest.mark.parametrize(
    ("value", "kind"),
    [
        (2.5, int),
        (2.0**63, int),
        (math.nan, int),
        (math.inf, int),
        ("2.5", int),
        ("9223372036854775808", int),
        ("12abc", int),
        (" 1", int),
        ("+1", float),
        ("1e999", float),
        ("", float),
        ("GREEN", float),
        (LARGEST_EXACT + 1, float),
        (1, str),
        (1.5, str),
        (1, list),
        ([], int),
        (2, bool),
        ("yes", bool),
    ],
)
def test_lossy_conversion_is_rejected(value, kind):
    with pytest.raises(RefusedValueError):
        fit(value, kind, ENUMS)


OPERANDS = [
    "a",
    "b",
    "t",
    "@n",
    "RED",
    "nope",
    "1",
    "0",
    "2.5",
    "1e300",
    "9007199254740993",
    "'x'",
    "'7'",
    "true",
]
SIGNS = [
    "+",
    "-",
    "*",
    "/",
    "..",
    "&",
    "|",
    "^",
    "&&",
    "||",
    "==",
    "!=",
    "<",
    ">=",
    "?",
    ":",
    ":=",
    "=",
    "+=",
    "/=",
    ";",
]
words = st.sampled_from([*OPERANDS, *OPERANDS, *SIGNS, "-", "~", "!", "(", ")"])
values = (
    st.integers() | st.floats() | st.text() | st.booleans() | st.none() | st.lists(st.integers(), max_size=1)
)


@given(st.lists(words, min_size=1, max_size=12).map(" ".join), values, values, values)
def test_parsed_script_has_value_or_error_within_text(text, first, second, third):
    try:
        program = Program(parse(text), ENUMS)
    except ScriptError:
        return
    _, error = outcome(program, a=first, b=second, t=third, **{"@n": 5})
    assert error is None or 0 <= error.start < error.end <= len(text)


@given(st.sampled_from(["+", "-", "*", "/", "..", "&", "|", "^", "&&", "||", "<", "=="]), values, values)
def test_binary_operator_yields_float_string_or_error(operator, left, right):
    text = f"a {operator} b"
    result, error = outcome(Program(parse(text)), a=left, b=right)
    if error is None:
        assert isinstance(result, (float, str))
    else:
        assert marked_text(text, error) == text


@given(st.floats() | st.integers() | st.text(), st.sampled_from([int, float, str, bool]))
def test_converted_value_has_type_and_converts_to_itself(value, kind):
    try:
        fitted = fit(value, kind)
    except RefusedValueError:
        return
    assert type(fitted) is kind
    assert repr(fit(fitted, kind)) == repr(fitted)
