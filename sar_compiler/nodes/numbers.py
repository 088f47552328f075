"""Numbers and durations as files write them, and the one number that another notation can mean."""

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from decimal import Decimal

INTEGER = r"[+\-]?[0-9]+"
"""A regular expression (as XSD and JSON Schema both read it) of whole numbers."""
REAL = r"[+\-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+\-]?[0-9]+)?"
"""That of numbers."""
_COUNT = r"([0-9]+(\.[0-9]*)?|\.[0-9]+)"
WITH_UNIT = rf"{_COUNT}(ms|s|min)"
"""That of durations with their unit."""
DURATION = rf"{WITH_UNIT}?"
"""That of durations of which a plain number has a unit of its own."""
HOW_LONG = "write a number with ms, s or min: 500ms, 1.5s, 2min"

_MILLISECONDS = {"ms": 1, "s": 1000, "min": 60_000}
# What others write for these units, and for how many of them.
_SPELT = {
    **dict.fromkeys(("us", "µs", "usec"), ("0.001", "ms")),
    **dict.fromkeys(("ms", "msec", "msecs", "millis", "millisecond", "milliseconds"), ("1", "ms")),
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), ("1", "s")),
    **dict.fromkeys(("min", "mins", "minute", "minutes"), ("1", "min")),
    **dict.fromkeys(("h", "hour", "hours"), ("60", "min")),
}
LONGEST = 100
"""No number that a robot needs has more digits."""
_AMBIGUOUS = re.compile(r"\s*([+\-]?[1-9][0-9]{0,2}),([0-9]{3})\s*[^\W\d_]*\s*")
_THOUSANDS = re.compile(r"[+\-]?[1-9][0-9]{0,2}(?:,[0-9]{3}){2,}(?:\.[0-9]+)?")
_UNDERSCORES = re.compile(r"[+\-]?[0-9]+(?:_[0-9]+)+(?:\.[0-9]+)?")
_DECIMAL_COMMA = re.compile(r"[+\-]?[0-9]*,[0-9]+")
_HEXADECIMAL = re.compile(r"[+\-]?0[xX][0-9a-fA-F]+")
_SPACED = re.compile(r"([+\-]?[0-9.,][0-9.,_eE+\-]*?)\s*([^\W\d_]+)")


def milliseconds_in(text: str) -> "Decimal | None":
    """Return the milliseconds of a duration with its unit; None for any other text."""
    match = re.fullmatch(WITH_UNIT, text) if len(text) <= LONGEST else None
    if match is None:
        return None
    from decimal import Decimal

    return Decimal(match[1]) * _MILLISECONDS[match[3]]


def plain_duration(text: str, unit: str) -> str:
    """Return a duration as the plain number that it is in another unit; any other text as it is."""
    milliseconds = milliseconds_in(text)
    return text if milliseconds is None else _written(milliseconds / _MILLISECONDS[unit])


def meant_number(text: str) -> str | None:
    """Return the one number that a text in another notation can mean (`1,5`, `1_000`, `0x10`); None if there is none."""
    text = text.strip()
    if len(text) > LONGEST or _AMBIGUOUS.fullmatch(text):
        return None
    if _THOUSANDS.fullmatch(text) or _UNDERSCORES.fullmatch(text):
        return text.replace(",", "").replace("_", "")
    if _DECIMAL_COMMA.fullmatch(text):
        return text.replace(",", ".")
    if _HEXADECIMAL.fullmatch(text):
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
    return _written(value) if abs(value.adjusted()) < LONGEST else None


def meant_duration(text: str) -> str | None:
    """Return the one duration that a text in another notation can mean (`5 sec`, `1,5s`, `2h`); None if there is none."""
    match = _SPACED.fullmatch(text.strip()) if len(text) <= LONGEST else None
    spelt = _SPELT.get(match[2].lower()) if match is not None else None
    number = meant_number(match[1]) if match is not None else None
    if number is None or spelt is None or number.startswith("-"):
        return None
    from decimal import Decimal

    value = Decimal(number) * Decimal(spelt[0])
    return f"{_written(value)}{spelt[1]}" if abs(value.adjusted()) < LONGEST else None


def number_hint(text: str) -> str | None:
    """Return what to do about a text that is no number, where no replacement is sure to mean the same."""
    match = _AMBIGUOUS.fullmatch(text)
    if match is not None:
        return f"a comma may mean either: write {match[1]}{match[2]}, or {match[1]}.{match[2]}"
    if re.match(r"\s*" + REAL + r"\s*[^\W\d]", text[:LONGEST]):
        return "write the number alone: this attribute has no unit"
    return None


def _written(value: "Decimal") -> str:
    text = f"{value:f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
