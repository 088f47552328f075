"""No advice changes what a number means: text, unit and all, before and after are equal."""

import math
from decimal import Decimal
from fractions import Fraction

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sar_compiler.checks import check
from sar_compiler.checks.fixing import fixed, fixes
from sar_compiler.nodes.registry import load_registry
from sar_compiler.nodes.values import ConversionError
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.guessing import nearest, unit_in
from sar_compiler.tree.xml import parse_xml
from tests.trees import document, forest

REGISTRY = load_registry(palettes=["nav2:main"])
# How many of its quantity's base unit each is.
TIMES = {
    "us": "1/1000000",
    "ms": "1/1000",
    "msec": "1/1000",
    "s": "1",
    "Seconds": "1",
    "min": "60",
    "h": "3600",
}
ANGLES = {"rad": "1", "deg": "pi/180", "degrees": "pi/180", "°": "pi/180"}
LENGTHS = {"m": "1", "cm": "1/100", "mm": "1/1000", "km": "1000"}
SPEEDS = {"m/s": "1", "km/h": "5/18", "cm/s": "1/100"}
RATES = {"hz": "1", "kHz": "1000"}
OTHERS = {"V": "1", "%": "1/100", "kg": "1"}
QUANTITIES = {"s": TIMES, "ms": TIMES, "rad": ANGLES, "m": LENGTHS, "m/s": SPEEDS, "hz": RATES}
SPELT = sorted({unit for each in (*QUANTITIES.values(), OTHERS) for unit in each})
TYPES = {
    (spec.tag, parameter.name): parameter.value_type
    for spec in REGISTRY
    for parameter in spec.attributes
    if parameter.value_type is not None
}
NUMBERS = {place: each for place, each in TYPES.items() if each.python in (int, float) or each.unit}
ROUNDED = Fraction(1, 10_000)


def factor(text):
    return Fraction(math.pi) / 180 if text == "pi/180" else Fraction(text)


def as_written(value, notation):
    """Write a number as somebody may: with a decimal comma, groups, an exponent, in hexadecimal."""
    plain = f"{value:f}"
    whole, _, rest = plain.partition(".")
    return {
        "plain": plain,
        "comma": plain.replace(".", ","),
        "groups": f"{value:,f}",
        "underscores": f"{value:,f}".replace(",", "_"),
        "exponent": f"{value:e}",
        "hexadecimal": hex(int(whole)) if not rest else plain,
        "plus": f"+{plain}",
    }[notation]


@st.composite
def quantities(draw):
    """Draw a number, its unit (none: that of the attribute) and a text for the two."""
    value = draw(st.decimals(-9_999_999, 9_999_999, places=draw(st.sampled_from([0, 1, 3]))))
    notation = draw(
        st.sampled_from(["plain", "comma", "groups", "underscores", "exponent", "hexadecimal", "plus"])
    )
    unit = draw(st.sampled_from(["", *SPELT]))
    return value, unit, as_written(value, notation) + draw(st.sampled_from(["", " "])) + unit


def meaning(number, spelt, unit):
    """Return what a number means in the base unit of an attribute's quantity; None if its unit is of another one."""
    if not spelt:
        return Fraction(number) * (factor(QUANTITIES[unit][unit]) if unit else 1)
    known = QUANTITIES.get(unit, {})
    return Fraction(number) * factor(known[spelt]) if spelt in known else None


def split(text):
    """Return number and unit of a suggestion; it is in plain notation."""
    number = text.rstrip("".join({*"abcdefghijklmnopqrstuvwxyz/°"}))
    return Decimal(number), text[len(number) :]


@pytest.mark.parametrize("place", [pytest.param(each, id=".".join(each)) for each in NUMBERS])
def test_what_is_suggested_for_an_attribute_has_a_known_value_beside_every_unit(place):
    for spelt in SPELT:
        hold_to(NUMBERS[place], Decimal(90), spelt, f"90{spelt}")


@given(st.sampled_from(sorted(NUMBERS)), quantities())
@example(("Spin", "spin_dist"), (Decimal(90), "deg", "90deg"))
@example(("Wait", "wait_duration"), (Decimal("1.5"), "ms", "1,500ms"))
@example(("Retry", "num_failures"), (Decimal(0), "", "0"))
def test_a_suggested_value_means_what_was_written(place, quantity):
    hold_to(NUMBERS[place], *quantity)


def hold_to(value_type, number, spelt, text):
    suggestion = suggested(value_type, text)
    if suggestion is None:
        return
    before, (plain, unit) = meaning(number, spelt, value_type.unit), split(suggestion)
    assert before is not None, f"{text} -> {suggestion}"
    after = meaning(plain, unit, value_type.unit)
    exact = spelt not in ("deg", "degrees", "\N{DEGREE SIGN}", "km/h")
    assert after == before if exact else abs(after - before) <= ROUNDED * abs(before), text
    value_type.convert(suggestion)


def suggested(value_type, text):
    try:
        value_type.convert(text)
    except ConversionError as error:
        return error.suggestion
    return None


UNIT_WORDS = ("ms", "msec", "s", "sec", "seconds", "min", "hours", "deg", "rad", "cm", "m", "hz")


@pytest.mark.parametrize("place", [pytest.param(each, id=".".join(each)) for each in sorted(NUMBERS)])
def test_no_attribute_is_suggested_whose_numbers_have_another_unit(place):
    tag, name = place
    stem = name.rpartition("_")[0] if unit_in(name) else name
    inside = {"Control": 2, "Decorator": 1}.get(REGISTRY[tag].kind.value, 0)
    for word in UNIT_WORDS:
        written = f"{stem}_{word}" if stem else word
        if written in REGISTRY[tag].parameters:
            continue
        found = check(forest(f'<{tag} {written}="7">{"<AlwaysSuccess/>" * inside}</{tag}>'), REGISTRY)
        for each in (finding for finding in found if finding.code == "unknown-attribute"):
            meant = each.suggestion
            if meant is not None:
                unit = TYPES[tag, meant].unit or unit_in(meant)
                assert unit == unit_in(written), f"{written} -> {meant}"


def test_a_number_of_an_attribute_with_another_unit_is_worked_out():
    [finding] = check(forest('<Delay delay_sec="3"><NavigateToBase/></Delay>'), REGISTRY)
    assert (finding.suggestion, finding.hint) == (None, 'write delay_msec="3000"')


@given(st.integers(0, 99), st.integers(0, 99), st.lists(st.integers(0, 9999).map(str)))
def test_no_number_is_meant_by_another_one(one, other, known):
    assert nearest(f"{one}.{other}", known) is None


@given(quantities(), st.sampled_from(["@a := {}", "@a == {}", "@a := -{}"]))
def test_mended_scripts_have_the_numbers_that_were_written(quantity, script):
    value, _, text = quantity
    tree_file = parse_xml(document(f'<ScriptCondition code="{script.format(text)}"/>'), "test.xml")
    found = check(Forest.of(tree_file), REGISTRY)
    after = fixed(tree_file.source.text, fixes(tree_file.source, tree_file, found))
    assert after == tree_file.source.text or f"{abs(value)}".lstrip("0") in after.replace("_", "").replace(
        ",", ""
    )


@given(st.lists(st.tuples(st.sampled_from(sorted(NUMBERS)), quantities()), max_size=5))
def test_mended_files_have_the_values_that_were_written(attributes):
    body = "".join(f'<{tag} {name}="{text}"/>' for (tag, name), (_, _, text) in attributes)
    tree_file = parse_xml(document(body or "<AlwaysSuccess/>"), "test.xml")
    mended = fixes(tree_file.source, tree_file, check(Forest.of(tree_file), REGISTRY))
    assert all(
        each.text.lower() == tree_file.source.text[each.start : each.end].lower().strip() for each in mended
    )
