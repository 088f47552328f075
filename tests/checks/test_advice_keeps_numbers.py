"""Tests that no advice changes a quantity: number and unit before and after mean the same.

Values of attributes are drawn for every type. The advice of each kind of finding is tested with the example of its page.
"""

import math
import re
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sar_compiler.checks import check
from sar_compiler.checks.fixing import SAFE, apply_fixes, fixes
from sar_compiler.nodes.numbers import convert_with_unit
from sar_compiler.nodes.registry import load_registry
from sar_compiler.nodes.values import NO_VALUE, ConversionError
from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.guessing import nearest, unit_suffix
from sar_compiler.tree.xml import parse_xml
from tests.docs.test_findings import ALONE, CODES, page_of, seen, write
from tests.trees import document, forest

REGISTRY = load_registry(palettes=["nav2:main"])
# The factor of each unit to the base unit of its quantity.
TIMES = {
    "us": "1/1000000",
    "ms": "1/1000",
    "msec": "1/1000",
    "s": "1",
    "sec": "1",
    "Seconds": "1",
    "min": "60",
    "h": "3600",
}
ANGLES = {"rad": "1", "deg": "pi/180", "degrees": "pi/180", "°": "pi/180"}
LENGTHS = {"m": "1", "cm": "1/100", "mm": "1/1000", "km": "1000"}
SPEEDS = {"m/s": "1", "km/h": "5/18", "cm/s": "1/100"}
RATES = {"hz": "1", "kHz": "1000"}
OTHER_UNITS = {"V": "1", "%": "1/100", "kg": "1"}
QUANTITIES = {"s": TIMES, "ms": TIMES, "rad": ANGLES, "m": LENGTHS, "m/s": SPEEDS, "hz": RATES}
UNIT_SPELLINGS = sorted({unit for each in (*QUANTITIES.values(), OTHER_UNITS) for unit in each})
TYPES = {
    (spec.tag, parameter.name): parameter.value_type
    for spec in REGISTRY
    for parameter in spec.attributes
    if parameter.value_type is not NO_VALUE
}
NUMBERS = {place: each for place, each in TYPES.items() if each.python in (int, float) or each.unit}
ROUNDED = Fraction(1, 10_000)


def factor(text):
    return Fraction(math.pi) / 180 if text == "pi/180" else Fraction(text)


def format_number(value, notation):
    """Return a number in one of several notations: with a decimal comma, groups, an exponent, or in hexadecimal."""
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
    """Draw a number, its unit (empty: the unit of the attribute), and their text."""
    value = draw(st.decimals(-9_999_999, 9_999_999, places=draw(st.sampled_from([0, 1, 3]))))
    notation = draw(
        st.sampled_from(["plain", "comma", "groups", "underscores", "exponent", "hexadecimal", "plus"])
    )
    unit = draw(st.sampled_from(["", *UNIT_SPELLINGS]))
    return value, unit, format_number(value, notation) + draw(st.sampled_from(["", " "])) + unit


def meaning(number, spelt, unit):
    """Return a number in the base unit of an attribute's quantity; None if its unit belongs to another quantity."""
    if not spelt:
        return Fraction(number) * (factor(QUANTITIES[unit][unit]) if unit else 1)
    known = QUANTITIES.get(unit, {})
    return Fraction(number) * factor(known[spelt]) if spelt in known else None


def split(text):
    """Return the number and the unit of a suggestion, which is in plain notation."""
    number = text.rstrip("".join({*"abcdefghijklmnopqrstuvwxyz/°"}))
    return Decimal(number), text[len(number) :]


@pytest.mark.parametrize("place", [pytest.param(each, id=".".join(each)) for each in NUMBERS])
def test_suggestion_for_number_with_any_unit_keeps_its_value(place):
    for spelt in UNIT_SPELLINGS:
        check_suggestion(NUMBERS[place], Decimal(90), spelt, f"90{spelt}")


def test_number_with_too_many_digits_is_rounded():
    assert convert_with_unit("1.0000000000000000000000001 km", "m") == "1000"
    assert convert_with_unit("1.0000000000000001 km", "m") == "1000.0000000000001"


@given(st.sampled_from(sorted(NUMBERS)), quantities())
@example(("Spin", "spin_dist"), (Decimal(90), "deg", "90deg"))
@example(("Wait", "wait_duration"), (Decimal("1.5"), "ms", "1,500ms"))
@example(("Retry", "num_failures"), (Decimal(0), "", "0"))
@example(("AssistedTeleop", "server_timeout"), (Decimal(3662), "h", "3662h"))
def test_suggested_value_equals_written_quantity(place, quantity):
    check_suggestion(NUMBERS[place], *quantity)


def check_suggestion(value_type, number, spelt, text):
    suggestion = suggestion_for(value_type, text)
    if suggestion is None:
        return
    before, (plain, unit) = meaning(number, spelt, value_type.unit), split(suggestion)
    assert before is not None, f"{text} -> {suggestion}"
    after = meaning(plain, unit, value_type.unit)
    exact = spelt not in ("deg", "degrees", "\N{DEGREE SIGN}", "km/h")
    assert after == before if exact else abs(after - before) <= ROUNDED * abs(before), text
    value_type.convert(suggestion)


def suggestion_for(value_type, text):
    try:
        value_type.convert(text)
    except ConversionError as error:
        return error.suggestion
    return None


UNIT_WORDS = ("ms", "msec", "s", "sec", "seconds", "min", "hours", "deg", "rad", "cm", "m", "hz")


@pytest.mark.parametrize("place", [pytest.param(each, id=".".join(each)) for each in sorted(NUMBERS)])
def test_suggested_attribute_has_unit_of_written_attribute(place):
    tag, name = place
    stem = name.rpartition("_")[0] if unit_suffix(name) else name
    inside = {"Control": 2, "Decorator": 1}.get(REGISTRY[tag].kind.value, 0)
    for word in UNIT_WORDS:
        written = f"{stem}_{word}" if stem else word
        if written in REGISTRY[tag].parameters:
            continue
        found = check(forest(f'<{tag} {written}="7">{"<AlwaysSuccess/>" * inside}</{tag}>'), REGISTRY)
        for each in (finding for finding in found if finding.code == "unknown-attribute"):
            meant = each.suggestion
            if meant is not None:
                unit = TYPES[tag, meant].unit or unit_suffix(meant)
                assert unit == unit_suffix(written), f"{written} -> {meant}"


def test_hint_converts_number_to_unit_of_known_attribute():
    [finding] = check(forest('<Delay delay_sec="3"><NavigateToBase/></Delay>'), REGISTRY)
    assert (finding.suggestion, finding.hint) == (None, 'write delay_msec="3000"')


@given(st.integers(0, 99), st.integers(0, 99), st.lists(st.integers(0, 9999).map(str)))
def test_number_is_not_suggested_for_another_number(one, other, known):
    assert nearest(f"{one}.{other}", known) is None


@given(quantities(), st.sampled_from(["@a := {}", "@a == {}", "@a := -{}"]))
def test_fixed_scripts_keep_written_numbers(quantity, script):
    value, _, text = quantity
    tree_file = parse_xml(document(f'<ScriptCondition code="{script.format(text)}"/>'), "test.xml")
    found = check(Forest.from_file(tree_file), REGISTRY)
    after = apply_fixes(tree_file.source.text, fixes(tree_file.source, tree_file, found))
    assert after == tree_file.source.text or f"{abs(value)}".lstrip("0") in after.replace("_", "").replace(
        ",", ""
    )


@given(st.lists(st.tuples(st.sampled_from(sorted(NUMBERS)), quantities()), max_size=5))
def test_fixed_files_keep_written_values(attributes):
    body = "".join(f'<{tag} {name}="{text}"/>' for (tag, name), (_, _, text) in attributes)
    tree_file = parse_xml(document(body or "<AlwaysSuccess/>"), "test.xml")
    mended = fixes(tree_file.source, tree_file, check(Forest.from_file(tree_file), REGISTRY))
    assert all(
        each.text.lower() == tree_file.source.text[each.start : each.end].lower().strip() for each in mended
    )


# The texts that replace the numbers of an example, one after the other.
SUBSTITUTES = ["7", "-3", "1,5", "1,500ms", "500ms", "90deg", "2 sec", "0x10", "1e3", ".5", "05", "1_000"]
IN_FILES = re.compile(r"""(?<=["':=(\[;,/ ])-?\d+(?:\.\d+)?(?=["');\],/\s])""")
VERSIONS = re.compile(r"""(?:format|btcpp|version)["']?\s*[=:]\s*["']?$""")
QUANTITY = re.compile(
    r"""(?<![\w.,])[-+]?(?:0[xX][0-9a-fA-F]+|(?:\d[\d_]*(?:[.,]\d+)*|\.\d+)(?:[eE][-+]?\d+)?)[ ]?(?:[A-Za-z/%\u00b0]+)?"""
)
NUMBER = re.compile(r"[-+]?(?:0[xX][0-9a-fA-F]+|(?:[\d_.,]+)(?:[eE][-+]?\d+)?)")
# Findings whose number is a version, not a quantity.
OF_VERSIONS = {"wrong-format", "missing-format"}
FORMAT = "BTCPP_format"
# Examples of findings that have a fix only in cases that their page does not show.
EXAMPLES_WITH_FIX = {
    "btcpp-version": """<ScriptCondition code='@a == "7 5"'/>""",
    "ignored-attribute": '<LoopInt queue="1;2" value=""><AlwaysSuccess/></LoopInt>',
}


def readings(number):
    """Return the possible values of a number, whose comma is a decimal comma or separates thousands."""
    plain = number.replace("_", "")
    if "x" in plain.lower():
        return {Fraction(int(plain, 16))}
    found = {plain.replace(",", ""), plain.replace(",", ".")}
    return {Fraction(each) for each in found if each.count(".") <= 1}


def quantities_in(text, unit):
    """Return the possible values of each number in a text; plain numbers have the given unit."""
    found = []
    for token in (each[0] for each in QUANTITY.finditer(text)):
        number = NUMBER.findall(token)[0]
        spelt = token[len(number) :].strip()
        factors = [known[spelt] for known in QUANTITIES.values() if spelt in known]
        times = factor(factors[0]) if factors else factor(QUANTITIES[unit][unit]) if unit in QUANTITIES else 1
        found.append({each * times for each in readings(number)})
    return found


def unit_of(source, start):
    """Return the unit of plain numbers at an offset of a file, given by the attribute or the key before it."""
    before = source.text[:start]
    names = re.findall(r"""([\w.-]+)["']?\s*[=:]\s*[^=]*$""", before[before.rfind("\n") + 1 :])
    tags = re.findall(r"<(\w+)", before)
    known = TYPES.get((tags[-1], names[-1])) if tags and names else None
    return (known.unit if known is not None else "") or (unit_suffix(names[-1]) if names else "")


def changed_numbers(finding):
    """Return the numbers that the advice of a finding introduces, and that equal none of the written numbers."""
    source, span = finding.source, finding.span
    start, end = source.offset(*span[:2]), source.offset(*span[2:])
    line = source.line(span.line)
    unit = unit_of(source, start)
    told = [(finding.suggestion, unit, [(source.text[start:end], unit)])] if finding.suggestion else []
    given = re.findall(r"""([\w.-]+)\s*=\s*["']([^"']*)""", line)
    for name, value in re.findall(rf"""(?!{FORMAT})\b([\w.-]+)="([^"{{]*)""", finding.hint or ""):
        told.append((value, unit_suffix(name), [(text, unit_suffix(other)) for other, text in given]))
    return [
        (text, sources)
        for text, unit, sources in told
        for after in quantities_in(text, unit)
        if not any(
            abs(one - other) <= ROUNDED * abs(other)
            for where in sources
            for before in quantities_in(*where)
            for one in after
            for other in before
        )
    ]


# A number that the hint tells to write, unless it is a limit, or one of several.
TO_WRITE = re.compile(r"\bwrite (-?\d[\d.]*)(?![\w.]| or (?:fewer|more)| at most)")
CONVERTED = re.compile(r"^(-?[\d.]+) ([\w/]+) are (-?[\d.]+)(?: [\w/]+)?: write \3$")
CONFUSED_UNITS = {"percent": "1/100", "degrees": "pi/180", "ms": "1/1000", "mm": "1/1000", "mm/s": "1/1000"}


def invented_numbers(finding):
    """Return the numbers that a hint tells to write, and that are neither examples nor follow from the text at the location."""
    hint, span = (finding.hint or "").partition("for example")[0], finding.span
    start, end = finding.source.offset(*span[:2]), finding.source.offset(*span[2:])
    written = [each for found in quantities_in(finding.source.text[start:end], "") for each in found]
    if converted := CONVERTED.match(hint):
        number, times = Fraction(converted[1]), factor(CONFUSED_UNITS[converted[2]])
        meant = Fraction(converted[3])
        is_right = number in written and abs(meant - number * times) <= ROUNDED * abs(meant)
        return [] if is_right else [converted[0]]
    plain = [
        *written,
        *(each * times for each in written for times in (factor("pi/180"), *map(Fraction, TIMES.values()))),
    ]
    return [
        each
        for each in TO_WRITE.findall(hint.replace("_", ""))
        if not any(abs(Fraction(each) - one) <= ROUNDED * abs(one) for one in plain)
    ]


def variants(files):
    """Yield the files of an example unchanged, and with each of the substitutes in place of its numbers."""
    yield files
    for text in SUBSTITUTES:

        def other(match, text=text):
            return match[0] if VERSIONS.search(match.string[: match.start()]) else text

        replaced = [
            each if each.language in {"sh", "text"} else replace(each, text=IN_FILES.sub(other, each.text))
            for each in files
        ]
        if replaced != files:
            yield replaced


@pytest.fixture
def findings_of(monkeypatch, tmp_path):
    """Return a function that yields all findings about the example of a kind, from any command."""
    made = []
    finish = Diagnostic.__post_init__

    def note(self):
        finish(self)
        made.append(self)

    monkeypatch.setattr(Diagnostic, "__post_init__", note)

    def run(code):
        page = page_of(code)
        command = page.commands("Finding")
        if command is not None and not ALONE.fullmatch(command):
            return  # another process reports the finding
        examples = [page.sections["Bad"]]
        if code in EXAMPLES_WITH_FIX:
            examples.append([replace(examples[0][0], text=document(EXAMPLES_WITH_FIX[code]))])
        every = (files for example in examples for files in variants(example))
        for number, files in enumerate(every):
            folder = tmp_path / str(number)
            folder.mkdir()
            seen(command, write(files, folder, "bad"), folder, monkeypatch)
            yield from made
            made.clear()

    return run


@pytest.mark.unmeasured
@pytest.mark.parametrize("code", CODES)
def test_advice_of_each_kind_of_finding_keeps_written_numbers(code, findings_of):
    advised = set()
    for finding in findings_of(code):
        if finding.code not in OF_VERSIONS:
            assert changed_numbers(finding) == [], finding.render()
            assert invented_numbers(finding) == [], finding.render()
        if finding.suggestion is not None:
            advised.add(finding.code)
    assert code in advised or code not in SAFE, "the page of a kind with a fix has an example with a fix"
