"""What scripts calculate, what they change, and what is said when they cannot be run."""

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


class Desk:
    """Variables in a dictionary; each keeps the type of its first value."""

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
    return Program(parse(text), ENUMS).run(Desk(**variables))


def left_by(text, **variables):
    """Return the variables after a script."""
    desk = Desk(**variables)
    Program(parse(text), ENUMS).run(desk)
    return desk.values


def error_of(text, **variables):
    with pytest.raises(EvaluationError) as caught:
        value_of(text, **variables)
    return caught.value


def outcome(program, **variables):
    """Return the value of a program or its error."""
    try:
        return program.run(Desk(**variables)), None
    except EvaluationError as error:
        return None, error


def marked(text, error):
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
def test_an_expression_has_the_value_that_it_has_in_behavior_tree_cpp(text, value):
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
def test_a_comparison_is_true_or_false(text, holds):
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
def test_dividing_by_zero_and_overflow_give_infinite_numbers(text, value):
    assert value_of(text) == value


def test_nothing_equals_what_is_not_a_number_and_no_order_with_it_is_denied():
    assert math.isnan(value_of("0 / 0"))
    assert value_of("(0 / 0) == (0 / 0)") == 0.0
    assert value_of("(0 / 0) != 1") == 1.0
    assert value_of("(0 / 0) < 1 < (0 / 0)") == 1.0


@pytest.mark.parametrize("text", ["false && nope", "true || nope", "nope && false"])
def test_both_sides_of_a_logical_operator_are_always_calculated(text):
    error = error_of(text)
    assert error.message == "there is no variable 'nope'"
    assert marked(text, error) == "nope"


def test_literals_keep_their_type_and_results_are_real_numbers():
    desk = left_by("i:=42; r:=3.5; s:='txt'; b:=true; h:=0xFF; e:=1e3; n:=-1; c:=RED")
    assert desk == {"i": 42, "r": 3.5, "s": "txt", "b": 1.0, "h": 255, "e": 1000.0, "n": -1.0, "c": 1.0}
    whole = {name for name, value in desk.items() if isinstance(value, int)}
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
def test_a_variable_is_changed_and_keeps_its_type(text, before, after):
    value = left_by(text, x=before)["x"]
    assert value == after
    assert type(value) is type(before)


def test_the_value_of_an_assignment_is_what_was_stored():
    assert type(value_of("x = 2.0", x=1)) is int
    assert value_of("y := x = '7'", x=1.5) == 7.0


def test_a_name_at_the_root_is_another_variable():
    assert left_by("@g := 1; g := 2") == {"@g": 1, "g": 2}


def test_a_name_of_an_enumeration_hides_a_variable_that_is_read():
    assert value_of("RED := 5; RED") == 1.0


@pytest.mark.parametrize("text", ["nope = 3", "nope += 3"])
def test_only_colon_equals_makes_a_variable(text):
    error = error_of(text)
    assert (error.message, error.hint) == ("there is no variable 'nope'", "to create it, write nope := ...")
    assert marked(text, error) == "nope"


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
def test_a_value_that_does_not_fit_is_pointed_at_and_explained(text, mark, said):
    error = error_of(text, count=3, label="abc", pose=[], huge=1 << 20_000)
    assert marked(text, error) == mark
    assert said in f"{error.message}; {error.hint}"


@pytest.mark.parametrize("text", ["a = a + a", "a += a", "a = a .. a", "a = a .. 1.5"])
def test_a_text_does_not_grow_without_end(text):
    error = error_of(text, a="x" * LONGEST_TEXT)
    assert f"but the limit is {LONGEST_TEXT:,}" in error.message


def test_a_text_that_somebody_else_has_made_may_be_longer():
    assert value_of("a == a ? a : ''", a="x" * 100_000) == "x" * 100_000


def test_any_value_can_be_handed_from_one_variable_to_another():
    pose = object()
    assert left_by("b := a", a=pose)["b"] is pose


def test_what_was_assigned_before_an_error_stays():
    desk = Desk()
    with pytest.raises(EvaluationError):
        Program(parse("a := 1; b := nope; c := 2")).run(desk)
    assert desk.values == {"a": 1}


def test_an_empty_script_changes_nothing():
    desk = Desk(a=1)
    assert Program(parse("", allow_empty=True)).run(desk) == 0.0
    assert desk.values == {"a": 1}


def test_a_program_runs_as_often_as_wanted():
    program, desk = Program(parse("n += 1")), Desk(n=0)
    assert [program.run(desk) for _ in range(3)] == [1, 2, 3]


@pytest.mark.parametrize(
    ("value", "holds"),
    [(1, True), (0, False), (1.0, True), (-0.0, False), (True, True), (0.5, True), (2.5, True)],
)
def test_one_and_zero_answer_a_condition_and_so_does_any_real_number_above(value, holds):
    assert as_condition(value) is holds


@pytest.mark.parametrize("value", [2, -1, -0.5, "1", "true", []])
def test_nothing_else_answers_a_condition(value):
    with pytest.raises(RefusedValueError, match="neither true"):
        as_condition(value)


def test_a_condition_is_a_script_with_a_yes_or_a_no():
    assert Program(parse("x > 3")).holds(Desk(x=4)) is True
    assert Program(parse("x > 3")).holds(Desk(x=3)) is False


def test_an_assignment_that_is_no_condition_is_asked_whether_it_is_a_comparison():
    text = "y := 1; x = 2"
    with pytest.raises(EvaluationError, match="'x = 2' is not a condition: 2 is neither") as caught:
        Program(parse(text)).holds(Desk(x=0))
    assert marked(text, caught.value) == "x = 2"
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
def test_a_value_that_is_one_of_the_type_fits(value, kind, fitted):
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
def test_a_value_that_would_become_another_is_refused(value, kind):
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
def test_a_script_that_could_be_read_has_a_value_or_an_error_within_it(text, first, second, third):
    try:
        program = Program(parse(text), ENUMS)
    except ScriptError:
        return
    _, error = outcome(program, a=first, b=second, t=third, **{"@n": 5})
    assert error is None or 0 <= error.start < error.end <= len(text)


@given(st.sampled_from(["+", "-", "*", "/", "..", "&", "|", "^", "&&", "||", "<", "=="]), values, values)
def test_any_two_values_have_a_result_that_is_real_or_a_text_or_an_error(operator, left, right):
    text = f"a {operator} b"
    result, error = outcome(Program(parse(text)), a=left, b=right)
    if error is None:
        assert isinstance(result, (float, str))
    else:
        assert marked(text, error) == text


@given(st.floats() | st.integers() | st.text(), st.sampled_from([int, float, str, bool]))
def test_what_fits_has_the_type_and_fits_again(value, kind):
    try:
        fitted = fit(value, kind)
    except RefusedValueError:
        return
    assert type(fitted) is kind
    assert repr(fit(fitted, kind)) == repr(fitted)
