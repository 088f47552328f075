"""Numbers, durations and units as files write them, and the one number that another notation can mean."""

import math
import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from sar_compiler.tree.guessing import UNIT_OF, unit_in

if TYPE_CHECKING:
    from decimal import Decimal
    from fractions import Fraction

INTEGER = r"[+\-]?[0-9]+"
"""A regular expression (as XSD and JSON Schema both read it) of whole numbers."""
REAL = r"[+\-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+\-]?[0-9]+)?"
"""That of numbers."""
_COUNT = r"([0-9]+(\.[0-9]*)?|\.[0-9]+)"
WITH_UNIT = rf"{_COUNT}(ms|s|min)"
"""That of durations with their unit."""
DURATION = rf"{WITH_UNIT}?"
"""That of durations of which a plain number has a unit of its own."""
HOW_LONG = "write a number with ms, s or min, for example 500ms, 1.5s or 2min"

_MILLISECONDS = {"ms": 1, "s": 1000, "min": 60_000}
# What people write for durations, and for how many of these units.
_DURATIONS = {
    "us": ("0.001", "ms"),
    "ms": ("1", "ms"),
    "s": ("1", "s"),
    "min": ("1", "min"),
    "h": ("60", "min"),
}
_DIGITS = 5
# More than a number in one unit has in another one; a part of a circle has no end, or a far one.
_MOST_DIGITS = 20
"""How many digits are written of a number that has no end: 90 degrees are 1.5708 radians."""
LONGEST = 100
"""No number that a robot needs has more digits."""
_AMBIGUOUS = r"\s*([+\-]?[1-9][0-9]{0,2}),([0-9]{3})\s*([^\W\d_]*)\s*"
_THOUSANDS = r"[+\-]?[1-9][0-9]{0,2}(?:,[0-9]{3}){2,}(?:\.[0-9]+)?"
_UNDERSCORES = r"[+\-]?[0-9]+(?:_[0-9]+)+(?:\.[0-9]+)?"
_DECIMAL_COMMA = r"[+\-]?[0-9]*,[0-9]+"
_HEXADECIMAL = r"[+\-]?0[xX][0-9a-fA-F]+"
_SPACED = r"([+\-]?[0-9.,][0-9.,_eE+\-]*?)\s*([^\W\d_]+(?:/[^\W\d_]+)?|[°%])"


class SensibleNumbers(NamedTuple):
    """The numbers that make sense to a node which takes others as well.

    Attributes:
        least: The smallest one.
        most: The largest one.
        is_open: Whether the smallest one itself does not.
    """

    least: float
    most: float = math.inf
    is_open: bool = False

    def __contains__(self, number: object) -> bool:
        """Return whether a number makes sense."""
        if not isinstance(number, (int, float)) or math.isnan(number):
            return False
        return number <= self.most and (number > self.least if self.is_open else number >= self.least)

    def __str__(self) -> str:
        """Return it in words: `more than 0`, `0 or more`, `from 0 to 255`."""
        if self.most != math.inf:
            return f"from {self.least:.10g} to {self.most:.10g}"
        return f"more than {self.least:g}" if self.is_open else f"{self.least:g} or more"


class Unit(NamedTuple):
    """A unit that numbers in files have without saying so.

    Attributes:
        words: What it is called in a sentence.
        others: How many of it each other unit of the same quantity is; units of time are in `_DURATIONS`.
        possible: The numbers that can be meant.
        usual: Those that a robot's mission has; any other is warned of.
        mistaken: The unit that a number outside of these was probably written in, and what it is called; empty if none is likely.
    """

    words: str
    others: Mapping[str, str] = MappingProxyType({})
    possible: SensibleNumbers = SensibleNumbers(-math.inf)
    usual: SensibleNumbers = SensibleNumbers(-math.inf)
    mistaken: tuple[str, str] = ("", "")


_TURN = round(2 * math.pi, 4)
_WEEK_SEC = 7 * 86_400.0
UNITS = {
    "s": Unit("seconds", {}, SensibleNumbers(0.0, 1e9), SensibleNumbers(0.0, _WEEK_SEC), ("ms", "ms")),
    "ms": Unit("milliseconds", {}, SensibleNumbers(0.0, 1e12), SensibleNumbers(0.0, 1000 * _WEEK_SEC)),
    "rad": Unit(
        "radians",
        {"rad": "1"},
        SensibleNumbers(-1e6, 1e6),
        SensibleNumbers(-_TURN, _TURN),
        ("deg", "degrees"),
    ),
    "deg": Unit("degrees", {"deg": "1"}),
    "m": Unit(
        "metres",
        {"m": "1", "mm": "1/1000", "cm": "1/100", "km": "1000"},
        SensibleNumbers(-1e6, 1e6),
        SensibleNumbers(-1e5, 1e5),
        ("mm", "mm"),
    ),
    "m/s": Unit(
        "metres per second",
        {"m/s": "1", "mm/s": "1/1000", "cm/s": "1/100", "km/h": "5/18", "kmh": "5/18"},
        SensibleNumbers(-1e3, 1e3),
        SensibleNumbers(-50.0, 50.0),
        ("mm/s", "mm/s"),
    ),
    "hz": Unit("hertz", {"hz": "1", "khz": "1000"}, SensibleNumbers(0.0, 1e6), SensibleNumbers(0.0, 1e5)),
    "share": Unit(
        "a share",
        {"%": "1/100", "percent": "1/100"},
        SensibleNumbers(0.0, 1.0),
        SensibleNumbers(0.0, 1.0),
        ("%", "percent"),
    ),
}
"""Every unit that numbers in trees, parameters and other files have, with the numbers that make sense in it."""
_KEYS = {
    "m": "x y geofence polygon sweep_width detection_range",
    "rad": "yaw",
    "deg": "lat lon heading",
    "share": "poa pod reserve wrong_by per_m per_sec",
    "m/s": "cruise_speed_mps",
}
_UNIT_OF_KEY = {key: unit for unit, keys in _KEYS.items() for key in keys.split()}


def unit_of_key(key: str) -> str:
    """Return the unit of the number that a parameter has (`initial_pose.yaw`: `rad`); empty if it has none."""
    name = key.rpartition(".")[2]
    return _UNIT_OF_KEY.get(name) or (unit_in(name) if "_" in name else "")


class Oddity(NamedTuple):
    """A number outside of the range of its unit.

    Attributes:
        message: What is wrong with it, as the end of a sentence.
        hint: What was probably meant, with what to write; empty if nothing follows from the number.
        is_impossible: Whether it cannot be meant; else it is unusual.
    """

    message: str
    hint: str
    is_impossible: bool

    def __str__(self) -> str:
        """Return both in a sentence."""
        return f"{self.message}; {self.hint}" if self.hint else self.message


def find_oddity(number: float, unit: str) -> Oddity | None:
    """Return why a number makes no sense in a unit; None if it does, or the unit is unknown."""
    known = UNITS.get(unit)
    if known is None or number in known.usual:
        return None
    is_impossible = number not in known.possible
    bounds = known.possible if is_impossible else known.usual
    message = (
        f"must be {known.words} {bounds}, is {number:.10g}"
        if is_impossible
        else f"is {number:.10g}, which is unusual for {known.words}: they are {bounds} as a rule"
    )
    return Oddity(message, convert_mistaken(f"{number!r}", unit), is_impossible)


def convert_mistaken(text: str, unit: str) -> str:
    """Return what a number is if it was written in another unit: `write 1.5708 for 90 degrees`; empty if none is likely."""
    known = UNITS.get(unit)
    if known is None or not known.mistaken[0] or (plain := meant_plain_number(text)) is None:
        return ""
    if unit == "share" and "." in plain:  # 1.5 may have a point at the wrong place
        return ""
    meant = number_in(f"{plain}{known.mistaken[0]}", unit)
    if meant is None or float(meant) not in known.usual:
        return ""
    return f"{plain} {known.mistaken[1]} are {meant}{'' if unit == 'share' else f' {unit}'}: write {meant}"


def milliseconds_in(text: str) -> "Decimal | None":
    """Return the milliseconds of a duration with its unit; None for any other text."""
    match = re.fullmatch(WITH_UNIT, text) if len(text) <= LONGEST else None
    if match is None:
        return None
    from decimal import Decimal

    return Decimal(match[1]) * _MILLISECONDS[match[3]]


def plain_duration(text: str, unit: str) -> str:
    """Return a duration as the plain number that it is in another unit; any other text as it is."""
    milliseconds = milliseconds_in(text) if unit in _MILLISECONDS else None
    return text if milliseconds is None else _plain_text(milliseconds / _MILLISECONDS[unit])


def meant_number(text: str) -> str | None:
    """Return the one number that a text in another notation can mean (`1,5`, `1_000`, `0x10`); None if there is none."""
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


def meant_whole_number(text: str) -> str | None:
    """Return the one whole number that a text in another notation can mean (`1e3`, `2.0`); None if there is none."""
    plain = meant_plain_number(text)
    return plain if plain is not None and "." not in plain else None


def meant_plain_number(text: str) -> str | None:
    """Return the one number that a text can mean, without an exponent; None if there is none."""
    number = meant_number(text)
    if number is None:
        return None
    from decimal import Decimal

    value = Decimal(number)
    return _plain_text(value) if abs(value.adjusted()) < LONGEST else None


def meant_duration(text: str) -> str | None:
    """Return the one duration that a text in another notation can mean (`5 sec`, `1,5s`, `2h`); None if there is none."""
    match = re.fullmatch(_SPACED, text.strip()) if len(text) <= LONGEST else None
    spelt = _DURATIONS.get(UNIT_OF.get(match[2].lower(), "")) if match is not None else None
    number = meant_number(match[1]) if match is not None else None
    if number is None or spelt is None or number.startswith("-"):
        return None
    from decimal import Decimal

    value = Decimal(number) * Decimal(spelt[0])
    return f"{_plain_text(value)}{spelt[1]}" if abs(value.adjusted()) < LONGEST else None


def number_hint(text: str, unit: str = "") -> str | None:
    """Return what to do about a text that is no number, where no replacement is sure to mean the same.

    Args:
        text: The text.
        unit: The unit that it is to have; empty if that is unknown.
    """
    match = re.fullmatch(_AMBIGUOUS, text)
    if match is not None:
        readings = [f"{match[1]}{point}{match[2]}{match[3]}" for point in ("", ".")]
        numbers = [number_in(each, unit) or each for each in readings] if unit else readings
        return f"a comma may mean either: write {', or '.join(numbers)}"
    if unit:
        return f"write the number alone, in {unit_words(unit)}"
    if re.match(r"\s*" + REAL + r"\s*[^\W\d]", text[:LONGEST]):
        return "write the number alone; if it has a unit, the author of the node knows which"
    return None


def unit_words(unit: str) -> str:
    """Return what a unit is called: `metres per second` for `m/s`."""
    return UNITS[unit].words if unit in UNITS else unit


def number_in(text: str, unit: str) -> str | None:
    """Return the one number that a text means where numbers have a unit (`90deg` in rad); None if there is none.

    A number without an end is rounded to five digits.
    """
    match = re.fullmatch(_SPACED, text.strip()) if len(text) <= LONGEST else None
    if match is None:
        return meant_plain_number(text)
    from fractions import Fraction

    number, one = meant_plain_number(match[1]), _one(match[2].lower(), unit)
    return _round(Fraction(number) * one) if number is not None and one is not None else None


def _one(spelt: str, unit: str) -> "Fraction | None":
    """Return how many of a unit one of another is; None where these are of different things, or one is unknown."""
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
    """Write a number with all its digits if it has an end, else the first ones."""
    from decimal import Decimal

    short = Decimal(value.numerator) / Decimal(value.denominator)
    if short * value.denominator == value.numerator and len(short.as_tuple().digits) <= _MOST_DIGITS:
        return _plain_text(short)
    return _plain_text(Decimal(f"{float(value):.{_DIGITS}g}"))


def _plain_text(value: "Decimal") -> str:
    text = f"{value:f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
