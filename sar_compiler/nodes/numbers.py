"""Parsing of numbers, durations and units, including suggestions for other notations."""

import math
import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from sar_compiler.tree.guessing import UNIT_OF, unit_suffix

if TYPE_CHECKING:
    from decimal import Decimal
    from fractions import Fraction

INTEGER = r"[+\-]?[0-9]+"
"""A regular expression for integers, also valid in XSD and JSON Schema."""
REAL = r"[+\-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+\-]?[0-9]+)?"
"""A regular expression for numbers."""
_COUNT = r"([0-9]+(\.[0-9]*)?|\.[0-9]+)"
WITH_UNIT = rf"{_COUNT}(ms|s|min)"
"""A regular expression for durations with a unit."""
DURATION = rf"{WITH_UNIT}?"
"""A regular expression for durations. Plain numbers, which are in a default unit, are durations, too."""
HOW_LONG = "write a number with ms, s or min, for example 500ms, 1.5s or 2min"

_MILLISECONDS = {"ms": 1, "s": 1000, "min": 60_000}
# The units that people write for durations, and their conversion.
_DURATIONS = {
    "us": ("0.001", "ms"),
    "ms": ("1", "ms"),
    "s": ("1", "s"),
    "min": ("1", "min"),
    "h": ("60", "min"),
}
_DIGITS = 5
"""The number of significant digits to which an infinite decimal is rounded.

For example, 90 degrees are 1.5708 radians.
"""
# More digits than a finite decimal has after a conversion between units; radians are infinite decimals.
_MOST_DIGITS = 20
LONGEST = 100
"""The maximum number of characters in a number."""
_AMBIGUOUS = r"\s*([+\-]?[1-9][0-9]{0,2}),([0-9]{3})\s*([^\W\d_]*)\s*"
_THOUSANDS = r"[+\-]?[1-9][0-9]{0,2}(?:,[0-9]{3}){2,}(?:\.[0-9]+)?"
_UNDERSCORES = r"[+\-]?[0-9]+(?:_[0-9]+)+(?:\.[0-9]+)?"
_DECIMAL_COMMA = r"[+\-]?[0-9]*,[0-9]+"
_HEXADECIMAL = r"[+\-]?0[xX][0-9a-fA-F]+"
_SPACED = r"([+\-]?[0-9.,][0-9.,_eE+\-]*?)\s*([^\W\d_]+(?:/[^\W\d_]+)?|[°%])"


class PlausibleRange(NamedTuple):
    """The range of plausible numbers for an attribute or a unit. Numbers outside of the range may be valid.

    Attributes:
        least: The smallest plausible number.
        most: The largest plausible number.
        is_open: Whether *least* itself is excluded.
    """

    least: float
    most: float = math.inf
    is_open: bool = False

    def __contains__(self, number: object) -> bool:
        """Return whether a number is plausible."""
        if not isinstance(number, (int, float)) or math.isnan(number):
            return False
        return number <= self.most and (number > self.least if self.is_open else number >= self.least)

    def __str__(self) -> str:
        """Return the range in words: `more than 0`, `0 or more`, `from 0 to 255`."""
        if self.most != math.inf:
            return f"from {self.least:.10g} to {self.most:.10g}"
        return f"more than {self.least:g}" if self.is_open else f"{self.least:g} or more"


class Unit(NamedTuple):
    """A unit in which files contain plain numbers.

    Attributes:
        words: The name of the unit in a sentence.
        others: The conversion factors of other units of the same quantity; units of time are in `_DURATIONS`.
        possible: The valid numbers.
        usual: The plausible numbers; other numbers get a warning.
        mistaken: The symbol and name of the unit that an implausible number probably has; empty if no unit is likely.
    """

    words: str
    others: Mapping[str, str] = MappingProxyType({})
    possible: PlausibleRange = PlausibleRange(-math.inf)
    usual: PlausibleRange = PlausibleRange(-math.inf)
    mistaken: tuple[str, str] = ("", "")


_TURN = round(2 * math.pi, 4)
_WEEK_SEC = 7 * 86_400.0
UNITS = {
    "s": Unit("seconds", {}, PlausibleRange(0.0, 1e9), PlausibleRange(0.0, _WEEK_SEC), ("ms", "ms")),
    "ms": Unit("milliseconds", {}, PlausibleRange(0.0, 1e12), PlausibleRange(0.0, 1000 * _WEEK_SEC)),
    "rad": Unit(
        "radians",
        {"rad": "1"},
        PlausibleRange(-1e6, 1e6),
        PlausibleRange(-_TURN, _TURN),
        ("deg", "degrees"),
    ),
    "deg": Unit("degrees", {"deg": "1"}),
    "m": Unit(
        "metres",
        {"m": "1", "mm": "1/1000", "cm": "1/100", "km": "1000"},
        PlausibleRange(-1e6, 1e6),
        PlausibleRange(-1e5, 1e5),
        ("mm", "mm"),
    ),
    "m/s": Unit(
        "metres per second",
        {"m/s": "1", "mm/s": "1/1000", "cm/s": "1/100", "km/h": "5/18", "kmh": "5/18"},
        PlausibleRange(-1e3, 1e3),
        PlausibleRange(-50.0, 50.0),
        ("mm/s", "mm/s"),
    ),
    "hz": Unit("hertz", {"hz": "1", "khz": "1000"}, PlausibleRange(0.0, 1e6), PlausibleRange(0.0, 1e5)),
    "share": Unit(
        "a share",
        {"%": "1/100", "percent": "1/100"},
        PlausibleRange(0.0, 1.0),
        PlausibleRange(0.0, 1.0),
        ("%", "percent"),
    ),
}
"""All units of numbers in trees, parameters and other files, by symbol."""
_KEYS = {
    "m": "x y geofence polygon sweep_width detection_range",
    "rad": "yaw",
    "deg": "lat lon heading",
    "share": "poa pod reserve wrong_by per_m per_sec",
    "m/s": "cruise_speed_mps",
}
_UNIT_OF_KEY = {key: unit for unit, keys in _KEYS.items() for key in keys.split()}


def unit_of_key(key: str) -> str:
    """Return the unit of a numeric parameter, such as `rad` for `initial_pose.yaw`; empty without a unit."""
    name = key.rpartition(".")[2]
    return _UNIT_OF_KEY.get(name) or (unit_suffix(name) if "_" in name else "")


class ImplausibleNumber(NamedTuple):
    """The finding about a number outside of the plausible range of its unit.

    Attributes:
        message: The error, as the end of a sentence.
        hint: The number that was probably intended, in a sentence; empty if no other number is likely.
        is_impossible: Whether the number is invalid; otherwise it is only implausible.
    """

    message: str
    hint: str
    is_impossible: bool

    def __str__(self) -> str:
        """Return the message and the hint as a sentence."""
        return f"{self.message}; {self.hint}" if self.hint else self.message


def find_implausible_number(number: float, unit: str) -> ImplausibleNumber | None:
    """Explain why a number is implausible in a unit.

    The result is None if the number is plausible or the unit is unknown.
    """
    known = UNITS.get(unit)
    if known is None or number in known.usual:
        return None
    is_impossible = number not in known.possible
    bounds = known.possible if is_impossible else known.usual
    message = (
        f"must be {known.words} {bounds}, but is {number:.10g}"
        if is_impossible
        else f"is {number:.10g}, which is implausible: {known.words} are usually {bounds}"
    )
    return ImplausibleNumber(message, convert_mistaken(f"{number!r}", unit), is_impossible)


def convert_mistaken(text: str, unit: str) -> str:
    """Return a hint for a number that is probably in a wrong unit; empty if no wrong unit is likely.

    A hint is, for example, `90 degrees are 1.5708 rad: write 1.5708`.
    """
    known = UNITS.get(unit)
    if known is None or not known.mistaken[0] or (plain := intended_plain_number(text)) is None:
        return ""
    if unit == "share" and "." in plain:  # 1.5 may have a misplaced point
        return ""
    meant = convert_with_unit(f"{plain}{known.mistaken[0]}", unit)
    if meant is None or float(meant) not in known.usual:
        return ""
    return f"{plain} {known.mistaken[1]} are {meant}{'' if unit == 'share' else f' {unit}'}: write {meant}"


def parse_milliseconds(text: str) -> "Decimal | None":
    """Convert a duration with a unit to milliseconds. Return None for any other text."""
    match = re.fullmatch(WITH_UNIT, text) if len(text) <= LONGEST else None
    if match is None:
        return None
    from decimal import Decimal

    return Decimal(match[1]) * _MILLISECONDS[match[3]]


def convert_duration(text: str, unit: str) -> str:
    """Convert a duration to a plain number in another unit. Return a text without a unit unchanged."""
    milliseconds = parse_milliseconds(text) if unit in _MILLISECONDS else None
    return text if milliseconds is None else _plain_text(milliseconds / _MILLISECONDS[unit])


def intended_number(text: str) -> str | None:
    """Convert a number in another notation (`1,5`, `1_000`, `0x10`) to a plain number.

    The result is None if the number is ambiguous.
    """
    text = text.strip()
    if len(text) > LONGEST or re.fullmatch(_AMBIGUOUS, text):
        return None
    if re.fullmatch(_THOUSANDS, text) or re.fullmatch(_UNDERSCORES, text):
        return text.replace(",", "").replace("_", "")
    if re.fullmatch(_DECIMAL_COMMA, text):
        return text.replace(",", ".")
    if re.fullmatch(_HEXADECIMAL, text):
        return str(int(text, 16))
    return text if re.fullmatch(REAL, text) else None


def intended_integer(text: str) -> str | None:
    """Convert an integer in another notation (`1e3`, `2.0`) to a plain integer.

    The result is None for any other text.
    """
    plain = intended_plain_number(text)
    return plain if plain is not None and "." not in plain else None


def intended_plain_number(text: str) -> str | None:
    """Convert a number to a plain number without an exponent.

    The result is None if the text is ambiguous or not a number.
    """
    number = intended_number(text)
    if number is None:
        return None
    from decimal import Decimal

    value = Decimal(number)
    return _plain_text(value) if abs(value.adjusted()) < LONGEST else None


def intended_duration(text: str) -> str | None:
    """Convert a duration in another notation (`5 sec`, `1,5s`, `2h`) to a valid duration.

    The result is None for any other text.
    """
    match = re.fullmatch(_SPACED, text.strip()) if len(text) <= LONGEST else None
    spelt = _DURATIONS.get(UNIT_OF.get(match[2].lower(), "")) if match is not None else None
    number = intended_number(match[1]) if match is not None else None
    if number is None or spelt is None or number.startswith("-"):
        return None
    from decimal import Decimal

    value = Decimal(number) * Decimal(spelt[0])
    return f"{_plain_text(value)}{spelt[1]}" if abs(value.adjusted()) < LONGEST else None


def number_hint(text: str, unit: str = "") -> str | None:
    """Return a hint for a text that is not a number and has no unambiguous replacement.

    Args:
        text: The text.
        unit: The expected unit; empty if the unit is unknown.
    """
    match = re.fullmatch(_AMBIGUOUS, text)
    if match is not None:
        readings = [f"{match[1]}{point}{match[2]}{match[3]}" for point in ("", ".")]
        numbers = [convert_with_unit(each, unit) or each for each in readings] if unit else readings
        return f"the comma is ambiguous: write {', or '.join(numbers)}"
    if unit:
        return f"write only the number, in {unit_name(unit)}"
    if re.match(r"\s*" + REAL + r"\s*[^\W\d]", text[:LONGEST]):
        return "write only the number, in the unit that the node's documentation states"
    return None


def unit_name(unit: str) -> str:
    """Return the name of a unit: `metres per second` for `m/s`."""
    return UNITS[unit].words if unit in UNITS else unit


def convert_with_unit(text: str, unit: str) -> str | None:
    """Convert a number with or without a unit (`90deg`) to a plain number in *unit*.

    The result is None if this is impossible.

    An infinite decimal is rounded to five significant digits.
    """
    match = re.fullmatch(_SPACED, text.strip()) if len(text) <= LONGEST else None
    if match is None:
        return intended_plain_number(text)
    from fractions import Fraction

    number, one = intended_plain_number(match[1]), _conversion_factor(match[2].lower(), unit)
    return _round(Fraction(number) * one) if number is not None and one is not None else None


def _conversion_factor(spelt: str, unit: str) -> "Fraction | None":
    """Return the conversion factor between two units.

    The result is None if the units measure different quantities or one of them is unknown.
    """
    from fractions import Fraction

    spelt = UNIT_OF.get(spelt, spelt)
    if unit in _MILLISECONDS:
        count, known = _DURATIONS.get(spelt, ("", ""))
        return Fraction(count) * _MILLISECONDS[known] / _MILLISECONDS[unit] if known else None
    if unit == "rad" and spelt == "deg":
        return Fraction(math.pi) / 180
    count = UNITS[unit].others.get(spelt, "") if unit in UNITS else ""
    return Fraction(count) if count else None


def _round(value: "Fraction") -> str:
    """Return the decimal digits of a number. An infinite decimal is rounded."""
    from decimal import Decimal

    short = Decimal(value.numerator) / Decimal(value.denominator)
    if short * value.denominator == value.numerator and len(short.as_tuple().digits) <= _MOST_DIGITS:
        return _plain_text(short)
    return _plain_text(Decimal(f"{float(value):.{_DIGITS}g}"))


def _plain_text(value: "Decimal") -> str:
    text = f"{value:f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
