"""Tests of the conversion of strings to values, and of the suggestions for invalid strings."""

import enum
from contextlib import suppress
from datetime import timedelta
from pathlib import Path
from typing import Literal, Optional

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.nodes.values import (
    ConversionError,
    Milliseconds,
    Seconds,
    blackboard_key,
    require_value_type,
    value_type_of,
)
from sar_compiler.tree.guessing import nearest


class Colour(enum.Enum):
    RED = 1
    GREEN = 2


def convert(annotation, text):
    value_type = value_type_of(annotation)
    assert value_type is not None
    return value_type.convert(text)


@pytest.mark.parametrize(
    ("annotation", "text", "value"),
    [
        (bool, "true", True),
        (bool, "FALSE", False),
        (bool, "1", True),
        (int, "-12", -12),
        (int, "+7", 7),
        (float, "3", 3.0),
        (float, "-2.5e-1", -0.25),
        (float, ".5", 0.5),
        (str, " any text ", " any text "),
        (Path, "maps/a.yaml", Path("maps/a.yaml")),
        (timedelta, "2.5", timedelta(seconds=2.5)),
        (timedelta, "250ms", timedelta(milliseconds=250)),
        (timedelta, "2min", timedelta(minutes=2)),
        (Seconds, "500ms", 0.5),
        (Seconds, "2min", 120.0),
        (Seconds, "1e-3", 0.001),
        (Milliseconds, "500", 500),
        (Milliseconds, "1.5s", 1500),
        (Milliseconds, "2min", 120_000),
        (Colour, "GREEN", Colour.GREEN),
        (Literal["left", "right"], "left", "left"),
        (Optional[int], "3", 3),  # noqa: UP045 - the old form must also work
        (float | None, "3", 3.0),
    ],
)
def test_string_is_converted_to_annotated_type(annotation, text, value):
    assert convert(annotation, text) == value
    assert type(convert(annotation, text)) is type(value)


@pytest.mark.parametrize(
    ("annotation", "text", "suggestion"),
    [
        (bool, "ture", "true"),
        (bool, "yes", None),
        (bool, "", None),
        (int, "12abc", None),
        (int, "2.7", None),
        (int, "2.0", "2"),
        (int, "1e3", "1000"),
        (int, "1e-3", None),
        (int, "1e999999999", None),
        (int, "1,5", None),
        (int, "1,000", None),
        (int, "1,000,000", "1000000"),
        (int, "0x10", "16"),
        (int, "500ms", None),
        (int, " 3", "3"),
        (int, "1_000", "1000"),
        (int, "٣", None),
        (float, "2,5", "2.5"),
        (float, "-0,125", "-0.125"),
        (float, "2,500", None),
        (float, "1,000,000.5", "1000000.5"),
        (float, "5s", None),
        (float, "50%", None),
        (float, "inf", None),
        (float, "nan", None),
        (float, "1e999", None),
        (float, "0x10", "16"),
        (timedelta, "5 hours", "300min"),
        (timedelta, "2m", None),
        (timedelta, "-1", None),
        (timedelta, "9e9", "9000000000"),
        (timedelta, "9e80", None),
        (timedelta, "+5", "5"),
        (Milliseconds, "99999h", None),
        (Seconds, "1,5", "1.5"),
        (Seconds, "1,5s", "1.5s"),
        (Seconds, "1,500", None),
        (Seconds, "1,500ms", None),
        (Seconds, "500 ms", "500ms"),
        (Seconds, "5 Seconds", "5s"),
        (Seconds, "1e3ms", "1000ms"),
        (Seconds, "250us", "0.25ms"),
        (Seconds, "-5s", None),
        (Seconds, "5 m", None),
        (Milliseconds, "1e3", "1000"),
        (Milliseconds, "-1e3", None),
        (Milliseconds, "1.5", None),
        (Milliseconds, "0.5ms", None),
        (Milliseconds, "99999min", None),
        (Milliseconds, "3 sec", "3s"),
        (timedelta, "9" * 40, None),
        (Colour, "green", "GREEN"),
        (Colour, "BLUE", None),
        (Literal["left", "right"], "rigth", "right"),
    ],
)
def test_invalid_string_is_rejected_with_nearest_valid_one(annotation, text, suggestion):
    with pytest.raises(ConversionError) as caught:
        convert(annotation, text)
    assert caught.value.suggestion == suggestion
    assert text in caught.value.message


_SPELLINGS = st.tuples(
    st.from_regex(r"[+\-]?[0-9]{1,4}([.,_][0-9]{1,4}){0,2}(e[0-3])?", fullmatch=True),
    st.sampled_from(["", "ms", " s", "sec", "Min", "h", "m", "abc"]),
).map("".join)


@given(_SPELLINGS, st.sampled_from([int, float, timedelta, Seconds, Milliseconds]))
def test_suggested_number_is_valid_and_keeps_its_digits(text, annotation):
    try:
        convert(annotation, text)
    except ConversionError as error:
        if error.suggestion is None:
            return
        convert(annotation, error.suggestion)
        if not set(text) & set("eh"):
            digits = [each for each in text if each.isdigit()]
            kept = [each for each in error.suggestion if each.isdigit()]
            assert "".join(kept).strip("0") == "".join(digits).strip("0")


@pytest.mark.parametrize(
    ("annotation", "text", "hint"),
    [
        (int, "1,000", "the comma is ambiguous: write 1000, or 1.000"),
        (int, "500ms", "write only the number, in the unit that the node's documentation states"),
        (Seconds, "2m", "write a number with ms, s or min, for example 500ms, 1.5s or 2min"),
    ],
)
def test_ambiguous_string_gives_hint_in_place_of_suggestion(annotation, text, hint):
    with pytest.raises(ConversionError) as caught:
        convert(annotation, text)
    assert (caught.value.suggestion, caught.value.hint) == (None, hint)


@pytest.mark.parametrize(
    ("annotation", "value", "fitted"),
    [(Seconds, "500ms", 0.5), (Seconds, 3, 3.0), (Milliseconds, "1.5s", 1500), (Milliseconds, 7.0, 7)],
)
def test_duration_on_blackboard_is_converted_as_in_file(annotation, value, fitted):
    assert require_value_type(annotation).fit(value) == fitted


def test_list_may_contain_members_of_enumeration():
    value_type = value_type_of(list[Colour])
    assert value_type is not None
    assert value_type.convert("RED;GREEN") == [Colour.RED, Colour.GREEN]
    assert value_type.label == "several values separated by ;, each one of RED, GREEN"


@pytest.mark.parametrize("annotation", [list, list[list[int]], dict, object, int | str, Literal[1, 2]])
def test_unsupported_annotation_has_no_value_type(annotation):
    assert value_type_of(annotation) is None


@given(st.integers())
def test_every_integer_survives_round_trip(number):
    assert convert(int, str(number)) == number


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_finite_float_survives_round_trip(number):
    assert convert(float, repr(number)) == number


@given(st.text(max_size=20), st.sampled_from([bool, int, float, str, Path, timedelta, Colour]))
def test_conversion_of_any_string_raises_at_most_conversion_error(text, annotation):
    with suppress(ConversionError):
        convert(annotation, text)


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("{a}", "a"),
        ("{@a}", "@a"),
        ("  {a}  ", "a"),
        ("{ a }", " a "),
        ("{}", None),
        ("{a", None),
        ("x {a}", None),
    ],
)
def test_blackboard_key_stands_alone_in_braces(text, key):
    assert blackboard_key(text) == key


def test_nearest_prefers_same_word_in_other_case():
    assert nearest("navigatetozone", ["NavigateToZone", "NavigateToBase"]) == "NavigateToZone"
    assert nearest("Sequense", ["Sequence", "Selector"]) == "Sequence"
    assert nearest("Xyz", ["Sequence", "Selector"]) is None


@pytest.mark.parametrize(
    "annotation", [bool, int, float, str, list[int], Colour, Seconds, Milliseconds, timedelta]
)
@pytest.mark.parametrize("held", [True, 7, -1, 2.5, "7", [1], Colour.RED, timedelta(seconds=1)])
def test_value_of_unchanged_type_is_returned_as_same_object(annotation, held):
    value_type = value_type_of(annotation)
    assert value_type is not None
    if type(held) is value_type.unchanged_type:
        assert value_type.fit(held) is held


def test_type_with_limits_has_no_unchanged_type():
    value_type = value_type_of(Milliseconds)
    assert value_type is not None
    assert value_type.unchanged_type is None
